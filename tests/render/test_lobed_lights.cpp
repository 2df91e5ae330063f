// Virtual lights on surfaces that are not Lambert's shine by the surface's own diffuse lobe.
#include <gtest/gtest.h>

#include <numbers>

#include "clustering/light_kernel.h"
#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
const Rgb kColor{0.7f, 0.7f, 0.7f};

Material oren_nayar(float slope, bool once = false) {
  Material m = test::diffuse(kColor.x, kColor.y, kColor.z);
  m.oren_nayar = true, m.roughness = slope, m.facets_once = once;
  return m;
}

Material burley(float roughness) {
  Material m = test::diffuse(kColor.x, kColor.y, kColor.z);
  m.lobe = LobeModel::ggx, m.specular = {}, m.burley = true, m.roughness = roughness;
  return m;
}

Material plastic(float roughness, float diffuse_roughness = 0.0f) {
  Material m = burley(roughness);
  m.burley = false, m.specular = {1, 1, 1}, m.diffuse_roughness = diffuse_roughness;
  return m;
}

const std::vector<Material> kMaterials{oren_nayar(0.2f), oren_nayar(1.0f), oren_nayar(0.6f, true), burley(0.0f),
                                       burley(1.0f)};

// A floor under a sun, with that shading normal.
std::unique_ptr<Scene> floor_of(const Material& material, const Vec3f& to_sun, const Vec3f& normal = {0, 0, 1}) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  scene->set_materials({material});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
  if (normal != Vec3f{0, 0, 1}) mesh.normals.assign(mesh.positions.size(), normal);
  scene->add_mesh(std::move(mesh));
  Light sun;
  sun.type = LightType::sun, sun.direction = -to_sun, sun.value = {1, 1, 1};
  scene->set_lights({sun});
  Progress progress;
  scene->commit(progress);
  return scene;
}

// Intensity of the light towards a unit direction.
float intensity(const Vpl& v, const Vec3f& direction) {
  SurfacePoint facing;
  facing.position = v.position + direction, facing.normal = facing.mirror = -direction, facing.diffuse = {1, 1, 1};
  return light_point(v, v.intensity, Falloff(), facing).x;
}

Vec3f at(float cosine, float azimuth) {
  const float sine = std::sqrt(1.0f - cosine * cosine);
  return {sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
}

TEST(LobedLights, ShineIntoEachDirectionAsTheSurfaceIsSeenFromThere) {
  for (size_t m = 0; m < kMaterials.size(); ++m)
    for (const float sun : {0.1f, 0.5f, 0.95f}) {
      const Vec3f to_sun = at(sun, 1.0f);
      const auto scene = floor_of(kMaterials[m], to_sun);
      const VplSet set = test::standing_lights_of(*scene, 200);
      ASSERT_GT(set.lights.size(), set.direct + 10);
      const Vpl& light = set.lights[set.direct + 5];
      ASSERT_EQ(light.kind, VplKind::lobed);
      float first = 0;
      for (const float cosine : {0.15f, 0.6f, 0.98f})
        for (const float azimuth : {0.7f, 1.5f, 4.0f}) {
          const Vec3f to_viewer = at(cosine, azimuth);
          RayHit ray;
          ray.ray.org = Vec3f{0.1f, 0.2f, 0} + to_viewer, ray.ray.dir = -to_viewer;
          scene->accel().intersect({&ray, 1});
          ASSERT_NE(ray.hit.geom, kNoId);
          const float seen = scene->interaction(ray).bsdf.evaluate(to_sun).x;
          const float ratio = intensity(light, to_viewer) / (seen * cosine);
          if (first == 0) first = ratio;
          // What gloss takes is exact for who looks, and about right for what shines.
          EXPECT_NEAR(ratio / first, 1.0f, light.falloff > 0 ? 0.05f : 2e-3f)
              << m << " " << sun << " " << cosine << " " << azimuth;
        }
    }
}

void expect_power_of_even_light(const Scene& scene) {
  const VplSet even = test::lights_of(scene, 200), lobed = off_surfaces(even, scene);
  const Vpl &light = lobed.lights[lobed.direct], &host = even.lights[even.direct];
  ASSERT_EQ(host.kind, VplKind::oriented);
  constexpr int kSteps = 200;  // midpoints of cosine and azimuth
  double power = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j)
      power += intensity(light, at((static_cast<float>(i) + 0.5f) / kSteps, 2 * kPi * static_cast<float>(j) / kSteps)) *
               2 * kPi / (kSteps * kSteps);
  EXPECT_NEAR(power / (kPi * host.intensity.x), 1.0, 5e-3);
}

TEST(LobedLights, HaveThePowerOfTheEvenOnesThatHostsGet) {
  for (size_t m = 0; m < kMaterials.size(); ++m)
    for (const float sun : {0.1f, 0.5f, 0.95f}) {
      SCOPED_TRACE(std::to_string(m) + " " + std::to_string(sun));
      expect_power_of_even_light(*floor_of(kMaterials[m], at(sun, 1.0f)));
    }
}

// By the geometric normal they had up to an eighth more.
TEST(LobedLights, HaveThatPowerWhereShadingNormalsLean) {
  for (size_t m = 0; m < kMaterials.size(); ++m)
    for (const float sun : {0.05f, 0.5f}) {
      SCOPED_TRACE(std::to_string(m) + " " + std::to_string(sun));
      expect_power_of_even_light(*floor_of(kMaterials[m], at(sun, 0.0f), at(0.9f, 0.0f)));
    }
}

TEST(LobedLights, AreNoneWhereSurfacesAreLambertsOrSpheresAreWanted) {
  const auto lambert = floor_of(test::diffuse(0.5f, 0.5f, 0.5f), {0, 0, 1});
  EXPECT_TRUE(test::lights_of(*lambert, 100).lobes.empty());
  const auto rough = floor_of(oren_nayar(1), {0, 0, 1});
  const VplSet spheres = off_surfaces(test::lights_of(*rough, 100, 1, 1.0f), *rough);
  for (const Vpl& v : spheres.lights) EXPECT_NE(v.kind, VplKind::lobed);
}

// A wall that a low sun shines on from behind, before a floor that begins where its shadow ends.
std::unique_ptr<Scene> wall_against_the_sun(const Material& floor_material) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  scene->set_materials({floor_material, test::diffuse(0.8f, 0.8f, 0.8f)});
  Mesh floor, wall;
  test::add_quad(floor, {-8, -16, 0}, {8, -16, 0}, {8, -2, 0}, {-8, -2, 0}, 0);
  test::add_quad(wall, {-1, 0, 0.2f}, {1, 0, 0.2f}, {1, 0, 0.7f}, {-1, 0, 0.7f}, 1);
  scene->add_mesh(std::move(floor)), scene->add_mesh(std::move(wall));
  Light sun;
  sun.type = LightType::sun, sun.direction = normalize(Vec3f{0, -4, -1}), sun.value = {1, 1, 1};
  scene->set_lights({sun});
  test::commit_seen_from(*scene, {0, -0.45f, 0.45f}, 0.4f);
  return scene;
}

TEST(LobedLights, OfAFloorLightAWallAgainstTheSunAsPathsDoInEveryIntegrator) {
  const test::RenderOptions options{.width = 16, .height = 12, .samples = 4};
  for (const Material& material : {oren_nayar(0.5f), burley(1.0f), plastic(0.5f), plastic(0.5f, 0.7f)}) {
    const auto scene = wall_against_the_sun(material);
    const double truth = test::mean_luminance(test::render(*scene, "path_tracer", {}, {{"samples", "16"}},
                                                           {.width = 16, .height = 12, .samples = test::trimmed(64)})
                                                  .radiance);
    for (const char* id : {"exhaustive", "lightcuts", "multidimensional_lightcuts", "light_slice",
                           "row_column_sampling", "stochastic_lightcuts", "wspd", "illumination_cut"}) {
      const double mean =
          test::mean_luminance(test::render(*scene, id, test::lights_of(*scene, 2000), {}, options).radiance);
      // Even lights: 0.6 and 0.7. Two thousand lights, the methods' own errors and the path tracer's noise.
      EXPECT_NEAR(mean / truth, 1.0, 0.05) << id;
    }
  }
}

}  // namespace
}  // namespace lumicut
