// Lamps with a radius against integrals over the disk or the sphere that they are.
#include <gtest/gtest.h>

#include <numbers>

#include "clustering/light_kernel.h"
#include "lights/light_sampler.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

constexpr double kPi = std::numbers::pi;

double falloff_of(const Light& l, double cosine) {
  if (l.type == LightType::point) return 1.0;
  if (!(cosine > static_cast<double>(l.cos_outer))) return 0.0;
  double x =
      l.blend_cosine > 0
          ? std::clamp((cosine - static_cast<double>(l.cos_outer)) / static_cast<double>(l.blend_cosine), 0.0, 1.0)
          : 1.0;
  x = x * x * (3 - 2 * x);
  return l.spot_cosine ? x * cosine : x;
}

// Irradiance, upwards (+z), of an even disk of radius r that faces it, at the distance d in direction `axis`.
double disk_irradiance(const Light& l, const Vec3d& axis, double d, double r, double radiance) {
  const Frame f(Vec3f{static_cast<float>(axis.x), static_cast<float>(axis.y), static_cast<float>(axis.z)});
  constexpr int kRings = 200, kSpokes = 400;
  double sum = 0.0;
  for (int i = 0; i < kRings; ++i)
    for (int k = 0; k < kSpokes; ++k) {
      const double rho = r * std::sqrt((i + 0.5) / kRings), phi = 2 * kPi * (k + 0.5) / kSpokes;
      Vec3d to{};
      for (int c = 0; c < 3; ++c)
        to[c] = d * axis[c] +
                rho * (std::cos(phi) * static_cast<double>(f.t[c]) + std::sin(phi) * static_cast<double>(f.b[c]));
      const double t2 = to.x * to.x + to.y * to.y + to.z * to.z, t = std::sqrt(t2);
      const double leaving = -(to.x * static_cast<double>(l.direction.x) + to.y * static_cast<double>(l.direction.y) +
                               to.z * static_cast<double>(l.direction.z)) /
                             t;
      sum += radiance * falloff_of(l, leaving) * (d / t) * std::max(0.0, to.z / t) / t2;
    }
  return sum * kPi * r * r / (kRings * kSpokes);
}

std::unique_ptr<Scene> scene_of(const Light& light, bool with_card = false) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_lights({light});
  if (with_card) {
    scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
    Mesh card;
    test::add_quad(card, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}, 0);
    scene->add_mesh(std::move(card));
  }
  Progress progress;
  scene->commit(progress);
  return scene;
}

double mean_irradiance(const Light& light, const Vec3f& at) {
  const auto scene = scene_of(light);
  const LightSampler sampler(*scene);
  SurfacePoint p;
  p.position = at, p.normal = {0, 0, 1}, p.diffuse = {1, 1, 1};
  constexpr uint64_t kCount = 200000;
  double sum = 0.0;
  for (uint64_t i = 0; i < kCount; ++i) {
    Rng rng(1, Stage::test, i);
    const Vpl v = sampler.sample_direct((static_cast<double>(i) + 0.5) / kCount, kCount, rng);
    sum += static_cast<double>(light_point(v, v.intensity, Falloff(), p).x);
  }
  return sum;
}

Light spot(float radius, bool facing) {
  Light l;
  l.type = LightType::spot, l.value = {1, 1, 1}, l.position = {0, 0, 2}, l.direction = {0, 0, -1};
  l.cos_outer = std::cos(0.6f), l.blend_cosine = 0.3f * (1 - l.cos_outer), l.spot_cosine = true;
  l.radius = radius, l.facing = facing;
  return l;
}

}  // namespace

TEST(SoftLamps, FacingDisksLightAsTheIntegralOverTheDiskDoes) {
  for (const LightType type : {LightType::spot, LightType::point})
    for (const float radius : {0.2f, 1.0f, 3.0f})
      for (const float x : {0.0f, 0.8f, 2.0f}) {
        Light l = spot(radius, true);
        l.type = type;
        const Vec3d to{-static_cast<double>(x), 0, 2};
        const double d = std::sqrt(to.x * to.x + to.z * to.z);
        const double r = static_cast<double>(radius);
        const double expected = disk_irradiance(l, {to.x / d, 0, to.z / d}, d, r, 1 / (kPi * r * r));
        // 200,000 places: standard error below 0.3 % of the largest.
        EXPECT_NEAR(mean_irradiance(l, {x, 0, 0}), expected, 0.01 * expected + 2e-4) << radius << " " << x;
        // In closed form towards the centre.
        if (type == LightType::point && x == 0.0f) {
          EXPECT_NEAR(expected, 1 / (4 + r * r), 1e-4);
        }
      }
}

TEST(SoftLamps, SpheresLightAsTheDiskOfTheirOutlineDoes) {
  for (const float radius : {0.2f, 1.0f, 1.8f})
    for (const float x : {0.0f, 0.8f, 2.0f}) {
      const Light l = spot(radius, false);
      const Vec3d to{-static_cast<double>(x), 0, 2};
      const double d = std::sqrt(to.x * to.x + to.z * to.z), r = static_cast<double>(radius);
      // The cone of directions of a sphere is that of a disk through its centre of a larger radius; both are even.
      const double outline = r / std::sqrt(1 - r * r / (d * d));
      const double expected = disk_irradiance(l, {to.x / d, 0, to.z / d}, d, outline, 1 / (kPi * r * r));
      EXPECT_NEAR(mean_irradiance(l, {x, 0, 0}), expected, 0.01 * expected + 4e-4) << radius << " " << x;
    }
}

TEST(SoftLamps, PlacesFillTheDiskEvenlySeenFromAnywhere) {
  const Vec3f towards = normalize(Vec3f{1, -2, 0.5f});
  constexpr int kCount = 100000;
  double inner = 0;
  for (int i = 0; i < kCount; ++i) {
    Rng rng(2, Stage::test, static_cast<uint64_t>(i));
    const float u = rng.next_float(), v = rng.next_float(), w = rng.next_float();
    const Vec3f place = place_in_ball(u, v, w);
    const float along = dot(place, towards), across2 = length2(place) - along * along;
    EXPECT_LE(across2, 1.0f + 1e-5f);
    inner += across2 < 0.25f ? 1 : 0;
  }
  EXPECT_NEAR(inner / kCount, 0.25, 0.006);  // four standard errors
}

TEST(SoftLamps, ALampAtACeilingStandsBelowItForWhatLiesBelow) {
  Light l = spot(0.5f, false);
  const auto scene = scene_of(l);
  const LightSampler sampler(*scene);
  for (uint64_t i = 0; i < 100; ++i) {
    Rng rng(3, Stage::test, i);
    const Vpl v = sampler.sample_direct(0.5, 1, rng);
    EXPECT_NEAR(shadow_origin(v, Vec3f{0, 0, -100}).light.z, 2.0f, 1e-3f);
  }
}

TEST(SoftLamps, WithoutShadowsNothingStandsBeforeIt) {
  Light l = spot(0.0f, false);
  l.shadows = false;
  const auto scene = scene_of(l);
  EXPECT_EQ(LightSampler(*scene).delta_lights()[0].ray_mask, 0u);
  const auto accel_scene = scene_of(l, true);
  const float x = 0, y = 0, z = 0;
  uint8_t occluded = 1;
  accel_scene->accel().occluded_from_point({{0, 0, 2}, false, 0}, &x, &y, &z, 1, &occluded);
  EXPECT_EQ(occluded, 0);
  accel_scene->accel().occluded_from_point({{0, 0, 2}, false, kShadowRay}, &x, &y, &z, 1, &occluded);
  EXPECT_EQ(occluded, 1);
}

}  // namespace lumicut
