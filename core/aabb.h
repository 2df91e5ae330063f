// Axis-aligned bounding box. Empty boxes are inverted (lo > hi) and neutral under `extend`.
#pragma once

#include <limits>

#include "core/vec.h"

namespace lumicut {

struct Aabb {
  Vec3f lo{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
           std::numeric_limits<float>::infinity()};
  Vec3f hi{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
           -std::numeric_limits<float>::infinity()};

  void extend(const Vec3f& p) { lo = min(lo, p), hi = max(hi, p); }
  void extend(const Aabb& b) { lo = min(lo, b.lo), hi = max(hi, b.hi); }
  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  Vec3f center() const { return (lo + hi) * 0.5f; }
  Vec3f extent() const { return hi - lo; }
  int longest_axis() const {
    const Vec3f e = extent();
    return e.x >= e.y && e.x >= e.z ? 0 : (e.y >= e.z ? 1 : 2);
  }
  float diagonal2() const { return empty() ? 0.0f : length2(extent()); }
  float diagonal() const { return std::sqrt(diagonal2()); }
  // Half of the surface area: xy + yz + zx. 0 when empty.
  float half_area() const {
    if (empty()) return 0.0f;
    const Vec3f e = extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
  bool contains(const Vec3f& p) const {
    return p.x >= lo.x && p.x <= hi.x && p.y >= lo.y && p.y <= hi.y && p.z >= lo.z && p.z <= hi.z;
  }
  // Squared distance from `p` to the nearest point of the box; 0 inside.
  float dist2(const Vec3f& p) const {
    const Vec3f d = max(max(lo - p, p - hi), Vec3f{});
    return length2(d);
  }
  // Squared distance between the nearest points of two boxes; 0 when they touch.
  float dist2(const Aabb& b) const {
    const Vec3f d = max(max(lo - b.hi, b.lo - hi), Vec3f{});
    return length2(d);
  }
};

inline Aabb merge(const Aabb& a, const Aabb& b) { return {min(a.lo, b.lo), max(a.hi, b.hi)}; }

}  // namespace lumicut
