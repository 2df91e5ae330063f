// Points that fill the unit square or cube evenly for any count. [Roberts 2018]
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/vec.h"

namespace lumicut {

// Point i of the sequence of these steps, moved by `shift`, which wraps around.
inline Vec2f rank1(uint64_t i, Vec2f shift, double step_x, double step_y) {
  const auto at = static_cast<double>(i);
  const double x = 0.5 + shift.x + at * step_x, y = 0.5 + shift.y + at * step_y;
  return {static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y))};
}
// R2.
inline Vec2f even_point(uint64_t i, Vec2f shift = {0, 0}) {
  return rank1(i, shift, 0.7548776662466927, 0.5698402909980532);
}

// R3, from its point 0 at `first`, in [0, 1).
inline Vec3f even_in_cube(uint64_t i, const Vec3f& first) {
  const auto step = [i](float x, double by) {
    const double at = static_cast<double>(x) + static_cast<double>(i) * by;
    return static_cast<float>(std::min(at - std::floor(at), 0.99999994));
  };
  return {step(first.x, 0.8191725133961645), step(first.y, 0.6710436067037893), step(first.z, 0.5497004779019703)};
}

}  // namespace lumicut
