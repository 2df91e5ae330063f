// Virtual lights where the camera looks, seen in whole images.
#include <gtest/gtest.h>

#include "core/parallel.h"
#include "render/render_loop.h"
#include "tests/support/test_scenes.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 12, kHeight = 9;

FrameOptions small_frame() {
  FrameOptions options;
  options.width = kWidth, options.height = kHeight, options.tile_size = 8;
  options.crop = {0, 0, kWidth, kHeight};
  return options;
}

std::vector<float> image(const Scene& scene, Preparation& preparation, IterationOptions iterations = {},
                         FrameOptions frame = small_frame(), RenderLoop::State* state = nullptr) {
  RenderLoop loop(preparation, scene, nullptr, frame, std::move(iterations), {});
  Progress progress;
  Stats stats;
  Arena arena(2);
  arena.run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  if (state != nullptr) *state = loop.state();
  std::vector<float> pixels(size_t{frame.crop.width()} * frame.crop.height() * 3);
  loop.read([&](const Film& film) { film.read(Channel::radiance, film.crop(), pixels.data()); });
  return pixels;
}

Preparation of(const std::string& integrator, bool importance, bool compensate, uint64_t seed) {
  Preparation p(*find_integrator(integrator));
  p.params.set("vpls", "150"), p.params.set("seed", std::to_string(seed));
  p.params.set("importance", importance ? "true" : "false"), p.params.set("compensate", compensate ? "true" : "false");
  return p;
}

// The room and, behind its wall, another as bright: light comes through a gap.
std::unique_ptr<Scene> two_rooms() {
  auto scene = test::make_room();
  Mesh mesh;
  test::add_box(mesh, {1.2f, -1, -1}, {3, 1, 1}, 0, true);
  scene->add_mesh(std::move(mesh));
  std::vector<Light> lights = scene->lights();
  Light other = lights[0];
  other.position = {2, 0, 0};
  lights.push_back(other);
  scene->set_lights(lights);
  Progress progress;
  scene->commit(progress);
  return scene;
}

// Of each pixel's luminance over many seeds: the difference of means in sigmas.
void expect_one_mean(const Scene& scene, bool compensate) {
  constexpr uint64_t kSeeds = test::kSanitized ? 40 : 96;
  constexpr size_t kPixels = size_t{kWidth} * kHeight;
  std::array<std::vector<double>, 2> sum, square;
  std::array<double, 2> all{}, all_square{};
  for (const size_t k : {size_t{0}, size_t{1}}) {
    sum[k].assign(kPixels, 0.0), square[k].assign(kPixels, 0.0);
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      Preparation p = of("exhaustive", k == 1, compensate, seed + 100000 * k);
      const std::vector<float> pixels = image(scene, p);
      double whole = 0.0;
      for (size_t i = 0; i < kPixels; ++i) {
        const auto y = static_cast<double>(luminance({pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]}));
        sum[k][i] += y, square[k][i] += y * y, whole += y;
      }
      all[k] += whole, all_square[k] += whole * whole;
    }
  }
  const auto n = static_cast<double>(kSeeds);
  const auto sigmas = [n](double sum0, double square0, double sum1, double square1) {
    const auto variance = [n](double s, double q) { return (q / n - s / n * (s / n)) / (n - 1); };
    const double v = variance(sum0, square0) + variance(sum1, square1);
    return (sum1 - sum0) / n / std::sqrt(v + 1e-12 * sum0 * sum0 / (n * n));
  };
  EXPECT_LT(std::abs(sigmas(all[0], all_square[0], all[1], all_square[1])), 3.5);
  double most = 0.0;
  for (size_t i = 0; i < kPixels; ++i)
    most = std::max(most, std::abs(sigmas(sum[0][i], square[0][i], sum[1][i], square[1][i])));
  EXPECT_LT(most, 5.0);  // of about a hundred pixels, whose spikes make tails heavier than Gauss's
}

TEST(Importance, APixelsMeanOverSeedsIsWhatItIsWithout) { expect_one_mean(*two_rooms(), false); }

TEST(Importance, APixelsMeanOverSeedsIsWhatItIsWithoutCompensatedToo) { expect_one_mean(*test::make_room(), true); }

TEST(Importance, IterationsGoOnFromACheckpointToTheSameBits) {
  const auto scene = two_rooms();
  const auto iterations = [](uint32_t count, bool checkpoints) {
    IterationOptions options;
    options.count = count, options.checkpoints = checkpoints;
    return options;
  };
  Preparation whole = of("lightcuts", true, true, 1), first = of("lightcuts", true, true, 1),
              second = of("lightcuts", true, true, 1);
  const auto all = image(*scene, whole, iterations(4, false));
  RenderLoop::State state;
  image(*scene, first, iterations(2, true), small_frame(), &state);
  ASSERT_NE(state.checkpoint, nullptr);
  IterationOptions rest = iterations(4, false);
  rest.resume = *state.checkpoint;
  EXPECT_EQ(image(*scene, second, std::move(rest)), all);
}

TEST(Importance, ACropIsAPartOfTheWholeFrame) {
  const auto scene = two_rooms();
  Preparation whole = of("exhaustive", true, false, 1), part = of("exhaustive", true, false, 1);
  const auto all = image(*scene, whole);
  FrameOptions frame = small_frame();
  frame.crop = {8, 0, kWidth, 8};
  const auto cropped = image(*scene, part, {}, frame);
  for (size_t y = 0; y < 8; ++y)
    for (size_t x = 0; x < 3 * size_t{frame.crop.width()}; ++x)
      EXPECT_EQ(cropped[3 * y * frame.crop.width() + x], all[3 * (y * kWidth + 8) + x]) << x << " " << y;
}

TEST(Importance, IsLearnedOnceForAllIterationsAndAnewForAnotherCamera) {
  const auto scene = two_rooms();
  Preparation p = of("exhaustive", true, false, 1);
  image(*scene, p);
  const auto first = p.prepared->importance;
  ASSERT_NE(first, nullptr);
  IterationOptions three;
  three.count = 3;
  image(*scene, p, three);
  EXPECT_EQ(p.prepared->importance, first);
  Camera camera = scene->camera();
  camera.position += Vec3f{0.01f, 0, 0};
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  image(*scene, p);
  EXPECT_NE(p.prepared->importance, first);
}

TEST(Importance, PointsAnywhereHaveLightsByPower) {
  const auto scene = two_rooms();
  Preparation p = of("exhaustive", true, false, 1), plain = of("exhaustive", false, false, 1);
  image(*scene, p);
  EXPECT_NE(p.prepared->importance, nullptr);
  Progress progress;
  Stats stats;
  p.prepare(*scene, nullptr, p.params, progress, stats), plain.prepare(*scene, nullptr, plain.params, progress, stats);
  EXPECT_EQ(p.prepared->importance, nullptr);
  ASSERT_EQ(p.prepared->vpls->lights.size(), plain.prepared->vpls->lights.size());
  for (size_t i = 0; i < p.prepared->vpls->lights.size(); ++i)
    EXPECT_EQ(p.prepared->vpls->lights[i].position, plain.prepared->vpls->lights[i].position);
}

}  // namespace
}  // namespace lumicut
