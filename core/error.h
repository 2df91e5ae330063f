// The one exception type inside the library. The C ABI turns it into a code and this thread's text (plugin/boundary.h).
#pragma once

#include <stdexcept>
#include <string>

namespace lumicut {

// Same values as lumicut_result in lumicut.h.
enum class ErrorCode : int {
  invalid_argument = 1,
  invalid_state = 2,
  unsupported = 3,
  out_of_memory = 4,
  cancelled = 5,
  internal = 6
};

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& text) : std::runtime_error(text), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

[[noreturn]] inline void fail_argument(const std::string& text) { throw Error(ErrorCode::invalid_argument, text); }
[[noreturn]] inline void fail_state(const std::string& text) { throw Error(ErrorCode::invalid_state, text); }

}  // namespace lumicut
