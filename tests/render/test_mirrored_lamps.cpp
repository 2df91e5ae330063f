// Lamps and suns with a radius light surfaces by way of mirrors: as their mirror images do.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kAlbedo = 0.8f;  // the floor does not light itself, nor by way of an upright mirror

// A wide floor, and either a wide mirror at x = 0 or nothing there; seen from above the place (2.5, 0, 0). `screen`: the
// light of a lamp above (1, 0, 0) comes by way of the mirror alone.
std::unique_ptr<Scene> floor_beside(bool mirror, std::vector<Light> lights, bool screen = false) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material silver = test::diffuse(1, 1, 1);
  silver.lobe = LobeModel::ggx, silver.specular = {1, 1, 1}, silver.roughness = 0, silver.metallic = 1;
  scene->set_materials({test::diffuse(kAlbedo, kAlbedo, kAlbedo), silver, test::diffuse(0, 0, 0)});
  Mesh floor;
  test::add_quad(floor, {0, -8, 0}, {8, -8, 0}, {8, 8, 0}, {0, 8, 0}, 0);
  scene->add_mesh(std::move(floor));
  if (mirror) {
    Mesh wall;
    test::add_quad(wall, {0, -8, 0}, {0, 8, 0}, {0, 8, 8}, {0, -8, 8}, 1);
    scene->add_mesh(std::move(wall));
  }
  if (screen) {
    Mesh black;
    test::add_quad(black, {1.7f, -4, 0.338f}, {1.7f, 4, 0.338f}, {1.7f, 4, 6}, {1.7f, -4, 6}, 2);
    scene->add_mesh(std::move(black));
  }
  scene->set_lights(std::move(lights));
  Camera camera;
  camera.position = {2.5f, 0, 0.5f};
  camera.right = {1, 0, 0}, camera.forward = {0, 0, -1}, camera.up = {0, 1, 0};
  camera.tan_half_fov_y = 0.2f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

Light lamp(float x, float radius) {
  Light light;
  light.type = LightType::point, light.position = {x, 0.3f, 1}, light.radius = radius, light.value = {5, 5, 5};
  return light;
}
Light spot(float x, float radius) {
  Light light = lamp(x, radius);
  // At the mirror's foot, or the image's.
  light.type = LightType::spot, light.direction = normalize(Vec3f{x > 0 ? -0.6f : 0.6f, -0.2f, -1});
  light.cos_outer = 0.3f, light.blend_cosine = 0.2f;
  return light;
}
Light sun(bool image, float degrees) {
  Light light;
  light.type = LightType::sun, light.value = {3, 3, 3};
  light.radius = degrees * std::numbers::pi_v<float> / 180;
  light.direction = normalize(Vec3f{image ? 0.8f : -0.8f, 0.2f, -1});
  return light;
}

struct Method {
  const char* name;
  const char* integrator;
  test::Settings settings;
};
void PrintTo(const Method& method, std::ostream* out) { *out << method.name; }

class MirroredLamps : public testing::TestWithParam<Method> {
 protected:
  static double render(const Scene& scene) {
    double sum = 0;
    constexpr uint64_t kSeeds = test::kSanitized ? 1 : 4;
    constexpr uint32_t kSize = 32;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      test::Settings settings = GetParam().settings;
      settings.emplace_back("seed", std::to_string(seed));
      const bool vpls = std::string(GetParam().integrator) != "path_tracer";
      for (const Rgb& c :
           test::render(scene, GetParam().integrator, vpls ? test::lights_of(scene, 100, seed) : VplSet{}, settings,
                        {.width = kSize, .height = kSize, .samples = 64})
               .radiance)
        sum += c.y / (kSize * kSize * kSeeds);
    }
    return sum;
  }
};
INSTANTIATE_TEST_SUITE_P(Methods, MirroredLamps,
                         testing::Values(Method{"compensated", "exhaustive", {{"compensate", "true"}}},
                                         Method{"lightcuts", "lightcuts", {{"compensate", "true"}, {"error", "0.01"}}},
                                         Method{"path_tracer", "path_tracer", {{"samples", "1"}}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(MirroredLamps, AMirrorLightsAsASecondLampBehindItWould) {
  for (const float radius : {0.1f, 0.25f}) {
    const double mirrored = render(*floor_beside(true, {lamp(1, radius)}, true));
    const double image = render(*floor_beside(false, {lamp(-1, radius)}, true));
    // Of all rays some 50 and 340 meet the lamp: four deviations.
    EXPECT_NEAR(mirrored / image, 1, test::trimmed_noise(radius < 0.2f ? 0.6 : 0.22)) << radius;
  }
}

TEST_P(MirroredLamps, SpotsToo) {
  const double mirrored = render(*floor_beside(true, {spot(1, 0.25f)}, true));
  const double image = render(*floor_beside(false, {spot(-1, 0.25f)}, true));
  EXPECT_NEAR(mirrored / image, 1, test::trimmed_noise(0.22));
}

TEST_P(MirroredLamps, SunsToo) {
  // By way of the mirror alone: the sun's own way is the same in both.
  const double mirrored = render(*floor_beside(true, {sun(false, 6)}));
  const double alone = render(*floor_beside(false, {sun(false, 6)}));
  const double image = render(*floor_beside(false, {sun(true, 6)}));
  EXPECT_NEAR((mirrored - alone) / image, 1, test::trimmed_noise(0.08));
}

// Those are rare dots: what makes them brighter than those of a sun of one degree is left out.
TEST_P(MirroredLamps, OfSmallSunsTheShareIsThatOfTheirDiscToOneOfADegree) {
  const double mirrored = render(*floor_beside(true, {sun(false, 0.7f)}));
  const double alone = render(*floor_beside(false, {sun(false, 0.7f)}));
  const double image = render(*floor_beside(false, {sun(true, 0.7f)}));
  // 30 rays meet it.
  EXPECT_NEAR((mirrored - alone) / image, 0.49, test::trimmed_noise(0.49 * 0.6));
}

}  // namespace
}  // namespace lumicut
