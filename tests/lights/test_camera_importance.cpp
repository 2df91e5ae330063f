// Virtual lights where the camera looks: what they mean does not change, where they are does.
#include "lights/camera_importance.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numbers>

#include "core/parallel.h"
#include "lights/light_sampler.h"
#include "lights/trace_vpls.h"
#include "tests/support/test_scenes.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr FrameSize kFrame{64, 48};

// Four rooms of side 2 in a row along x, walls .1 thick, each with a lamp of its own kind; doors lead from each to the
// next. The camera stands in the first.
std::unique_ptr<Scene> four_rooms() {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material lamp = test::diffuse(0.5f, 0.5f, 0.5f);
  lamp.emission = {6, 5, 4};
  Material glossy = test::diffuse(0.3f, 0.3f, 0.4f);
  glossy.lobe = LobeModel::ggx, glossy.specular = {1, 1, 1}, glossy.roughness = 0.4f;
  scene->set_materials({test::diffuse(0.7f, 0.6f, 0.5f), lamp, glossy});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {7.3f, 1, 1}, 0, true);
  for (int wall = 0; wall < 3; ++wall) {
    const float x = 1.0f + 2.1f * static_cast<float>(wall);
    test::add_box(mesh, {x, -1, -1}, {x + 0.1f, 0.6f, 1}, 0, false);  // the door is beside it
  }
  test::add_box(mesh, {-0.5f, -0.9f, -1}, {0.3f, -0.2f, -0.4f}, 2, false);
  test::add_box(mesh, {2.0f, -0.2f, 0.6f}, {2.2f, 0.2f, 0.65f}, 1, false);
  test::add_box(mesh, {-0.7f, 0.3f, 0.6f}, {-0.6f, 0.4f, 0.65f}, 1, false);
  scene->add_mesh(std::move(mesh));
  Light area;
  area.type = LightType::rectangle;
  area.position = {0, 0, 0.95f}, area.u = {0.3f, 0, 0}, area.v = {0, -0.3f, 0};
  area.value = {8, 8, 8};
  Light sphere;
  sphere.position = {4.2f, 0, 0.5f}, sphere.radius = 0.1f, sphere.value = {1, 1, 1};
  Light point;
  point.position = {6.3f, 0, 0.5f}, point.value = {1, 1, 2};
  scene->set_lights({area, sphere, point});
  Camera camera;
  camera.position = {-0.9f, -0.9f, 0.2f};
  camera.forward = normalize(Vec3f{1, 1, -0.3f}), camera.right = normalize(cross(camera.forward, Vec3f{0, 0, 1}));
  camera.up = cross(camera.right, camera.forward);
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

size_t room_of(const Vec3f& at) { return static_cast<size_t>(std::clamp((at.x + 1.05f) / 2.1f, 0.0f, 3.0f)); }

struct Moments {
  double sum = 0.0, square = 0.0;
  void add(double x) { sum += x, square += x * x; }
  double mean(int n) const { return sum / n; }
  double variance_of_mean(int n) const { return std::max(0.0, square / n - mean(n) * mean(n)) / (n - 1); }
};

struct Importance {
  explicit Importance(const Scene& scene, const VplOptions& options = {})
      : emitters(scene), importance(scene, emitters, options, kFrame, progress) {}
  Progress progress;
  LightSampler emitters;
  CameraImportance importance;
};

// Direct and bounced light of each room, and its moment along y, from many seeds of few lights.
TEST(CameraImportance, LightsOfEachRoomMeanWhatTheyMeanWithout) {
  const auto scene = four_rooms();
  constexpr auto kSeeds = static_cast<int>(test::trimmed(600));
  std::array<std::array<Moments, 16>, 2> all;
  Importance pilot(*scene);
  for (const bool important : {false, true})
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const VplSet set = trace_vpls(*scene, pilot.emitters,
                                    {.count = 300, .seed = static_cast<uint64_t>(seed + (important ? 10000 : 0))},
                                    important ? &pilot.importance : nullptr, pilot.progress);
      std::array<double, 16> sums{};
      for (size_t i = 0; i < set.lights.size(); ++i) {
        const Vpl& v = set.lights[i];
        const size_t slot = 4 * room_of(v.position) + (i < set.direct ? 0 : 2);
        const auto flux = static_cast<double>(luminance(v.intensity));
        sums[slot] += flux, sums[slot + 1] += flux * static_cast<double>(v.position.y);
      }
      for (size_t k = 0; k < 16; ++k) all[important ? 1 : 0][k].add(sums[k]);
    }
  for (size_t k = 0; k < 16; ++k) {
    const Moments &plain = all[0][k], &important = all[1][k];
    const double sigma = std::sqrt(plain.variance_of_mean(kSeeds) + important.variance_of_mean(kSeeds));
    // Sixteen numbers: one beyond 4 sigma in a thousand runs.
    EXPECT_NEAR(important.mean(kSeeds), plain.mean(kSeeds), 4.0 * sigma + 1e-5 * std::abs(plain.mean(kSeeds)))
        << "room " << k / 4 << (k % 4 < 2 ? " direct" : " bounced") << (k % 2 == 0 ? "" : ", along y");
  }
}

TEST(CameraImportance, MostLightsAreInTheRoomThatTheCameraSees) {
  const auto scene = four_rooms();
  Importance pilot(*scene);
  const auto share = [&](const CameraImportance* importance) {
    const VplSet set = trace_vpls(*scene, pilot.emitters, {.count = 4000}, importance, pilot.progress);
    EXPECT_NEAR(static_cast<double>(set.lights.size()), 4000.0, 400.0);
    size_t here = 0;
    for (const Vpl& v : set.lights) here += room_of(v.position) == 0 ? 1 : 0;
    return static_cast<double>(here) / static_cast<double>(set.lights.size());
  };
  EXPECT_LT(share(nullptr), 0.55);
  EXPECT_GT(share(&pilot.importance), 0.75);
}

TEST(CameraImportance, WeightsAreBounded) {
  const auto scene = four_rooms();
  Importance pilot(*scene);
  const LightSampler& e = pilot.emitters;
  const size_t first = e.emitter_count() - e.extended_count();
  double extended = 0.0;
  for (size_t i = first; i < e.emitter_count(); ++i) extended += e.power_of(i);
  for (size_t i = 0; i < e.emitter_count(); ++i) {
    EXPECT_GE(pilot.importance.path_starts().pmf(i), 0.99 * CameraImportance::kByPower * e.power_of(i) / e.power());
    if (i >= first) {
      EXPECT_GE(pilot.importance.direct().pmf(i - first), 0.99 * CameraImportance::kByPower * e.power_of(i) / extended);
    }
  }
  Rng rng(1, Stage::test);
  BallQueryTree::Scratch scratch;
  for (int i = 0; i < 10000; ++i) {
    const float keep = pilot.importance.keep(test::random_point(rng, 10.0f), test::random_direction(rng), scratch);
    EXPECT_GE(keep, CameraImportance::kLeastChance);
    EXPECT_LE(keep, 1.0f);
  }
}

// A thousand point lights, two hundred and fifty in each room, and spots among them.
TEST(CameraImportance, OfManyLampsFewAreKeptAndTheirMeanStays) {
  const auto scene = four_rooms();
  std::vector<Light> lamps;
  Rng rng(1, Stage::test);
  for (int i = 0; i < 1000; ++i) {
    Light lamp;
    lamp.position = test::random_point(rng, 0.9f);
    lamp.position.x += 2.1f * static_cast<float>(i % 4), lamp.position.z = 0.9f;
    lamp.value = {0.1f, 0.1f, 0.1f};
    if (i % 3 == 0) lamp.type = LightType::spot, lamp.direction = {0, 0, -1}, lamp.cos_outer = 0.3f;
    lamps.push_back(lamp);
  }
  scene->set_lights(lamps);
  Progress progress;
  scene->commit(progress);
  Importance pilot(*scene);
  constexpr auto kSeeds = static_cast<int>(test::trimmed(2000));
  std::array<Moments, 4> flux;
  double kept = 0.0, here = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const VplSet set = trace_vpls(*scene, pilot.emitters, {.count = 1, .seed = static_cast<uint64_t>(seed)},
                                  &pilot.importance, pilot.progress);
    std::array<double, 4> sums{};
    for (size_t i = 0; i < set.lights.size(); ++i) {
      const Vpl& v = set.lights[i];
      if (v.kind == VplKind::oriented) continue;  // the lamps on emissive meshes
      sums[room_of(v.position)] += static_cast<double>(luminance(v.intensity));
      kept += 1.0, here += room_of(v.position) == 0 ? 1.0 : 0.0;
    }
    for (size_t k = 0; k < 4; ++k) flux[k].add(sums[k]);
  }
  for (size_t k = 0; k < 4; ++k)
    EXPECT_NEAR(flux[k].mean(kSeeds), 25.0, 4.0 * std::sqrt(flux[k].variance_of_mean(kSeeds)) + 1e-4) << k;
  EXPECT_LT(kept / kSeeds, 400.0);
  EXPECT_GT(here / kept, 0.7);
}

TEST(CameraImportance, IsTheSameOnAnyNumberOfThreads) {
  const auto scene = four_rooms();
  const auto lights = [&](int threads) {
    Arena arena(threads);
    return arena.run([&] {
      Importance pilot(*scene);
      return trace_vpls(*scene, pilot.emitters, {.count = 2000}, &pilot.importance, pilot.progress);
    });
  };
  const VplSet one = lights(1), four = lights(4);
  ASSERT_EQ(one.lights.size(), four.lights.size());
  for (size_t i = 0; i < one.lights.size(); ++i) {
    EXPECT_EQ(one.lights[i].position, four.lights[i].position);
    EXPECT_EQ(one.lights[i].intensity, four.lights[i].intensity);
  }
}

TEST(CameraImportance, ACameraThatSeesNothingKeepsAllLights) {
  const auto scene = four_rooms();
  Camera camera;
  camera.position = {0, 0, 100}, camera.right = {1, 0, 0}, camera.up = {0, 1, 0}, camera.forward = {0, 0, 1};
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  Importance pilot(*scene);
  BallQueryTree::Scratch scratch;
  EXPECT_EQ(pilot.importance.keep({0, 0, -1}, {0, 0, 1}, scratch), 1.0f);
  for (size_t i = 0; i < pilot.emitters.emitter_count(); ++i)
    EXPECT_NEAR(pilot.importance.path_starts().pmf(i), pilot.emitters.power_of(i) / pilot.emitters.power(), 1e-12);
}

TEST(CameraImportance, CancelStopsIt) {
  const auto scene = four_rooms();
  Progress progress;
  const LightSampler emitters(*scene);
  progress.cancel();
  EXPECT_THROW(CameraImportance(*scene, emitters, {}, kFrame, progress), Error);
}

}  // namespace
}  // namespace lumicut
