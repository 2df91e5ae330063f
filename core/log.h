// Messages for the host: a callback given at device creation, else silence. The library never writes to stdout or
// stderr.
#pragma once

#include <string>

namespace lumicut {

enum class LogLevel : int { error = 0, warning = 1, info = 2, debug = 3 };

class Log {
 public:
  using Callback = void (*)(void* user, int level, const char* text);
  Log() = default;
  Log(Callback callback, void* user, LogLevel verbosity) : callback_(callback), user_(user), verbosity_(verbosity) {}
  bool enabled(LogLevel level) const { return callback_ != nullptr && level <= verbosity_; }
  void operator()(LogLevel level, const std::string& text) const;

 private:
  Callback callback_ = nullptr;
  void* user_ = nullptr;
  LogLevel verbosity_ = LogLevel::warning;
};

}  // namespace lumicut
