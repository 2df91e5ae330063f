// More rays of compensation where iterations before were noisy.
#include <gtest/gtest.h>

#include <numeric>

#include "render/compensation_rays.h"
#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr uint32_t kSide = 64;
constexpr Rect kCrop{10, 20, 10 + kSide, 20 + kSide};

// So many iterations of light 1, with noise of `high` in a patch of 16x16 pixels and of `low` elsewhere.
std::vector<uint8_t> rays_after(uint64_t iterations, float low, float high) {
  IterationMean mean(kCrop, 0.95, false);
  Film film(kCrop), pass(kCrop);
  Rng rng(5, Stage::test);
  for (uint64_t n = 1; n <= iterations; ++n) {
    for (uint32_t y = kCrop.y0; y < kCrop.y1; ++y)
      for (uint32_t x = kCrop.x0; x < kCrop.x1; ++x) {
        const bool noisy = x - kCrop.x0 >= 24 && x - kCrop.x0 < 40 && y - kCrop.y0 >= 24 && y - kCrop.y0 < 40;
        pass.set(Channel::radiance, x, y, Rgb{1, 1, 1} * (1 + (noisy ? high : low) * (rng.next_float() - 0.5f)));
      }
    mean.add(pass, kCrop, n, film);
  }
  return compensation_rays(mean, film, iterations, Progress());
}

TEST(CompensationRays, AreManyWhereIterationsBeforeWereNoisyAndFewElsewhere) {
  for (const uint64_t iterations : {1, 2, 7}) {
    const auto rays = rays_after(iterations, 0.02f, 0.8f);
    ASSERT_EQ(rays.size(), size_t{kSide} * kSide);
    EXPECT_EQ(rays[0], 1) << iterations;
    EXPECT_GE(rays[32 * kSide + 32], 8) << iterations;
    EXPECT_LE(*std::max_element(rays.begin(), rays.end()), kMostCompensationRays);
    EXPECT_LE(std::accumulate(rays.begin(), rays.end(), 0.0) / static_cast<double>(rays.size()), 3) << iterations;
  }
}

TEST(CompensationRays, OfTheFirstIterationAreTwoAndOfOneWithoutNoiseOne) {
  const IterationMean none(kCrop, 0.95, false);
  const Film black(kCrop);
  EXPECT_EQ(compensation_rays(none, black, 0, Progress()), std::vector<uint8_t>(size_t{kSide} * kSide, 2));
  EXPECT_EQ(compensation_rays(none, black, 3, Progress()), std::vector<uint8_t>(size_t{kSide} * kSide, 1));
  EXPECT_EQ(rays_after(2, 0, 0), std::vector<uint8_t>(size_t{kSide} * kSide, 1));
}

TEST(CompensationRays, LookAtCancel) {
  Progress progress;
  progress.cancel();
  EXPECT_THROW(compensation_rays(IterationMean(kCrop, 0.95, false), Film(kCrop), 2, progress), Error);
}

// A lamp by way of the metal around it, or of a plate above it: what rays find by chance.
std::unique_ptr<Scene> make_lamp_in_metal(bool plate = false) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material metal = test::diffuse(0.9f, 0.6f, 0.4f);
  metal.lobe = LobeModel::ggx, metal.specular = {1, 1, 1}, metal.metallic = 1, metal.roughness = 0.35f;
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), metal});
  Mesh room;
  test::add_box(room, {-1, -1, -1}, {1, 1, 1}, 0, true);
  if (plate) {
    test::add_quad(room, {-0.15f, -0.15f, 0.3f}, {-0.15f, 0.15f, 0.3f}, {0.15f, 0.15f, 0.3f}, {0.15f, -0.15f, 0.3f}, 1);
  } else {
    test::add_box(room, {-0.15f, -0.15f, -0.1f}, {0.15f, 0.15f, 0.3f}, 1, true);
    room.indices.erase(room.indices.begin() + 36, room.indices.begin() + 42);  // open below
    room.triangle_materials.erase(room.triangle_materials.begin() + 12, room.triangle_materials.begin() + 14);
  }
  scene->add_mesh(std::move(room));
  Light lamp;
  lamp.type = LightType::point, lamp.position = {0, 0, 0.1f}, lamp.radius = 0.03f, lamp.value = {1, 1, 1};
  scene->set_lights({lamp});
  test::commit_seen_from(*scene, {0, -0.9f, 0.2f}, 0.5f, {0, 1, -0.9f});
  return scene;
}

// Images of seeds by render_frame itself: mean and mean variance of a pixel.
std::pair<double, double> mean_and_variance(const Scene& scene, uint32_t rays, uint64_t seeds, bool guided = false) {
  const test::RenderOptions size{.width = 16, .height = 12};
  std::vector<double> sum(size_t{size.width} * size.height), squares(sum.size());
  for (uint64_t seed = 1; seed <= seeds; ++seed) {
    FrameOptions frame = test::frame_of(size);
    frame.seed = seed;
    const Params params = [&] {
      Params p(all_params(*find_integrator("exhaustive")));
      p.set("compensate", "true"), p.set("vpls", "2000"), p.set("seed", std::to_string(seed));
      return p;
    }();
    Preparation preparation(*find_integrator("exhaustive"));
    preparation.params = params;
    Progress progress;
    Stats stats;
    Film film(frame.crop);
    Arena(0).run([&] {
      preparation.prepare(scene, nullptr, params, progress, stats);
      const Prepared& prepared = *preparation.prepared;
      FrameLight light;
      light.nearby = prepared.nearby.get(), light.compensated = prepared.clamp.get();
      const std::vector<uint8_t> each(sum.size(), static_cast<uint8_t>(rays));
      if (rays > 0) light.rays = each;
      const GlintGuide glints(prepared.vpls->glints, &progress);
      if (guided) light.glints = &glints;
      const GroupMethod method{0, prepared.method.get()};
      render_frame(scene, {&method, 1}, frame, light, film, {progress, stats}, [](const Rect&) {});
    });
    for (uint32_t i = 0; i < sum.size(); ++i) {
      const float* c = film.pixel(Channel::radiance, i % size.width, i / size.width);
      const double value = luminance(Rgb{c[0], c[1], c[2]});
      sum[i] += value, squares[i] += value * value;
    }
  }
  const auto n = static_cast<double>(seeds), pixels = static_cast<double>(sum.size());
  double mean = 0, variance = 0;
  for (size_t i = 0; i < sum.size(); ++i)
    mean += sum[i] / n / pixels, variance += (squares[i] / n - sum[i] / n * sum[i] / n) / pixels;
  return {mean, variance};
}

TEST(CompensationRays, MoreOfThemChangeNoMeanAndLessenItsNoise) {
  const auto scene = make_lamp_in_metal();
  const uint64_t seeds = test::kSanitized ? 4 : 60;
  const auto [mean, variance] = mean_and_variance(*scene, 0, seeds);
  const auto [same, same_variance] = mean_and_variance(*scene, 1, test::kSanitized ? 2 : 10);
  const auto [many, less] = mean_and_variance(*scene, 8, seeds);
  // Of independent pixels; the lights' own noise, which all share, is a percent too.
  const double deviation = std::sqrt(variance / (192.0 * static_cast<double>(seeds))) / mean;
  RecordProperty("ratio", std::to_string(many / mean) + " +- " + std::to_string(deviation));
  RecordProperty("variance", std::to_string(less / variance));
  EXPECT_NEAR(many / mean, 1.0, test::kSanitized ? 0.6 : 3 * deviation + 0.01);
  // Four seeds know no variance: it is of few bright pixels.
  if (!test::kSanitized) {
    EXPECT_LT(less, 0.4 * variance) << "an eighth, and what is not theirs";
  }
  EXPECT_GT(same, 0);
  EXPECT_GT(same_variance, 0);
}

TEST(CompensationRays, ThatGlintsGuideChangeNoMeanAndHaveFarLessNoise) {
  const auto scene = make_lamp_in_metal(true);
  const uint64_t seeds = test::kSanitized ? 4 : 60;
  const auto [mean, variance] = mean_and_variance(*scene, 8, seeds);
  const auto [guided, less] = mean_and_variance(*scene, 8, seeds, true);
  const double deviation = std::sqrt(variance / (192.0 * static_cast<double>(seeds))) / mean;
  RecordProperty("ratio", std::to_string(guided / mean) + " +- " + std::to_string(deviation));
  RecordProperty("variance", std::to_string(less / variance));
  EXPECT_NEAR(guided / mean, 1.0, test::kSanitized ? 0.6 : 3 * deviation + 0.01);
  if (!test::kSanitized) {
    EXPECT_LT(less, 0.1 * variance) << "measured: a hundredth";
  }
}

}  // namespace
}  // namespace lumicut
