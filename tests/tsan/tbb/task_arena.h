#pragma once

#include "ordered.h"
// All that knows the arena by its own name.
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/task_scheduler_observer.h>
#include_next <tbb/task_arena.h>
#include "parallel_for.h"
#include "parallel_invoke.h"
#include "parallel_sort.h"

namespace tbb {

class ordered_task_arena : public task_arena {
 public:
  using task_arena::task_arena;

  template <typename Fn>
  auto execute(Fn&& fn) {
    lumicut::tsan::Ordered ordered;
    return task_arena::execute(ordered.body(fn));
  }
};

}  // namespace tbb

#define task_arena ordered_task_arena
