#include "geometry/instances.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/rng.h"
#include "core/vec.h"
#include "geometry/point_tree.h"

namespace lumicut {
namespace {

double uniform01(Rng& rng) {
  return (static_cast<double>(rng.next_u32() >> 6) * 134217728.0 + static_cast<double>(rng.next_u32() >> 5)) * 0x1p-53;
}

// The unit sphere and the plane through its equator, seen from the south pole; the origin is the north pole.
Vec3d to_sphere(const Point2& p) {
  const double d = p.x * p.x + p.y * p.y;
  return {2 * p.x / (1 + d), 2 * p.y / (1 + d), (1 - d) / (1 + d)};
}
Point2 to_plane(const Vec3d& v) { return {v.x / (1 + v.z), v.y / (1 + v.z)}; }
// The centre on the sphere of a circle of the plane.
Vec3d spherical_centre(const Point2& c, double radius) {
  return normalize(Vec3d{2 * c.x, 2 * c.y, 1 - (c.x * c.x + c.y * c.y) + radius * radius});
}
// The cap {v : dot(axis, v) >= height} in the plane.
Disk to_disk(const Vec3d& axis, double height) {
  const double w = axis.z + height;
  const Point2 c{axis.x / w, axis.y / w};
  return {c, std::sqrt(c.x * c.x + c.y * c.y + (axis.z - height) / w)};
}

}  // namespace

std::vector<Point2> uniform_points(size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test, 77);
  std::vector<Point2> p(n);
  for (Point2& q : p) q.x = uniform01(rng), q.y = uniform01(rng);
  return p;
}

std::vector<Point2> gauss9_points(size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test, 77);
  std::vector<Point2> p(n);
  struct Gauss {
    Point2 mean;
    double a, b, c;
  } g[9];
  for (Gauss& k : g) {
    k.mean = {uniform01(rng), uniform01(rng)};
    k.a = 0.02 + 0.1 * uniform01(rng);
    k.b = 0.1 * (uniform01(rng) - 0.5);
    k.c = 0.02 + 0.1 * uniform01(rng);
  }
  Point2 lo{1e300, 1e300}, hi{-1e300, -1e300};
  for (size_t i = 0; i < n; ++i) {
    const Gauss& k = g[i % 9];
    const double r = std::sqrt(-2 * std::log(1 - uniform01(rng))), t = 6.283185307179586 * uniform01(rng);
    const double u = r * std::cos(t), v = r * std::sin(t);
    p[i] = {k.mean.x + k.a * u, k.mean.y + k.b * u + k.c * v};
    lo = {std::min(lo.x, p[i].x), std::min(lo.y, p[i].y)};
    hi = {std::max(hi.x, p[i].x), std::max(hi.y, p[i].y)};
  }
  const double scale = n > 1 ? 1 / std::max(hi.x - lo.x, hi.y - lo.y) : 0.0;
  for (Point2& q : p) q = {(q.x - lo.x) * scale, (q.y - lo.y) * scale};
  return p;
}

std::vector<Disk> random_disks(std::span<const Point2> points, size_t count, double largest, uint64_t seed) {
  std::vector<Disk> disks;
  Rng rng(seed, Stage::test, count);
  const PointTree tree(points);
  for (size_t i = 0; i < count; ++i) {
    Disk d;
    d.centre.x = uniform01(rng), d.centre.y = uniform01(rng), d.radius = largest * uniform01(rng);
    if (tree.count_in(d) > 0) disks.push_back(d);
  }
  return disks;
}

std::vector<Disk> fixed_disks(std::span<const Point2> points, double radius) {
  std::vector<Disk> disks;
  for (const Point2& p : points) disks.push_back({p, radius});
  return disks;
}

TightInstance tight_instance(int side) {
  if (side < 1 || side > 300) fail_argument("tight instance: side " + std::to_string(side) + "; 1 to 300 expected");
  const double edge = 1.7 / side,
               kRoot3 = 1.7320508075688772;  // the triangle's corners are 1.7 / sqrt(3) from its middle
  const auto row = [&](int j) { return j * (side + 1) - j * (j - 1) / 2; };
  const auto lattice = [&](int i, int j) {  // 0 <= i + j <= side
    return Point2{edge * (i + 0.5 * j - 0.5 * side), edge * (0.5 * kRoot3 * j - side / (2 * kRoot3))};
  };
  const auto number = [&](int i, int j) { return static_cast<uint32_t>(row(j) + i); };

  TightInstance t;
  std::vector<Point2> plane;
  std::vector<Vec3d> v;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i + j <= side; ++i)
      plane.push_back(lattice(i, j)), v.push_back(spherical_centre(plane.back(), edge / 2));
  t.small = v.size();
  struct Face {
    uint32_t corner[3];  // counter-clockwise
    uint32_t middle = 0;
  };
  std::vector<Face> faces;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i + j < side; ++i) {
      faces.push_back({{number(i, j), number(i + 1, j), number(i, j + 1)}});
      if (i + j + 1 < side) faces.push_back({{number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)}});
    }
  for (Face& f : faces) {
    const Point2 &a = plane[f.corner[0]], &b = plane[f.corner[1]], &c = plane[f.corner[2]];
    f.middle = static_cast<uint32_t>(v.size());
    v.push_back(spherical_centre({(a.x + b.x + c.x) / 3, (a.y + b.y + c.y) / 3}, edge / (2 * kRoot3)));
  }
  // Contacts. How far they may move towards a face: a share of how far outside the disks between centres they are.
  struct Pair {
    uint32_t small, start;
    Vec3d aside;  // of the disk's centre, away from the other point at a contact
  };
  std::vector<Pair> pairs;
  for (const Face& f : faces) {
    for (int k = 0; k < 3; ++k) pairs.push_back({f.corner[k], f.middle, {}});
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = f.corner[k], b = f.corner[(k + 1) % 3];
      const Vec3d contact = to_sphere({(plane[a].x + plane[b].x) / 2, (plane[a].y + plane[b].y) / 2});
      double gap = 1;
      for (const uint32_t end : {a, b}) {
        const Vec3d axis = normalize(v[end] + v[f.middle]);
        gap = std::min(gap, length(axis - contact) - length(axis - v[end]));
      }
      const Vec3d to_middle = v[f.middle] - contact;
      const auto m = static_cast<uint32_t>(v.size());
      v.push_back(normalize(contact + normalize(to_middle) * (0.25 * gap)));
      pairs.push_back({a, m, to_middle * 0.15}), pairs.push_back({b, m, to_middle * 0.15});
    }
  }
  for (size_t i = t.small; i < v.size(); ++i) t.start.push_back(static_cast<uint32_t>(i));
  for (const Vec3d& p : v) t.points.push_back(to_plane(p));
  // A disk around each pair, widened half-way to the nearest other point.
  const PointTree tree(t.points);
  for (const Pair& pair : pairs) {
    const Vec3d axis = normalize((v[pair.small] + v[pair.start]) * 0.5 + pair.aside);
    const double height = std::min(dot(axis, v[pair.small]), dot(axis, v[pair.start]));
    double other = -1;
    tree.for_each_in(to_disk(axis, height - 3 * (1 - height)), [&](uint32_t p) {
      if (p != pair.small && p != pair.start) other = std::max(other, dot(axis, v[p]));
    });
    other = std::max(other, height - (1 - height));
    if (other >= height) throw Error(ErrorCode::internal, "tight instance: a disk holds a third point");
    t.disks.push_back(to_disk(axis, (height + other) / 2));
  }
  return t;
}

}  // namespace lumicut
