// Level 4: renders of many passes, their error, and going on after a stop.
#include <cmath>
#include <cstring>

#include "box_scene.h"

namespace {

using namespace box;

lumicut_render_desc passes_of(uint32_t n, uint32_t width = 48, uint32_t height = 36) {
  auto f = frame(width, height);
  f.passes = n;
  f.tile_size = 16;
  return f;
}

std::vector<uint8_t> checkpoint_of(const api::Render& r) {
  const void* data = nullptr;
  uint64_t size = 0;
  EXPECT_EQ(lumicut_render_checkpoint(r.get(), &data, &size), LUMICUT_OK);
  const auto* bytes = static_cast<const uint8_t*>(data);
  return {bytes, bytes + size};
}

struct Pictures {
  std::vector<float> radiance, error;
  bool operator==(const Pictures&) const = default;
};

Pictures pictures(const api::Integrator& i, const api::Scene& s, const lumicut_render_desc& f) {
  const api::Render r(i, s, f);
  r.wait();
  return {r.read("radiance"), r.read("error")};
}

TEST(Passes, AnImageOfManyPassesIsTheSameOnAnyNumberOfThreads) {
  const auto image = [](int threads) {
    const api::Device device(threads);
    const api::Scene s = scene(device);
    const api::Integrator i = integrator(device, 60);
    EXPECT_EQ(lumicut_integrator_set(i.get(), "compensate", "true"), LUMICUT_OK);
    return pictures(i, s, passes_of(3));
  };
  EXPECT_EQ(image(1), image(4));
}

TEST(Passes, ARenderThatGoesOnFromACheckpointIsTheUnbrokenOne) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  const Pictures unbroken = pictures(i, s, passes_of(5));
  auto first = passes_of(2);
  first.flags = LUMICUT_CHECKPOINTS;
  std::vector<uint8_t> bytes;
  {
    const api::Render r(i, s, first);
    r.wait();
    bytes = checkpoint_of(r);
  }
  ASSERT_FALSE(bytes.empty());
  auto rest = passes_of(5);
  rest.checkpoint = bytes.data(), rest.checkpoint_size = bytes.size();
  const api::Integrator fresh = integrator(device, 60);
  EXPECT_EQ(pictures(fresh, s, rest), unbroken);
}

TEST(Passes, ACheckpointOfAnythingElseIsRefusedByName) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  auto f = passes_of(2);
  f.flags = LUMICUT_CHECKPOINTS;
  std::vector<uint8_t> bytes;
  {
    const api::Render r(i, s, f);
    r.wait();
    bytes = checkpoint_of(r);
  }
  const auto refusal = [&](const std::vector<uint8_t>& given, uint32_t width) -> std::string {
    auto rest = passes_of(3, width);
    rest.checkpoint = given.data(), rest.checkpoint_size = given.size();
    try {
      const api::Render r(i, s, rest);
      r.wait();
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(bytes, 48), "");
  EXPECT_NE(refusal(bytes, 40).find("another scene, size"), std::string::npos);
  auto damaged = bytes;
  damaged[damaged.size() / 2] ^= 1;
  EXPECT_NE(refusal(damaged, 48).find("damaged"), std::string::npos);
  damaged = bytes;
  damaged.resize(bytes.size() - 5);
  EXPECT_NE(refusal(damaged, 48).find("cut short"), std::string::npos);
  EXPECT_NE(refusal({1, 2, 3}, 48).find("too short"), std::string::npos);
}

TEST(Passes, ATargetStopsWhenTheErrorIsReached) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  auto f = passes_of(0);
  f.target_error = 0.5f;
  const api::Render r(i, s, f);
  const auto status = r.wait();
  EXPECT_EQ(status.state, LUMICUT_DONE);
  EXPECT_GE(status.passes_done, 8u);
  EXPECT_LE(status.error, 0.5);
  EXPECT_GT(status.error, 0.0);
}

TEST(Passes, MorePassesTellTheErrorToMoreThanTheRootOfTheirNumber) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  ASSERT_EQ(lumicut_integrator_set(i.get(), "compensate", "true"), LUMICUT_OK);
  const auto error = [&](uint32_t n) {
    const api::Render r(i, s, passes_of(n));
    return r.wait().error;
  };
  // Halved by four times as many passes, within what Student's t at 8 and the chance of a quantile allow.
  EXPECT_NEAR(error(32) / error(8), 0.5, 0.15);
}

TEST(Passes, SecondsStopARenderThatHasNoOtherEnd) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  auto f = passes_of(0);
  f.max_seconds = 0.2f;
  const api::Render r(i, s, f);
  const auto status = r.wait();
  EXPECT_EQ(status.state, LUMICUT_DONE);
  EXPECT_GE(status.passes_done, 1u);
  EXPECT_EQ(status.passes_total, 0u);
}

TEST(Passes, OnlyTracedLightsAreCompensated) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  ASSERT_EQ(lumicut_integrator_set(i.get(), "compensate", "true"), LUMICUT_OK);
  lumicut_vpl light{};
  light.position[2] = 0.5f;
  light.intensity[0] = light.intensity[1] = light.intensity[2] = 1;
  ASSERT_EQ(lumicut_integrator_set_lights(i.get(), &light, 1), LUMICUT_OK);
  lumicut_render render = nullptr;
  const auto f = frame(8, 8);
  EXPECT_EQ(lumicut_render_start(i.get(), s.get(), &f, &render), LUMICUT_INVALID_ARGUMENT);
  EXPECT_NE(std::string(lumicut_last_error()).find("compensate"), std::string::npos);
}

TEST(Passes, ACheckpointIsShownOnlyWhereItIsKept) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  const api::Render r(i, s, passes_of(2));
  r.wait();
  const void* data = nullptr;
  uint64_t size = 0;
  EXPECT_EQ(lumicut_render_checkpoint(r.get(), &data, &size), LUMICUT_INVALID_STATE);
}

}  // namespace
