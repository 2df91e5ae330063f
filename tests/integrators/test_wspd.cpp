#include <gtest/gtest.h>

#include <cstring>
#include <thread>

#include "clustering/block_kernel.h"
#include "tests/support/render.h"

namespace lumicut {

namespace {

// No clusters but single lights, and no visibility taken over.
const test::Settings kExact = {{"bright", "0"}, {"visibility", "full"}};

bool same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0;
}

// The room's lights, some distant ones, and one without a direction.
VplSet lights_of_all_kinds(const Scene& scene) {
  VplSet vpls = test::lights_of(scene, 2000);
  Rng rng(6, Stage::test);
  for (int i = 0; i < 300; ++i) {
    Vpl v;
    v.kind = VplKind::directional;
    v.normal = normalize(Vec3f{0.3f, 0.2f, -1.0f} + test::random_direction(rng) * 0.5f);
    v.intensity = {2e-4f, 3e-4f, 4e-4f};
    vpls.lights.push_back(v);
    v.kind = VplKind::omni;
    v.position = test::random_point(rng, 0.9f);
    v.normal = {};
    vpls.lights.push_back(v);
  }
  return vpls;
}

}  // namespace

TEST(BlockKernel, EqualsThePlainSumForEveryKindAndCount) {
  Rng rng(1, Stage::test);
  BlockSums sums;
  for (const bool glossy : {false, true})
    for (const size_t count : {1u, 15u, 16u, 17u, 100u, 256u}) {
      ShadePoints points;
      std::vector<SurfacePoint> plain;
      for (size_t i = 0; i < 16 + count; ++i) {
        SurfacePoint p;
        p.position = test::random_point(rng, 2.0f);
        p.normal = test::random_direction(rng), p.mirror = test::random_direction(rng);
        p.diffuse = {rng.next_float(), rng.next_float(), rng.next_float()};
        if (glossy) p.specular = {1, 2, 3}, p.shape = 100.0f * rng.next_float();
        points.push(p);
        plain.push_back(p);
      }
      points.finish();
      std::vector<Vpl> lights;
      for (uint32_t i = 0; i < 12; ++i) {
        Vpl v;
        v.kind = static_cast<VplKind>(i / 3);
        v.position = test::random_point(rng, 2.0f);
        if (v.kind != VplKind::omni) v.normal = test::random_direction(rng);
        v.intensity = {rng.next_float(), rng.next_float(), rng.next_float()};
        v.clamp2 = 0.01f;
        if (v.kind == VplKind::spot)
          v.cos_outer() = -0.5f, v.blend_cosine = i % 3 == 0 ? 0.0f : 0.4f, v.spot_cosine = i % 3 == 1 ? 1.0f : 0.0f,
          v.spread_tan = i % 3 == 2 ? 0.7f : 0.0f;
        lights.push_back(v);
      }
      light_block(lights, 0.5f, {}, points, 16, count, false, sums);
      light_block({lights.data(), 2}, 0.25f, {}, points, 16, count, true, sums);
      for (size_t i = 0; i < count; ++i) {
        Rgb expected;
        for (size_t l = 0; l < lights.size(); ++l)
          expected += light_point(lights[l], lights[l].intensity, {}, plain[16 + i]) * (l < 2 ? 0.75f : 0.5f);
        // Log and exp of the lobe: a few units in the last place, times the exponent.
        EXPECT_NEAR(sums.r[i], expected.x, 1e-4f * expected.x + 1e-6f);
        EXPECT_NEAR(sums.g[i], expected.y, 1e-4f * expected.y + 1e-6f);
        EXPECT_NEAR(sums.b[i], expected.z, 1e-4f * expected.z + 1e-6f);
      }
    }
}

TEST(Wspd, EqualsExhaustiveWithoutClusters) {
  const auto scene = test::make_room();
  const VplSet vpls = lights_of_all_kinds(*scene);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.samples = 2}),
             frame = test::render(*scene, "wspd", vpls, kExact, {.samples = 2});
  EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 2e-4);  // order of summation, lobes
  EXPECT_LT(test::rmse_over_mean(frame.radiance, reference.radiance), 2e-3);
}

// A point alone is its own sample: no light is lost that reaches it, and visibility is its own.
TEST(Wspd, PointByPointEqualsExhaustiveWithoutClusters) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 1000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 32, .height = 24});
  for (const char* clusters : {"exact", "printed"}) {
    const auto frame = test::render(*scene, "wspd", vpls, {{"bright", "0"}, {"block", "1"}, {"clusters", clusters}},
                                    {.width = 32, .height = 24});
    EXPECT_LT(test::mean_relative_error(frame.radiance, reference.radiance), 1e-5) << clusters;  // order of summation
    EXPECT_LE(frame.counters.rays, 2 * reference.counters.rays) << clusters;  // clusters that are split are asked too
  }
}

TEST(Wspd, Algorithm2AsPrintedIsNearTheExhaustiveSumAndTheSameOnAnyNumberOfThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 5000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 32, .height = 24});
  const test::Settings printed{{"clusters", "printed"}};
  const auto one = test::render(*scene, "wspd", vpls, printed, {.width = 32, .height = 24, .threads = 1}),
             four = test::render(*scene, "wspd", vpls, printed, {.width = 32, .height = 24, .threads = 4});
  EXPECT_TRUE(same_bits(one.radiance, four.radiance));
  EXPECT_LT(test::mean_relative_error(one.radiance, reference.radiance), 0.05);
  EXPECT_LT(one.counters.rays, reference.counters.rays / 2);
}

TEST(Wspd, ErrorFallsWithTheSeparation) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  for (const char* local : {"cubemap", "representative"}) {
    double last = 1;
    uint64_t last_clusters = 0;
    for (const auto& [separation, limit] : {std::pair{"0.6", 0.15}, {"0.25", 0.06}, {"0.08", 0.03}}) {
      const auto frame = test::render(*scene, "wspd", vpls,
                                      {{"separation", separation}, {"bright", "1"}, {"local_visibility", local}});
      const double error = test::mean_relative_error(frame.radiance, reference.radiance);
      EXPECT_LT(error, limit) << separation << " " << local;
      EXPECT_LT(error, last) << separation << " " << local;
      EXPECT_GT(frame.counters.clusters, last_clusters);
      last = error, last_clusters = frame.counters.clusters;
    }
    EXPECT_LT(last_clusters, uint64_t{10000} * 64 * 48 / 2);
  }
}

TEST(Wspd, SkiesAndSunsAreClusteredByDirection) {
  // A floor and a block under the open sky.
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.7f, 0.7f, 0.7f)});
  Mesh mesh;
  test::add_quad(mesh, {-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}, 0);
  test::add_box(mesh, {-0.3f, 0.2f, 0}, {0.3f, 0.6f, 0.8f}, 0, false);
  scene->add_mesh(std::move(mesh));
  Camera camera;
  camera.position = {0, -2, 1};
  camera.right = {1, 0, 0}, camera.forward = normalize(Vec3f{0, 1, -0.4f}),
  camera.up = cross(camera.right, camera.forward);
  camera.tan_half_fov_y = 0.5f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  VplSet vpls;
  Rng rng(6, Stage::test);
  for (int i = 0; i < 2000; ++i) {
    Vpl v;
    v.kind = VplKind::directional;
    v.normal = test::random_direction(rng);
    v.normal.z = -std::abs(v.normal.z);
    if (i < 200) v.normal = normalize(Vec3f{1, 0.5f, -1} + test::random_direction(rng) * 0.01f);  // a sun
    v.intensity = Rgb{1, 1, 1} * (i < 200 ? 5e-3f : 1e-3f);
    vpls.lights.push_back(v);
  }
  const auto reference = test::render(*scene, "exhaustive", vpls, {}),
             clustered = test::render(*scene, "wspd", vpls, {});
  EXPECT_LT(test::mean_relative_error(test::render(*scene, "wspd", vpls, kExact).radiance, reference.radiance), 2e-3);
  EXPECT_LT(test::mean_relative_error(clustered.radiance, reference.radiance), 0.03);
  EXPECT_LT(5 * clustered.counters.clusters, reference.counters.clusters);
}

TEST(Wspd, BrightClustersAreSplit) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto reference = test::render(*scene, "exhaustive", vpls, {});
  const auto coarse = test::render(*scene, "wspd", vpls, {{"separation", "0.6"}, {"bright", "1"}}),
             split = test::render(*scene, "wspd", vpls, {{"separation", "0.6"}, {"bright", "0.003"}});
  EXPECT_LT(test::mean_relative_error(split.radiance, reference.radiance),
            0.7 * test::mean_relative_error(coarse.radiance, reference.radiance));
}

TEST(Wspd, SampledVisibilityIsCloseToFullAndTracesFarFewerRays) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  const auto full = test::render(*scene, "wspd", vpls, {{"visibility", "full"}}, {.width = 128, .height = 96}),
             sampled = test::render(*scene, "wspd", vpls, {{"visibility", "sampling"}}, {.width = 128, .height = 96});
  EXPECT_LT(test::mean_relative_error(sampled.radiance, full.radiance), 0.02);
  EXPECT_LT(2 * sampled.counters.rays, full.counters.rays);
}

TEST(Wspd, SameImageOnOneAndFourThreads) {
  const auto scene = test::make_room();
  const VplSet vpls = lights_of_all_kinds(*scene);
  const auto one = test::render(*scene, "wspd", vpls, {}, {.samples = 2, .threads = 1}),
             four = test::render(*scene, "wspd", vpls, {}, {.samples = 2, .threads = 4});
  EXPECT_TRUE(same_bits(one.radiance, four.radiance));
  EXPECT_EQ(one.counters.rays, four.counters.rays);
}

TEST(Wspd, ImageDoesNotDependOnTheScaleOfTheScene) {
  const auto image = [](float scale) {
    const auto scene = test::make_room(scale);
    return test::render(*scene, "wspd", test::lights_of(*scene, 3000), {}).radiance;
  };
  const auto unit = image(1.0f);
  // Powers of two round alike.
  for (float scale : {1.0f / 1024, 1024.0f}) EXPECT_LT(test::rmse_over_mean(image(scale), unit), 1e-5) << scale;
}

TEST(Wspd, PreparedOnceServesEveryCameraAndComesBackFromItsState) {
  const auto scene = test::make_room();
  const VplSet vpls = lights_of_all_kinds(*scene);
  const IntegratorEntry* entry = find_integrator("wspd");
  const Params params(all_params(*entry));
  Progress progress;
  Stats stats;
  const auto first = entry->create(), second = entry->create();
  first->prepare(*scene, vpls, params, {progress, stats});
  const std::vector<uint8_t> state = first->save_state();
  second->load_state(*scene, vpls, params, state, {progress, stats});
  EXPECT_EQ(second->save_state(), state);
  Rng rng(8, Stage::test);
  ShadePoints points;
  for (uint32_t i = 0; i < 700; ++i) {
    SurfacePoint p;
    p.position = test::random_point(rng, 0.95f);
    p.normal = test::random_direction(rng), p.mirror = test::random_direction(rng);
    p.diffuse = {0.2f, 0.2f, 0.2f};
    p.pixel = i;
    points.push(p);
  }
  points.finish();
  std::vector<Rgb> a(points.size()), b(points.size());
  first->shade(points, a, {}, {progress, stats});
  second->shade(points, b, {}, {progress, stats});
  EXPECT_TRUE(same_bits(a, b));
  EXPECT_THROW(second->load_state(*scene, vpls, params, {state.data(), state.size() - 1}, {progress, stats}), Error);
  EXPECT_THROW(find_integrator("exhaustive")->create()->save_state(), Error);
}

TEST(Wspd, DegenerateInputIsNoTrouble) {
  const auto scene = test::make_room();
  const auto dark = test::render(*scene, "wspd", {}, {}, {.width = 16, .height = 16});
  const auto reference = test::render(*scene, "exhaustive", {}, {}, {.width = 16, .height = 16});
  EXPECT_TRUE(same_bits(dark.radiance, reference.radiance));
  VplSet one;
  one.lights.resize(1);
  one.lights[0].position = {0, -0.5f, 0.8f};
  one.lights[0].intensity = {1, 1, 1};
  const auto single = test::render(*scene, "exhaustive", one, {}, {.width = 16, .height = 16});
  EXPECT_LT(test::mean_relative_error(test::render(*scene, "wspd", one, kExact, {.width = 16, .height = 16}).radiance,
                                      single.radiance),
            1e-5);
  VplSet many;
  many.lights.assign(1000000, one.lights[0]);
  for (Vpl& v : many.lights) v.intensity = {1e-6f, 1e-6f, 1e-6f};
  EXPECT_LT(test::mean_relative_error(test::render(*scene, "wspd", many, kExact, {.width = 16, .height = 16}).radiance,
                                      single.radiance),
            1e-3);  // rounding of a million summands
  // No points at all.
  const auto wspd = find_integrator("wspd")->create();
  Progress progress;
  Stats stats;
  wspd->prepare(*scene, one, Params(all_params(*find_integrator("wspd"))), {progress, stats});
  ShadePoints none;
  none.finish();
  wspd->shade(none, {}, {}, {progress, stats});
}

TEST(Wspd, CancelStopsPreparationAndShading) {
  const auto scene = test::make_room();
  const VplSet vpls = test::standing_lights_of(*scene, 20000);
  const IntegratorEntry* entry = find_integrator("wspd");
  Params params(all_params(*entry));
  Stats stats;
  Progress cancelled;
  cancelled.cancel();
  EXPECT_THROW(entry->create()->prepare(*scene, vpls, params, {cancelled, stats}), Error);
  Progress progress;
  const auto wspd = entry->create();
  wspd->prepare(*scene, vpls, params, {progress, stats});
  ShadePoints points;
  for (uint32_t i = 0; i < 200; ++i) {
    SurfacePoint p;
    p.position = {0, 0, 0.9f}, p.normal = {0, 0, -1}, p.mirror = {0, 0, -1}, p.diffuse = {1, 1, 1};
    points.push(p);
  }
  points.finish();
  std::vector<Rgb> radiance(points.size());
  EXPECT_THROW(wspd->shade(points, radiance, {}, {cancelled, stats}), Error);
}

}  // namespace lumicut
