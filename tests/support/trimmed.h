// Sizes of tests where sanitizers look on, which take many times as long.
#pragma once

#include <cstddef>

namespace lumicut::test {

#ifdef LUMICUT_SANITIZED
constexpr bool kSanitized = true;
// A tenth of n where the test is built with a sanitizer.
constexpr size_t trimmed(size_t n) { return n / 10; }
// A tolerance for the noise of n samples, for those of trimmed(n).
constexpr double trimmed_noise(double tolerance) { return tolerance * 3.1622776601683795; }
#else
constexpr bool kSanitized = false;
constexpr size_t trimmed(size_t n) { return n; }
constexpr double trimmed_noise(double tolerance) { return tolerance; }
#endif

}  // namespace lumicut::test
