#pragma once

#include "ordered.h"
#define parallel_for unordered_parallel_for
#include_next <tbb/parallel_for.h>
#undef parallel_for

namespace tbb {

template <typename Index, typename Fn>
void parallel_for(Index first, Index last, const Fn& fn) {
  lumicut::tsan::Ordered ordered;
  unordered_parallel_for(first, last, ordered.body(fn));
}

template <typename Range, typename Fn, typename... Partitioner>
requires(!std::is_arithmetic_v<Range>) void parallel_for(const Range& range, const Fn& fn,
                                                         Partitioner&&... partitioner) {
  lumicut::tsan::Ordered ordered;
  unordered_parallel_for(range, ordered.body(fn), std::forward<Partitioner>(partitioner)...);
}

}  // namespace tbb
