// Point sets of the thesis's tables that can be generated, by name.
#pragma once

#include <cstring>
#include <vector>

#include "core/rng.h"
#include "geometry/instances.h"

namespace lumicut::bench {

inline double uniform01(Rng& rng) {
  return (static_cast<double>(rng.next_u32() >> 6) * 134217728.0 + static_cast<double>(rng.next_u32() >> 5)) * 0x1p-53;
}

// "uniform" or "gauss9"
inline std::vector<Point2> point_set(const char* kind, size_t n, uint64_t seed) {
  return std::strcmp(kind, "uniform") == 0 ? uniform_points(n, seed) : gauss9_points(n, seed);
}

}  // namespace lumicut::bench
