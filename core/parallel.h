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

#include "core/current_work.h"

namespace lumicut {

// Threads that the hardware offers to this process.
int hardware_threads();

// fn(begin, end) over [0, n) in chunks of exactly `chunk` (the last may be shorter). Runs on the caller's arena.
template <typename Fn>
void parallel_chunks(size_t n, size_t chunk, Fn&& fn) {
  const size_t chunks = (n + chunk - 1) / chunk;
  const Progress* work = CurrentWork::progress();
  tbb::parallel_for(tbb::blocked_range<size_t>(0, chunks, 1), [&](const tbb::blocked_range<size_t>& range) {
    const CurrentWork current(work);  // the thread may have been in another's, which waits
    for (size_t i = range.begin(); i < range.end(); ++i) fn(i * chunk, std::min(n, (i + 1) * chunk));
  });
}

// threads - 1 workers, and the thread of each call beside them: a call never waits for another one's work to end, not even
// on a device of one thread (a commit while a long render runs). Beyond kCalls at once they do.
class Arena {
 public:
  // 0: all hardware threads.
  explicit Arena(int threads)
      : threads_(threads > 0 ? threads : hardware_threads()), arena_(threads_ - 1 + kCalls, kCalls) {
    // oneTBB has no more workers than cores unless told so.
    if (threads_ > hardware_threads())
      control_ = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads_);
  }
  int threads() const { return threads_; }
  template <typename Fn>
  auto run(Fn&& fn) {
    const Progress* work = CurrentWork::progress();
    return arena_.execute([&] {
      const CurrentWork current(work);  // another thread may take it over
      return std::forward<Fn>(fn)();
    });
  }

 private:
  static constexpr int kCalls = 8;

  int threads_;
  tbb::task_arena arena_;
  std::unique_ptr<tbb::global_control> control_;
};

}  // namespace lumicut
