// What the subcommands of `lumicut` share.
#pragma once

#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace CLI {
class App;
}

namespace lumicut::tools {

// Exit codes, documented in docs/command_line.md.
enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2, kBadFile = 3, kInterrupted = 130 };

// A command line that cannot be obeyed: unknown integrator, parameter or layer.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Ctrl-C came.
class Interrupted : public std::runtime_error {
 public:
  explicit Interrupted(const std::string& text = "interrupted; nothing was written") : std::runtime_error(text) {}
};

// Ends the command with this code; what there is to say has been said.
class SilentExit : public std::runtime_error {
 public:
  explicit SilentExit(int code) : std::runtime_error(""), code_(code) {}
  int code() const { return code_; }

 private:
  int code_;
};

// Set by the first Ctrl-C (or SIGTERM); the second ends the program at once.
extern volatile std::sig_atomic_t interrupted;
void catch_interrupts();

// While one lives, Ctrl-C ends the program at once: for work that reads alone, in loops of libraries that ask nobody.
class NothingToLose {
 public:
  NothingToLose();
  ~NothingToLose();
  NothingToLose(const NothingToLose&) = delete;
  NothingToLose& operator=(const NothingToLose&) = delete;
};

inline void stop_if_interrupted() {
  if (interrupted) throw Interrupted();
}

// On standard error. Throws nothing when that cannot be written to: a render shall not end for a lost message.
template <typename... T>
void print_error(fmt::format_string<T...> format, T&&... values) {
  std::fputs(fmt::format(format, std::forward<T>(values)...).c_str(), stderr);
}

// Each adds its subcommand to the command line; its callback does the work.
void add_render(CLI::App& app);
void add_flythrough(CLI::App& app);
void add_compare(CLI::App& app);
void add_convert(CLI::App& app);
void add_mix(CLI::App& app);
void add_bench(CLI::App& app);
void add_report(CLI::App& app);
void add_info(CLI::App& app);
void add_check(CLI::App& app);
void add_errors(CLI::App& app);

// Of --version: the library's version, and what traces rays in it.
std::string version_text();

}  // namespace lumicut::tools
