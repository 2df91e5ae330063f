#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/support/render.h"

namespace lumicut {

TEST(Lightcuts, EqualsExhaustiveAtNoError) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}),
             frame = test::render(*scene, "lightcuts", vpls, {{"error", "0"}});
  EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5);  // order of summation alone
}

TEST(Lightcuts, ErrorFallsWithTheParameterAndStaysUnderIt) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  double last_error = 1;
  uint64_t last_rays = 0;
  for (const auto& [error, limit] : {std::pair{"0.1", 0.1}, {"0.02", 0.02}, {"0.004", 0.005}}) {
    const auto frame = test::render(*scene, "lightcuts", vpls, {{"error", error}});
    const double measured = test::mean_relative_error(frame.radiance, reference.radiance);
    // Three quarters of it bound each cluster; errors of many clusters have either sign, though on a glossy wall at tiny
    // thresholds more of one.
    EXPECT_LT(measured, limit) << error;
    EXPECT_LT(measured, last_error);
    EXPECT_GT(frame.counters.rays, last_rays);
    last_error = measured, last_rays = frame.counters.rays;
  }
  EXPECT_LT(last_rays, reference.counters.rays) << "a cut is cheaper than all lights";
}

TEST(Lightcuts, EveryLightTreeAndSeveralRepresentativesHoldTheError) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 5000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  for (const char* tree : {"agglomerative", "divisive_3d", "divisive_6d"})
    for (const char* representatives : {"1", "8"}) {
      const auto frame =
          test::render(*scene, "lightcuts", vpls, {{"tree", tree}, {"representatives", representatives}});
      EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 0.02) << tree << " " << representatives;
    }
}

TEST(Lightcuts, LargestCutIsKept) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 5000);
  const auto frame = test::render(*scene, "lightcuts", vpls, {{"error", "0"}, {"max_cut", "40"}});
  // A refinement adds one cluster to a cut below the limit; both children of the last one count.
  for (float cut : frame.cut_size) EXPECT_LE(cut, 41.0f);
}

TEST(Lightcuts, ADarkFloorSparesClustersOfDarkPointsAlone) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}),
             plain = test::render(*scene, "lightcuts", vpls, {}),
             floored = test::render(*scene, "lightcuts", vpls, {{"dark_floor", "0.5"}});
  EXPECT_LT(floored.counters.clusters, plain.counters.clusters);
  EXPECT_LT(test::rmse_over_mean(floored.radiance, reference.radiance), 0.02);
  double mean = 0;
  for (const Rgb& r : reference.radiance) mean += luminance(r) / static_cast<double>(reference.radiance.size());
  size_t bright = 0;
  double clusters = 0, as_many = 0;
  for (size_t i = 0; i < reference.radiance.size(); ++i)
    if (luminance(reference.radiance[i]) > 0.8 * mean)
      ++bright, clusters += floored.cut_size[i], as_many += plain.cut_size[i];
  ASSERT_GT(bright, 100u);
  EXPECT_NEAR(clusters / as_many, 1.0, 0.01) << "bright points keep their cuts";
  const auto four = test::render(*scene, "lightcuts", vpls, {{"dark_floor", "0.5"}}, {.threads = 4});
  EXPECT_EQ(std::memcmp(floored.radiance.data(), four.radiance.data(), four.radiance.size() * sizeof(Rgb)), 0);
}

TEST(Lightcuts, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto one = test::render(*scene, "lightcuts", vpls, {}, {.samples = 2, .threads = 1}),
             four = test::render(*scene, "lightcuts", vpls, {}, {.samples = 2, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST(Lightcuts, ImageDoesNotDependOnTheScaleOfTheScene) {
  // Scales that are powers of two round alike; the lights' radiance stays, so the image does.
  const auto image = [](float scale) {
    const auto scene = test::make_room(scale);
    return test::render(*scene, "lightcuts", test::lights_of(*scene, 3000), {}).radiance;
  };
  const auto unit = image(1.0f);
  for (float scale : {1.0f / 1024, 1024.0f}) EXPECT_LT(test::rmse_over_mean(image(scale), unit), 1e-5) << scale;
  // Others round otherwise, and a path or a cut may turn: still the same picture.
  for (float scale : {0.001f, 1000.0f}) EXPECT_LT(test::rmse_over_mean(image(scale), unit), 0.05) << scale;
}

TEST(Lightcuts, ReconstructionHalvesTheRaysAndStaysNearTheExhaustiveSum) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const test::RenderOptions settings{.width = 160, .height = 120};
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, settings),
             plain = test::render(*scene, "lightcuts", vpls, {}, settings);
  for (const char* points : {"4", "16"}) {
    const auto frame = test::render(*scene, "lightcuts", vpls, {{"reconstruction", points}}, settings);
    // Between its samples a point may see what none of them sees: no bound, but no more than the share itself here.
    EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 0.02) << points;
    EXPECT_LT(frame.counters.rays, plain.counters.rays / 2) << points;
    EXPECT_EQ(frame.counters.points, plain.counters.points) << points;
    // Points with cuts of their own have bounds; a quarter or a sixteenth must, and those on edges.
    EXPECT_LT(frame.counters.bounds, plain.counters.bounds / 2) << points;
  }
}

TEST(Lightcuts, ReconstructionGivesTheSameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  for (const char* points : {"4", "16"})
    for (const uint32_t samples : {1u, 3u}) {
      const test::Settings parameters{{"reconstruction", points}, {"representatives", "4"}};
      // 61 x 47 pixels: blocks and groups that are not full.
      const auto one = test::render(*scene, "lightcuts", vpls, parameters,
                                    {.width = 61, .height = 47, .samples = samples, .threads = 1}),
                 four = test::render(*scene, "lightcuts", vpls, parameters,
                                     {.width = 61, .height = 47, .samples = samples, .threads = 4});
      EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
      for (const Rgb& r : one.radiance) EXPECT_TRUE(std::isfinite(r.x) && r.x >= 0.0f);
    }
}

TEST(Lightcuts, DegenerateLightsAreNoTrouble) {
  const auto scene = test::make_room();
  for (const char* id : {"exhaustive", "lightcuts"}) {
    VplSet one;
    one.lights.resize(1);
    one.lights[0].position = {0, -0.5f, 0.8f};
    one.lights[0].intensity = {1, 1, 1};
    const auto single = test::render(*scene, id, one, {}, {.width = 16, .height = 16});
    VplSet many;
    many.lights.assign(20000, one.lights[0]);
    for (Vpl& v : many.lights) v.intensity = {1 / 20000.0f, 1 / 20000.0f, 1 / 20000.0f};
    const auto coincident = test::render(*scene, id, many, {}, {.width = 16, .height = 16});
    // 20,000 single-precision summands: up to 1e-4 of rounding.
    EXPECT_LT(test::mean_relative_error(coincident.radiance, single.radiance), 1e-3) << id;
    EXPECT_GT(
        test::mean_relative_error(single.radiance, std::vector<Rgb>(single.radiance.size(), Rgb{1e-6f, 1e-6f, 1e-6f})),
        1.0)
        << "it is lit at all";
  }
}

}  // namespace lumicut
