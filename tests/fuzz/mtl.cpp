// MTL files of a good OBJ, with a texture beside them.
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/scene_obj.h"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  [[maybe_unused]] static const bool once = [] {
    folder.write("a.obj",
                 "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 3 2\n");
    io::write_png(folder / "a.png", std::vector<uint8_t>(3 * 4 * 4, 128), 4, 4, 3);
    return true;
  }();
  std::vector<io::Texture> textures;
  io::TextureStore store(textures);
  folder.write("a.mtl", fuzz::text_of(data, size));
  try {
    io::Warnings warnings;
    io::read_obj(folder / "a.obj", {}, store, warnings);
  } catch (const io::FileError&) {
  }
  return 0;
}
