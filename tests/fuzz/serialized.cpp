// Mitsuba's serialized meshes: as files (first byte odd), or as what such a file packs; and what gzip packed.
#include "io/serialized_mesh.h"

#include <zlib.h>

#include "io/file_error.h"
#include "io/gzip.h"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

namespace {

template <typename T>
void put(std::string& to, T value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::string packed(std::string_view bytes) {
  uLongf size = compressBound(bytes.size());
  std::string body(size, '\0');
  compress(reinterpret_cast<Bytef*>(body.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  body.resize(size);
  std::string out;
  put(out, uint16_t{0x041c}), put(out, uint16_t{4});
  out += body;
  put(out, uint64_t{0}), put(out, uint32_t{1});
  return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  if (size == 0) return 0;
  const std::string_view text = fuzz::text_of(data + 1, size - 1);
  try {
    const auto path = folder.write("a.serialized", data[0] % 2 != 0 ? std::string(text) : packed(text));
    const io::Geometry mesh = io::read_serialized_mesh(path, data[0] / 64);
    const size_t vertices = mesh.positions.size() / 3;
    if ((!mesh.normals.empty() && mesh.normals.size() != 3 * vertices) ||
        (!mesh.uvs.empty() && mesh.uvs.size() != 2 * vertices))
      fuzz::finding("normals or coordinates of other vertices");
    for (const uint32_t i : mesh.indices)
      if (i >= vertices) fuzz::finding("an index beyond the vertices");
  } catch (const io::FileError&) {
  }
  try {
    (void)io::unpacked(std::string(text), uint64_t{1} << 26, "a.gz");
  } catch (const io::FileError&) {
  }
  return 0;
}
