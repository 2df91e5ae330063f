// What is far away does not change the picture, and light close to an emitter is right in a single iteration:
// docs/decisions/0018-lengths-are-local.md
#include <gtest/gtest.h>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kFar = 10000.0f;  // 10 km

enum class Around { nothing, object, ground, far_ground, dome, far_dome };

void add_ground(Mesh& mesh, float half) {
  test::add_quad(mesh, {-half, -half, -1.01f}, {half, -half, -1.01f}, {half, half, -1.01f}, {-half, half, -1.01f}, 0);
}

// Two walls and a floor with a block, open to the rest: a rectangle, a spot and the sun light it.
std::unique_ptr<Scene> make_corner(Around around) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), test::diffuse(0.7f, 0.2f, 0.1f)});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, 0);
  test::add_quad(mesh, {-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1}, 0);
  test::add_quad(mesh, {-1, -1, -1}, {-1, 1, -1}, {-1, 1, 1}, {-1, -1, 1}, 1);
  test::add_box(mesh, {-0.3f, 0.0f, -1.0f}, {0.3f, 0.5f, -0.4f}, 0, false);
  switch (around) {
    case Around::nothing:
      break;
    case Around::object:
      test::add_box(mesh, {kFar, 0, 0}, {kFar + 1, 1, 1}, 0, false);
      break;
    case Around::ground:
      add_ground(mesh, 50);
      break;
    case Around::far_ground:
      add_ground(mesh, kFar);
      break;
    case Around::dome:
      test::add_box(mesh, {-50, -50, -50}, {50, 50, 50}, 0, true);
      break;
    case Around::far_dome:
      test::add_box(mesh, {-kFar, -kFar, -kFar}, {kFar, kFar, kFar}, 0, true);
  }
  scene->add_mesh(std::move(mesh));
  Light lamp;
  lamp.type = LightType::rectangle;
  lamp.position = {0.2f, 0.3f, 0.8f};
  lamp.u = {0, 0.3f, 0}, lamp.v = {0.3f, 0, 0};
  lamp.value = {8, 8, 8};
  Light sun;
  sun.type = LightType::sun;
  sun.direction = normalize(Vec3f{-0.4f, 0.6f, -1.0f});
  sun.value = {0.5f, 0.5f, 0.4f};
  if (around < Around::dome)
    scene->set_lights({lamp, sun});
  else
    scene->set_lights({lamp});  // no sun shines into a dome
  Camera camera;
  camera.position = {0.6f, -2.5f, 0.2f};
  camera.right = {1, 0, 0}, camera.forward = normalize(Vec3f{0, 1, -0.5f});  // no horizon
  camera.up = normalize(Vec3f{0, 0.5f, 1});
  camera.tan_half_fov_y = 0.4f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

constexpr uint32_t kWidth = 32, kHeight = 24, kBlock = 8;

// Mean luminance of blocks over a few iterations.
std::vector<double> blocks_of(const Scene& scene, const char* id, uint64_t first_seed) {
  constexpr uint64_t kIterations = test::kSanitized ? 1 : 6;
  std::vector<double> blocks((kWidth / kBlock) * (kHeight / kBlock));
  for (uint64_t seed = first_seed; seed < first_seed + kIterations; ++seed) {
    const VplSet vpls = test::lights_of(scene, static_cast<uint32_t>(test::trimmed(1200)), seed);
    const auto image = test::render(scene, id, vpls, {{"seed", std::to_string(seed)}, {"compensate", "true"}},
                                    {.width = kWidth, .height = kHeight});
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x)
        blocks[(y / kBlock) * (kWidth / kBlock) + x / kBlock] +=
            luminance(image.radiance[y * kWidth + x]) / (kIterations * kBlock * kBlock);
  }
  return blocks;
}

// Root mean square of the differences over the mean.
double difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, mean = 0;
  for (size_t i = 0; i < a.size(); ++i)
    sum += (a[i] - b[i]) * (a[i] - b[i]), mean += b[i] / static_cast<double>(b.size());
  return std::sqrt(sum / static_cast<double>(a.size())) / mean;
}

std::vector<const char*> ids() {
  std::vector<const char*> all;
  for (const IntegratorEntry& entry : integrators()) all.push_back(entry.id);
  return all;
}

class LocalLengths : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Registry, LocalLengths, testing::ValuesIn(ids()),
                         [](const auto& entry) { return std::string(entry.param); });

TEST_P(LocalLengths, WhatIsTenKilometresAwayChangesNoMoreThanTheNoise) {
  for (const auto& [near, far] : {std::pair{Around::nothing, Around::object},
                                  {Around::ground, Around::far_ground},
                                  {Around::dome, Around::far_dome}}) {
    const auto close = make_corner(near), distant = make_corner(far);
    const auto picture = blocks_of(*close, GetParam(), 1);
    const double noise = difference(blocks_of(*close, GetParam(), 11), picture);
    // Twelve blocks: the ratio of two estimates of one noise; of a single iteration they scatter more.
    const double limit = (test::kSanitized ? 5.0 : 2.0) * noise + 0.005;
    EXPECT_LT(difference(blocks_of(*distant, GetParam(), 21), picture), limit)
        << static_cast<int>(far) << ", noise " << noise;
  }
}

// A floor a few centimetres below a panel and a tube, whose faces emit.
std::unique_ptr<Scene> make_close_lights() {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material glowing = test::diffuse(0.2f, 0.2f, 0.2f);
  glowing.emission = {3, 3, 3};
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f), glowing});
  Mesh mesh;
  test::add_quad(mesh, {-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}, 0);
  test::add_box(mesh, {-0.5f, 0.6f, 0.06f}, {0.5f, 0.64f, 0.10f}, 1, false);  // the tube
  scene->add_mesh(std::move(mesh));
  Light panel;
  panel.type = LightType::rectangle;
  panel.position = {0, -0.3f, 0.03f};
  panel.u = {0, 0.5f, 0}, panel.v = {0.8f, 0, 0};
  panel.value = {4, 4, 4};
  Light ball;
  ball.type = LightType::point, ball.radius = 0.05f;
  ball.position = {0.7f, 0.2f, 0.08f};
  ball.value = {0.05f, 0.05f, 0.05f};
  scene->set_lights({panel, ball});
  Camera camera;
  camera.position = {0, 0, 2};
  camera.right = {1, 0, 0}, camera.forward = {0, 0, -1}, camera.up = {0, 1, 0};
  camera.tan_half_fov_y = 0.5f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

TEST_P(LocalLengths, CloseToAPanelATubeAndABallOneIterationIsRight) {
  if (find_integrator(GetParam())->light_source == LightSource::emitters) GTEST_SKIP() << "it is the truth";
  const auto scene = make_close_lights();
  const auto truth = test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(4000))}},
                                  {.width = kWidth, .height = kHeight});
  for (const char* compensate : {"false", "true"}) {
    const auto image = test::render(*scene, GetParam(), test::lights_of(*scene, 400), {{"compensate", compensate}},
                                    {.width = kWidth, .height = kHeight});
    double error = 0, sum = 0, expected = 0;
    for (size_t i = 0; i < image.radiance.size(); ++i) {
      const double a = luminance(image.radiance[i]), b = luminance(truth.radiance[i]);
      error += std::abs(a - b), sum += a, expected += b;
    }
    RecordProperty(compensate, std::to_string(error / expected) + ", mean " + std::to_string(sum / expected));
    // Noise of sixteen samples, without which the panel's light would lack four fifths.
    EXPECT_LT(error / expected, test::kSanitized ? 0.15 : 0.09) << compensate;
    EXPECT_NEAR(sum / expected, 1.0, test::trimmed_noise(0.015)) << compensate;
  }
}

}  // namespace
}  // namespace lumicut
