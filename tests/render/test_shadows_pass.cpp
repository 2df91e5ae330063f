// Suns and lamps behind glass that light passes straight. No light is counted twice: tests/render/test_glass.cpp has
// rooms with such glass too.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kAlbedo = 0.01f;  // so dark that glass does not show the floor its own light

double passed_by_fresnel(double cosine, double ior = 1.5) {
  const double in = std::acos(cosine), out = std::asin(std::sin(in) / ior);
  if (in < 1e-6) return 1 - (ior - 1) * (ior - 1) / ((ior + 1) * (ior + 1));
  const double s = std::sin(in - out) / std::sin(in + out), p = std::tan(in - out) / std::tan(in + out);
  return 1 - 0.5 * (s * s + p * p);
}

Material pane(const Rgb& colour = {1, 1, 1}) {
  Material m = test::diffuse(colour.x, colour.y, colour.z);
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1}, m.roughness = 0, m.transmission = 1, m.shadows_pass = true;
  return m;
}

// From a height above the origin.
Camera looking_down(float height, float tan_half_fov_y) {
  Camera camera;
  camera.position = {0, 0, height};
  camera.right = {1, 0, 0}, camera.forward = {0, 0, -1}, camera.up = {0, 1, 0};
  camera.tan_half_fov_y = tan_half_fov_y;
  return camera;
}

enum class Body { sheet, turned_sheet, slab };

// A wide floor under wide glass, and a camera beneath it that sees a small place at the origin.
std::unique_ptr<Scene> floor_under(Body body, const Material& glass, const Light& light) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  scene->set_materials({test::diffuse(kAlbedo, kAlbedo, kAlbedo), glass});
  Mesh floor, window;
  test::add_quad(floor, {-40, -40, 0}, {40, -40, 0}, {40, 40, 0}, {-40, 40, 0}, 0);
  if (body == Body::sheet)
    test::add_quad(window, {-40, -40, 2}, {40, -40, 2}, {40, 40, 2}, {-40, 40, 2}, 1);
  else if (body == Body::turned_sheet)
    test::add_quad(window, {-40, 40, 2}, {40, 40, 2}, {40, -40, 2}, {-40, -40, 2}, 1);
  else
    test::add_box(window, {-40, -40, 2}, {40, 40, 2.1f}, 1, false);
  scene->add_mesh(std::move(floor)), scene->add_mesh(std::move(window));
  scene->set_lights({light});
  scene->set_camera(looking_down(1.0f, 0.05f));
  Progress progress;
  scene->commit(progress);
  return scene;
}

Light sun(double cosine) {
  Light light;
  light.type = LightType::sun, light.value = {3, 3, 3};
  const auto c = static_cast<float>(cosine), s = std::sqrt(1 - c * c);
  light.direction = {-s * 0.6f, -s * 0.8f, -c};
  return light;
}

Rgb mean_of(const std::vector<Rgb>& pixels) {
  Rgb sum{};
  for (const Rgb& c : pixels) sum += c / static_cast<float>(pixels.size());
  return sum;
}

struct Method {
  const char* name;
  const char* integrator;
  test::Settings settings;
};
void PrintTo(const Method& method, std::ostream* out) { *out << method.name; }

class ThroughGlass : public testing::TestWithParam<Method> {
 protected:
  static Rgb render(const Scene& scene, uint64_t seed = 1) {
    const bool vpls = GetParam().settings.empty() || GetParam().settings[0].first != "samples";
    return mean_of(test::render(scene, GetParam().integrator, vpls ? test::lights_of(scene, 400, seed) : VplSet{},
                                GetParam().settings, {.width = 32, .height = 32, .samples = test::kSanitized ? 8 : 64})
                       .radiance);
  }
  // Three deviations of the chances of all camera samples, and what the floor and the glass throw to and fro.
  static double tolerance(double passed) {
    const double samples = 32 * 32 * (test::kSanitized ? 8 : 64);
    return 0.002 + 3 * std::sqrt((1 - passed) / passed / samples);
  }
};
INSTANTIATE_TEST_SUITE_P(Methods, ThroughGlass,
                         testing::Values(Method{"virtual_lights", "exhaustive", {}},
                                         Method{"compensated", "exhaustive", {{"compensate", "true"}}},
                                         Method{"lightcuts", "lightcuts", {{"error", "0.01"}}},
                                         Method{"path_tracer", "path_tracer", {{"samples", "1"}}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(ThroughGlass, ASunShinesByFresnelsEquationsOnceForASheetAndTwiceForASlab) {
  for (const Body body : {Body::sheet, Body::slab})
    for (const double cosine : {1.0, 0.7, 0.35}) {
      const double border = passed_by_fresnel(cosine), passed = body == Body::sheet ? border : border * border;
      const double expected = 3 * cosine * passed * kAlbedo / std::numbers::pi;
      const auto scene = floor_under(body, pane(), sun(cosine));
      EXPECT_NEAR(render(*scene).y / expected, 1, tolerance(passed)) << cosine << " " << static_cast<int>(body);
    }
}

TEST_P(ThroughGlass, APointLightToo) {
  Light lamp;
  lamp.type = LightType::point, lamp.position = {3, 0, 4}, lamp.value = {20, 20, 20};
  const double cosine = 0.8, passed = passed_by_fresnel(cosine);
  const auto scene = floor_under(Body::sheet, pane(), lamp);
  EXPECT_NEAR(render(*scene).y / (20 * cosine / 25 * passed * kAlbedo / std::numbers::pi), 1,
              tolerance(passed) + 0.003);
}

// The camera looks down at the floor: with the normal upwards both are inside the glass.
TEST_P(ThroughGlass, OpenGlassPassesLessByTheSquareOfItsIndexToWhatIsInsideIt) {
  Material open = pane();
  open.open_glass = true;
  Light lamp;
  lamp.type = LightType::point, lamp.position = {3, 0, 4}, lamp.value = {20, 20, 20};
  const double of_lamp = 20 * 0.8 / 25 * passed_by_fresnel(0.8), of_sun = 3 * 0.7 * passed_by_fresnel(0.7);
  for (const Body body : {Body::sheet, Body::turned_sheet})
    for (const bool is_sun : {false, true}) {
      const double passed = passed_by_fresnel(is_sun ? 0.7 : 0.8) / (body == Body::sheet ? 2.25 : 1);
      const double expected =
          (is_sun ? of_sun : of_lamp) / (body == Body::sheet ? 2.25 : 1) * kAlbedo / std::numbers::pi;
      const auto scene = floor_under(body, open, is_sun ? sun(0.7) : lamp);
      // Glass throws more of the floor's light back inwards: 60 % of 0.01.
      EXPECT_NEAR(render(*scene).y / expected, 1, tolerance(passed) + 0.006) << static_cast<int>(body) << is_sun;
    }
}

TEST_P(ThroughGlass, ColourDimsByItsLuminance) {
  const Rgb colour{0.81f, 0.16f, 0.36f};
  const double passed = passed_by_fresnel(0.7) * (0.2126 * 0.9 + 0.7152 * 0.4 + 0.0722 * 0.6);
  const Rgb light = render(*floor_under(Body::sheet, pane(colour), sun(0.7)));
  const double expected = 3 * 0.7 * passed * kAlbedo / std::numbers::pi;
  EXPECT_NEAR(light.x / expected, 1, tolerance(passed));
  EXPECT_NEAR(light.y / expected, 1, tolerance(passed));
}

TEST_P(ThroughGlass, WithoutTheFlagASunGivesNothing) {
  Material blocks = pane();
  blocks.shadows_pass = false;
  // Paths find a little past the window's rim.
  EXPECT_LT(render(*floor_under(Body::sheet, blocks, sun(0.7))).y, 1e-4f * kAlbedo);
}

// What the clamp takes is brought back by the whole distance, not by that from the glass on.
TEST(Compensation, OfALampOrALitCeilingCloseBehindGlassGivesThePathTracersLight) {
  for (const bool ceiling : {false, true}) {
    auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
    scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), pane()});
    Mesh room;
    test::add_quad(room, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
    test::add_quad(room, {-2, -2, 0.5f}, {2, -2, 0.5f}, {2, 2, 0.5f}, {-2, 2, 0.5f}, 1);
    Light lamp;
    lamp.type = LightType::rectangle, lamp.position = {0, 0, 0.6f}, lamp.value = {4, 4, 4};
    lamp.u = {0, 1, 0}, lamp.v = {1, 0, 0};
    if (ceiling) {
      test::add_quad(room, {-1, 1, 0.7f}, {1, 1, 0.7f}, {1, -1, 0.7f}, {-1, -1, 0.7f}, 0);
      std::swap(lamp.u, lamp.v);  // shines up at it
    }
    scene->set_lights({lamp});
    scene->add_mesh(std::move(room));
    scene->set_camera(looking_down(0.4f, 1.0f));
    Progress progress;
    scene->commit(progress);
    const test::RenderOptions options{.width = 32, .height = 32, .samples = 4};
    const double truth =
        mean_of(
            test::render(*scene, "path_tracer", {}, {{"samples", test::kSanitized ? "16" : "256"}}, options).radiance)
            .y;
    double sum = 0;
    constexpr uint64_t kIterations = test::trimmed(40);
    for (uint64_t seed = 1; seed <= kIterations; ++seed)
      sum += mean_of(test::render(*scene, "exhaustive", test::lights_of(*scene, 400, seed),
                                  {{"compensate", "true"}, {"clamp_distance", "1"}, {"seed", std::to_string(seed)}},
                                  options)
                         .radiance)
                 .y /
             kIterations;
    RecordProperty(ceiling ? "ceiling" : "lamp", std::to_string(sum / truth));
    EXPECT_NEAR(sum / truth, 1.0, test::kSanitized ? 0.06 : 0.015) << ceiling;
  }
}

// Light paths carry the colour itself.
TEST(LightPaths, GoStraightThroughGlassWithItsColour) {
  const Rgb colour{0.81f, 0.16f, 0.36f};
  const double cosine = 0.6;
  Light light = sun(cosine);
  for (const Body body : {Body::sheet, Body::slab}) {
    const auto scene = floor_under(body, pane(colour), light);
    Progress progress;
    VplOptions options{.count = static_cast<uint32_t>(test::trimmed(200000)), .max_depth = 1};
    const VplSet set = trace_vpls(*scene, options, progress);
    Rgb flux{};
    size_t count = 0;
    for (size_t i = set.direct; i < set.lights.size(); ++i) {
      const Vec3f& p = set.lights[i].position;
      EXPECT_NEAR(p.z, 0, 1e-4f) << "glass is no surface that counts";
      // Where the sun's way through the window is not that of its rim.
      if (std::abs(p.x) < 20 && std::abs(p.y) < 20)
        flux += set.lights[i].intensity * std::numbers::pi_v<float>, ++count;
    }
    ASSERT_GT(count, test::trimmed(10000));
    for (int k = 0; k < 3; ++k) {
      const double border = passed_by_fresnel(cosine) * std::sqrt(static_cast<double>(colour[k]));
      const double passed = body == Body::sheet ? border : border * border;
      const double expected = 3 * cosine * 40 * 40 * passed * kAlbedo;
      EXPECT_NEAR(flux[k] / expected, 1, 4 / std::sqrt(static_cast<double>(count))) << k;
    }
  }
}

}  // namespace
}  // namespace lumicut
