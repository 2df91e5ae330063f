// Exact orientation of three points: a floating-point filter, then expansion arithmetic. [Shewchuk 1997, sec. 2
// and 4.2] Departs: one exact stage instead of four adaptive ones; the filter settles nearly all calls.
#pragma once

#include <cmath>

#include "geometry/point2.h"

namespace lumicut {

// Sign of the exact determinant; exact while no product of two coordinates over- or underflows (|coordinate| is 0 or
// within [1e-140, 1e150]).
int orientation_exact(const Point2& a, const Point2& b, const Point2& c);

// +1: a, b, c turn left (counter-clockwise); -1: right; 0: collinear.
inline int orientation(const Point2& a, const Point2& b, const Point2& c) {
  const double left = (a.x - c.x) * (b.y - c.y), right = (a.y - c.y) * (b.x - c.x);
  const double det = left - right;
  // Shewchuk's ccwerrboundA = (3 + 16 eps) eps with eps = 2^-53; |left| + |right| bounds both sign cases.
  const double bound = 3.3306690738754716e-16 * (std::fabs(left) + std::fabs(right));
  if (det > bound) return 1;
  if (det < -bound) return -1;
  return orientation_exact(a, b, c);
}

// `q` on the closed segment ab, given that a, b, q are collinear.
inline bool between(const Point2& a, const Point2& b, const Point2& q) {
  return (a.x <= b.x ? a.x <= q.x && q.x <= b.x : b.x <= q.x && q.x <= a.x) &&
         (a.y <= b.y ? a.y <= q.y && q.y <= b.y : b.y <= q.y && q.y <= a.y);
}

}  // namespace lumicut
