#include "io/standard_streams.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace lumicut::io {

void open_standard_streams() {
  for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; ++fd)
    // The lowest free number is this one. Opened for the other direction, so that using it fails.
    if (fcntl(fd, F_GETFD) < 0) (void)!open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  std::signal(SIGXFSZ, SIG_IGN);
}

int close_standard_output(const char* command, int code, int failure, int error) {
  const bool failed = std::ferror(stdout) != 0;
  if (std::fclose(stdout) != 0) {
    error = errno;
  } else if (!failed) {
    return code;
  }
  if (error != EPIPE)
    std::fprintf(stderr, "%s: standard output: cannot be written%s%s\n", command, error ? ": " : "",
                 error ? std::strerror(error) : "");
  return code != 0 ? code : failure;
}

}  // namespace lumicut::io
