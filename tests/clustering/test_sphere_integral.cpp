// Virtual spherical lights against integrals by brute force.
#include <gtest/gtest.h>

#include <numbers>

#include "bsdf/point_bsdf.h"
#include "clustering/block_kernel.h"
#include "clustering/light_kernel.h"
#include "tests/clustering/random_lighting.h"
#include "tests/support/trimmed.h"

namespace lumicut {

namespace {

// Cosine of the cone's half-angle and its solid angle over πr².
struct TrueCone {
  double cosine, geometry;
};
TrueCone cone_of(const Vpl& light, const Vec3f& position) {
  const double d = length(light.position - position), r = light.radius();
  const double c = d >= r ? std::sqrt(1 - r * r / (d * d)) : -std::sqrt(1 - d * d / (r * r));
  return {c, 2 * (1 - c) / (r * r)};
}

// The mean over the cone on a grid of directions, fine beside the lobes that are tried.
double brute_force(const Vpl& light, const SurfacePoint& p) {
  constexpr int kSide = test::kSanitized ? 160 : 500;  // a tenth of the work
  const TrueCone cone = cone_of(light, p.position);
  const Frame frame(normalize(light.position - p.position));
  double sum = 0;
  for (int i = 0; i < kSide; ++i) {
    const double z = 1 - (1 - cone.cosine) * (i + 0.5) / kSide, s = std::sqrt(std::max(0.0, 1 - z * z));
    for (int k = 0; k < kSide; ++k) {
      const double phi = 2 * std::numbers::pi * (k + 0.5) / kSide;
      const Vec3f w = frame.to_world(
          {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)), static_cast<float>(z)});
      const float cx = dot(p.normal, w), cl = -dot(light.normal, w);
      if (cx > 0 && cl > 0) sum += static_cast<double>(reflectance(p, w).y) * double{cx} * double{cl};
    }
  }
  return sum / (kSide * kSide) * cone.geometry;
}

enum class Model { diffuse, blinn, phong, ggx };

// A point and a sphere that may shine at it, often where its lobe looks.
void place(Rng& rng, Model model, float sharpness, bool inside, SurfacePoint& p, Vpl& light) {
  p = {};
  p.position = test::random_point(rng, 1.0f);
  p.normal = test::random_direction(rng);
  // Seen from above: the lobe of a grazing view is so narrow across that a grid misses it.
  p.mirror = normalize(p.normal * 1.2f + test::random_direction(rng));
  if (model == Model::diffuse) {
    p.diffuse = {0.3f, 0.3f, 0.3f};
  } else if (model == Model::ggx) {
    p.lobe = kLobe<GgxReflection>, p.shape = sharpness, p.specular = {0.3f, 0.3f, 0.3f}, p.grazing = {1, 1, 1};
  } else {
    p.shape = sharpness, p.specular = Rgb{0.5f, 0.5f, 0.5f} * cosine_lobe_scale(model == Model::phong, sharpness);
  }
  light.kind = VplKind::sphere;
  light.intensity = {1, 1, 1};
  light.radius() = 0.1f + 0.4f * rng.next_float();
  const float distance =
      light.radius() * (inside ? rng.next_float() : 1.0f + 9.0f * rng.next_float() * rng.next_float());
  Vec3f to = normalize(p.mirror + test::random_direction(rng) * (1.5f * light.radius() / distance));
  if (!(dot(to, p.normal) > 0)) to = p.normal;
  light.position = p.position + to * distance;
  light.normal = normalize(test::random_direction(rng) - to);
}

}  // namespace

TEST(SphereIntegral, IsThatOfBruteForceForEveryMaterialInsideAndOutside) {
  struct Case {
    Model model;
    float sharpness;
    double rms, bias;  // largest, over the mean
  };
  // 18 directions: errors of single places are a few percent, and average out.
  for (const Case& c :
       {Case{Model::diffuse, 0, 0.06, 0.015}, Case{Model::blinn, 4, 0.06, 0.03}, Case{Model::blinn, 40, 0.06, 0.03},
        Case{Model::phong, 20, 0.06, 0.03}, Case{Model::phong, 150, 0.06, 0.03}, Case{Model::ggx, 0.1f, 0.10, 0.04},
        Case{Model::ggx, 0.3f, 0.10, 0.04}, Case{Model::ggx, 0.8f, 0.10, 0.04}}) {
    for (const bool inside : {false, true}) {
      double error2 = 0, difference = 0, sum = 0;
      constexpr int kTrials = 40;
      for (int trial = 0; trial < kTrials; ++trial) {
        Rng rng(static_cast<uint64_t>(trial), Stage::test, 31 + static_cast<uint64_t>(c.model));
        SurfacePoint p;
        Vpl light;
        place(rng, c.model, c.sharpness, inside, p, light);
        // In units of the cone's own size, so that no near sphere outweighs the others.
        const double unit = cone_of(light, p.position).geometry;
        const double truth = brute_force(light, p) / unit;
        const double value = static_cast<double>(light_point(light, light.intensity, {}, p).y) / unit;
        error2 += (value - truth) * (value - truth), difference += value - truth, sum += truth;
      }
      const double rms = std::sqrt(error2 / kTrials) / (sum / kTrials), bias = difference / sum;
      RecordProperty("model " + std::to_string(static_cast<int>(c.model)) + " " + std::to_string(c.sharpness) +
                         (inside ? " inside" : " outside"),
                     std::to_string(rms) + " rms, " + std::to_string(bias) + " bias");
      std::printf("model %d %g %s: rms %.4f bias %+.4f\n", static_cast<int>(c.model), static_cast<double>(c.sharpness),
                  inside ? "inside" : "outside", rms, bias);
      EXPECT_LT(rms, c.rms) << static_cast<int>(c.model) << " " << c.sharpness << " inside " << inside;
      EXPECT_LT(std::abs(bias), c.bias) << static_cast<int>(c.model) << " " << c.sharpness << " inside " << inside;
    }
  }
}

TEST(SphereIntegral, OfADiffusePointAboveAllOfASphereIsTheClosedForm) {
  // Facing each other: ∫ cos² dω = 2π(1 − c³)/3.
  SurfacePoint p;
  p.normal = p.mirror = {0, 0, 1}, p.diffuse = {1, 1, 1};
  Vpl light;
  light.kind = VplKind::sphere, light.normal = {0, 0, -1}, light.intensity = {1, 1, 1};
  for (const float r : {0.01f, 0.3f, 0.9f, 1.0f}) {
    light.position = {0, 0, 1}, light.radius() = r;
    const double c = std::sqrt(1 - double{r} * double{r});
    EXPECT_NEAR(light_point(light, light.intensity, {}, p).x, 2 * (1 - c * c * c) / (3 * double{r} * double{r}),
                1e-4 / (1e-3 + double{r} * double{r}) * 1e-2 + 1e-5)
        << r;
  }
  // At the centre all directions count; those below either horizon give nothing: half of ∫ cos² over the sphere.
  light.position = p.position, light.radius() = 0.5f;
  EXPECT_NEAR(light_point(light, light.intensity, {}, p).x, 2.0 / (3 * 0.25), 0.03 * 2.0 / (3 * 0.25));
}

TEST(SphereIntegral, TendsToThePointLightAsTheSphereShrinks) {
  uint32_t lit = 0;
  for (uint32_t trial = 0; trial < 3000; ++trial) {
    Rng rng(trial, Stage::test, 33);
    const SurfacePoint p = test::random_surface(rng, 1.0f, true);
    Vpl point = test::random_light(rng, VplKind::oriented, 1.0f), sphere = point;
    const float d = length(point.position - p.position);
    sphere.kind = VplKind::sphere;
    const Rgb expected = light_point(point, point.intensity, {}, p);
    for (const float share : {2e-3f, 1e-3f, 3e-4f, 1e-4f, 1e-5f, 1e-7f}) {
      sphere.radius() = share * d;
      const Rgb got = light_point(sphere, sphere.intensity, {}, p);
      // Over the cone the sharpest lobe (exponent 1000, α 0.01) varies by some share/0.01 to either side of its mean,
      // and cosines by `share` near the horizon.
      const float slack = (0.01f + 4.0f * share / 0.01f) * expected.y +
                          2.0f * share / (d * d) * point.intensity.y * (p.diffuse.y + 3000.0f * share);
      ASSERT_NEAR(got.y, expected.y, slack + 1e-6f) << trial << " share " << share;
    }
    lit += expected.y > 0;
  }
  EXPECT_GT(lit, 500u);
}

TEST(SphereIntegral, IsContinuousThroughTheSurfaceOfTheSphere) {
  for (uint32_t trial = 0; trial < 300; ++trial) {
    Rng rng(trial, Stage::test, 34);
    SurfacePoint p = test::random_surface(rng, 1.0f, false);
    Vpl light = test::random_light(rng, VplKind::sphere, 1.0f);
    const float d = length(light.position - p.position);
    float value[2];
    for (const int side : {0, 1}) {
      light.radius() = d * (side == 0 ? 0.999999f : 1.000001f);
      value[side] = light_point(light, light.intensity, {}, p).y;
    }
    // The cone's angle grows with the root of the distance to the surface: √(2e-6) to either side of π/2.
    EXPECT_NEAR(value[0], value[1], 0.03f * std::max(value[0], 0.1f * light.intensity.y * p.diffuse.y / (d * d)));
  }
}

TEST(SphereIntegral, IsTheSameInBlocksOfLightsAndOneByOne) {
  for (uint32_t trial = 0; trial < 60; ++trial) {
    Rng rng(trial, Stage::test, 35);
    const ShadePoints points = test::random_points(rng, 48, 1.0f, trial % 3 != 0);
    const std::vector<Vpl> lights = test::random_cluster(rng, VplKind::sphere, 9);
    BlockSums sums;
    light_block(lights, 1.0f, {}, points, 0, points.size(), false, sums);
    for (size_t i = 0; i < points.size(); ++i) {
      Rgb sum{};
      for (const Vpl& light : lights) sum += light_point(light, light.intensity, {}, points.get(i));
      EXPECT_NEAR(sums.g[i], sum.y, 1e-3f * sum.y + 1e-6f);
    }
  }
}

TEST(SphereIntegral, StaysFiniteWhereverTheLightLies) {
  Rng rng(1, Stage::test, 36);
  const ShadePoints points = test::random_points(rng, 64, 1.0f, true);
  for (const float radius : {1e-20f, 1e-6f, 1.0f, 1e6f}) {
    for (size_t at = 0; at < points.size(); ++at) {
      Vpl light = test::random_light(rng, VplKind::sphere, 1.0f);
      light.radius() = radius;
      if (at % 2 == 0) light.position = points.position_at(at);
      if (at % 4 == 1) light.position = points.position_at(at) + points.get(at).mirror * 0.5f;  // the lobe's own axis
      LitPoints lit;
      light_points(light, light.intensity, {}, points, 0, points.size(), lit);
      // A radius whose fourth power leaves the range of floats may overflow, and nothing else.
      for (size_t i = 0; i < lit.count && radius > 1e-10f; ++i)
        EXPECT_TRUE(std::isfinite(lit.r[i]) && lit.r[i] >= 0.0f) << radius << " " << at;
    }
  }
}

}  // namespace lumicut
