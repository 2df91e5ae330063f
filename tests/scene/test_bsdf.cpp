#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "scene/bsdf.h"
#include "scene/material.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

SurfacePoint point_of(const Rgb& kd, const Rgb& ks, float shininess, const Vec3f& to_viewer) {
  SurfacePoint p;
  p.normal = normalize(Vec3f{0.2f, -0.3f, 0.9f});
  p.mirror = normalize(reflect(to_viewer, p.normal));
  p.diffuse = kd * std::numbers::inv_pi_v<float>;
  p.specular = ks * lobe_scale(false, shininess);
  p.shininess = shininess;
  return p;
}

std::vector<SurfacePoint> points() {
  const Vec3f steep = normalize(Vec3f{0.3f, 0.1f, 0.9f}), flat = normalize(Vec3f{0.9f, 0.3f, 0.2f});
  return {point_of({0.5f, 0.4f, 0.3f}, {}, 0, steep), point_of({0.2f, 0.2f, 0.2f}, {0.6f, 0.5f, 0.4f}, 40, steep),
          point_of({}, {0.8f, 0.8f, 0.8f}, 5, flat), point_of({0.1f, 0.1f, 0.1f}, {0.5f, 0.5f, 0.5f}, 300, flat)};
}

// Pearson's statistic over 16 x 32 cells of the sphere, against the density integrated over each cell.
TEST(Bsdf, SamplesFollowTheirDensity) {
  constexpr int kRows = 16, kColumns = 32, kSamples = 200000, kSub = 16;
  for (const SurfacePoint& p : points()) {
    const Bsdf bsdf(p);
    std::array<double, kRows * kColumns> expected{};
    std::array<double, kRows * kColumns> found{};
    double mass = 0;
    for (int r = 0; r < kRows * kSub; ++r)
      for (int c = 0; c < kColumns * kSub; ++c) {
        const double z = -1.0 + 2.0 * (r + 0.5) / (kRows * kSub), phi = 2 * M_PI * (c + 0.5) / (kColumns * kSub);
        const double s = std::sqrt(1 - z * z);
        const Vec3f d{static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
                      static_cast<float>(z)};
        const double m = bsdf.pdf(d) * 4 * M_PI / (kRows * kSub * kColumns * kSub);
        expected[(r / kSub) * kColumns + c / kSub] += m;
        mass += m;
      }
    Rng rng(7, Stage::test);
    double lost = 0;
    for (int i = 0; i < kSamples; ++i) {
      const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
      const BsdfSample s = bsdf.sample(choice, u, v);
      if (!(s.pdf > 0)) {
        lost += 1;
        continue;
      }
      ASSERT_NEAR(length(s.direction), 1.0f, 1e-4f);
      const int r = std::clamp(static_cast<int>((s.direction.z + 1) / 2 * kRows), 0, kRows - 1);
      const double phi = std::atan2(s.direction.y, s.direction.x);
      const int c =
          std::clamp(static_cast<int>((phi < 0 ? phi + 2 * M_PI : phi) / (2 * M_PI) * kColumns), 0, kColumns - 1);
      found[r * kColumns + c] += 1;
    }
    // What the density lacks of 1 is what falls below the horizon.
    EXPECT_NEAR(mass, 1.0 - lost / kSamples, 0.01);
    double chi2 = 0;
    int cells = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      const double e = expected[i] * kSamples;
      if (e < 10) continue;
      // The cells' integrals are good to about 1 %.
      chi2 += (found[i] - e) * (found[i] - e) / (e + 1e-4 * e * e);
      ++cells;
    }
    // Five standard deviations of chi-squared with `cells` degrees of freedom.
    EXPECT_LT(chi2, cells + 5 * std::sqrt(2.0 * cells)) << "shininess " << p.shininess;
  }
}

TEST(Bsdf, WeightIsReflectanceTimesCosineOverDensity) {
  Rng rng(3, Stage::test);
  for (const SurfacePoint& p : points())
    for (int i = 0; i < 1000; ++i) {
      const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
      const BsdfSample s = Bsdf(p).sample(choice, u, v);
      if (!(s.pdf > 0)) continue;
      const Rgb f = reflectance(p, s.direction);
      const float scale = dot(p.normal, s.direction) / s.pdf;
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(s.weight[k], f[k] * scale, 1e-4f * (1 + f[k] * scale));
    }
}

TEST(Bsdf, ABlackSurfaceReflectsNothing) {
  const SurfacePoint p = point_of({}, {}, 10, {0, 0, 1});
  EXPECT_TRUE(Bsdf(p).black());
  EXPECT_EQ(Bsdf(p).sample(0.5f, 0.5f, 0.5f).pdf, 0.0f);
  EXPECT_EQ(Bsdf(p).pdf(p.normal), 0.0f);
}

}  // namespace
}  // namespace lumicut
