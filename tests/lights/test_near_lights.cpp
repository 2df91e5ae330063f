// Lights near a place, drawn by solid angle: against numeric integrals over their surface.
#include "lights/near_lights.h"

#include <gtest/gtest.h>

#include "core/spherical.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

// Mean of cosine · radiance at `position` (facing up) that samples bring, and its spread.
struct Mean {
  double value = 0, deviation = 0;
};
Mean irradiance(const NearLights& near, const Vec3f& position, int n = 40000) {
  Rng rng(3, Stage::test);
  double sum = 0, sum2 = 0;
  for (int i = 0; i < n; ++i) {
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    double value = 0;
    if (const auto s = near.sample(position, choice, u, v)) {
      const Vec3f to = s->vpl.position - position;
      const double d2 = static_cast<double>(length2(to));
      const double facing = std::max(0.0, static_cast<double>(to.z)) / std::sqrt(d2);
      const double shining = std::max(0.0, -static_cast<double>(dot(s->vpl.normal, to))) / std::sqrt(d2);
      value = static_cast<double>(s->vpl.intensity.x) * facing * shining / d2;
    }
    sum += value, sum2 += value * value;
  }
  return {sum / n, std::sqrt(std::max(0.0, sum2 / n - sum / n * sum / n) / n)};
}

// ∫ (1 − d²/reach²)⁺ cos cos / d² dA by the midpoint rule over a parallelogram, or the disk within.
double by_quadrature(const Vec3f& corner, const Vec3f& u, const Vec3f& v, const Vec3f& position, double reach2,
                     bool disk, bool triangle = false) {
  constexpr int kSteps = 1500;
  const Vec3f normal = normalize(cross(u, v));
  const double cell = static_cast<double>(length(cross(u, v))) / (kSteps * kSteps);
  double sum = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const float a = (static_cast<float>(i) + 0.5f) / kSteps, b = (static_cast<float>(j) + 0.5f) / kSteps;
      if (disk && (a - 0.5f) * (a - 0.5f) + (b - 0.5f) * (b - 0.5f) > 0.25f) continue;
      if (triangle && a + b > 1.0f) continue;
      const Vec3f to = corner + u * a + v * b - position;
      const double d2 = static_cast<double>(length2(to));
      if (!(d2 < reach2)) continue;
      sum += (1 - d2 / reach2) * std::max(0.0, static_cast<double>(to.z)) *
             std::max(0.0, -static_cast<double>(dot(normal, to))) / (d2 * d2) * cell;
    }
  return sum;
}

std::unique_ptr<Scene> scene_with(const Light& light) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0}, 0);
  scene->add_mesh(std::move(mesh));
  scene->set_lights({light});
  Progress progress;
  scene->commit(progress);
  return scene;
}

Light flat(LightType type) {
  Light l;
  l.type = type, l.position = {0.1f, 0.2f, 0.5f};
  l.u = {1, 0.1f, 0}, l.v = {0.1f, -0.7f, 0.2f};  // shines down
  l.value = {2, 2, 2};
  return l;
}

TEST(NearLights, OfAFlatLightGiveTheIntegralOfWhatTheClampTakes) {
  for (const LightType type : {LightType::rectangle, LightType::disk})
    for (const double clamp_lights : {1.0, 40.0, 1e9}) {
      const Light l = flat(type);
      const auto scene = scene_with(l);
      Progress progress;
      const LightSampler sampler(*scene);
      const NearLights near(sampler, 100, clamp_lights, 0.0f, progress);
      const double area = static_cast<double>(length(cross(l.u, l.v))) * (type == LightType::disk ? 0.78539816 : 1.0);
      const double reach2 = clamp_lights * area / 100 / 3.14159265;
      for (const Vec3f& p : {Vec3f{0, 0, 0.45f}, Vec3f{0.3f, 0, 0.2f}, Vec3f{1.5f, 1, 0}}) {
        const double expected =
            2 * by_quadrature(l.position - (l.u + l.v) * 0.5f, l.u, l.v, p, reach2, type == LightType::disk);
        const Mean found = irradiance(near, p);
        EXPECT_NEAR(found.value, expected, 4 * found.deviation + 2e-3 * expected)
            << static_cast<int>(type) << " " << clamp_lights << " at " << p.x;
      }
    }
}

// What a place close to a large light sees is nearly the same everywhere: no 1/d² is left in the samples.
TEST(NearLights, CloseToALightTheirSamplesHardlyDiffer) {
  const auto scene = scene_with(flat(LightType::rectangle));
  Progress progress;
  const LightSampler sampler(*scene);
  const NearLights near(sampler, 100, 1e9, 0.0f, progress);
  const Mean found = irradiance(near, {0.1f, 0.2f, 0.49f}, 4000);
  EXPECT_LT(found.deviation * std::sqrt(4000.0), 0.75 * found.value);  // of the cosine alone: 0.58
}

TEST(NearLights, OfASphereGiveTheClosedForm) {
  Light l;
  l.position = {0, 0, 1}, l.radius = 0.4f, l.value = {3, 3, 3};
  const auto scene = scene_with(l);
  Progress progress;
  const LightSampler sampler(*scene);
  const NearLights near(sampler, 100, 1e12, 0.0f, progress);
  // Of radiance L straight above: π L sin² of half the angle it covers; the light's value is its intensity.
  const double radiance = 3 / (3.14159265 * 0.16);
  for (const float z : {0.0f, 0.5f, 0.59f}) {
    const double sine = 0.4 / (1 - static_cast<double>(z));
    const Mean found = irradiance(near, {0, 0, z});
    EXPECT_NEAR(found.value, 3.14159265 * radiance * sine * sine, 4 * found.deviation + 1e-3 * found.value) << z;
  }
  EXPECT_FALSE(near.sample({0, 0, 1}, 0.5f, 0.5f, 0.5f)) << "from within nothing is seen";
}

// Thousands of triangles: those near are found, each with the density that find_triangle states.
TEST(NearLights, OfAMeshGiveTheIntegralAndStateTheirDensity) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material lamp = test::diffuse(0, 0, 0);
  lamp.emission = {2, 2, 2};
  scene->set_materials({lamp});
  Mesh mesh;
  constexpr int kSide = 40;
  for (int i = 0; i < kSide; ++i)
    for (int k = 0; k < kSide; ++k) {
      const float x = -1 + 2.0f * static_cast<float>(i) / kSide, y = -1 + 2.0f * static_cast<float>(k) / kSide,
                  d = 2.0f / kSide;
      test::add_quad(mesh, {x, y, 1}, {x, y + d, 1}, {x + d, y + d, 1}, {x + d, y, 1}, 0);
    }
  scene->add_mesh(std::move(mesh));
  Progress progress;
  scene->commit(progress);
  const LightSampler sampler(*scene);
  for (const double clamp_lights : {20.0, 400.0}) {
    const NearLights near(sampler, 1000, clamp_lights, 0.0f, progress);
    const double reach2 = clamp_lights * 4.0 / 1000 / 3.14159265;
    for (const Vec3f& p : {Vec3f{0.2f, 0.1f, 0.9f}, Vec3f{0.9f, 0.9f, 0.95f}}) {
      const double expected = 2 * by_quadrature({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, p, reach2, false);
      const Mean found = irradiance(near, p);
      EXPECT_NEAR(found.value, expected, 4 * found.deviation + 2e-3 * expected) << clamp_lights;
      Rng rng(5, Stage::test);
      for (int i = 0; i < 50; ++i) {
        const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
        const auto s = near.sample(p, choice, u, v);
        if (!s) continue;
        RayHit ray;
        ray.ray.org = p, ray.ray.dir = normalize(s->vpl.position - p);
        scene->accel().intersect({&ray, 1});
        ASSERT_EQ(ray.hit.geom, 0u);
        const auto at = near.find_triangle(p, 0, ray.hit.prim, scene->instance_of(ray.hit), ray.ray.tfar);
        EXPECT_NEAR(at.density, s->density, 0.02 * s->density);
        EXPECT_NEAR(at.lost, 1 - static_cast<double>(ray.ray.tfar) * ray.ray.tfar / reach2, 1e-3);
      }
    }
  }
  EXPECT_FALSE(NearLights(sampler, 1000, 20.0, 0.0f, progress).near({0, 0, -1}));
  EXPECT_TRUE(NearLights(sampler, 0, 20.0, 0.0f, progress).empty());
}

TEST(SphericalTriangle, CoversAnOctant) {
  const SphericalTriangle octant({}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
  EXPECT_NEAR(octant.solid_angle(), 3.14159265 / 2, 1e-8);
  Rng rng(1, Stage::test);
  Vec3f mean{};
  for (int i = 0; i < 100000; ++i) {
    const float u = rng.next_float(), v = rng.next_float();
    const Vec3f d = octant.sample(u, v);
    EXPECT_GE(std::min(d.x, std::min(d.y, d.z)), -1e-6f);
    mean += d / 100000.0f;
  }
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(mean[k], 0.5f, 0.003f);  // by symmetry; half is the centroid's
}

}  // namespace
}  // namespace lumicut
