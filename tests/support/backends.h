// What traces rays in this build, for tests that run on each.
#pragma once

#include <vector>

namespace lumicut::test {

#ifdef LUMICUT_WITHOUT_EMBREE
inline constexpr bool kHasEmbree = false;
#else
inline constexpr bool kHasEmbree = true;
#endif

// The library's own first.
inline std::vector<const char*> backends() {
  std::vector<const char*> all{"bvh"};
  if (kHasEmbree) all.push_back("embree");
  return all;
}
inline const char* last_backend() { return backends().back(); }  // the one that is not the default, where there are two

}  // namespace lumicut::test

// At the head of a test that compares with Embree.
#define SKIP_WITHOUT_EMBREE() \
  if (!lumicut::test::kHasEmbree) GTEST_SKIP() << "this build has no Embree"
