// Glass, and sheets that pass light evenly: virtual lights with compensation, averaged over iterations, give the path tracer's image.
#include <gtest/gtest.h>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

enum class Glass {
  none,
  sheet_out,
  sheet_in,
  slab,
  ball,
  paper,
  tinted_ball,  // absorbs inside
  // Light passes straight.
  straight_sheet,
  straight_slab,
  straight_ball,
  straight_rough,
  straight_lamp,
  straight_tinted,
  open_out,  // and what lies behind them is inside
  open_in,
};

void add_ball(Mesh& mesh, const Vec3f& center, float radius, uint32_t material) {
  constexpr int kRings = 12, kSegments = 24;
  const auto at = [&](int i, int j) {
    const float theta = 3.14159265f * static_cast<float>(i) / kRings,
                phi = 6.2831853f * static_cast<float>(j) / kSegments;
    return center + Vec3f{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)} * radius;
  };
  for (int i = 0; i < kRings; ++i)
    for (int j = 0; j < kSegments; ++j)
      test::add_quad(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), material);
}

// A closed room of two halves with glass between them; the light is in the one, the camera in the other.
std::unique_ptr<Scene> make_glass(Glass kind) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material glass = test::diffuse(1, 1, 1);
  glass.lobe = LobeModel::ggx, glass.specular = {1, 1, 1}, glass.roughness = 0, glass.transmission = 1;
  Material glowing = test::diffuse(0, 0, 0);
  glowing.emission = {2, 2, 2};
  if (kind >= Glass::straight_sheet) glass.shadows_pass = true;
  if (kind >= Glass::open_out) glass.open_glass = true;
  if (kind == Glass::straight_sheet) glass.diffuse = {0.8f, 0.7f, 0.9f};
  if (kind == Glass::tinted_ball || kind == Glass::straight_tinted) glass.absorption = {1, 4, 2};
  if (kind == Glass::straight_rough) glass.roughness = 0.4f;
  if (kind == Glass::straight_lamp) {
    // Close to the pane, so that the clamp takes much of what passes, and in the half of the camera a mesh of its own.
    glowing.emission = {};
    Light lamp;
    lamp.type = LightType::rectangle, lamp.position = {0, 0.15f, 0}, lamp.value = {4, 4, 4};
    lamp.u = {0.6f, 0, 0}, lamp.v = {0, 0, 0.6f};  // shines to −y, through the pane
    scene->set_lights({lamp});
  }
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), glass, glowing});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  mesh.triangle_materials[6] = mesh.triangle_materials[7] = 2;  // the wall at y = 1
  switch (kind) {
    case Glass::none:
      break;
    case Glass::paper:  // passes light evenly
      glass = test::diffuse(0.3f, 0.3f, 0.3f), glass.translucency = {0.5f, 0.4f, 0.6f};
      scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), glass, glowing});
      [[fallthrough]];
    case Glass::straight_sheet:
    case Glass::straight_rough:
    case Glass::straight_lamp:
    case Glass::open_out:
    case Glass::sheet_out:
      test::add_quad(mesh, {-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1}, 1);
      break;
    case Glass::open_in:
    case Glass::sheet_in:
      test::add_quad(mesh, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}, 1);
      break;
    case Glass::straight_slab:
    case Glass::straight_tinted:
    case Glass::slab:
      test::add_box(mesh, {-1.1f, 0, -1.1f}, {1.1f, 0.1f, 1.1f}, 1, false);
      break;
    case Glass::straight_ball:
    case Glass::tinted_ball:
    case Glass::ball:
      add_ball(mesh, {0, 0.1f, 0}, 0.6f, 1);
  }
  scene->add_mesh(std::move(mesh));
  test::commit_seen_from(*scene, {0, -0.95f, 0.2f}, 0.8f, {0.3f, 1, -0.5f});
  return scene;
}

// No chance blackens a pixel that shows a mirror.
TEST(Mirror, OfOneSampleHasNoBlackPixel) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material mirror = test::diffuse(0.6f, 0.55f, 0.5f);
  mirror.lobe = LobeModel::ggx, mirror.specular = {1, 1, 1}, mirror.metallic = 1, mirror.roughness = 0;
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), mirror});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  test::add_quad(mesh, {-0.99f, 0.99f, -0.99f}, {0.99f, 0.99f, -0.99f}, {0.99f, 0.99f, 0.99f}, {-0.99f, 0.99f, 0.99f},
                 1);
  scene->add_mesh(std::move(mesh));
  Light lamp;
  lamp.type = LightType::point, lamp.position = {0.3f, -0.5f, 0.6f}, lamp.value = {1, 1, 1};
  scene->set_lights({lamp});
  test::commit_seen_from(*scene, {0, -0.9f, 0.1f}, 0.4f);
  for (const Rgb& c : test::render(*scene, "exhaustive", test::lights_of(*scene, 100), {}).radiance)
    EXPECT_GT(luminance(c), 0.001f);
}

class OfGlass : public testing::TestWithParam<Glass> {};
INSTANTIATE_TEST_SUITE_P(Kinds, OfGlass,
                         testing::Values(Glass::none, Glass::sheet_out, Glass::sheet_in, Glass::slab, Glass::ball,
                                         Glass::paper, Glass::straight_sheet, Glass::straight_slab,
                                         Glass::straight_ball, Glass::straight_rough, Glass::straight_lamp,
                                         Glass::tinted_ball, Glass::straight_tinted, Glass::open_out, Glass::open_in));

TEST_P(OfGlass, CompensatedIterationsGiveThePathTracersImage) {
  const auto scene = make_glass(GetParam());
  const auto samples = [](uint32_t count) { return test::RenderOptions{.width = 24, .height = 18, .samples = count}; };
  const double truth = test::mean_luminance(
      test::render(*scene, "path_tracer", {}, {{"samples", "4"}}, samples(test::kSanitized ? 100 : 1024)).radiance);
  const auto [mean, deviation] = test::mean_of_iterations(*scene, test::trimmed(40), samples(8));
  RecordProperty("ratio", std::to_string(mean / truth) + " +- " + std::to_string(deviation / truth));
  // Sanitized: four iterations tell little of their own deviation, and the truth has a noise of 1 %.
  EXPECT_NEAR(mean / truth, 1.0, test::kSanitized ? 0.08 : 0.01 + 3 * deviation / truth);
}

// What a slab of parallel borders bends, it bends back; light is shifted by a little alone.
TEST(StraightGlass, OfASlabLetsThroughAsMuchAsOneThatBends) {
  const auto mean = [](Glass kind) {
    return test::mean_luminance(test::render(*make_glass(kind), "path_tracer", {}, {{"samples", "4"}},
                                             {.width = 24, .height = 18, .samples = test::kSanitized ? 100 : 1024})
                                    .radiance);
  };
  const double ratio = mean(Glass::straight_slab) / mean(Glass::slab);
  RecordProperty("ratio", std::to_string(ratio));
  EXPECT_NEAR(ratio, 1.0, test::kSanitized ? 0.06 : 0.03);
}

// A slab of 0.5 that absorbs, seen or lit straight on.
struct TintedSlab {
  static constexpr Rgb kAbsorption{0.5f, 1, 2};
  static constexpr double kReflected = 0.04;

  static std::unique_ptr<Scene> make(bool straight, const Transform& to_world = {}) {
    auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
    Material glass = test::diffuse(1, 1, 1), glowing = test::diffuse(0, 0, 0);
    glass.lobe = LobeModel::ggx, glass.specular = {1, 1, 1}, glass.roughness = 0, glass.transmission = 1;
    glass.absorption = kAbsorption, glass.shadows_pass = straight;
    glowing.emission = {1, 1, 1};
    scene->set_materials({straight ? test::diffuse(0.5f, 0.5f, 0.5f) : glowing, glass});
    Mesh wall, slab;
    test::add_quad(wall, {-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0}, 0);
    test::add_box(slab, {-4, -4, 1}, {4, 4, 1.5f}, 1, false);
    slab.instances = {to_world};
    scene->add_mesh(std::move(wall)), scene->add_mesh(std::move(slab));
    return scene;
  }
  static Rgb mean(Scene& scene, float height, float from, uint32_t pixels, uint32_t samples) {
    Camera camera;
    camera.orthographic = true, camera.height = height, camera.position = {0, 0, from};
    camera.right = {1, 0, 0}, camera.forward = {0, 0, -1}, camera.up = {0, 1, 0};
    scene.set_camera(camera);
    Progress progress;
    scene.commit(progress);
    Rgb sum{};
    const auto image = test::render(scene, "exhaustive", test::lights_of(scene, 100), {},
                                    {.width = pixels, .height = pixels, .samples = samples});
    for (const Rgb& c : image.radiance) sum += c * (1.0f / static_cast<float>(image.radiance.size()));
    return sum;
  }
};

// L·T²·a / (1 − R²a²) with a = e^(−σd): what goes to and fro in the slab is in it. [Beer, Lambert; Stokes 1862]
TEST(TintedGlass, ASlabShowsWhatIsBehindItByBeersLaw) {
  const auto scene = TintedSlab::make(false);
  const Rgb seen = TintedSlab::mean(*scene, 0.1f, 3, 16, test::kSanitized ? 16 : 256);
  for (int k = 0; k < 3; ++k) {
    const double a = std::exp(-0.5 * TintedSlab::kAbsorption[k]), r = TintedSlab::kReflected;
    // Reflection is by chance: 4 % of 65,536 samples.
    EXPECT_NEAR(seen[k], (1 - r) * (1 - r) * a / (1 - r * r * a * a), test::kSanitized ? 0.02 : 0.004) << k;
  }
}

// As a drink in its glass: where bodies overlap, both absorb.
TEST(TintedGlass, ABodyInsideAnotherAbsorbsBesideIt) {
  constexpr Rgb kOuter{0.5f, 1, 0}, kInner{0, 1, 2};
  Scene scene({"bvh", true});
  Material outer = test::diffuse(1, 1, 1), glowing = test::diffuse(0, 0, 0);
  outer.lobe = LobeModel::ggx, outer.specular = {1, 1, 1}, outer.roughness = 0, outer.transmission = 1;
  Material inner = outer;
  outer.absorption = kOuter, inner.absorption = kInner, glowing.emission = {1, 1, 1};
  scene.set_materials({glowing, outer, inner});
  Mesh wall, whole, part;
  test::add_quad(wall, {-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0}, 0);
  test::add_box(whole, {-4, -4, 1}, {4, 4, 2}, 1, false), test::add_box(part, {-3, -3, 1.25f}, {3, 3, 1.75f}, 2, false);
  scene.add_mesh(std::move(wall)), scene.add_mesh(std::move(whole)), scene.add_mesh(std::move(part));
  const Rgb seen = TintedSlab::mean(scene, 0.1f, 3, 16, test::kSanitized ? 16 : 256);
  const Rgb beyond = TintedSlab::mean(scene, 0.1f, 0.5f, 16, 1);  // nothing is in between
  const double t = std::pow(1 - TintedSlab::kReflected, 4);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(beyond[k], 1) << k;
    const double straight = t * std::exp(-1.0 * kOuter[k] - 0.5 * kInner[k]);
    // What goes to and fro between the four borders: at most their six pairs of reflections, if nothing was absorbed.
    EXPECT_GT(seen[k], straight - (test::kSanitized ? 0.02 : 0.004)) << k;
    EXPECT_LT(seen[k], straight * (1 + 6 * 0.04 * 0.04 * 1.1) + (test::kSanitized ? 0.02 : 0.004)) << k;
  }
}

// Shadow rays know the slab's thickness by its volume and area: here to the edges' 6 %, whatever the instance's size.
TEST(TintedGlass, ASunThroughASlabIsDimmedByBeersLaw) {
  const auto lit = [](bool slab, float size) {
    Transform to_world;
    for (const int k : {0, 5, 10}) to_world.m[k] = size;
    if (!slab) to_world.m[3] = 100;
    const auto scene = TintedSlab::make(true, to_world);
    Light sun;
    sun.type = LightType::sun, sun.direction = {0, 0, -1}, sun.value = {1, 1, 1};
    scene->set_lights({sun});
    return luminance(TintedSlab::mean(*scene, 1, 0.5f * size, 64, 1));
  };
  for (const float size : {1.0f, 0.5f, 2.0f}) {
    const double r = TintedSlab::kReflected;
    Rgb passed{};
    for (int k = 0; k < 3; ++k)
      passed[k] = static_cast<float>(
          (1 - r) * std::exp(-0.25 * size * TintedSlab::kAbsorption[k] * 8 * 8 / (8 * 8 + 2 * 8 * 0.5)));
    const double expected = luminance(passed) * luminance(passed);  // a border at a time, by chance
    EXPECT_NEAR(lit(true, size) / lit(false, size), expected, 0.03) << size;
  }
}

}  // namespace
}  // namespace lumicut
