// What goes wrong with a file. The text names the file, the place in it (line, key or record) and the value found
// there.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace lumicut::io {

class FileError : public std::runtime_error {
 public:
  explicit FileError(const std::string& whole) : std::runtime_error(whole) {}
  FileError(const std::string& file, const std::string& text) : std::runtime_error(file + ": " + text) {}
};

// Throws FileError when the file is missing or is no plain file (links followed): for readers of libraries, which
// would wait for ever at a pipe and read for ever from a device.
void check_regular_file(const std::string& path);

// The whole file as bytes. A pipe is read too, up to 1 GiB and while bytes come. Throws FileError when it is missing, a
// folder, a device, unreadable, longer than `max_bytes` or than half the memory, or a pipe that nobody writes into
// (for 2 s) or that is silent for 10 s.
std::string read_whole_file(const std::string& path, uint64_t max_bytes = uint64_t{8} << 30);

}  // namespace lumicut::io
