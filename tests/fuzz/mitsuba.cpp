// Mitsuba scenes beside a file to include, a mesh and a picture.
#include "io/scene_mitsuba.h"

#include "io/file_error.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/scene_data.h"

using namespace lumicut;

// As in texture.cpp: OpenImageIO's reader of PNG.
extern "C" const char* __asan_default_options() { return "fast_unwind_on_malloc=0"; }
extern "C" const char* __lsan_default_suppressions() { return "leak:libpng16\n"; }

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  [[maybe_unused]] static const bool once = [] {
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("b.xml", "<scene><bsdf type=\"diffuse\" id=\"b\"/></scene>");
    folder.write("a.pgm", "P2 2 2 255 0 9 99 255\n");
    return true;
  }();
  try {
    fuzz::check_scene(io::read_mitsuba(folder.write("a.xml", fuzz::text_of(data, size))));
  } catch (const io::FileError&) {
  }
  return 0;
}
