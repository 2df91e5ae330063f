#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/render.h"

namespace lumicut {

namespace {

constexpr const char* kId = "multidimensional_lightcuts";

}  // namespace

TEST(MultidimensionalLightcuts, EqualsExhaustiveAtNoErrorForAnyNumberOfSamples) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 400);
  for (uint32_t samples : {1u, 3u, 20u}) {
    const auto reference =
                   test::render(*scene, "exhaustive", vpls, {}, {.width = 24, .height = 16, .samples = samples}),
               frame =
                   test::render(*scene, kId, vpls, {{"error", "0"}}, {.width = 24, .height = 16, .samples = samples});
    EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5) << samples;  // order of summation
  }
}

TEST(MultidimensionalLightcuts, ErrorFallsWithTheParameter) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 48, .height = 32, .samples = 8});
  double last_error = 1;
  uint64_t last_rays = 0;
  // Texture, edges and penumbrae within a pixel are sampled as well: twice the parameter bounds the mean.
  for (const auto& [error, limit] : {std::pair{"0.05", 0.1}, {"0.01", 0.02}, {"0.002", 0.004}}) {
    const auto frame = test::render(*scene, kId, vpls, {{"error", error}}, {.width = 48, .height = 32, .samples = 8});
    const double measured = test::mean_relative_error(frame.radiance, reference.radiance);
    EXPECT_LT(measured, limit) << error;
    EXPECT_LT(measured, last_error);
    EXPECT_GT(frame.counters.rays, last_rays);
    last_error = measured, last_rays = frame.counters.rays;
  }
  EXPECT_LT(last_rays, reference.counters.rays);
}

TEST(MultidimensionalLightcuts, CostGrowsFarSlowerThanTheSamples) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto one = test::render(*scene, kId, vpls, {}, {.width = 48, .height = 32}),
             many = test::render(*scene, kId, vpls, {}, {.width = 48, .height = 32, .samples = 64});
  EXPECT_LT(many.counters.rays, 4 * one.counters.rays) << "64 times the samples";
  const auto lightcuts = test::render(*scene, "lightcuts", vpls, {}, {.width = 48, .height = 32, .samples = 64});
  EXPECT_LT(many.counters.rays, lightcuts.counters.rays / 10);
}

TEST(MultidimensionalLightcuts, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  const auto one = test::render(*scene, kId, vpls, {}, {.samples = 20, .threads = 1}),
             four = test::render(*scene, kId, vpls, {}, {.samples = 20, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST(MultidimensionalLightcuts, ImageDoesNotDependOnTheScaleOfTheScene) {
  const auto unit_scene = test::make_room();
  const VplSet vpls = test::lights_of(*unit_scene, 2000);
  const auto unit = test::render(*unit_scene, kId, vpls, {}, {.samples = 4}).radiance;
  for (float scale : {1.0f / 1024, 1024.0f}) {
    const auto scene = test::make_room(scale);
    const VplSet scaled = test::scaled(vpls, scale);
    EXPECT_LT(test::rmse_over_mean(test::render(*scene, kId, scaled, {}, {.samples = 4}).radiance, unit), 1e-3)
        << scale;
  }
}

TEST(MultidimensionalLightcuts, LargestCutIsKept) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  const auto frame =
      test::render(*scene, kId, vpls, {{"error", "0"}, {"max_cut", "40"}}, {.width = 48, .height = 32, .samples = 4});
  // A refinement below the limit adds the children of a light, or of a cluster of four points.
  for (float cut : frame.cut_size) EXPECT_LE(cut, 44.0f);
}

TEST(MultidimensionalLightcuts, DegenerateInputIsNoTrouble) {
  const auto scene = test::make_room();
  const auto none = test::render(*scene, kId, VplSet{}, {}, {.width = 16, .height = 16, .samples = 4});
  for (const Rgb& c : none.radiance) EXPECT_TRUE(is_finite(c));
  const VplSet one = test::light_in_parts(1), many = test::light_in_parts(20000);
  const auto single = test::render(*scene, kId, one, {{"error", "0"}}, {.width = 16, .height = 16, .samples = 4});
  EXPECT_LT(test::mean_relative_error(
                single.radiance,
                test::render(*scene, "exhaustive", one, {}, {.width = 16, .height = 16, .samples = 4}).radiance),
            1e-6);
  const auto coincident = test::render(*scene, kId, many, {}, {.width = 16, .height = 16}),
             whole = test::render(*scene, kId, one, {}, {.width = 16, .height = 16});
  // 20,000 summands in single precision.
  EXPECT_LT(test::mean_relative_error(coincident.radiance, whole.radiance), 1e-3);
}

TEST(MultidimensionalLightcuts, IsCancelledAndTakesNoPoints) {
  const auto scene = test::make_room();
  test::expect_no_points_and_cancel(kId, *scene, test::standing_lights_of(*scene, 500), 3);
}

}  // namespace lumicut
