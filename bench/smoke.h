// Smoke runs (CTest sets LUMICUT_BENCH_SMOKE): every part of a benchmark on small input, about a second in all, so
// that a broken one is noticed. Their figures mean nothing.
#pragma once

#include <cstdlib>

namespace lumicut::bench {

inline bool smoke() {
  static const bool on = std::getenv("LUMICUT_BENCH_SMOKE") != nullptr;
  return on;
}

template <typename T>
T sized(T whole, T in_smoke) {
  return smoke() ? in_smoke : whole;
}

}  // namespace lumicut::bench
