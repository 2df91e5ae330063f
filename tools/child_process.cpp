#include "tools/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "tools/commands.h"

namespace lumicut::tools {

namespace {

constexpr size_t kMostText = 1 << 16;

// In the child, between fork and exec: only what is safe after a fork of a program with threads.
[[noreturn]] void become(char* const* arguments, int errors, pid_t parent) {
  setpgid(0, 0);  // the terminal's Ctrl-C goes to the parent, which passes it on
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  const int nothing = open("/dev/null", O_RDWR);
  dup2(nothing, STDIN_FILENO);
  dup2(nothing, STDOUT_FILENO);
  dup2(errors, STDERR_FILENO);
  execv("/proc/self/exe", arguments);
  _exit(127);
}

}  // namespace

ChildResult run_self(const std::vector<std::string>& arguments, const std::function<void()>& waiting) {
  std::vector<std::string> texts = {"lumicut"};
  texts.insert(texts.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
  const pid_t parent = getpid(), child = fork();
  if (child == 0) become(pointers.data(), pipe_ends[1], parent);
  close(pipe_ends[1]);
  if (child < 0) {
    close(pipe_ends[0]);
    throw std::runtime_error(std::string("no process: ") + std::strerror(errno));
  }
  ChildResult result;
  bool told = false;
  for (char buffer[4096];;) {
    pollfd poll_end = {pipe_ends[0], POLLIN, 0};
    const int ready = poll(&poll_end, 1, 200);
    if (interrupted && !told) {
      kill(child, SIGINT);
      told = true;
    }
    if (ready <= 0) {
      waiting();
      continue;
    }
    const ssize_t count = read(pipe_ends[0], buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;  // the child has ended
    result.messages.append(buffer, static_cast<size_t>(count));
    if (result.messages.size() > kMostText) result.messages.erase(0, result.messages.size() - kMostText);
  }
  close(pipe_ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  stop_if_interrupted();
  return result;
}

}  // namespace lumicut::tools
