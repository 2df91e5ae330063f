// Extension "lumicut.hits/1": what camera rays meet is what channels show.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "box_scene.h"
#include "lumicut/lumicut_hits.h"

namespace {

using namespace box;

const lumicut_hits_extension& hits_table() {
  const auto* table = static_cast<const lumicut_hits_extension*>(lumicut_get_extension(LUMICUT_HITS_EXTENSION));
  EXPECT_NE(table, nullptr);
  EXPECT_EQ(table->struct_size, sizeof(lumicut_hits_extension));
  return *table;
}

TEST(Hits, CoverWhatTheChannelAlphaSays) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  api::Integrator method = integrator(device, 20);
  method.set("seed", "7");
  for (const uint32_t filter : {uint32_t{LUMICUT_BOX}, uint32_t{LUMICUT_BLACKMAN_HARRIS}}) {
    auto frame = box::frame(24, 16);
    frame.samples = 2, frame.passes = 3, frame.filter = filter;
    const api::Render render(method, s, frame);
    render.wait();
    std::vector<float> alpha(24 * 16), covered(24 * 16, 0.0f);
    ASSERT_EQ(lumicut_render_read(render.get(), "alpha", nullptr, alpha.data()), LUMICUT_OK);
    std::vector<lumicut_first_hit> hits(24 * 16 * 2);
    for (uint64_t pass = 0; pass < 3; ++pass) {
      ASSERT_EQ(hits_table().trace(s.get(), &frame, 7, pass, nullptr, hits.data()), LUMICUT_OK) << lumicut_last_error();
      for (size_t i = 0; i < hits.size(); ++i)
        if (hits[i].mesh != LUMICUT_NO_ID) covered[i / 2] += 1.0f / 6.0f;
    }
    float sum = 0.0f;
    for (size_t p = 0; p < alpha.size(); ++p) {
      EXPECT_NEAR(alpha[p], covered[p], 1e-5f) << p;
      sum += alpha[p];
    }
    EXPECT_GT(sum, 1.0f);
    EXPECT_LT(sum, 24 * 16 - 1.0f);
  }
}

TEST(Hits, RectanglesArePartsOfTheWhole) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  auto frame = box::frame(24, 16);
  frame.passes = 1;
  std::vector<lumicut_first_hit> whole(24 * 16), part(5 * 4);
  auto rect = make<lumicut_tile>();
  rect.x0 = 7, rect.y0 = 6, rect.x1 = 12, rect.y1 = 10;
  ASSERT_EQ(hits_table().trace(s.get(), &frame, 1, 0, nullptr, whole.data()), LUMICUT_OK);
  ASSERT_EQ(hits_table().trace(s.get(), &frame, 1, 0, &rect, part.data()), LUMICUT_OK);
  for (size_t y = 0; y < 4; ++y)
    for (size_t x = 0; x < 5; ++x) {
      const lumicut_first_hit &a = whole[24 * (y + 6) + x + 7], &b = part[5 * y + x];
      EXPECT_EQ(a.mesh, b.mesh);
      EXPECT_EQ(a.triangle, b.triangle);
      EXPECT_EQ(a.u, b.u);
      EXPECT_EQ(a.v, b.v);
    }
}

TEST(Hits, EndWhenTheSceneIsCancelled) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  auto frame = box::frame(2000, 200);
  frame.passes = 1, frame.samples = 16;
  std::vector<lumicut_first_hit> hits(size_t{2000} * 200 * 16);
  std::atomic<bool> over{false};
  std::thread other([&] {
    while (!over) lumicut_cancel(s.get());  // the first may come before there is anything to cancel
  });
  const lumicut_result result = hits_table().trace(s.get(), &frame, 1, 0, nullptr, hits.data());
  over = true;
  other.join();
  EXPECT_EQ(result, LUMICUT_CANCELLED);
  hits.resize(16);
  frame = box::frame(4, 4);
  EXPECT_EQ(hits_table().trace(s.get(), &frame, 1, 0, nullptr, hits.data()), LUMICUT_OK) << lumicut_last_error();
}

TEST(Hits, WrongInputIsAnError) {
  const api::Device device(1);
  const api::Scene s = scene(device, false);
  const auto frame = box::frame(4, 4);
  lumicut_first_hit hits[16];
  EXPECT_EQ(hits_table().trace(nullptr, &frame, 1, 0, nullptr, hits), LUMICUT_INVALID_ARGUMENT);
  EXPECT_EQ(hits_table().trace(s.get(), &frame, 1, 0, nullptr, hits), LUMICUT_INVALID_STATE);  // not committed
  ASSERT_EQ(lumicut_scene_commit(s.get()), LUMICUT_OK) << lumicut_last_error();
  EXPECT_EQ(hits_table().trace(s.get(), nullptr, 1, 0, nullptr, hits), LUMICUT_INVALID_ARGUMENT);
  EXPECT_EQ(hits_table().trace(s.get(), &frame, 1, 0, nullptr, nullptr), LUMICUT_INVALID_ARGUMENT);
  auto rect = make<lumicut_tile>();
  rect.x1 = rect.y1 = 5;
  EXPECT_EQ(hits_table().trace(s.get(), &frame, 1, 0, &rect, hits), LUMICUT_INVALID_ARGUMENT);
}

}  // namespace
