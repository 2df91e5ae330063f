// OBJ files beside a good MTL. The first byte chooses whether materials are read, or positions alone.
#include "io/file_error.h"
#include "io/scene_obj.h"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  [[maybe_unused]] static const bool once = [] {
    folder.write("a.mtl", "newmtl a\nKd .5 .5 .5\nnewmtl b\nKe 1 1 1\n");
    return true;
  }();
  if (size == 0) return 0;
  std::vector<io::Texture> textures;
  io::TextureStore store(textures);
  io::ObjOptions options;
  options.read_materials = (data[0] & 1) == 0;
  options.positions_only = (data[0] & 2) != 0;
  io::Warnings warnings;
  try {
    const io::ObjModel model =
        io::read_obj(folder.write("a.obj", fuzz::text_of(data + 1, size - 1)), options, store, warnings);
    for (const io::Mesh& mesh : model.meshes)
      for (const uint32_t i : mesh.indices)
        if (i >= mesh.positions.size() / 3) fuzz::finding("an index beyond the vertices");
  } catch (const io::FileError&) {
  }
  return 0;
}
