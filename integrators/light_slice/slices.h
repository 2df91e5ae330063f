// Slices: groups of shading points that lie together and look the same way. [Ou and Pellacini 2011, sec. 4.1]
#pragma once

#include <vector>

#include "bsdf/shade_points.h"
#include "core/progress.h"

namespace lumicut {

struct Slices {
  std::vector<uint32_t> order;            // all points, slice by slice, in their own order within each
  std::vector<uint32_t> begins;           // of the slices in `order`, and the end
  std::vector<uint32_t> representatives;  // of each slice: the point nearest to its mean
  size_t size() const { return representatives.size(); }
};

// Where a point is put by: position in units of `length`, and its normal and, where it is glossy, its mirror direction.
struct PointFeature {
  float v[9];
};
PointFeature point_feature(const ShadePoints& points, size_t i, float length);
inline float distance2(const PointFeature& a, const PointFeature& b) {
  float d = 0;
  for (int k = 0; k < 9; ++k) d += (a.v[k] - b.v[k]) * (a.v[k] - b.v[k]);
  return d;
}

// Halves the group with the largest sum of squared distances from its mean, across the axis of largest variance, until
// there are `count` groups or none has more than `least` points. Slices that follow each other are mostly near.
Slices build_slices(const ShadePoints& points, size_t count, size_t least, float length,
                    const Progress* progress = nullptr);

}  // namespace lumicut
