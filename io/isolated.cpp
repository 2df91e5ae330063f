#include "io/isolated.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

constexpr char kDone = 'd', kRefused = 'r', kNoMemory = 'm';

void write_all(int to, const std::string& bytes) {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t n = write(to, bytes.data() + at, bytes.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) _exit(1);
    at += static_cast<size_t>(n);
  }
}

void limit(__rlimit_resource_t what, rlim_t most) {
  rlimit now{};
  if (getrlimit(what, &now) != 0) return;
  now.rlim_cur = std::min(most, now.rlim_max);
  setrlimit(what, &now);
}

// Of addresses, in bytes; 0 where /proc does not say.
[[maybe_unused]] uint64_t taken() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

[[noreturn]] void child(int to, double seconds, [[maybe_unused]] uint64_t bytes,
                        const std::function<std::string()>& work) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int signal : {SIGINT, SIGTERM, SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL}) std::signal(signal, SIG_DFL);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<rlim_t>(std::ceil(seconds)));
#ifndef LUMICUT_SANITIZED
  limit(RLIMIT_AS, taken() + bytes);  // sanitizers reserve more
#endif
  // Libraries talk; their words are not this program's.
  if (const int nothing = open("/dev/null", O_WRONLY); nothing >= 0) dup2(nothing, 1), dup2(nothing, 2);
  std::string answer;
  try {
    answer = work();
    answer += kDone;
  } catch (const FileError& error) {
    answer = error.what();
    answer += kRefused;
  } catch (const std::bad_alloc&) {
    answer = kNoMemory;
  }
  write_all(to, answer);
  _exit(0);
}

}  // namespace

std::string isolated(const std::string& file, const std::string& reader, double seconds, uint64_t bytes,
                     const std::function<std::string()>& work) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw FileError(file, fmt::format("no pipe for its reader: {}", strerror(errno)));
  const pid_t pid = fork();
  if (pid < 0) {
    const int error = errno;
    close(ends[0]), close(ends[1]);
    throw FileError(file, fmt::format("no process for its reader: {}", strerror(error)));
  }
  if (pid == 0) {
    close(ends[0]);
    child(ends[1], seconds, bytes, work);
  }
  close(ends[1]);
  std::string answer;
  for (char block[1 << 16];;) {
    const ssize_t n = read(ends[0], block, sizeof(block));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    answer.append(block, static_cast<size_t>(n));
  }
  close(ends[0]);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    throw FileError(
        file, fmt::format("{} was ended: it took more than {:.0f} s of the processor, or more memory than there is",
                          reader, seconds));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || answer.empty())
    throw FileError(file,
                    fmt::format("{} broke at it (signal {})", reader, WIFSIGNALED(status) ? WTERMSIG(status) : 0));
  const char end = answer.back();
  answer.pop_back();
  if (end == kNoMemory)
    throw FileError(file, fmt::format("{} needs more than {} MB of memory for it", reader, bytes >> 20));
  if (end == kRefused) throw FileError(answer);
  return answer;
}

}  // namespace lumicut::io
