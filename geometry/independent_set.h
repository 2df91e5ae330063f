// Many disks of a list that do not touch each other, by local search. [Bus 2015 (thesis), ch. 8, remark at Theorem 8.1]
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/progress.h"
#include "geometry/point2.h"

namespace lumicut {

// Small disks first, each that touches none taken before; then up to `exchange` - 1 disks (exchange from 2 to 4) are
// given up for one more, as long as it can be done. With exchange = 3 at least an eighth of the most there can be, and
// usually nearly all. Disks are closed: two that touch in a point touch. Indices, ascending. Deterministic.
// `start`: in place of the small ones first; refused if two of it touch.
// Time and memory go by the pairs of disks that touch, whose square root is the number of disks where all do: more than
// 2^28 pairs are refused.
std::vector<uint32_t> independent_disks(std::span<const Disk> disks, int exchange, std::span<const uint32_t> start = {},
                                        Progress* progress = nullptr);

}  // namespace lumicut
