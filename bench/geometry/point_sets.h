// Point sets of the thesis's tables that can be generated.
#pragma once

#include <cmath>
#include <cstring>
#include <vector>

#include "core/rng.h"
#include "geometry/point2.h"

namespace lumicut::bench {

inline double uniform01(Rng& rng) {
  return (static_cast<double>(rng.next_u32() >> 6) * 134217728.0 + static_cast<double>(rng.next_u32() >> 5)) * 0x1p-53;
}

// "uniform" in the unit square, or "gauss9": nine Gaussians with random mean and covariance, scaled to the unit square.
inline std::vector<Point2> point_set(const char* kind, size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test, 77);
  std::vector<Point2> p(n);
  if (!std::strcmp(kind, "uniform")) {
    for (Point2& q : p) q.x = uniform01(rng), q.y = uniform01(rng);
    return p;
  }
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
  const double scale = 1 / std::max(hi.x - lo.x, hi.y - lo.y);
  for (Point2& q : p) q = {(q.x - lo.x) * scale, (q.y - lo.y) * scale};
  return p;
}

}  // namespace lumicut::bench
