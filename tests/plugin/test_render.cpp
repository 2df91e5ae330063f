// Level 4: frames in the background, their tiles, and their end at any moment.
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "box_scene.h"
#include "tests/support/trimmed.h"

namespace {

using namespace box;

TEST(Render, TilesComeOnceAndCoverTheCrop) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 50);
  auto f = frame(70, 50);
  f.crop[0] = 5, f.crop[1] = 7, f.crop[2] = 66, f.crop[3] = 50;
  const api::Render r(i, s, f);
  const auto status = r.wait();
  EXPECT_EQ(status.state, LUMICUT_DONE);
  EXPECT_EQ(status.fraction, 1.0);
  EXPECT_EQ(status.tiles_total, 4u * 3u);
  EXPECT_EQ(status.tiles_done, status.tiles_total);
  std::set<std::pair<uint32_t, uint32_t>> pixels;
  auto tile = make<lumicut_tile>();
  uint64_t tiles = 0;
  for (; r.next_tile(tile); ++tiles)
    for (uint32_t y = tile.y0; y < tile.y1; ++y)
      for (uint32_t x = tile.x0; x < tile.x1; ++x) EXPECT_TRUE(pixels.insert({x, y}).second);
  EXPECT_EQ(tiles, status.tiles_total);
  EXPECT_EQ(pixels.size(), 61u * 43u);
  EXPECT_EQ(*pixels.begin(), std::make_pair(5u, 7u));
  EXPECT_FALSE(r.next_tile(tile));
}

TEST(Render, CropsAndRectanglesAreCutOutOfTheWhole) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 50);
  const auto f = frame(70, 50);
  const auto whole = render(i, s, f);
  auto cropped = f;
  cropped.crop[0] = 5, cropped.crop[1] = 7, cropped.crop[2] = 66, cropped.crop[3] = 50;
  const api::Render r(i, s, cropped);
  r.wait();
  const auto at = [&](uint32_t x, uint32_t y) { return &whole[3 * (size_t{y} * 70 + x)]; };
  const auto crop = r.read("radiance");
  for (uint32_t y = 7; y < 50; ++y)
    for (uint32_t x = 5; x < 66; ++x)
      ASSERT_EQ(std::memcmp(&crop[3 * (size_t{y - 7} * 61 + (x - 5))], at(x, y), 12), 0) << x << " " << y;
  auto rect = make<lumicut_tile>();
  rect.x0 = 19, rect.y0 = 20, rect.x1 = 40, rect.y1 = 41;  // cuts tiles on all sides
  std::vector<float> part(3 * 21 * 21);
  ASSERT_EQ(lumicut_render_read(r.get(), "radiance", &rect, part.data()), LUMICUT_OK);
  for (uint32_t y = 20; y < 41; ++y)
    for (uint32_t x = 19; x < 40; ++x)
      ASSERT_EQ(std::memcmp(&part[3 * (size_t{y - 20} * 21 + (x - 19))], at(x, y), 12), 0) << x << " " << y;
  rect.x1 = 67;
  EXPECT_CODE(lumicut_render_read(r.get(), "radiance", &rect, part.data()), LUMICUT_INVALID_ARGUMENT,
              "inside the crop");
  rect.x1 = 19;
  EXPECT_CODE(lumicut_render_read(r.get(), "radiance", &rect, part.data()), LUMICUT_INVALID_ARGUMENT,
              "inside the crop");
  EXPECT_CODE(lumicut_render_read(r.get(), "beauty", nullptr, part.data()), LUMICUT_INVALID_ARGUMENT,
              "radiance, alpha");
}

TEST(Render, EveryChannelCanBeRead) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Render r(integrator(device, 50), s, frame());
  r.wait();
  auto info = make<lumicut_channel_info>();
  std::set<std::string> names;
  for (uint32_t c = 0; lumicut_get_channel_info(c, &info) == LUMICUT_OK; ++c) {
    EXPECT_TRUE(names.insert(info.name).second);
    EXPECT_STRNE(info.description, "");
    EXPECT_EQ(r.read(info.name).size(), 48u * 32u * info.components);
  }
  for (const char* name : {"radiance", "alpha", "depth", "normal", "albedo", "cut_size"})
    EXPECT_EQ(names.count(name), 1u);
  // The middle of the image looks at the back wall, 4.2 in front of the camera.
  EXPECT_NEAR(r.read("depth")[16 * 48 + 24], 4.2, 1e-3);
}

TEST(Render, OneThreadAndFourGiveTheSameBits) {
  const auto image = [](const std::string& id, int threads) {
    const api::Device device(threads);
    api::Scene s = scene(device);
    auto f = frame();
    f.samples = 2;
    return render(integrator(device, 300, id.c_str()), s, f);
  };
  for (const std::string& id : integrator_ids()) {
    SCOPED_TRACE(id);
    const auto one = image(id, 1);
    EXPECT_GT(mean(one), 0.01);
    EXPECT_EQ(one, image(id, 4));
    EXPECT_EQ(one, image(id, 3));
  }
}

// More work than any machine does while this program runs: without cancel the test would not end.
api::Integrator endless(const api::Device& device, const char* id = "exhaustive") {
  return integrator(device, static_cast<int>(lumicut::test::trimmed(200000)), id);
}
lumicut_render_desc endless_frame() {
  auto f = frame(1024, 1024);
  f.samples = 64;
  return f;
}

void wait_until(const api::Render& r, const std::function<bool(const lumicut_status&)>& reached) {
  for (;;) {
    const auto s = r.wait(1);
    if (reached(s)) return;
    ASSERT_EQ(s.state, LUMICUT_RUNNING);
  }
}

TEST(Cancel, AtTheStartInTheMiddleAndAtTheEndAndThenAgain) {
  const api::Device device(2);
  api::Scene s = scene(device);
  api::Integrator small = integrator(device);
  const auto expected = render(small, s);
  auto status = make<lumicut_status>();

  for (const std::string& id : integrator_ids()) {
    SCOPED_TRACE(id);
    api::Integrator i = endless(device, id.c_str());
    {  // at the start
      const api::Render r(i, s, endless_frame());
      r.cancel();
      EXPECT_CODE(lumicut_render_wait(r.get(), LUMICUT_FOREVER, &status), LUMICUT_CANCELLED, "cancelled");
      EXPECT_EQ(status.state, LUMICUT_STOPPED);
    }
    {  // while the lights are traced
      const api::Render r(i, s, endless_frame());
      wait_until(r, [](const auto& now) { return std::strcmp(now.phase, "") != 0; });
      r.cancel();
      EXPECT_EQ(lumicut_render_wait(r.get(), LUMICUT_FOREVER, &status), LUMICUT_CANCELLED);
    }
    {  // while pixels are rendered
      const api::Render r(i, s, endless_frame());
      wait_until(r, [](const auto& now) { return std::strcmp(now.phase, "render") == 0; });
      r.cancel();
      EXPECT_EQ(lumicut_render_wait(r.get(), LUMICUT_FOREVER, &status), LUMICUT_CANCELLED);
      // What was done stays readable.
      EXPECT_EQ(lumicut_render_wait(r.get(), 0, &status), LUMICUT_CANCELLED);
      float pixel = -1;
      auto rect = make<lumicut_tile>();
      rect.x1 = rect.y1 = 1;
      EXPECT_EQ(lumicut_render_read(r.get(), "alpha", &rect, &pixel), LUMICUT_OK);
      EXPECT_GE(pixel, 0);
    }
    i.set("vpls", "400");
    EXPECT_GT(mean(render(i, s)), 0.01) << "the integrator works on";
  }
  {  // after the end: nothing to cancel
    const api::Render r(small, s, frame());
    r.wait();
    r.cancel();
    EXPECT_EQ(lumicut_render_wait(r.get(), 0, &status), LUMICUT_OK);
    EXPECT_EQ(r.read("radiance"), expected);
  }
  small.cancel();
  s.cancel();
  EXPECT_EQ(render(small, s), expected) << "a cancel of idle objects is forgotten";
}

TEST(Cancel, ReleasingARunningRenderEndsIt) {
  const api::Device device(2);
  api::Scene s = scene(device);
  api::Integrator i = endless(device);
  for (int n = 0; n < 3; ++n) {
    const api::Render r(i, s, endless_frame());
    if (n > 0) std::this_thread::sleep_for(std::chrono::milliseconds(5 * n));
  }
  s.set_lights({lamp()});  // nobody uses the scene any more
  s.commit();
  i.set("vpls", "400");
  EXPECT_GT(mean(render(i, s)), 0.01);
}

TEST(Cancel, PrepareAndShadeEndFromAnotherThread) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device, 100000000);
  const auto cancelled_call = [&](auto call) {
    std::atomic<bool> over{false};
    lumicut_result result = LUMICUT_OK;
    std::thread worker([&] {
      result = call();
      over = true;
    });
    while (!over) {  // the call may not have begun when the first cancel comes
      i.cancel();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    worker.join();
    return result;
  };
  EXPECT_EQ(cancelled_call([&] { return lumicut_integrator_prepare(i.get(), s.get()); }), LUMICUT_CANCELLED);
  EXPECT_EQ(i.status().state, LUMICUT_STOPPED);
  std::vector<lumicut_point> points(20);
  for (auto& p : points) {
    p.position[1] = -1, p.position[2] = -1;
    p.normal[1] = p.geometric_normal[1] = p.to_viewer[1] = 1;
  }
  float radiance[60];
  EXPECT_EQ(lumicut_integrator_shade(i.get(), points.data(), 20, radiance), LUMICUT_INVALID_STATE)
      << "nothing was prepared";
  i.set("vpls", "500");
  i.prepare(s);
  points.resize(1000000, points[0]);
  std::vector<float> many(3 * points.size());
  EXPECT_EQ(
      cancelled_call([&] { return lumicut_integrator_shade(i.get(), points.data(), points.size(), many.data()); }),
      LUMICUT_CANCELLED);
  EXPECT_EQ(lumicut_integrator_shade(i.get(), points.data(), 20, radiance), LUMICUT_OK) << lumicut_last_error();
}

TEST(Render, ItsSceneAndIntegratorMayNotChangeMeanwhile) {
  const api::Device device(2);
  api::Scene s = scene(device);
  const api::Integrator i = endless(device), other = integrator(device, 50);
  const auto f = frame();
  {
    const api::Render r(i, s, endless_frame());
    auto m = materials();
    auto l = lamp();
    auto c = camera();
    auto mesh = geometry().mesh();
    lumicut_render second = nullptr;
    const char* why = "in use by a render";
    EXPECT_CODE(lumicut_scene_set_materials(s.get(), m.data(), m.size()), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_add_mesh(s.get(), &mesh, nullptr), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_update_mesh(s.get(), 0, nullptr, nullptr, nullptr), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_set_lights(s.get(), &l, 1), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_set_environment(s.get(), nullptr), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_set_camera(s.get(), &c), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_set_trace(s.get(), nullptr), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_scene_commit(s.get()), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_integrator_set(i.get(), "vpls", "5"), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_integrator_set_lights(i.get(), nullptr, 0), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_integrator_prepare(i.get(), s.get()), LUMICUT_INVALID_STATE, why);
    EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &second), LUMICUT_INVALID_STATE, why);
    EXPECT_EQ(second, nullptr);
    EXPECT_EQ(r.wait(0).state, LUMICUT_RUNNING);
    EXPECT_GT(mean(render(other, s)), 0.01) << "another integrator may read the same scene";
  }
  s.set_camera(camera());
  s.commit();
}

// Another call's work is not waited for, whose end nobody knows.
TEST(Render, OnOneThreadLeavesRoomForCallsThatPrepareOtherScenes) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 200000);
  const api::Render r(i, s, frame(2048, 2048));
  api::Scene other = scene(device);
  EXPECT_EQ(render(integrator(device, 10), other).size(), render(integrator(device, 10), s).size());
  EXPECT_EQ(r.wait(0).state, LUMICUT_RUNNING);
  r.cancel();
}

TEST(Render, WhatIsDoneCanBeReadWhileTheRestRuns) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 1500);
  const auto f = frame(128, 96);
  const auto final_image = render(i, s, f);
  const api::Render r(i, s, f);
  auto tile = make<lumicut_tile>();
  uint64_t tiles = 0, early = 0;
  for (bool running = true; running;) {
    running = r.wait(1).state == LUMICUT_RUNNING;
    while (r.next_tile(tile)) {
      ++tiles;
      early += running;
      std::vector<float> part(size_t{3} * (tile.x1 - tile.x0) * (tile.y1 - tile.y0));
      ASSERT_EQ(lumicut_render_read(r.get(), "radiance", &tile, part.data()), LUMICUT_OK);
      for (uint32_t y = tile.y0, k = 0; y < tile.y1; ++y)
        for (uint32_t x = 3 * tile.x0; x < 3 * tile.x1; ++x, ++k)
          ASSERT_EQ(part[k], final_image[size_t{y} * 3 * 128 + x]);
    }
    // The whole holds final pixels and zeros, never anything between.
    const auto now = r.read("radiance");
    for (size_t k = 0; k < now.size(); ++k) ASSERT_TRUE(now[k] == 0 || now[k] == final_image[k]);
  }
  EXPECT_EQ(tiles, 48u);
  EXPECT_GT(early, 0u) << "tiles come before the end";
}

TEST(Render, KeepsWhatItStandsOnAlive) {
  lumicut_render r = nullptr;
  {
    const api::Device device(2);
    const api::Scene s = scene(device);
    const api::Integrator i = integrator(device, 50);
    const auto f = frame();
    ASSERT_EQ(lumicut_render_start(i.get(), s.get(), &f, &r), LUMICUT_OK);
  }
  auto status = make<lumicut_status>();
  EXPECT_EQ(lumicut_render_wait(r, LUMICUT_FOREVER, &status), LUMICUT_OK) << lumicut_last_error();
  std::vector<float> image(48 * 32 * 3);
  EXPECT_EQ(lumicut_render_read(r, "radiance", nullptr, image.data()), LUMICUT_OK);
  EXPECT_GT(mean(image), 0.01);
  lumicut_release(r);
}

TEST(Render, ItsStatisticsAreJsonWithWhatIsPromised) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 300);
  const api::Render r(i, s, frame());
  r.wait();
  const auto stats = nlohmann::json::parse(r.stats_json());
  EXPECT_GT(stats.at("seconds").get<double>(), 0);
  double phases = 0;
  for (const auto& [name, seconds] : stats.at("phases").items()) phases += seconds.get<double>();
  EXPECT_TRUE(stats.at("phases").contains("light paths"));
  EXPECT_TRUE(stats.at("phases").contains("render"));
  EXPECT_LE(phases, stats.at("seconds").get<double>());
  // Their number follows from that of the light paths, which is fixed beforehand: four deviations.
  EXPECT_NEAR(stats.at("values").at("vpls").get<double>(), 300, 60);
  EXPECT_GT(stats.at("values").at("light_paths").get<double>(), 0);
  EXPECT_GT(stats.at("peak_bytes").get<double>(), 1e6);
  const auto& counters = stats.at("counters");
  EXPECT_GT(counters.at("points").get<double>(), 0);
  EXPECT_GT(counters.at("rays").get<double>(), counters.at("points").get<double>());
  for (const char* name : {"bounds", "clusters"}) EXPECT_TRUE(counters.contains(name));
  for (const auto& text : {device.stats_json(), s.stats_json(), i.stats_json()})
    EXPECT_TRUE(nlohmann::json::accept(text)) << text;
  EXPECT_EQ(nlohmann::json::parse(s.stats_json()).at("values").at("triangles").get<int>(), 34);
}

}  // namespace
