// Frames of some of the light alone: by kinds of lobes, direct light, ambient occlusion.
#include <gtest/gtest.h>

#include "tests/support/render.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 24, kHeight = 18;

// A closed room with a glowing panel below its ceiling, a glossy floor and a mirror.
std::unique_ptr<Scene> room() {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material glowing = test::diffuse(0, 0, 0), gloss = test::diffuse(0.4f, 0.3f, 0.2f), mirror = gloss;
  glowing.emission = {6, 6, 6};
  gloss.lobe = mirror.lobe = LobeModel::ggx;
  gloss.roughness = 0.6f, gloss.specular = {0.5f, 0.5f, 0.5f}, gloss.fresnel = false;
  mirror.metallic = 1, mirror.roughness = 0, mirror.specular = {1, 1, 1};
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), glowing, gloss, mirror});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  test::add_quad(mesh, {-0.3f, 0.3f, 0.98f}, {0.3f, 0.3f, 0.98f}, {0.3f, -0.3f, 0.98f}, {-0.3f, -0.3f, 0.98f}, 1);
  test::add_quad(mesh, {-1, -1, -0.9f}, {1, -1, -0.9f}, {1, 1, -0.9f}, {-1, 1, -0.9f}, 2);
  test::add_quad(mesh, {-0.6f, 0.9f, -0.6f}, {0.2f, 0.9f, -0.6f}, {0.2f, 0.9f, 0.4f}, {-0.6f, 0.9f, 0.4f}, 3);
  scene->add_mesh(std::move(mesh));
  test::commit_seen_from(*scene, {0, -0.95f, 0.1f}, 0.8f);
  return scene;
}

struct Shown {
  std::vector<Rgb> radiance, albedo;
};
Shown render(const Scene& scene, uint32_t lobes, bool direct = false, float occlusion = 0,
             const std::string& id = "exhaustive") {
  Preparation preparation(*find_integrator(id));
  if (id == "path_tracer")
    preparation.params.set("samples", "64");
  else
    preparation.params.set("vpls", "400"), preparation.params.set("compensate", "1");
  FrameOptions frame = test::frame_of({.width = kWidth, .height = kHeight});
  frame.lobes = lobes, frame.direct = direct, frame.occlusion = occlusion;
  RenderLoop loop(preparation, scene, nullptr, frame, {}, {});
  Progress progress;
  Stats stats;
  Arena(0).run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  Shown out{std::vector<Rgb>(kWidth * kHeight), std::vector<Rgb>(kWidth * kHeight)};
  loop.read([&](const Film& film) {
    film.read(Channel::radiance, frame.crop, &out.radiance[0].x);
    film.read(Channel::albedo, frame.crop, &out.albedo[0].x);
  });
  return out;
}
double mean(const Shown& s) { return test::mean_luminance(s.radiance); }

TEST(Lobes, ApartTheySumToThoseOfAll) {
  const auto scene = room();
  const Shown whole = render(*scene, kDiffuseRay | kGlossyRay | kTransmissionRay),
              diffuse = render(*scene, kDiffuseRay), glossy = render(*scene, kGlossyRay),
              passed = render(*scene, kTransmissionRay);
  EXPECT_EQ(mean(passed), 0);
  // Rays of compensation choose among other lobes: noise of a few percent.
  EXPECT_NEAR((mean(diffuse) + mean(glossy)) / mean(whole), 1, 0.03);
  for (size_t i = 0; i < whole.albedo.size(); ++i)
    EXPECT_NEAR(diffuse.albedo[i].x + glossy.albedo[i].x, whole.albedo[i].x, 1e-5) << i;
}

TEST(Lobes, DirectLightIsThatOfPathsWithoutASurfaceBetween) {
  const auto scene = room();
  for (const uint32_t lobes : {uint32_t{kDiffuseRay}, uint32_t{kGlossyRay}}) {
    const double lights = mean(render(*scene, lobes, true)),
                 paths = mean(render(*scene, lobes, true, 0, "path_tracer"));
    EXPECT_NEAR(lights / paths, 1, 0.04) << lobes;
    EXPECT_LT(lights, 0.9 * mean(render(*scene, lobes))) << lobes;
  }
}

// It was read where nothing had been written.
TEST(Lobes, FramesOfOcclusionHaveNoIlluminance) {
  const auto scene = room();
  Preparation preparation(*find_integrator("exhaustive"));
  FrameOptions frame = test::frame_of({.width = kWidth, .height = kHeight});
  frame.occlusion = 1, frame.illuminance = true;
  RenderLoop loop(preparation, *scene, nullptr, frame, {}, {});
  Progress progress;
  Stats stats;
  Arena(0).run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  loop.read([&](const Film& film) {
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) EXPECT_EQ(*film.pixel(Channel::illuminance, x, y), 0);
  });
}

TEST(Lobes, OcclusionIsTheShareOfDirectionsInWhichNothingIsNear) {
  const auto scene = room();
  EXPECT_LT(mean(render(*scene, 0, false, 100)), 0.01) << "of a closed room, but for its edges";
  const Shown open = render(*scene, 0, false, 1e-3f);
  EXPECT_NEAR(mean(open), 1, 0.01) << "but in corners";
  const double some = mean(render(*scene, 0, false, 0.5f));
  EXPECT_GT(some, 0.3);
  EXPECT_LT(some, 0.95);
}

}  // namespace
}  // namespace lumicut
