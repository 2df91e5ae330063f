// What a local search has yet to look at: each element once, and again when something near it changed.
#pragma once

#include <cstdint>
#include <vector>

namespace lumicut {

class WorkQueue {
 public:
  explicit WorkQueue(size_t elements = 0) : queued_(elements, 0) {}
  void push(uint32_t x) {
    if (queued_[x]) return;
    queued_[x] = 1;
    queue_.push_back(x);
  }
  // fn(x) for each, first come first; what fn pushes follows.
  template <typename Fn>
  void run(Fn&& fn) {
    for (size_t i = 0; i < queue_.size(); ++i) {
      const uint32_t x = queue_[i];
      queued_[x] = 0;
      fn(x);
    }
  }

 private:
  std::vector<uint8_t> queued_;
  std::vector<uint32_t> queue_;
};

}  // namespace lumicut
