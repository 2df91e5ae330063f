// Parts of files of little-endian numbers of 32 bits that scene files name: { "file", "offset", "count" }.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "io/json_reader.h"

namespace lumicut::io {

// `offset` in bytes, `count` elements of `width` numbers. Throws FileError where the part does not lie in the file.
// `resolve`: the path of a file that a value names.
template <typename T>
std::vector<T> read_block(const JsonValue& value, size_t width,
                          const std::function<std::string(const JsonValue&)>& resolve);
extern template std::vector<float> read_block(const JsonValue&, size_t,
                                              const std::function<std::string(const JsonValue&)>&);
extern template std::vector<uint32_t> read_block(const JsonValue&, size_t,
                                                 const std::function<std::string(const JsonValue&)>&);

// `size` bytes from `offset` on. Throws FileError.
std::string read_part(const std::string& path, uint64_t offset, uint64_t size);

}  // namespace lumicut::io
