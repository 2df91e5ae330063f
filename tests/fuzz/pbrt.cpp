// pbrt scenes beside a file to include, a mesh and a picture.
#include "io/scene_pbrt.h"

#include "tests/fuzz/scene_text.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lumicut::fuzz::read_scene_text(data, size, "pbrt", "Material \"diffuse\"\n",
                                 [](const std::string& path) { return lumicut::io::read_pbrt(path); });
  return 0;
}
