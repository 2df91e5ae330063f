// Meshes that some kinds of rays do not see.
#include <gtest/gtest.h>

#include "tests/support/backends.h"
#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 24, kHeight = 18;

// A closed room lit by a panel in its ceiling, with what `add` puts into it.
std::unique_ptr<Scene> room(const std::function<void(Scene&)>& add, const std::string& accel = kDefaultAccel) {
  auto scene = std::make_unique<Scene>(Scene::Config{accel, true});
  Material glowing = test::diffuse(0, 0, 0), mirror = test::diffuse(0.9f, 0.9f, 0.9f);
  glowing.emission = {6, 6, 6};
  mirror.lobe = LobeModel::ggx, mirror.metallic = 1, mirror.roughness = 0, mirror.specular = {1, 1, 1};
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), glowing, test::diffuse(0.1f, 0.5f, 0.2f), mirror});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  test::add_quad(mesh, {-0.3f, 0.3f, 0.98f}, {0.3f, 0.3f, 0.98f}, {0.3f, -0.3f, 0.98f}, {-0.3f, -0.3f, 0.98f}, 1);
  scene->add_mesh(std::move(mesh));
  if (add) add(*scene);
  test::commit_seen_from(*scene, {0, -0.95f, 0.1f}, 0.8f);
  return scene;
}

// A green box in the middle that `mask` rays see.
std::function<void(Scene&)> box(uint32_t mask, uint32_t material = 2) {
  return [=](Scene& scene) {
    Mesh mesh;
    test::add_box(mesh, {-0.4f, -0.2f, -0.7f}, {0.4f, 0.4f, 0.1f}, material, false);
    mesh.mask = mask;
    scene.add_mesh(std::move(mesh));
  };
}

std::vector<Rgb> render(const Scene& scene, const std::string& id = "exhaustive", const test::Settings& settings = {}) {
  const VplSet lights = id == "path_tracer" ? VplSet{} : test::lights_of(scene, 400);
  return test::render(scene, id, lights, settings, {.width = kWidth, .height = kHeight}).radiance;
}

class RayKinds : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Accels, RayKinds, testing::ValuesIn(test::backends()));

TEST_P(RayKinds, AMeshThatNoneSeesIsNotThere) {
  constexpr uint32_t kOther = 0x80000000u;
  EXPECT_TRUE(render(*room(box(kOther), GetParam())) == render(*room({}, GetParam())));
  // Trees and random numbers at a point go by the size of the scene's parts, which a box changes.
  for (const char* id : {"lightcuts", "wspd", "stochastic_lightcuts", "path_tracer"})
    EXPECT_NEAR(test::mean_luminance(render(*room(box(kOther), GetParam()), id)) /
                    test::mean_luminance(render(*room({}, GetParam()), id)),
                1, 0.05)
        << id;
}

TEST_P(RayKinds, AllKindsTogetherSeeWhatAMeshWithoutMaskShows) {
  for (const char* id : {"exhaustive", "path_tracer"})
    EXPECT_TRUE(render(*room(box(kAllRays), GetParam()), id) == render(*room(box(0xffffffffu), GetParam()), id)) << id;
}

// The rest of the room is lit as if it were not there; where the camera sees it, it is lit.
TEST_P(RayKinds, WhatTheCameraAloneSeesLeavesAllElseAsItIs) {
  const auto without = room({}, GetParam()), with = room(box(kCameraRay), GetParam());
  const auto a = render(*without), b = render(*with);
  size_t other = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    if (a[i] == b[i]) continue;
    ++other;
    EXPECT_GT(b[i].y, 3 * b[i].x) << "the box is green, and nothing is green by its light";
  }
  EXPECT_GT(other, kWidth * kHeight / 20);
  EXPECT_LT(other, kWidth * kHeight / 2);
}

// Shadows and green light stay where the camera does not see their cause.
TEST_P(RayKinds, WhatTheCameraDoesNotSeeDarkensAndColoursAllTheSame) {
  const auto none = render(*room({}, GetParam())), hidden = render(*room(box(kAllRays & ~kCameraRay), GetParam()));
  double lost = 0, green = 0;
  for (size_t i = 0; i < none.size(); ++i) {
    lost = std::max(lost, 1.0 - luminance(hidden[i]) / luminance(none[i]));
    green = std::max<double>(green, hidden[i].y / hidden[i].x);
  }
  EXPECT_GT(lost, 0.3);
  EXPECT_GT(green, 1.02);
}

// Its shadow and its light on the rest stay; the camera sees neither it nor what is behind.
TEST_P(RayKinds, AHoldoutIsAHoleToTheCameraAlone) {
  const auto holdout = [](bool held) {
    return [=](Scene& scene) {
      std::vector<Material> materials = scene.materials();
      materials[2].holdout = held;
      scene.set_materials(materials);
      box(kAllRays)(scene);
    };
  };
  const auto there = render(*room(holdout(false), GetParam())), held = render(*room(holdout(true), GetParam()));
  size_t holes = 0;
  for (size_t i = 0; i < held.size(); ++i) {
    if (held[i] == Rgb{})
      ++holes;
    else
      EXPECT_EQ(held[i], there[i]);
  }
  EXPECT_GT(holes, kWidth * kHeight / 20);
  EXPECT_LT(holes, kWidth * kHeight / 2);
}

TEST_P(RayKinds, AMirrorShowsWhatGlossyRaysSee) {
  const auto mirror = [&](uint32_t mask) {
    return render(*room(
        [=](Scene& scene) {
          Mesh wall;  // before the back wall
          test::add_quad(wall, {-0.99f, 0.99f, -0.99f}, {0.99f, 0.99f, -0.99f}, {0.99f, 0.99f, 0.99f},
                         {-0.99f, 0.99f, 0.99f}, 3);
          scene.add_mesh(std::move(wall));
          Mesh behind;  // the camera, which looks away
          test::add_quad(behind, {-0.99f, -0.97f, -0.99f}, {-0.99f, -0.97f, 0.99f}, {0.99f, -0.97f, 0.99f},
                         {0.99f, -0.97f, -0.99f}, 2);
          behind.mask = mask;
          scene.add_mesh(std::move(behind));
        },
        GetParam()));
  };
  const auto seen = mirror(kGlossyRay), unseen = mirror(kCameraRay);
  const size_t middle = size_t{kHeight / 2} * kWidth + kWidth / 2;
  EXPECT_GT(seen[middle].y, 2 * seen[middle].x) << "green behind the camera";
  EXPECT_LT(unseen[middle].y, 1.5f * unseen[middle].x) << "the wall behind it";
}

// Nothing is counted twice or lost: the mean of compensated iterations is the path tracer's, whatever rays see a mesh.
TEST(RayKind, CompensatedIterationsGiveThePathTracersImage) {
  const auto lamp = [](uint32_t mask) { return [=](Scene& scene) { box(mask, 1)(scene); }; };
  for (const auto& [name, add] :
       {std::pair{"camera", std::function<void(Scene&)>(box(kCameraRay))},
        std::pair{"no camera", box(kAllRays & ~kCameraRay)}, std::pair{"no shadow", box(kAllRays & ~kShadowRay)},
        std::pair{"no diffuse", box(kAllRays & ~kDiffuseRay)},
        std::pair{"a lamp without glossy rays", std::function<void(Scene&)>(lamp(kAllRays & ~kGlossyRay))},
        std::pair{"a lamp for camera and glossy rays", std::function<void(Scene&)>(lamp(kCameraRay | kGlossyRay))}}) {
    const auto scene = room(add);
    const double truth =
        test::mean_luminance(test::render(*scene, "path_tracer", {}, {{"samples", "64"}},
                                          {.width = kWidth, .height = kHeight, .samples = test::kSanitized ? 2 : 16})
                                 .radiance);
    const auto [mean, deviation] =
        test::mean_of_iterations(*scene, test::trimmed(40), {.width = kWidth, .height = kHeight, .samples = 4});
    EXPECT_NEAR(mean / truth, 1.0, test::kSanitized ? 0.08 : 0.01 + 3 * deviation / truth) << name;
  }
}

// Bounced light is stopped by what scattered rays see, a lamp's by what shadow rays do: in every method, for trees and
// columns keep the two apart.
TEST(RayKind, EveryMethodStopsBouncedLightByWhatScatteredRaysSee) {
  for (const auto& [name, mask] :
       {std::pair{"no shadow", kAllRays & ~kShadowRay}, std::pair{"no diffuse", kAllRays & ~kDiffuseRay}}) {
    const auto scene = room(box(mask));
    const double exact = test::mean_luminance(render(*scene));
    // What one mask for all lights would give differs: the test can fail.
    VplSet lights = test::lights_of(*scene, 400);
    lights.light_paths = 0;  // nothing is known of them
    const double mistaken = test::mean_luminance(
        test::render(*scene, "exhaustive", lights, {}, {.width = kWidth, .height = kHeight}).radiance);
    EXPECT_GT(std::abs(mistaken / exact - 1), 0.02) << name;
    for (const IntegratorEntry& entry : integrators()) {
      if (std::string(entry.id) == "path_tracer") continue;
      EXPECT_NEAR(test::mean_luminance(render(*scene, entry.id)) / exact, 1, 0.01) << name << ": " << entry.id;
    }
  }
}

// Light samples pass all of them, and so no ray may bring any: four sheets give four times the light of one.
TEST(RayKind, LampsThatCastNoShadowShineThroughEachOther) {
  const auto lit = [](int sheets) {
    return test::mean_luminance(render(*room([=](Scene& scene) {
      Mesh mesh;
      for (int k = 0; k < sheets; ++k) {
        const float z = 0.6f + 0.01f * static_cast<float>(k);
        test::add_quad(mesh, {-0.2f, 0.2f, z}, {0.2f, 0.2f, z}, {0.2f, -0.2f, z}, {-0.2f, -0.2f, z}, 1);
      }
      mesh.mask = kDiffuseRay | kGlossyRay;
      scene.add_mesh(std::move(mesh));
    }),
                                       "path_tracer", {{"samples", "400"}}));
  };
  const double none = lit(0), one = lit(1) - none, four = lit(4) - none;
  EXPECT_NEAR(four / one, 4.0, 0.3);  // bounced light stops at the sheets: a few per cent
}

// Of the light of a lamp without extent alone: what casts no shadow lights what is behind it, and is lit.
TEST(RayKind, LightPathsPassWhatCastsNoShadow) {
  const auto flux = [](uint32_t mask) {
    auto scene = std::make_unique<Scene>(Scene::Config{kDefaultAccel, true});
    scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f), test::diffuse(0.3f, 0.3f, 0.3f)});
    Mesh outer, inner;
    test::add_box(outer, {-2, -2, -2}, {2, 2, 2}, 0, true);
    test::add_box(inner, {-1, -1, -1}, {1, 1, 1}, 1, true);
    inner.mask = mask;
    scene->add_mesh(std::move(outer)), scene->add_mesh(std::move(inner));
    Light lamp;
    lamp.type = LightType::point, lamp.position = {0.1f, 0.2f, 0}, lamp.value = {1, 1, 1};
    scene->set_lights({lamp});
    Progress progress;
    scene->commit(progress);
    double of_outer = 0, of_inner = 0;
    for (const Vpl& v : test::lights_of(*scene, test::trimmed(200000)).lights) {
      if (v.kind != VplKind::oriented) continue;
      const double power = std::numbers::pi * v.intensity.x / (4 * std::numbers::pi);
      (max_component(max(v.position, -v.position)) > 1.5f ? of_outer : of_inner) += power;
    }
    return std::pair{of_outer, of_inner};
  };
  const double noise = test::trimmed_noise(0.02);
  // ρ + ρ² + … of each box alone.
  const auto [none, alone] = flux(kAllRays);
  EXPECT_EQ(none, 0.0);
  EXPECT_NEAR(alone, 0.3 / 0.7, noise);
  // All light meets the inner box and the outer one; what leaves either then meets the inner one on its way.
  const auto [outer, inner] = flux(kAllRays & ~kShadowRay);
  EXPECT_GT(outer, 0.5 - noise) << "the lamp lights it past the inner box";
  EXPECT_GT(inner, 0.3 - noise);
  // No virtual light stands on what diffuse rays do not see, though it keeps the lamp's light in.
  const auto [kept, stopped] = flux(kAllRays & ~kDiffuseRay);
  EXPECT_EQ(kept, 0.0);
  EXPECT_EQ(stopped, 0.0);
  const auto [free, unseen] = flux(kCameraRay | kGlossyRay);
  EXPECT_NEAR(free, 0.5 / 0.5, noise);
  EXPECT_EQ(unseen, 0.0);
}

}  // namespace
}  // namespace lumicut
