// Sizes of tests where sanitizers look on, which take many times as long.
#pragma once

#include <cstddef>

namespace lumicut::test {

// A tenth of n where the test is built with a sanitizer.
#ifdef LUMICUT_SANITIZED
constexpr size_t trimmed(size_t n) { return n / 10; }
#else
constexpr size_t trimmed(size_t n) { return n; }
#endif

}  // namespace lumicut::test
