// glTF files; the first byte chooses text or binary.
#include "io/file_error.h"
#include "io/scene_gltf.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/libpng_leak.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  if (size == 0) return 0;
  try {
    const char* name = (data[0] & 1) == 0 ? "a.gltf" : "a.glb";
    const io::SceneData scene = io::read_gltf(folder.write(name, fuzz::text_of(data + 1, size - 1)));
    for (const io::Mesh& mesh : scene.meshes)
      for (const uint32_t i : mesh.indices)
        if (i >= mesh.positions.size() / 3) fuzz::finding("an index beyond the vertices");
  } catch (const io::FileError&) {
  }
  return 0;
}
