#include "io/binary_block.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/file_error.h"

namespace lumicut::io {

std::string read_part(const std::string& path, uint64_t offset, uint64_t size) {
  check_regular_file(path);
  std::error_code code;
  const uint64_t all = std::filesystem::file_size(path, code);
  if (code || offset > all || size > all - offset)
    throw FileError(path, fmt::format("has {} bytes; wanted are {} from {} on", code ? 0 : all, size, offset));
  std::string bytes(size, '\0');
  std::ifstream in(path, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(offset));
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<uint64_t>(in.gcount()) != size) throw FileError(path, "cannot be read");
  return bytes;
}

template <typename T>
std::vector<T> read_block(const JsonValue& value, size_t width,
                          const std::function<std::string(const JsonValue&)>& resolve) {
  static_assert(sizeof(T) == 4 && std::endian::native == std::endian::little);
  JsonObject object(value);
  const std::string path = resolve(object.need("file"));
  const auto offset = static_cast<uint64_t>(object.integer("offset", 0, 0, int64_t{1} << 53));
  const auto count = static_cast<uint64_t>(object.need("count").integer(0, int64_t{1} << 32));
  object.finish();
  const std::string bytes = read_part(path, offset, count * width * sizeof(T));
  std::vector<T> out(count * width);
  if (!out.empty()) std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}
template std::vector<float> read_block(const JsonValue&, size_t, const std::function<std::string(const JsonValue&)>&);
template std::vector<uint32_t> read_block(const JsonValue&, size_t,
                                          const std::function<std::string(const JsonValue&)>&);

}  // namespace lumicut::io
