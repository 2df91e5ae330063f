// What goes wrong with a file. The text names the file, the place in it (line, key or record) and the value found
// there.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace lumicut::io {

class FileError : public std::runtime_error {
 public:
  FileError(const std::string& file, const std::string& text) : std::runtime_error(file + ": " + text) {}
};

// The whole file as bytes. Throws FileError when it is missing, a folder, unreadable or longer than `max_bytes`.
std::string read_whole_file(const std::string& path, uint64_t max_bytes = uint64_t{8} << 30);

}  // namespace lumicut::io
