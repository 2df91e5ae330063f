#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/render.h"

namespace lumicut {

TEST(StochasticLightcuts, EqualsExhaustiveWithACutOfAllLights) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 1500);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}),
             frame = test::render(*scene, "stochastic_lightcuts", vpls, {{"lights", "1500"}});
  EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5);  // order of summation alone
}

TEST(StochasticLightcuts, MeanOverSeedsIsTheExhaustiveSumForEveryKindOfLight) {
  // For each pixel the mean of n seeds lies within z·s/√n of the truth, s the seeds' own deviation. At z = 4 and 200
  // seeds Student's t leaves 9 pixels in 100,000 outside by chance; deviations of few rare bright draws are
  // underestimated, so 5 in 1000 are allowed. A bias of 1 % moves the whole image's mean by many of its deviations.
  const auto scene = test::make_room();
  for (const VplSet& vpls : {test::lights_of(*scene, 1000), test::lights_of_every_kind(400)}) {
    const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 24, .height = 16});
    const size_t n = reference.radiance.size();
    constexpr int kSeeds = 200;
    std::vector<double> sum(n), sum2(n);
    double image_sum = 0, image_sum2 = 0, truth = 0;
    for (const Rgb& c : reference.radiance) truth += luminance(c);
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const auto frame = test::render(*scene, "stochastic_lightcuts", vpls,
                                      {{"lights", "12"}, {"seed", std::to_string(seed)}}, {.width = 24, .height = 16});
      double image = 0;
      for (size_t i = 0; i < n; ++i) {
        const double v = luminance(frame.radiance[i]);
        sum[i] += v, sum2[i] += v * v, image += v;
      }
      image_sum += image, image_sum2 += image * image;
    }
    const auto deviates = [&](double s, double s2, double expected, double z) {
      const double mean = s / kSeeds, variance = std::max(0.0, s2 / kSeeds - mean * mean);
      return std::abs(mean - expected) > z * std::sqrt(variance / (kSeeds - 1)) + 1e-5 * std::abs(expected);
    };
    size_t outside = 0;
    for (size_t i = 0; i < n; ++i) outside += deviates(sum[i], sum2[i], luminance(reference.radiance[i]), 4.0);
    EXPECT_LE(outside, n / 200 + 1);
    EXPECT_FALSE(deviates(image_sum, image_sum2, truth, 3.5))
        << image_sum / kSeeds << " instead of " << truth << ", variance "
        << image_sum2 / kSeeds - image_sum / kSeeds * image_sum / kSeeds;
    // The test can fail: the deviation of the whole image's mean is far below the biases it is to find.
    const double mean = image_sum / kSeeds;
    EXPECT_LT(std::sqrt(std::max(0.0, image_sum2 / kSeeds - mean * mean) / kSeeds), 0.005 * truth);
  }
}

TEST(StochasticLightcuts, VarianceFallsAtLeastAsFastAsTheCutGrows) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  double last = 1e30;
  for (const char* lights : {"8", "32", "128"}) {
    const auto frame = test::render(*scene, "stochastic_lightcuts", vpls, {{"lights", lights}});
    const double error = test::rmse_over_mean(frame.radiance, reference.radiance);
    EXPECT_LT(error, 0.65 * last) << lights;  // √4 by number alone, less what one image's luck may spoil
    for (float clusters : frame.cut_size) EXPECT_LE(clusters, std::stof(lights));
    last = error;
  }
}

TEST(StochasticLightcuts, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto one = test::render(*scene, "stochastic_lightcuts", vpls, {}, {.samples = 2, .threads = 1}),
             four = test::render(*scene, "stochastic_lightcuts", vpls, {}, {.samples = 2, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST(StochasticLightcuts, ImageDoesNotDependOnTheScaleOfTheScene) {
  const auto image = [](float scale) {
    const auto scene = test::make_room(scale);
    return test::render(*scene, "stochastic_lightcuts", test::lights_of(*scene, 3000), {}).radiance;
  };
  const auto unit = image(1.0f);
  // Powers of two round alike, and a point's random numbers belong to its place relative to the scene.
  for (float scale : {1.0f / 1024, 1024.0f}) EXPECT_LT(test::rmse_over_mean(image(scale), unit), 1e-5) << scale;
}

TEST(StochasticLightcuts, NeighboursDrawLightsOfTheirOwn) {
  // Two seeds, and two pixels, have errors that do not go together: noise a denoiser can remove.
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 5000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}),
             frame = test::render(*scene, "stochastic_lightcuts", vpls, {{"lights", "16"}});
  double product = 0, square = 0;
  for (size_t i = 0; i + 1 < frame.radiance.size(); ++i) {
    const double a = luminance(frame.radiance[i] - reference.radiance[i]),
                 b = luminance(frame.radiance[i + 1] - reference.radiance[i + 1]);
    product += a * b, square += a * a;
  }
  EXPECT_LT(std::abs(product / square), 0.1);  // 3072 pixels: 0.018 by chance; shared draws give above 0.5
}

TEST(StochasticLightcuts, DegenerateLightsAreNoTrouble) {
  const auto scene = test::make_room();
  for (const Rgb& c : test::render(*scene, "stochastic_lightcuts", {}, {}, {.width = 16, .height = 16}).radiance)
    EXPECT_EQ(c, Rgb{});
  const VplSet one = test::light_in_parts(1), many = test::light_in_parts(200000);
  const auto reference = test::render(*scene, "exhaustive", one, {}, {.width = 16, .height = 16}),
             single = test::render(*scene, "stochastic_lightcuts", one, {}, {.width = 16, .height = 16});
  EXPECT_LT(test::mean_relative_error(single.radiance, reference.radiance), 1e-6);
  const auto coincident = test::render(*scene, "stochastic_lightcuts", many, {}, {.width = 16, .height = 16});
  // Whatever is drawn gives the same; probabilities of 200,000 lights are rounded to floats.
  EXPECT_LT(test::mean_relative_error(coincident.radiance, reference.radiance), 1e-4);
}

TEST(StochasticLightcuts, IsCancelledAndTakesNoPoints) {
  const auto scene = test::make_room();
  test::expect_no_points_and_cancel("stochastic_lightcuts", *scene, test::standing_lights_of(*scene, 2000), 1);
}

}  // namespace lumicut
