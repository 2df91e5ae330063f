// Cone of directions. Built from the box of unit directions, so that merging is O(1). [Walter et al. 2008, sec. 5]
#pragma once

#include "core/aabb.h"

namespace lumicut {

struct Cone {
  Vec3f axis{0, 0, 1};
  float cos_half = -1.0f;  // cosine of the half-angle; -1: all directions

  static Cone all() { return {}; }
  float sin_half() const { return std::sqrt(std::max(0.0f, 1.0f - cos_half * cos_half)); }
};

// Smallest cone through the circle in which the box's circumscribed sphere cuts the unit sphere. With centre c and
// radius r of that sphere: cos = (1 + |c|² − r²) / (2|c|) and |c|² − r² = lo·hi.
// Conservative: widened by 1e-5 against rounding. Boxes around the origin give the cone of all directions.
inline Cone cone_of_direction_box(const Aabb& directions) {
  if (directions.empty()) return Cone::all();
  const Vec3f sum = directions.lo + directions.hi;  // 2c
  const float len = length(sum);
  if (!(len > 1e-6f)) return Cone::all();
  const float c = (1.0f + dot(directions.lo, directions.hi)) / len - 1e-5f;
  // The circumscribed sphere holds the whole unit sphere, or reaches past its far pole.
  if (!(c > -1.0f)) return Cone::all();
  return {sum / len, std::min(c, 1.0f - 1e-6f)};
}

}  // namespace lumicut
