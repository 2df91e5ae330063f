// This program again, as a child: so that a run's memory and its failures are its own.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace lumicut::tools {

struct ChildResult {
  int exit_code = 0;     // 128 + signal when a signal ended it
  std::string messages;  // the end of what it wrote to stderr
};

// Runs this program with these arguments and waits. `waiting` is called a few times a second. When an interrupt comes,
// the child is interrupted and waited for, and Interrupted thrown. Throws std::runtime_error when it cannot be started.
ChildResult run_self(const std::vector<std::string>& arguments, const std::function<void()>& waiting);

}  // namespace lumicut::tools
