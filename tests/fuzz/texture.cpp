// Images as textures of every use, and as pictures to compare. The first byte chooses the extension, the second the use.
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/texture_store.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/libpng_leak.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  static constexpr const char* kExtensions[] = {"exr", "png", "hdr", "tif", "jpg", "tga", "bmp"};
  constexpr int kUses = 5;
  if (size < 2) return 0;
  const std::string name = std::string("a.") + kExtensions[data[0] % std::size(kExtensions)];
  const std::string path = folder.write(name, fuzz::text_of(data + 2, size - 2));
  try {
    if (data[1] % (kUses + 1) == kUses) {
      io::read_image(path);
    } else {
      std::vector<io::Texture> textures;
      io::TextureStore(textures).get(path, static_cast<io::TextureUse>(data[1] % (kUses + 1)), 0, "material \"a\"");
      const io::Texture& t = textures.at(0);
      const size_t values = size_t{t.width} * t.height * t.channels;
      if (t.bytes.size() != values && t.floats.size() != values) fuzz::finding("pixels do not fit the size");
    }
  } catch (const io::FileError&) {
  }
  std::filesystem::remove(path);
  return 0;
}
