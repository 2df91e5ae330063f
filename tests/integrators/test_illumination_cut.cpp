#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/support/render.h"

namespace lumicut {

namespace {

constexpr const char* kId = "illumination_cut";

}  // namespace

TEST(IlluminationCut, EqualsExhaustiveAtNoErrorWhateverItsModes) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  for (const char* visibility : {"full", "sampling", "recursive", "unbiased"})
    for (const char* representative : {"mean", "stochastic"}) {
      const auto frame = test::render(*scene, kId, vpls,
                                      {{"error", "0"},
                                       {"visibility", visibility},
                                       {"representative", representative},
                                       {"refine_coarse", "1"},
                                       {"material_weight", "1"}});
      // Single lights are traced whole: the order of summation alone is left.
      EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5) << visibility << representative;
    }
}

TEST(IlluminationCut, ErrorFallsWithTheParameter) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 128, .height = 96});
  for (const char* representative : {"mean", "random"}) {
    double last_error = 1;
    uint64_t last_rays = 0;
    for (const auto& [error, limit] : {std::pair{"0.1", 0.1}, {"0.02", 0.02}, {"0.004", 0.005}}) {
      const auto frame = test::render(*scene, kId, vpls,
                                      {{"error", error}, {"visibility", "full"}, {"representative", representative}},
                                      {.width = 128, .height = 96});
      const double measured = test::mean_relative_error(frame.radiance, reference.radiance);
      // It bounds each pair; errors of many pairs have either sign.
      EXPECT_LT(measured, limit) << error;
      EXPECT_LT(measured, last_error);
      EXPECT_GT(frame.counters.rays, last_rays);
      last_error = measured, last_rays = frame.counters.rays;
    }
    EXPECT_LT(last_rays, reference.counters.rays);
  }
}

TEST(IlluminationCut, MeanShinesAsItsLightsDoWhereTheyFaceAllWays) {
  const auto scene = test::make_room();
  VplSet vpls;
  Rng rng(7, Stage::test);
  for (int cluster = 0; cluster < 40; ++cluster) {
    const Vec3f place = test::random_point(rng, 0.8f);
    for (int i = 0; i < 100; ++i) {
      Vpl v;
      v.kind = VplKind::oriented;
      v.position = place + test::random_point(rng, 1e-4f);
      v.normal = test::random_direction(rng);
      v.intensity = Rgb{1, 1, 1} * 1e-3f;
      vpls.lights.push_back(v);
    }
  }
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  const auto frame = test::render(*scene, kId, vpls, {{"error", "0.3"}, {"visibility", "full"}});
  EXPECT_LT(frame.counters.rays * 8, reference.counters.rays);  // clusters, not lights
  // Of lights that face all ways mean_cosine tells a twelfth too little; one normal for all of them erred by a quarter.
  EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 0.1);
}

TEST(IlluminationCut, SampledVisibilityTracesFewerRaysForLittleMoreError) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 256, .height = 192});
  const auto full = test::render(*scene, kId, vpls, {{"visibility", "full"}}, {.width = 256, .height = 192}),
             sampled = test::render(*scene, kId, vpls, {{"visibility", "sampling"}}, {.width = 256, .height = 192});
  EXPECT_LT(sampled.counters.rays, full.counters.rays * 2 / 3);
  EXPECT_LT(test::mean_relative_error(sampled.radiance, reference.radiance),
            test::mean_relative_error(full.radiance, reference.radiance) + 0.005);
}

TEST(IlluminationCut, RecursiveSamplingTracesFewestRays) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  const test::RenderOptions size{.width = 256, .height = 192};
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, size),
             all_or_few = test::render(*scene, kId, vpls, {{"visibility", "sampling"}}, size),
             recursive = test::render(*scene, kId, vpls, {{"visibility", "recursive"}}, size);
  EXPECT_LT(recursive.counters.rays, all_or_few.counters.rays);
  EXPECT_LT(test::mean_relative_error(recursive.radiance, reference.radiance),
            test::mean_relative_error(all_or_few.radiance, reference.radiance) + 0.01);
}

TEST(IlluminationCut, ARefinedCoarseImageSparesTheLargestErrors) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const test::RenderOptions size{.width = 128, .height = 96};
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, size);
  const auto large_errors = [&](const char* rounds) {
    const auto frame =
        test::render(*scene, kId, vpls, {{"error", "0.05"}, {"visibility", "full"}, {"refine_coarse", rounds}}, size);
    EXPECT_EQ(frame.counters.points, 128u * 96u) << rounds;
    std::vector<double> errors;
    for (size_t i = 0; i < reference.radiance.size(); ++i)
      errors.push_back(std::abs(luminance(frame.radiance[i]) / luminance(reference.radiance[i]) - 1.0));
    std::nth_element(errors.begin(), errors.begin() + 12165, errors.end());  // 99 %
    return errors[12165];
  };
  EXPECT_LT(large_errors("1"), large_errors("0"));
}

TEST(IlluminationCut, OneShadowAPixelIsTheWholeTruthOfOneSampleAPixel) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  for (const char* visibility : {"full", "sampling", "recursive", "unbiased"}) {
    const auto each = test::render(*scene, kId, vpls, {{"visibility", visibility}}),
               shared = test::render(*scene, kId, vpls, {{"visibility", visibility}, {"shadow_a_pixel", "true"}});
    EXPECT_EQ(std::memcmp(each.radiance.data(), shared.radiance.data(), each.radiance.size() * sizeof(Rgb)), 0);
    const test::RenderOptions four{.samples = 4};
    EXPECT_LT(
        test::render(*scene, kId, vpls, {{"visibility", visibility}, {"shadow_a_pixel", "true"}}, four).counters.rays,
        test::render(*scene, kId, vpls, {{"visibility", visibility}}, four).counters.rays);
  }
}

TEST(IlluminationCut, UnbiasedModesAreRightOnAverage) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 2000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  constexpr int kRuns = 24;
  const auto mean_of = [&](int runs, int first_seed) {
    std::vector<Rgb> mean(reference.radiance.size());
    for (int run = 0; run < runs; ++run) {
      const auto frame = test::render(*scene, kId, vpls,
                                      {{"error", "0.1"},
                                       {"visibility", "unbiased"},
                                       {"representative", "stochastic"},
                                       {"seed", std::to_string(first_seed + run)}});
      for (size_t i = 0; i < mean.size(); ++i) mean[i] += frame.radiance[i] * (1.0f / static_cast<float>(runs));
    }
    return mean;
  };
  const double single = test::rmse_over_mean(mean_of(1, 1), reference.radiance),
               many = test::rmse_over_mean(mean_of(kRuns, 1), reference.radiance);
  // Noise falls with the root of 24 = 4.9; a bias would stay.
  EXPECT_LT(many, single / 3.5);
}

TEST(IlluminationCut, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 3000);
  for (const char* visibility : {"sampling", "unbiased"}) {
    const test::Settings settings = {{"visibility", visibility}};
    const auto one = test::render(*scene, kId, vpls, settings, {.width = 96, .height = 80, .samples = 2, .threads = 1}),
               four =
                   test::render(*scene, kId, vpls, settings, {.width = 96, .height = 80, .samples = 2, .threads = 4});
    EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
    EXPECT_EQ(one.counters.rays, four.counters.rays);
  }
}

TEST(IlluminationCut, ImageDoesNotDependOnTheScaleOfTheScene) {
  // The same set of lights, scaled: where light paths turn is not the method's doing.
  const auto unit_scene = test::make_room();
  const VplSet vpls = test::lights_of(*unit_scene, 3000);
  const auto unit = test::render(*unit_scene, kId, vpls, {}).radiance;
  for (float scale : {1.0f / 1024, 1024.0f}) {
    const auto scene = test::make_room(scale);
    const VplSet scaled = test::scaled(vpls, scale);
    EXPECT_LT(test::rmse_over_mean(test::render(*scene, kId, scaled, {}).radiance, unit), 1e-3) << scale;
  }
}

TEST(IlluminationCut, LightsOfEveryKind) {
  const auto scene = test::make_room();
  VplSet vpls;
  Rng rng(1, Stage::test);
  for (int i = 0; i < 2000; ++i) {
    Vpl v;
    v.kind = static_cast<VplKind>(i % 4);
    v.position = test::random_point(rng, 0.9f);
    if (v.kind != VplKind::omni) v.normal = test::random_direction(rng);
    if (v.kind == VplKind::spot) v.cos_outer() = 0.5f, v.blend_cosine = 0.2f;
    const float power = rng.next_float();
    v.intensity = Rgb{power, power, power} * 0.01f;
    vpls.lights.push_back(v);
  }
  const auto reference = test::render(*scene, "exhaustive", vpls, {}), frame = test::render(*scene, kId, vpls, {});
  EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 0.02);
}

TEST(IlluminationCut, DegenerateInputIsNoTrouble) {
  const auto scene = test::make_room();
  const auto none = test::render(*scene, kId, VplSet{}, {}, {.width = 16, .height = 16});
  for (const Rgb& c : none.radiance) EXPECT_TRUE(is_finite(c));
  const VplSet one = test::light_in_parts(1), many = test::light_in_parts(200000);
  const auto single = test::render(*scene, kId, one, {}, {.width = 16, .height = 16});
  EXPECT_LT(test::mean_relative_error(
                single.radiance, test::render(*scene, "exhaustive", one, {}, {.width = 16, .height = 16}).radiance),
            1e-6);
  const auto coincident = test::render(*scene, kId, many, {}, {.width = 16, .height = 16});
  // Hundreds of thousands of summands in single precision.
  EXPECT_LT(test::mean_relative_error(coincident.radiance, single.radiance), 2e-3);
}

TEST(IlluminationCut, IsCancelledAndTakesNoPoints) {
  const auto scene = test::make_room();
  test::expect_no_points_and_cancel(kId, *scene, test::standing_lights_of(*scene, 1000), 1);
}

}  // namespace lumicut
