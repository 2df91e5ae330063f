#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/render.h"

namespace lumicut {

namespace {

// Both methods cluster the columns of a sampled light matrix: what is true of one is true of the other.
const char* const kMethods[] = {"light_slice", "row_column_sampling"};

VplSet one_light() {
  VplSet set;
  set.lights.resize(1);
  set.lights[0].position = {0, -0.5f, 0.8f};
  set.lights[0].intensity = {1, 1, 1};
  return set;
}

}  // namespace

TEST(ColumnMethods, EqualExhaustiveWithAColumnForEachLight) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 1500);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  for (const char* id : kMethods) {
    // Light paths are kept whole: the set may be a few lights larger than was asked for.
    const auto frame = test::render(*scene, id, vpls, {{"columns", std::to_string(vpls.lights.size())}});
    EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5) << id;  // order of summation alone
    EXPECT_EQ(frame.counters.rays, reference.counters.rays) << id << ": no rows where there is nothing to cluster";
  }
}

TEST(ColumnMethods, ErrorFallsWithTheColumns) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 6000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 96, .height = 72});
  for (const char* id : kMethods) {
    double last = 1e30;
    for (const char* columns : {"25", "200", "1600"}) {
      const auto frame = test::render(*scene, id, vpls, {{"columns", columns}}, {.width = 96, .height = 72});
      const double error = test::rmse_over_mean(frame.radiance, reference.radiance);
      // Eight times the clusters: the cost at least halves, for all that one seed's luck may spoil.
      EXPECT_LT(error, 0.75 * last) << id << " " << columns;
      EXPECT_GT(error, 0) << id << ": it clusters";
      last = error;
    }
    EXPECT_LT(last, 0.05) << id;  // uniform rows meet the gloss of floor and wall in few samples
  }
}

TEST(ColumnMethods, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 20000);  // enough for sums in several chunks
  for (const char* id : kMethods) {
    const test::Settings settings = {{"columns", "100"}};
    const auto one = test::render(*scene, id, vpls, settings, {.samples = 2, .threads = 1}),
               four = test::render(*scene, id, vpls, settings, {.samples = 2, .threads = 4});
    EXPECT_EQ(std::memcmp(one.radiance.data(), four.radiance.data(), one.radiance.size() * sizeof(Rgb)), 0) << id;
    EXPECT_EQ(one.counters.rays, four.counters.rays) << id;
  }
}

TEST(ColumnMethods, ImageDoesNotDependOnTheScaleOfTheScene) {
  for (const char* id : kMethods) {
    const auto image = [&](float scale) {
      const auto scene = test::make_room(scale);
      return test::render(*scene, id, test::lights_of(*scene, 3000), {{"columns", "100"}}).radiance;
    };
    const auto unit = image(1.0f);
    // Powers of two round alike.
    for (float scale : {1.0f / 1024, 1024.0f}) EXPECT_LT(test::rmse_over_mean(image(scale), unit), 1e-5) << id << scale;
  }
}

TEST(ColumnMethods, DegenerateLightsAreNoTrouble) {
  const auto scene = test::make_room();
  for (const char* id : kMethods) {
    const test::Settings settings = {{"columns", "8"}};
    for (const Rgb& c : test::render(*scene, id, {}, settings, {.width = 16, .height = 16}).radiance)
      EXPECT_EQ(c, Rgb{}) << id;
    const auto single = test::render(*scene, id, one_light(), settings, {.width = 16, .height = 16});
    const auto reference = test::render(*scene, "exhaustive", one_light(), {}, {.width = 16, .height = 16});
    EXPECT_LT(test::mean_relative_error(single.radiance, reference.radiance), 1e-6) << id;
    VplSet many;
    many.lights.assign(200000, one_light().lights[0]);
    for (Vpl& v : many.lights) v.intensity = {5e-6f, 5e-6f, 5e-6f};
    const auto coincident = test::render(*scene, id, many, settings, {.width = 16, .height = 16});
    // All columns are the same: one light of any of them is exact, but where no row sees the light it is missing.
    size_t wrong = 0;
    for (size_t i = 0; i < single.radiance.size(); ++i)
      wrong += length(coincident.radiance[i] - reference.radiance[i]) > 1e-3f * length(reference.radiance[i]);
    EXPECT_LE(wrong, single.radiance.size() / 50) << id;
  }
}

TEST(ColumnMethods, EveryKindOfLightIsClustered) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of_every_kind(2000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  for (const char* id : kMethods) {
    const auto frame = test::render(*scene, id, vpls, {{"columns", "800"}});
    EXPECT_LT(test::rmse_over_mean(frame.radiance, reference.radiance), 0.15) << id;
    for (const Rgb& c : frame.radiance) ASSERT_TRUE(is_finite(c)) << id;
  }
}

TEST(ColumnMethods, AreCancelledAndTakeNoPoints) {
  const auto scene = test::make_room();
  for (const char* id : kMethods)
    test::expect_no_points_and_cancel(id, *scene, test::standing_lights_of(*scene, 2000), 1);
}

TEST(LightSlice, BeatsOneClusteringForAllPointsWhereEachSeesLittle) {
  // A row of closed cells, each with its own lights: a slice needs the lights of its own cell alone.
  Scene scene(Scene::Config{});
  scene.set_materials({test::diffuse(0.7f, 0.7f, 0.7f)});
  Mesh mesh;
  VplSet vpls;
  Rng rng(7, Stage::test);
  ShadePoints points;
  for (int cell = 0; cell < 16; ++cell) {
    const auto x = static_cast<float>(3 * cell);
    test::add_box(mesh, {x - 1, -1, -1}, {x + 1, 1, 1}, 0, true);
    for (int i = 0; i < 100; ++i) {
      Vpl v;
      v.position = Vec3f{x, 0, 0} + test::random_point(rng, 0.9f);
      v.intensity = {1, 1, 1};
      v.clamp2 = 0.25f;
      vpls.lights.push_back(v);
    }
    for (int i = 0; i < 256; ++i) {
      SurfacePoint p;
      p.position = {x + 1.8f * rng.next_float() - 0.9f, 1.8f * rng.next_float() - 0.9f, -0.999f};
      p.normal = {0, 0, 1}, p.mirror = {0, 0, 1}, p.diffuse = {0.2f, 0.2f, 0.2f};
      points.push(p);
    }
  }
  points.finish();
  scene.add_mesh(std::move(mesh));
  Progress progress;
  scene.commit(progress);
  const auto shade = [&](const char* id, const test::Settings& settings) {
    Params params(all_params(*find_integrator(id)));
    for (const auto& [name, value] : settings) params.set(name, value);
    Stats stats;
    const auto integrator = find_integrator(id)->create();
    integrator->prepare(scene, vpls, params, {progress, stats});
    std::vector<Rgb> radiance(points.size());
    integrator->shade(points, radiance, {}, {progress, stats});
    return radiance;
  };
  const auto reference = shade("exhaustive", {});
  const double slices = test::rmse_over_mean(shade("light_slice", {{"columns", "64"}, {"slices", "64"}}), reference),
               one = test::rmse_over_mean(shade("row_column_sampling", {{"columns", "64"}}), reference);
  EXPECT_LT(slices, 0.5 * one);
  EXPECT_LT(slices, 0.1);
}

TEST(LightSlice, SeveralRepresentativesAreTakenInTurn) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 5000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.samples = 4});
  double errors[2] = {};
  for (int k = 0; k < 2; ++k)
    for (const char* seed : {"1", "2", "3"}) {
      const test::Settings settings = {{"columns", "40"}, {"seed", seed}, {"representatives", k == 0 ? "1" : "4"}};
      errors[k] += test::rmse_over_mean(test::render(*scene, "light_slice", vpls, settings, {.samples = 4}).radiance,
                                        reference.radiance);
    }
  // Four draws of each cluster's light in place of one; what the rows do not tell stays. Measured: 0.80.
  EXPECT_LT(errors[1], 0.9 * errors[0]);
}

}  // namespace lumicut
