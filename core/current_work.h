// Which work a thread does a part of.
#pragma once

#include "core/progress.h"

namespace lumicut {

// The work that this thread does a part of. What is deep inside of it, and may take long at one place (texture programs),
// asks whether it still counts; what it gives then is thrown away, since work looks at its Progress before it gives
// anything out. Chunks of parallel work belong to the work that cut them (core/parallel.h).
class CurrentWork {
 public:
  explicit CurrentWork(const Progress* progress) : before_(current_) { current_ = progress; }
  ~CurrentWork() { current_ = before_; }
  CurrentWork(const CurrentWork&) = delete;
  CurrentWork& operator=(const CurrentWork&) = delete;
  static const Progress* progress() { return current_; }
  static bool cancelled() { return current_ != nullptr && current_->cancelled(); }

 private:
  static inline thread_local const Progress* current_ = nullptr;
  const Progress* before_;
};

}  // namespace lumicut
