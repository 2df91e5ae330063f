// Smooth meshes of few faces: virtual lights and camera paths see one image. [Veach 1997, 5.3]
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

// A quad in the plane z = 0, whose shading normals all lean to x.
std::unique_ptr<Scene> leaning_floor(const Vec3f& normal) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
  mesh.normals.assign(mesh.positions.size(), normal);
  scene->add_mesh(std::move(mesh));
  Light lamp;
  lamp.position = {0.5f, 0, 1.5f}, lamp.value = {1, 1, 1};
  scene->set_lights({lamp});
  Progress progress;
  scene->commit(progress);
  return scene;
}

TEST(ShadingNormals, AVirtualLightReflectsWhatTheyReceiveAndShinesByTheFace) {
  const Vec3f leaning = normalize(Vec3f{0.6f, 0, 0.8f}), lamp{0.5f, 0, 1.5f};
  const VplSet flat = test::lights_of(*leaning_floor({0, 0, 1}), 2000),
               smooth = test::lights_of(*leaning_floor(leaning), 2000);
  ASSERT_GT(flat.lights.size(), 100u);
  size_t k = flat.direct, dark = 0;
  for (size_t i = smooth.direct; i < smooth.lights.size(); ++i, ++k) {
    const Vpl& v = smooth.lights[i];
    while (flat.lights[k].position != v.position) {  // those that the leaning normal has turned from the lamp
      EXPECT_LE(dot(leaning, lamp - flat.lights[k].position), 1e-5f);
      ++k, ++dark;
      ASSERT_LT(k, flat.lights.size());
    }
    const Vec3f to_lamp = normalize(lamp - v.position);
    EXPECT_EQ(v.normal, (Vec3f{0, 0, 1}));
    EXPECT_NEAR(v.intensity.x / flat.lights[k].intensity.x, dot(leaning, to_lamp) / to_lamp.z, 1e-4);
  }
  EXPECT_LT(dark, flat.lights.size() / 2);
}

// A lamp in a shade of eight faces, whose normals lean as those of a thin body do at its rim, in a closed room.
TEST(ShadingNormals, CompensatedIterationsGiveThePathTracersImage) {
  Scene scene({"bvh", true});
  scene.set_materials({test::diffuse(0.6f, 0.6f, 0.6f), test::diffuse(0.8f, 0.8f, 0.8f)});
  Mesh room, shade;
  test::add_box(room, {-1, -1, -1}, {1, 1, 1}, 0, true);
  constexpr int kFaces = 8;
  const auto ring = [](int j, float radius, float height) {
    const float phi = 2 * std::numbers::pi_v<float> * static_cast<float>(j) / kFaces;
    return Vec3f{radius * std::cos(phi), radius * std::sin(phi), height};
  };
  for (int j = 0; j < kFaces; ++j)
    test::add_quad(shade, ring(j, 0.4f, 0), ring(j, 0.1f, 0.5f), ring(j + 1, 0.1f, 0.5f), ring(j + 1, 0.4f, 0), 1);
  for (const Vec3f& p : shade.positions) {  // inwards; at the rim down too
    const Vec3f inwards = normalize(Vec3f{-p.x, -p.y, 0});
    shade.normals.push_back(normalize(inwards + Vec3f{0, 0, p.z > 0.25f ? -0.6f : -1.0f}));
  }
  scene.add_mesh(std::move(room)), scene.add_mesh(std::move(shade));
  Light lamp;
  lamp.position = {0, 0, 0.2f}, lamp.value = {1, 1, 1};
  scene.set_lights({lamp});
  test::commit_seen_from(scene, {0, -0.95f, 0.1f}, 0.8f);
  const auto samples = [](uint32_t count) { return test::RenderOptions{.width = 24, .height = 18, .samples = count}; };
  const double truth = test::mean_luminance(
      test::render(scene, "path_tracer", {}, {{"samples", "4"}}, samples(test::kSanitized ? 100 : 1024)).radiance);
  const auto [mean, deviation] = test::mean_of_iterations(scene, test::trimmed(400), samples(1));
  RecordProperty("ratio", std::to_string(mean / truth) + " +- " + std::to_string(deviation / truth));
  // Half a per cent is what light paths of a limited depth lack. With the flux as it comes: 1.21.
  EXPECT_NEAR(mean / truth, 1.0, test::kSanitized ? 0.08 : 0.015 + 3 * deviation / truth);
}

}  // namespace
}  // namespace lumicut
