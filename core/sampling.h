// Monte Carlo helpers that know neither lights nor surfaces.
#pragma once

namespace lumicut {

// Power heuristic for a sample drawn with density `a`, where `b` could have drawn it too. [Veach, Guibas 1995, sec. 4]
inline float power_heuristic(double a, double b) {
  const double a2 = a * a, b2 = b * b;
  return a2 + b2 > 0.0 ? static_cast<float>(a2 / (a2 + b2)) : 0.0f;
}

}  // namespace lumicut
