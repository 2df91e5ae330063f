// Points that fill the unit square evenly for any count. [Roberts 2018]
#pragma once

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

}  // namespace lumicut
