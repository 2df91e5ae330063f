// Several lights against a block of points, summed without shadows: the inner loop of methods that know the visibility
// of a whole cluster at once. SIMD over points, picked at run time.
#pragma once

#include <span>

#include "clustering/light_kernel.h"

namespace lumicut {

struct alignas(64) BlockSums {
  float r[kMaxLit + kLanes], g[kMaxLit + kLanes], b[kMaxLit + kLanes];
};

// Unshadowed radiance that `lights` together give to points [first, first + count) of `points`, times `weight`: set, or
// added to what is there. first a multiple of kLanes, count <= kMaxLit; sums of up to kLanes - 1 points past the end
// are written too. `falloff` as in light_points. Lights of one kind are best neighbours.
void light_block(std::span<const Vpl> lights, float weight, Falloff falloff, const ShadePoints& points, size_t first,
                 size_t count, bool add, BlockSums& sums);

}  // namespace lumicut
