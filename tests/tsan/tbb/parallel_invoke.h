#pragma once

#include "ordered.h"
#define parallel_invoke unordered_parallel_invoke
#include_next <tbb/parallel_invoke.h>
#undef parallel_invoke

namespace tbb {

template <typename... Fn>
void parallel_invoke(Fn&&... fns) {
  lumicut::tsan::Ordered ordered;
  unordered_parallel_invoke(ordered.body(fns)...);
}

}  // namespace tbb
