#include <gtest/gtest.h>

#include "clusters/light_kernel.h"
#include "tests/clusters/random_lighting.h"

namespace lumicut {

TEST(LightKernel, EqualsPlainArithmeticForEveryKindOfLightAndMaterial) {
  for (const bool glossy : {false, true}) {
    for (uint32_t trial = 0; trial < 400; ++trial) {
      Rng rng(trial, Stage::test, glossy);
      const ShadePoints points = test::random_points(rng, 1 + rng.next_below(kMaxLit), 1.0f, glossy);
      const Vpl light = test::random_light(rng, static_cast<VplKind>(trial % 4), 1.5f);
      const float clamp2 = 0.01f;
      auto lit = std::make_unique<LitPoints>();
      light_points(light, light.intensity, clamp2, points, 0, points.size(), *lit);
      size_t next = 0;
      for (size_t i = 0; i < points.size(); ++i) {
        const Rgb expected = light_point(light, light.intensity, clamp2, points.get(i));
        Rgb got{};
        if (next < lit->count && lit->index[next] == i) {
          got = {lit->r[next], lit->g[next], lit->b[next]};
          EXPECT_EQ(lit->x[next], points.position[0][i]);
          ++next;
        }
        // GGX's lobe is 3000 high at the sharpest, and rounding of the light's direction turns it by 1e-6 of its width.
        // exp(n log x) against pow: relative error grows with n (up to 1000) times half an ulp of the logarithm; near
        // the horizon cosines cancel, so the largest possible value sets the absolute scale.
        const float scale = max_component(light.intensity) / clamp2;
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(got[k], expected[k], 1e-3f * expected[k] + 1e-6f * scale);
      }
      EXPECT_EQ(next, lit->count) << "indices rise, and no point beyond the count is lit";
    }
  }
}

TEST(LightKernel, LightOnThePointItselfStaysFinite) {
  Rng rng(1, Stage::test);
  const ShadePoints points = test::random_points(rng, 16, 1.0f, true);
  Vpl light;
  light.kind = VplKind::omni;
  light.position = points.position_at(3);
  light.intensity = {1, 1, 1};
  for (const float clamp2 : {0.0f, 0.25f}) {
    LitPoints lit;
    light_points(light, light.intensity, clamp2, points, 0, points.size(), lit);
    for (size_t i = 0; i < lit.count; ++i) EXPECT_TRUE(std::isfinite(lit.r[i]));
  }
}

}  // namespace lumicut
