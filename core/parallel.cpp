#include "core/parallel.h"

#include <tbb/info.h>

namespace lumicut {

int hardware_threads() { return tbb::info::default_concurrency(); }

}  // namespace lumicut
