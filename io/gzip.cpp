#include "io/gzip.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <memory>

#include "io/file_error.h"
#include "io/physical_memory.h"

namespace lumicut::io {

namespace {

// One stream after the other, as gzip joins them, or the first alone.
std::string inflate_all(const std::string& bytes, uint64_t from, uint64_t most, const std::string& path, bool gzip) {
  z_stream stream{};
  if (inflateInit2(&stream, gzip ? 15 + 16 : 15) != Z_OK) throw FileError(path, "out of memory while it is unpacked");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> owner(&stream, inflateEnd);
  // Meshes and scenes become five times as large, not hundreds.
  most = std::min({most, physical_memory() / 2, (uint64_t{64} << 20) + 200 * bytes.size()});
  std::string out;
  uint64_t at = from;
  while (true) {
    constexpr uint64_t kStep = 1 << 20;
    const uint64_t before = out.size(), given = std::min(kStep, bytes.size() - at);
    out.resize(before + kStep);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data())) + at;
    stream.avail_in = static_cast<uInt>(given);
    stream.next_out = reinterpret_cast<Bytef*>(out.data()) + before;
    stream.avail_out = static_cast<uInt>(kStep);
    const int code = inflate(&stream, Z_NO_FLUSH);
    at += given - stream.avail_in;
    out.resize(before + kStep - stream.avail_out);
    if (out.size() > most) throw FileError(path, fmt::format("holds more than {} bytes when it is unpacked", most));
    if (code == Z_STREAM_END) {
      const bool more = gzip && at + 1 < bytes.size() && bytes[at] == '\x1f' && bytes[at + 1] == '\x8b';
      if (!more) return out;
      inflateReset(&stream);
    } else if (code != Z_OK || (out.size() == before && at >= bytes.size())) {
      throw FileError(path,
                      fmt::format("cannot be unpacked: byte {} is {}", at, at < bytes.size() ? "wrong" : "its end"));
    }
  }
}

}  // namespace

std::string unpacked(std::string bytes, uint64_t most, const std::string& path) {
  if (!bytes.starts_with("\x1f\x8b")) return bytes;
  return inflate_all(bytes, 0, most, path, true);
}

std::string inflated(const std::string& bytes, uint64_t from, uint64_t most, const std::string& path) {
  return inflate_all(bytes, std::min<uint64_t>(from, bytes.size()), most, path, false);
}

}  // namespace lumicut::io
