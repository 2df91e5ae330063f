#include "io/serialized_mesh.h"

#include <fmt/format.h>

#include <cstring>

#include "io/file_error.h"
#include "io/gzip.h"

namespace lumicut::io {

namespace {

constexpr uint64_t kMostBytes = uint64_t{8} << 30;
enum Flag : uint32_t { kNormals = 1, kUvs = 2, kColours = 8, kDouble = 0x2000 };

// Numbers of a file, the least byte first, one after the other.
class Numbers {
 public:
  Numbers(const std::string& bytes, const std::string& path, uint64_t at) : bytes_(bytes), path_(path), at_(at) {}

  template <typename T>
  T next() {
    T value;
    std::memcpy(&value, take(sizeof(T)), sizeof(T));
    return value;
  }
  void pass_text() {
    while (*take(1) != 0) {
    }
  }
  // `count` floats or doubles.
  std::vector<float> floats(uint64_t count, bool as_double) {
    std::vector<float> out(checked(count, as_double ? 8 : 4));
    for (float& x : out) x = as_double ? static_cast<float>(next<double>()) : next<float>();
    return out;
  }
  uint64_t checked(uint64_t count, uint64_t size) const {
    if (count > (bytes_.size() - at_) / size)
      throw FileError(path_, fmt::format("ends before the {} numbers that it says it has", count));
    return count;
  }

 private:
  const char* take(uint64_t size) {
    if (at_ > bytes_.size() || size > bytes_.size() - at_) throw FileError(path_, "ends too early");
    at_ += size;
    return bytes_.data() + at_ - size;
  }
  const std::string& bytes_;
  const std::string& path_;
  uint64_t at_;
};

}  // namespace

Geometry read_serialized_mesh(const std::string& path, size_t index) {
  check_regular_file(path);
  const std::string file = read_whole_file(path, kMostBytes);
  Numbers head(file, path, 0);
  const auto format = head.next<uint16_t>();
  const auto version = head.next<uint16_t>();
  if (format != 0x041c || (version != 3 && version != 4))
    throw FileError(path,
                    fmt::format("is no serialized mesh of version 3 or 4: it begins with {:#x}, {}", format, version));
  // At the end there are the meshes' places and their number.
  const auto count = Numbers(file, path, file.size() - 4).next<uint32_t>();
  if (index >= count) throw FileError(path, fmt::format("has {} meshes: there is no number {}", count, index));
  const uint64_t size = version == 4 ? 8 : 4, table = size * count + 4;
  if (table > file.size()) throw FileError(path, fmt::format("says that it has {} meshes", count));
  Numbers places(file, path, file.size() - table + size * index);
  const uint64_t place = version == 4 ? places.next<uint64_t>() : places.next<uint32_t>();
  if (place > file.size() - table) throw FileError(path, fmt::format("its mesh {} lies beyond its end", index));
  const std::string bytes = inflated(file, place + 4, kMostBytes, path);  // after the same head again
  Numbers in(bytes, path, 0);
  const auto flags = in.next<uint32_t>();
  if (version == 4) in.pass_text();
  const auto vertices = in.next<uint64_t>(), triangles = in.next<uint64_t>();
  if (in.checked(vertices, 12) >= 0xffffffff || in.checked(triangles, 12) >= 0x40000000)
    throw FileError(path, fmt::format("its mesh {} has {} vertices and {} triangles", index, vertices, triangles));
  const bool as_double = (flags & kDouble) != 0;
  Geometry out;
  out.positions = in.floats(3 * vertices, as_double);
  if ((flags & kNormals) != 0) out.normals = in.floats(3 * vertices, as_double);
  if ((flags & kUvs) != 0) out.uvs = in.floats(2 * vertices, as_double);
  if ((flags & kColours) != 0) in.floats(3 * vertices, as_double);
  out.indices.resize(in.checked(3 * triangles, 4));
  for (uint32_t& i : out.indices) {
    i = in.next<uint32_t>();
    if (i >= vertices)
      throw FileError(path, fmt::format("its mesh {} has the index {} of {} vertices", index, i, vertices));
  }
  return out;
}

}  // namespace lumicut::io
