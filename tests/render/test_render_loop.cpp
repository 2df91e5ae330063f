// The loop below the ABI: what hosts' renders, tests and benches drive.
#include "render/render_loop.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

FrameOptions small_frame() {
  FrameOptions options;
  options.width = 24, options.height = 16, options.tile_size = 8;
  options.crop = {0, 0, 24, 16};
  return options;
}

IterationOptions iterations(uint32_t count, bool checkpoints = false) {
  IterationOptions options;
  options.count = count, options.checkpoints = checkpoints;
  return options;
}

struct RoomRender {
  explicit RoomRender(const std::string& integrator = "lightcuts")
      : scene(test::make_room()), preparation(*find_integrator(integrator)) {
    preparation.params.set("vpls", "300");
  }
  // Radiance of the whole crop; the loop's last state into `state`.
  std::vector<float> render(IterationOptions iterations, int threads, RenderLoop::State* state = nullptr,
                            std::vector<uint32_t> groups = {}) {
    RenderLoop loop(preparation, *scene, nullptr, small_frame(), std::move(iterations), std::move(groups));
    Progress progress;
    Stats stats;
    std::atomic<int> tiles = 0;
    Arena arena(threads);
    arena.run([&] { loop.run(progress, stats, [&](const Rect&) { ++tiles; }); });
    tiles_done = tiles;
    if (state != nullptr) *state = loop.state();
    std::vector<float> image(24 * 16 * 3);
    loop.read([&](const Film& film) { film.read(Channel::radiance, film.crop(), image.data()); });
    return image;
  }
  std::unique_ptr<Scene> scene;
  Preparation preparation;
  int tiles_done = 0;
};

TEST(RenderLoop, IterationsGoOnFromACheckpointToTheSameBits) {
  RoomRender whole, halves;
  RenderLoop::State state;
  const auto all = whole.render(iterations(4), 2, &state);
  EXPECT_EQ(state.iterations, 4u);
  EXPECT_EQ(whole.tiles_done, 4 * 6) << "once a tile and iteration";
  EXPECT_EQ(state.checkpoint, nullptr) << "not asked for";
  halves.render(iterations(2, true), 1, &state);
  ASSERT_NE(state.checkpoint, nullptr);
  IterationOptions rest = iterations(4);
  rest.resume = *state.checkpoint;
  EXPECT_EQ(halves.render(std::move(rest), 2), all);
}

TEST(RenderLoop, ThreadsDoNotChangeTheImage) {
  EXPECT_EQ(RoomRender().render(iterations(2), 1), RoomRender().render(iterations(2), 4));
}

TEST(RenderLoop, PreparationIsReusedUntilSomethingChanges) {
  RoomRender run;
  run.render({}, 2);
  const Integrator* const method = run.preparation.prepared->method.get();
  run.render({}, 2);
  EXPECT_EQ(run.preparation.prepared->method.get(), method);
  run.preparation.params.set("error", "0.1");
  const auto lights = run.preparation.prepared->vpls;
  run.render({}, 2);
  EXPECT_NE(run.preparation.prepared->method.get(), method);
  EXPECT_EQ(run.preparation.prepared->vpls, lights) << "the light paths do not depend on the error";
}

TEST(RenderLoop, ACancelledRenderThrowsAndLeavesWhatWasPrepared) {
  RoomRender run;
  run.render({}, 2);
  const Integrator* const method = run.preparation.prepared->method.get();
  RenderLoop loop(run.preparation, *run.scene, nullptr, small_frame(), {}, {});
  Progress progress;
  Stats stats;
  progress.cancel();
  EXPECT_THROW(loop.run(progress, stats, [](const Rect&) {}), Error);
  EXPECT_EQ(run.preparation.prepared->method.get(), method);
}

TEST(RenderLoop, GroupsOfLightAddUpToAllLight) {
  RoomRender one, apart;
  const auto all = one.render({}, 2);
  const std::vector<uint32_t> groups = light_groups(*apart.scene);
  // Each group has a cut of its own, within the method's error of 2 % of the sum.
  IterationOptions by_group;
  by_group.groups = true;
  const auto sum = apart.render(std::move(by_group), 2, nullptr, groups);
  double difference = 0, total = 0;
  for (size_t i = 0; i < all.size(); ++i) difference += std::abs(double{all[i]} - sum[i]), total += all[i];
  EXPECT_LT(difference, 0.02 * total);
}

// Each group then has methods for what bounced, whose gloss rays bring, and for the rest.
TEST(RenderLoop, GroupsAddUpWhereGlossIsTraced) {
  RoomRender one("exhaustive"), apart("exhaustive");
  for (RoomRender* r : {&one, &apart}) {
    std::vector<Light> lights = r->scene->lights();
    lights[1].group = 3;
    r->scene->set_lights(lights);
    std::vector<Material> materials = r->scene->materials();
    materials[3].shininess = 600;
    r->scene->set_materials(materials);
    Progress progress;
    r->scene->commit(progress);
    r->preparation.params.set("compensate", "true"), r->preparation.params.set("trace_gloss", "true");
  }
  const auto all = one.render({}, 2);
  IterationOptions by_group;
  by_group.groups = true;
  const auto sum = apart.render(std::move(by_group), 2, nullptr, light_groups(*apart.scene));
  double difference = 0, total = 0;
  for (size_t i = 0; i < all.size(); ++i) difference += std::abs(double{all[i]} - sum[i]), total += all[i];
  EXPECT_LT(difference, 1e-5 * total) << "rounding";
}

TEST(RenderLoop, WhereNothingShinesGlossIsNotTraced) {
  RoomRender without, with;
  for (RoomRender* r : {&without, &with}) {
    r->scene->set_materials(std::vector<Material>(4, test::diffuse(0.5f, 0.5f, 0.5f)));
    Progress progress;
    r->scene->commit(progress);
    r->preparation.params.set("compensate", "true");
  }
  with.preparation.params.set("trace_gloss", "true");
  EXPECT_EQ(with.render({}, 2), without.render({}, 2));
}

}  // namespace
}  // namespace lumicut
