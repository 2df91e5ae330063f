// Progress and cancellation of long work. Every phase polls `check()` at least every few milliseconds of work.
#pragma once

#include <atomic>
#include <cstdint>

#include "core/error.h"

namespace lumicut {

class Progress {
 public:
  // Names the phase that starts (a string literal) and the units of work in it.
  void begin(const char* phase, uint64_t total) {
    phase_.store(phase, std::memory_order_relaxed);
    done_.store(0, std::memory_order_relaxed);
    total_.store(total, std::memory_order_relaxed);
  }
  void advance(uint64_t n) { done_.fetch_add(n, std::memory_order_relaxed); }
  const char* phase() const { return phase_.load(std::memory_order_relaxed); }
  // In [0, 1] within the phase.
  float fraction() const {
    const auto total = total_.load(std::memory_order_relaxed);
    const auto done = done_.load(std::memory_order_relaxed);
    return total == 0 ? 0.0f : static_cast<float>(done < total ? done : total) / static_cast<float>(total);
  }
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  // Throws Error(cancelled).
  void check() const {
    if (cancelled()) throw Error(ErrorCode::cancelled, "cancelled");
  }

 private:
  std::atomic<const char*> phase_{""};
  std::atomic<uint64_t> done_{0}, total_{0};
  std::atomic<bool> cancelled_{false};
};

// For loops of short steps: looks at `progress`, where there is one, at step 0 and every 16384 steps on. Throws as check().
inline void check_now_and_then(const Progress* progress, uint64_t step) {
  if (progress != nullptr && step % 16384 == 0) progress->check();
}

}  // namespace lumicut
