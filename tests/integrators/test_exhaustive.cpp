#include <gtest/gtest.h>

#include <cstring>
#include <numbers>

#include "clustering/light_kernel.h"
#include "core/error.h"
#include "tests/support/render.h"

namespace lumicut {

namespace {

// A floor seen from straight above; looks down the z axis from height `h`.
std::unique_ptr<Scene> floor_scene(const Light& light, float side = 50.0f) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-side, -side, 0}, {side, -side, 0}, {side, side, 0}, {-side, side, 0}, 0);
  scene->add_mesh(mesh);
  scene->set_lights({light});
  Camera camera;
  camera.orthographic = true;
  camera.position = {0, 0, 10};
  camera.height = 4.0f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

}  // namespace

TEST(Exhaustive, PointLampOverAFloorFollowsTheInverseSquareAndCosineLaws) {
  Light lamp;
  lamp.position = {0, 0, 2};
  lamp.value = {3, 2, 1};
  const auto scene = floor_scene(lamp);
  const auto frame = test::render(*scene, "exhaustive", test::lights_of(*scene, 1),
                                  {{"clamp_relative", "0"}, {"max_depth", "0"}}, {.width = 33, .height = 33});
  for (uint32_t y = 0; y < 33; ++y)
    for (uint32_t x = 0; x < 33; ++x) {
      const double px = (x + 0.5 - 16.5) * 4.0 / 33, py = (16.5 - y - 0.5) * 4.0 / 33;
      const double d2 = px * px + py * py + 4.0, cosine = 2.0 / std::sqrt(d2);
      const double expected = 3.0 * 0.5 / std::numbers::pi * cosine / d2;
      // The point stands off the floor by the scene's epsilon (1.4e-3 of a height of 2): twice that in the square.
      EXPECT_NEAR(frame.radiance[y * 33 + x].x, expected, 3e-3 * expected);
    }
}

TEST(Exhaustive, SunGivesItsIrradianceOverPi) {
  Light sun;
  sun.type = LightType::sun;
  sun.direction = normalize(Vec3f{1, 0, -1});
  sun.value = {4, 4, 4};
  const auto scene = floor_scene(sun);
  const auto frame = test::render(*scene, "exhaustive", test::lights_of(*scene, 1), {}, {.width = 8, .height = 8});
  for (const Rgb& c : frame.radiance) EXPECT_NEAR(c.x, 4 * std::sqrt(0.5) * 0.5 / std::numbers::pi, 1e-5);
}

TEST(Exhaustive, WhiteFurnaceUnderAConstantSky) {
  // A floor of albedo ρ under a sky of radiance 1 has radiance ρ: nothing else reflects.
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
  scene->add_mesh(mesh);
  Environment sky;
  sky.color = {1, 1, 1};
  scene->set_environment(sky);
  Camera camera;
  camera.orthographic = true;
  camera.position = {0, 0, 3};
  camera.height = 1.0f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  Progress tracing;
  const VplSet vpls = trace_vpls(*scene, {.count = 50000, .max_depth = 0}, tracing);
  const auto frame = test::render(*scene, "exhaustive", vpls, {}, {.width = 8, .height = 8});
  for (const Rgb& c : frame.radiance) EXPECT_NEAR(c.x, 0.5, 0.01);  // 50,000 directions: 0.5 % of spread
}

TEST(Exhaustive, ClosedWhiteBoxHasTheRadianceOfItsGeometricSeries) {
  // All walls alike, one light: mean irradiance Φ/(A(1−ρ)), mean radiance ρ/π of it. The camera sees the whole sphere of
  // walls only roughly, so the mean over the walls is taken at points on them.
  constexpr float kAlbedo = 0.5f;
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(kAlbedo, kAlbedo, kAlbedo)});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  scene->add_mesh(mesh);
  Light lamp;
  lamp.value = {1, 1, 1};
  scene->set_lights({lamp});
  Progress progress;
  scene->commit(progress);
  const VplSet vpls = test::standing_lights_of(*scene, 5000);
  ShadePoints points;
  Rng rng(1, Stage::test);
  for (int i = 0; i < 2400; ++i) {
    Vec3f p = test::random_point(rng, 1.0f), n{};
    const int axis = i % 3, side = i / 3 % 2;
    p[axis] = side ? 1.0f : -1.0f;
    n[axis] = side ? -1.0f : 1.0f;
    points.push(scene->bsdf({p, n, n, n, 1e-5f, static_cast<uint32_t>(i)}, 0, {}).layers()[0]);
  }
  points.finish();
  const auto integrator = find_integrator("exhaustive")->create();
  Params params(all_params(*find_integrator("exhaustive")));
  // A clamp loses the light of near pairs in the corners: none here, at the price of some spread.
  params.set("clamp_relative", "0.01");
  Stats stats;
  integrator->prepare(*scene, vpls, params, {progress, stats});
  std::vector<Rgb> radiance(points.size());
  integrator->shade(points, radiance, {}, {progress, stats});
  double mean = 0;
  for (const Rgb& c : radiance) mean += c.x / 2400.0;
  const double expected = kAlbedo / std::numbers::pi * 4 * std::numbers::pi / (24.0 * (1 - kAlbedo));
  EXPECT_NEAR(mean / expected, 1.0, 0.03);  // 5,000 light paths of one flux, 2,400 points: some 1 % of spread
}

TEST(Exhaustive, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 500);
  const auto one = test::render(*scene, "exhaustive", vpls, {}, {.samples = 2, .threads = 1}),
             four = test::render(*scene, "exhaustive", vpls, {}, {.samples = 2, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST(Exhaustive, NoLightsGiveBlackAndNoPointsNothing) {
  const auto scene = test::make_room();
  const auto frame = test::render(*scene, "exhaustive", {}, {}, {.width = 16, .height = 16});
  for (const Rgb& c : frame.radiance) EXPECT_EQ(c, Rgb{});
  const auto integrator = find_integrator("exhaustive")->create();
  const VplSet vpls;
  Progress progress;
  Stats stats;
  integrator->prepare(*scene, vpls, Params(all_params(*find_integrator("exhaustive"))), {progress, stats});
  integrator->shade(ShadePoints{}, {}, {}, {progress, stats});
}

TEST(Exhaustive, StopsWhenCancelled) {
  const auto scene = test::make_room();
  const VplSet vpls = test::standing_lights_of(*scene, 100);
  const auto integrator = find_integrator("exhaustive")->create();
  Progress progress;
  Stats stats;
  integrator->prepare(*scene, vpls, Params(all_params(*find_integrator("exhaustive"))), {progress, stats});
  Rng rng(1, Stage::test);
  ShadePoints points;
  points.push(scene->bsdf({{0, 0, -1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, 1e-5f}, 0, {}).layers()[0]);
  points.finish();
  std::vector<Rgb> radiance(1);
  progress.cancel();
  EXPECT_THROW(integrator->shade(points, radiance, {}, {progress, stats}), Error);
}

}  // namespace lumicut
