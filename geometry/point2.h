// Points and disks of the plane, in double precision and any one unit.
#pragma once

namespace lumicut {

struct Point2 {
  double x = 0, y = 0;
  constexpr bool operator==(const Point2&) const = default;
};

struct Disk {
  Point2 centre;
  double radius = 0;
};

constexpr double dist2(const Point2& a, const Point2& b) {
  const double dx = a.x - b.x, dy = a.y - b.y;
  return dx * dx + dy * dy;
}

// Disks are closed. This one test decides everywhere in geometry/, so that every solver and oracle sees the same
// instance.
constexpr bool hits(const Point2& p, const Disk& d) { return dist2(p, d.centre) <= d.radius * d.radius; }

}  // namespace lumicut
