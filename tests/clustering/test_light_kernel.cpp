#include <gtest/gtest.h>

#include "clustering/light_kernel.h"
#include "tests/clustering/random_lighting.h"

namespace lumicut {

TEST(LightKernel, EqualsPlainArithmeticForEveryKindOfLightAndMaterial) {
  for (const bool glossy : {false, true}) {
    for (uint32_t trial = 0; trial < 400; ++trial) {
      Rng rng(trial, Stage::test, glossy);
      const ShadePoints points = test::random_points(rng, 1 + rng.next_below(kMaxLit), 1.0f, glossy);
      Vpl light = test::random_light(rng, static_cast<VplKind>(trial % kVplKinds), 1.5f);
      light.clamp2 = 0.01f;
      auto lit = std::make_unique<LitPoints>();
      light_points(light, light.intensity, Falloff(test::random_profiles()), points, 0, points.size(), *lit);
      size_t next = 0;
      for (size_t i = 0; i < points.size(); ++i) {
        const Rgb expected = light_point(light, light.intensity, Falloff(test::random_profiles()), points.get(i));
        Rgb got{};
        if (next < lit->count && lit->index[next] == i) {
          got = {lit->r[next], lit->g[next], lit->b[next]};
          EXPECT_EQ(lit->x[next], points.position[0][i]);
          ++next;
        }
        // GGX's lobe is 3000 high at the sharpest, and rounding of the light's direction turns it by 1e-6 of its width.
        // exp(n log x) against pow: relative error grows with n (up to 1000) times half an ulp of the logarithm; near
        // the horizon cosines cancel, so the largest possible value sets the absolute scale.
        const float scale = max_component(light.intensity) / light.clamp2;
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
    light.clamp2 = clamp2;
    light_points(light, light.intensity, Falloff(test::random_profiles()), points, 0, points.size(), lit);
    for (size_t i = 0; i < lit.count; ++i) EXPECT_TRUE(std::isfinite(lit.r[i]));
  }
}

TEST(LightKernel, MeanOfAClusterShinesAsItsLightsTogether) {
  // Normals of every spread, from one direction to all.
  for (const float spread : {0.0f, 0.3f, 1.0f, 3.0f, 100.0f}) {
    for (uint32_t trial = 0; trial < 50; ++trial) {
      Rng rng(trial, Stage::test, static_cast<uint64_t>(spread * 10.0f));
      const auto direction = [&] {
        return normalize(Vec3f{rng.next_float() - 0.5f, rng.next_float() - 0.5f, rng.next_float() - 0.5f});
      };
      const Vec3f axis = direction(), to_light = direction();
      constexpr int kLights = 400;
      std::vector<Vec3f> normals;
      Vec3f mean{};
      for (int i = 0; i < kLights; ++i) {
        normals.push_back(normalize(axis + direction() * spread));
        mean = mean + normals.back() / float{kLights};
      }
      DirectionScatter s;
      double exact = 0.0;
      for (const Vec3f& n : normals) {
        const Vec3f d = n - mean;
        const float k = 0.63661977f / float{kLights};
        s.xx += k * d.x * d.x, s.yy += k * d.y * d.y, s.zz += k * d.z * d.z;
        s.xy += k * d.x * d.y, s.xz += k * d.x * d.z, s.yz += k * d.y * d.z;
        exact += std::max(0.0f, -dot(n, to_light)) / kLights;
      }
      EXPECT_NEAR(mean_cosine(mean, s, to_light), exact, spread == 0.0f ? 1e-5 : 0.05) << spread;
      EXPECT_GE(mean_cosine(mean, s, to_light), 0.0f);

      const ShadePoints points = test::random_points(rng, 64, 1.0f, trial % 2 == 0);
      Vpl light = test::random_light(rng, VplKind::oriented, 1.5f);
      light.normal = mean, light.clamp2 = 0.01f;
      Vpl omni = light;
      omni.kind = VplKind::omni;
      LitPoints lit;
      light_points(light, light.intensity, {}, points, 0, points.size(), lit, nullptr, &s);
      for (size_t i = 0; i < lit.count; ++i) {
        const SurfacePoint point = points.get(lit.index[i]);
        const Rgb expected = light_point(omni, light.intensity, {}, point) *
                             mean_cosine(mean, s, normalize(light.position - point.position));
        EXPECT_NEAR(lit.g[i], expected.y, 2e-3f * expected.y + 1e-4f * max_component(light.intensity));
      }
    }
  }
}

}  // namespace lumicut
