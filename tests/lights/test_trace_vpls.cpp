#include <gtest/gtest.h>

#include <cstring>
#include <numbers>

#include "core/error.h"
#include "lights/trace_vpls.h"
#include "tests/support/test_scenes.h"
#include "tests/support/trimmed.h"

namespace lumicut {

namespace {

// A closed box of one albedo, with a point light inside.
std::unique_ptr<Scene> closed_box(float albedo) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(albedo, albedo, albedo)});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  scene->add_mesh(mesh);
  Light l;
  l.position = {0.2f, -0.1f, 0.3f};
  l.value = {1, 1, 1};
  scene->set_lights({l});
  Progress progress;
  scene->commit(progress);
  return scene;
}

}  // namespace

// Where the number of paths followed from the lights that they brought, few lights gave 1 + spread²/paths of all: here 5 %.
TEST(TraceVpls, FewLightsMeanNoMoreThanMany) {
  const auto scene = closed_box(0.5f);
  Progress progress;
  double flux = 0;
  constexpr auto kSets = static_cast<int>(test::trimmed(4000));
  for (int seed = 1; seed <= kSets; ++seed) {
    const VplSet set =
        trace_vpls(*scene, {.count = 41, .max_depth = 200, .seed = static_cast<uint64_t>(seed)}, progress);
    for (const Vpl& v : set.lights)
      if (v.kind == VplKind::oriented) flux += std::numbers::pi * v.intensity.x / kSets;
  }
  // Φ(ρ + ρ² + …) = Φ; the spread of path lengths is √2 of their mean: 0.4 % for 4,000 times 40.
  EXPECT_NEAR(flux / (4 * std::numbers::pi), 1.0, test::trimmed_noise(0.015));
}

TEST(TraceVpls, ClosedBoxReflectsTheGeometricSeriesOfItsAlbedo) {
  // Flux that leaves the walls: Φ(ρ + ρ² + …) = Φρ/(1−ρ). An oriented VPL of intensity I emits πI.
  for (float albedo : {0.2f, 0.5f, 0.8f}) {
    const auto scene = closed_box(albedo);
    Progress progress;
    const VplSet set = trace_vpls(*scene, {.count = 100000, .max_depth = 200}, progress);
    double flux = 0;
    for (const Vpl& v : set.lights)
      if (v.kind == VplKind::oriented) flux += std::numbers::pi * v.intensity.x;
    const double expected = 4 * std::numbers::pi * albedo / (1 - albedo);
    EXPECT_NEAR(flux / expected, 1.0, 0.02) << albedo;  // 100k VPLs of path lengths that vary by their mean: 0.7 %
    EXPECT_NEAR(static_cast<double>(set.lights.size()), 100000, 1000);
  }
}

TEST(TraceVpls, DepthLimitCutsTheSeries) {
  const auto scene = closed_box(0.5f);
  Progress progress;
  const VplSet one = trace_vpls(*scene, {.count = 20000, .max_depth = 1}, progress);
  double flux = 0;
  for (const Vpl& v : one.lights)
    if (v.kind == VplKind::oriented) flux += std::numbers::pi * v.intensity.x;
  EXPECT_NEAR(flux, 4 * std::numbers::pi * 0.5, 1e-2);  // every path meets exactly one wall: rounding only
  const VplSet none = trace_vpls(*scene, {.count = 20000, .max_depth = 0}, progress);
  EXPECT_EQ(none.lights.size(), 1u) << "the lamp itself";
}

// A floor of albedo 1/2 below a slab of `material`, and a spot that shines straight up or down through the slab's
// middle: the flux that leaves the floor over the flux of the lamp.
double flux_from_floor(const Material& material, bool from_above) {
  Scene scene(Scene::Config{});
  scene.set_materials({test::diffuse(0.5f, 0.5f, 0.5f), material});
  Mesh mesh;
  test::add_quad(mesh, {-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}, 0);
  test::add_box(mesh, {-8, -8, 2}, {8, 8, 2.2f}, 1, false);
  scene.add_mesh(mesh);
  Light l;
  l.type = LightType::spot;
  l.position = {0, 0, from_above ? 3.0f : 1.0f};
  l.direction = {0, 0, from_above ? -1.0f : 1.0f};
  l.cos_outer = 0.9f;
  l.value = {1, 1, 1};
  scene.set_lights({l});
  Progress progress;
  scene.commit(progress);
  const VplSet set = trace_vpls(scene, {.count = 40000, .max_depth = 30}, progress);
  // The floor's first light alone: what comes back to it is small.
  double flux = 0;
  for (const Vpl& v : set.lights)
    if (v.kind == VplKind::oriented && v.position.z < 1) flux += std::numbers::pi * v.intensity.x;
  return flux / (2 * std::numbers::pi * 0.1);
}

TEST(TraceVpls, MirrorsAndGlassHandLightOn) {
  Material m;
  m.lobe = LobeModel::ggx;
  m.specular = {1, 1, 1};
  m.roughness = 0, m.diffuse = {0.4f, 0.4f, 0.4f};
  m.metallic = 1;
  // Floor ½ · mirror 0.4, once more by ½ · 0.4 · (share that returns), and so on: between 0.2 and 0.25.
  const double mirror = flux_from_floor(m, false);
  EXPECT_GT(mirror, 0.2);
  EXPECT_LT(mirror, 0.255);
  EXPECT_EQ(flux_from_floor(m, true), 0.0) << "a mirror lets nothing through";
  m.metallic = 0, m.transmission = 1, m.diffuse = {1, 1, 1};
  // A slab passes (1 − R)/(1 + R) with R = 0.04, 0.923; the floor gives half; a tenth or less of it returns.
  const double glass = flux_from_floor(m, true);
  EXPECT_GT(glass, 0.44);
  EXPECT_LT(glass, 0.5);
}

TEST(TraceVpls, ClosedBoxOfGgxKeepsAlmostAllOfItsAlbedo) {
  // Every wall reflects 97 to 100 % of what is left when its base takes the rest: flux of all VPLs at albedo near 1/2.
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material m = test::diffuse(0.5f, 0.5f, 0.5f);
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1}, m.roughness = 0.4f;
  scene->set_materials({m});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  scene->add_mesh(mesh);
  Light l;
  l.value = {1, 1, 1};
  scene->set_lights({l});
  Progress progress;
  scene->commit(progress);
  const VplSet set = trace_vpls(*scene, {.count = 100000, .max_depth = 200}, progress);
  double flux = 0;
  for (const Vpl& v : set.lights)
    if (v.kind == VplKind::oriented) flux += std::numbers::pi * v.intensity.x;
  // Of light that meets a wall the coat reflects s, 0.05 to 0.09, and the base 0.5 (1 − s − at most 0.03); bases give
  // Φ d/(1 − s − d).
  const auto series = [](double s, double lost) {
    const double d = 0.5 * (1 - s - lost);
    return 4 * std::numbers::pi * d / (1 - s - d);
  };
  EXPECT_GT(flux, series(0.05, 0.03));
  EXPECT_LT(flux, series(0.09, -0.005));
}

TEST(TraceVpls, TheEnvironmentGetsTheLightsItIsGiven) {
  Scene scene{{}};
  scene.set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
  scene.add_mesh(mesh);
  Light lamp;
  lamp.type = LightType::rectangle;
  lamp.position = {0, 0, 2}, lamp.u = {1, 0, 0}, lamp.v = {0, -1, 0}, lamp.value = {10, 10, 10};
  scene.set_lights({lamp});
  Environment env;
  env.color = {3, 3, 3};
  scene.set_environment(env);
  Progress progress;
  scene.commit(progress);
  const auto environment_lights = [&](uint32_t asked, double& irradiance) {
    const VplSet set = trace_vpls(scene, {.count = 4000, .environment_count = asked}, progress);
    EXPECT_NEAR(static_cast<double>(set.lights.size()), 4000, 100);
    size_t n = 0;
    irradiance = 0;
    for (const Vpl& v : set.lights)
      if (v.kind == VplKind::directional) ++n, irradiance += v.intensity.x * std::max(0.0f, -v.normal.z);
    return n;
  };
  double irradiance;
  for (const uint32_t asked : {1u, 100u, 1500u}) {
    EXPECT_EQ(environment_lights(asked, irradiance), asked);
    if (asked < 100) continue;
    EXPECT_NEAR(irradiance / (std::numbers::pi * 3), 1.0, 0.01) << asked;
  }
  EXPECT_GT(environment_lights(0, irradiance), 400u) << "its share of the direct lights";
}

TEST(TraceVpls, SameLightsOnOneAndFourThreads) {
  const auto scene = test::make_room();
  std::vector<Vpl> first;
  for (int threads : {1, 4}) {
    Arena arena(threads);
    Progress progress;
    const VplSet set = arena.run([&] { return trace_vpls(*scene, {.count = 30000}, progress); });
    if (first.empty()) first = set.lights;
    ASSERT_EQ(set.lights.size(), first.size());
    EXPECT_EQ(std::memcmp(set.lights.data(), first.data(), first.size() * sizeof(Vpl)), 0);
  }
}

TEST(TraceVpls, SeedsDiffer) {
  const auto scene = test::make_room();
  Progress progress;
  const VplSet a = trace_vpls(*scene, {.count = 1000, .seed = 1}, progress),
               b = trace_vpls(*scene, {.count = 1000, .seed = 2}, progress);
  EXPECT_NE(std::memcmp(a.lights.data(), b.lights.data(), 900 * sizeof(Vpl)), 0);
}

TEST(TraceVpls, DarkSceneGivesNoLightsAndAnOpenSceneEnds) {
  Scene dark{{}};
  Progress progress;
  dark.commit(progress);
  EXPECT_TRUE(trace_vpls(dark, {}, progress).lights.empty());
  Scene open{{}};
  open.set_materials({Material{}});
  Mesh mesh;
  test::add_quad(mesh, {0, 0, 0}, {1e-3f, 0, 0}, {1e-3f, 1e-3f, 0}, {0, 1e-3f, 0}, 0);
  open.add_mesh(mesh);
  Light l;
  l.position = {0, 0, 0.01f};
  l.value = {1, 1, 1};
  open.set_lights({l});
  open.commit(progress);
  const VplSet set = trace_vpls(open, {.count = 1000}, progress);
  EXPECT_LT(set.lights.size(), 100u);  // nearly all paths miss; what matters is that it ends
}

TEST(TraceVpls, StopsWhenCancelled) {
  const auto scene = test::make_room();
  Progress progress;
  progress.cancel();
  EXPECT_THROW(trace_vpls(*scene, {.count = 1000000}, progress), Error);
}

}  // namespace lumicut
