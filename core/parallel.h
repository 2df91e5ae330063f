// Threads: a device owns one arena, and all parallel work of its objects runs inside it. Work is cut in fixed chunks,
// so that what is computed never depends on the number of threads.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>

namespace lumicut {

// Threads that the hardware offers to this process.
int hardware_threads();

// fn(begin, end) over [0, n) in chunks of exactly `chunk` (the last may be shorter). Runs on the caller's arena.
template <typename Fn>
void parallel_chunks(size_t n, size_t chunk, Fn&& fn) {
  const size_t chunks = (n + chunk - 1) / chunk;
  tbb::parallel_for(size_t{0}, chunks, [&](size_t i) { fn(i * chunk, std::min(n, (i + 1) * chunk)); });
}

class Arena {
 public:
  // 0: all hardware threads.
  explicit Arena(int threads) : arena_(threads > 0 ? threads : hardware_threads()) {
    // oneTBB has no more workers than cores unless told so.
    if (arena_.max_concurrency() > hardware_threads())
      control_ =
          std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, arena_.max_concurrency());
  }
  int threads() const { return arena_.max_concurrency(); }
  template <typename Fn>
  auto run(Fn&& fn) {
    return arena_.execute(std::forward<Fn>(fn));
  }

 private:
  tbb::task_arena arena_;
  std::unique_ptr<tbb::global_control> control_;
};

}  // namespace lumicut
