// Bytes packed by zlib's methods.
#pragma once

#include <cstdint>
#include <string>

namespace lumicut::io {

// What gzip packed, or the bytes as they are where it did not. Throws FileError about `path` where they are broken or hold
// more than `most`.
std::string unpacked(std::string bytes, uint64_t most, const std::string& path);
// The stream of deflate with zlib's head that begins at `from`; what follows it is passed over. Throws as above.
std::string inflated(const std::string& bytes, uint64_t from, uint64_t most, const std::string& path);

}  // namespace lumicut::io
