#pragma once

// oneTBB's sort calls its own parallel_for, whose name is another here.
#include "parallel_for.h"
#define parallel_for unordered_parallel_for
#include_next <tbb/parallel_sort.h>
#undef parallel_for
