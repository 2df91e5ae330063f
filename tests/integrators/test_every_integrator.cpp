// What holds for every integrator of the registry, whoever adds the next.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/backends.h"
#include "tests/support/render.h"

namespace lumicut {

class EveryIntegrator : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Registry, EveryIntegrator, testing::ValuesIn([] {
                           std::vector<const char*> ids;
                           for (const IntegratorEntry& entry : integrators()) ids.push_back(entry.id);
                           return ids;
                         }()),
                         [](const auto& entry) { return std::string(entry.param); });

TEST_P(EveryIntegrator, GivesTheSameImageOnEmbreeAndOnOurBvh) {
  SKIP_WITHOUT_EMBREE();
  const auto embree = test::make_room(1.0f, "embree"), ours = test::make_room(1.0f, "bvh");
  const VplSet vpls = test::lights_of(*embree, 1500);
  const auto a = test::render(*embree, GetParam(), vpls, {}), b = test::render(*ours, GetParam(), vpls, {});
  // Rays through an edge between two surfaces may take either: a few pixels in a thousand see another wall. Points that
  // differ in the last digit are clustered and sampled otherwise: then the error is the same, if not the noise.
  const auto truth = test::render(*embree, "exhaustive", vpls, {});
  const double theirs = test::mean_relative_error(a.radiance, truth.radiance);
  EXPECT_LT(test::mean_relative_error(b.radiance, truth.radiance), 1.25 * theirs + 0.01);
  const auto mean = [](const test::Image& frame) {
    double sum = 0;
    for (const Rgb& c : frame.radiance) sum += luminance(c);
    return sum / static_cast<double>(frame.radiance.size());
  };
  EXPECT_NEAR(mean(b) / mean(a), 1.0, 0.01);
}

TEST_P(EveryIntegrator, GivesTheSameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 1500);
  const auto one = test::render(*scene, GetParam(), vpls, {}, {.samples = 2, .threads = 1}),
             four = test::render(*scene, GetParam(), vpls, {}, {.samples = 2, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST_P(EveryIntegrator, IsAsNearToTheSumOfSpheresAsToThatOfPoints) {
  if (find_integrator(GetParam())->light_source == LightSource::emitters) GTEST_SKIP() << "has no virtual lights";
  const auto scene = test::make_room();
  double error[2];
  for (const bool spheres : {false, true}) {
    const VplSet vpls = test::lights_of(*scene, 1500, 1, spheres ? 1.0f : 0.0f);
    const auto truth = test::render(*scene, "exhaustive", vpls, {}), own = test::render(*scene, GetParam(), vpls, {});
    error[spheres] = test::mean_relative_error(own.radiance, truth.radiance);
  }
  RecordProperty("error", std::to_string(error[0]) + " of points, " + std::to_string(error[1]) + " of spheres");
  EXPECT_LT(error[1], 1.3 * error[0] + 0.005);
}

TEST_P(EveryIntegrator, GivesTheSameImageOfSpheresOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 700, 1, 1.0f);
  const auto one = test::render(*scene, GetParam(), vpls, {}, {.width = 48, .height = 32, .threads = 1}),
             four = test::render(*scene, GetParam(), vpls, {}, {.width = 48, .height = 32, .threads = 4});
  EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0);
}

TEST_P(EveryIntegrator, ScaleOfTheSceneChangesNothing) {
  const auto image = [&](float scale) {
    const auto scene = test::make_room(scale);
    return test::render(*scene, GetParam(), test::lights_of(*scene, 1500), {}).radiance;
  };
  // A power of two rounds alike. Clustering compares products of lengths, and a tie may fall otherwise.
  EXPECT_LT(test::rmse_over_mean(image(1024.0f), image(1.0f)), 1e-3);
}

}  // namespace lumicut
