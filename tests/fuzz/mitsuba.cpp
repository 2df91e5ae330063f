// Mitsuba scenes beside a file to include, a mesh and a picture.
#include "io/scene_mitsuba.h"

#include "tests/fuzz/scene_text.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lumicut::fuzz::read_scene_text(data, size, "xml", "<scene><bsdf type=\"diffuse\" id=\"b\"/></scene>",
                                 [](const std::string& path) { return lumicut::io::read_mitsuba(path); });
  return 0;
}
