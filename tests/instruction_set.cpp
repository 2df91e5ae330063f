// Linked into tests of SIMD code: LUMICUT_TEST_INSTRUCTION_SET (AVX2, SSE4, EMU128) rules out the better ones, so that
// one machine passes the tests of all.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "hwy/highway.h"

namespace {

const bool restricted = [] {
  const char* wanted = std::getenv("LUMICUT_TEST_INSTRUCTION_SET");
  if (wanted == nullptr) return false;
  const std::string name = wanted;
  // A better set has a lower bit.
  const int64_t best = name == "AVX2" ? HWY_AVX2 : name == "SSE4" ? HWY_SSE4 : name == "EMU128" ? HWY_EMU128 : 0;
  if (best == 0) {
    std::fprintf(stderr, "LUMICUT_TEST_INSTRUCTION_SET: no such set: %s\n", wanted);
    std::exit(2);
  }
  hwy::DisableTargets(best - 1);
  return true;
}();

TEST(InstructionSet, IsTheOneAskedFor) {
  if (!restricted) GTEST_SKIP() << "LUMICUT_TEST_INSTRUCTION_SET is not set";
  const auto targets = hwy::SupportedTargets();
  const int64_t best = targets & ~(targets - 1);
  // A processor without the set falls to a lesser one.
  const std::string wanted = std::getenv("LUMICUT_TEST_INSTRUCTION_SET");
  EXPECT_GE(best, wanted == "AVX2" ? HWY_AVX2 : wanted == "SSE4" ? HWY_SSE4 : HWY_EMU128);
}

}  // namespace
