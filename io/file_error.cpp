#include "io/file_error.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "io/physical_memory.h"

namespace lumicut::io {

namespace {

constexpr uint64_t kMaxPipeBytes = uint64_t{1} << 30;
// How long a pipe may have no writer, and its writer be silent.
constexpr int kWriterSeconds = 2, kSilentSeconds = 10;

[[noreturn]] void fail_read(const std::string& path, int error) {
  throw FileError(path, fmt::format("cannot be read: {}", std::strerror(error)));
}

// What kind of file it is, without opening it: to open a device may do something.
struct stat look_at(const std::string& path) {
  struct stat found {};
  if (path.find('\0') != std::string::npos) throw FileError(path, "holds a zero byte");
  if (stat(path.c_str(), &found) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) throw FileError(path, "no such file");
    fail_read(path, errno);
  }
  if (S_ISDIR(found.st_mode)) throw FileError(path, "is a folder, not a file");
  if (!S_ISREG(found.st_mode) && !S_ISFIFO(found.st_mode))
    throw FileError(path, S_ISSOCK(found.st_mode) ? "is a socket, not a file" : "is a device, not a file");
  return found;
}

}  // namespace

void check_regular_file(const std::string& path) {
  if (!S_ISREG(look_at(path).st_mode)) throw FileError(path, "is a pipe, not a file");
}

std::string read_whole_file(const std::string& path, uint64_t max_bytes) {
  const bool pipe = S_ISFIFO(look_at(path).st_mode);
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) fail_read(path, errno);
  struct Closer {
    int fd;
    ~Closer() { close(fd); }
  } closer{fd};
  struct stat found {};
  if (fstat(fd, &found) != 0) fail_read(path, errno);
  if (S_ISFIFO(found.st_mode) != pipe || (!pipe && !S_ISREG(found.st_mode)))
    throw FileError(path, "changed while it was opened");
  const auto size = static_cast<uint64_t>(found.st_size);
  if (pipe) max_bytes = std::min(max_bytes, kMaxPipeBytes);
  if (size > max_bytes) throw FileError(path, fmt::format("has {} bytes; at most {} are read", size, max_bytes));
  // A sparse file may say more than the disk holds.
  const uint64_t memory = physical_memory();
  if (size > memory / 2)
    throw FileError(path, fmt::format("has {} bytes, too many for the {} bytes of memory here", size, memory));
  std::string bytes;
  bytes.reserve(size);
  std::string chunk(size_t{1} << 20, '\0');
  for (int silence = 0;;) {
    pollfd ready = {fd, POLLIN, 0};
    const int events = pipe ? poll(&ready, 1, 1000) : 1;
    if (events < 0) fail_read(path, errno);  // EINTR: Ctrl-C
    silence = events > 0 ? 0 : silence + 1;
    const ssize_t count = read(fd, chunk.data(), chunk.size());
    if (events == 0 && count == 0) {  // there is no writer yet
      if (silence >= kWriterSeconds) throw FileError(path, "nobody writes into this pipe");
      continue;
    }
    if (pipe && count < 0 && errno == EAGAIN) {
      if (silence >= kSilentSeconds)
        throw FileError(path, fmt::format("nothing came through this pipe for {} s", kSilentSeconds));
      continue;
    }
    if (count < 0) fail_read(path, errno);
    if (count == 0) break;
    bytes.append(chunk.data(), static_cast<size_t>(count));
    if (bytes.size() > max_bytes) throw FileError(path, fmt::format("is longer than {} bytes", max_bytes));
  }
  return bytes;
}

}  // namespace lumicut::io
