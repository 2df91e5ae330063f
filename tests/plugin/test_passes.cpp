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

namespace {
std::vector<uint8_t> checkpoint_of_two(const api::Integrator& i, const api::Scene& s) {
  auto f = passes_of(2);
  f.flags = LUMICUT_CHECKPOINTS;
  const api::Render r(i, s, f);
  r.wait();
  return checkpoint_of(r);
}
}  // namespace

TEST(Passes, ARenderThatGoesOnFromACheckpointIsTheUnbrokenOne) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  const Pictures unbroken = pictures(i, s, passes_of(5));
  const std::vector<uint8_t> bytes = checkpoint_of_two(i, s);
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
  const std::vector<uint8_t> bytes = checkpoint_of_two(i, s);
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

namespace {
// How a render of noisy iterations ends.
lumicut_status end_of(const lumicut_render_desc& frame, bool compensate = false) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  EXPECT_EQ(lumicut_integrator_set(i.get(), "compensate", compensate ? "true" : "false"), LUMICUT_OK);
  const api::Render r(i, s, frame);
  return r.wait();
}
}  // namespace

TEST(Passes, ATargetStopsWhenTheErrorIsReached) {
  auto f = passes_of(0);
  f.target_error = 0.5f;
  const auto status = end_of(f);
  EXPECT_EQ(status.state, LUMICUT_DONE);
  EXPECT_GE(status.passes_done, 8u);
  EXPECT_LE(status.error, 0.5);
  EXPECT_GT(status.error, 0.0);
}

TEST(Passes, MorePassesTellTheErrorToMoreThanTheRootOfTheirNumber) {
  const auto error = [](uint32_t n) { return end_of(passes_of(n), true).error; };
  // Halved by four times as many passes, within what Student's t at 8 and the chance of a quantile allow.
  EXPECT_NEAR(error(32) / error(8), 0.5, 0.15);
}

TEST(Passes, SecondsStopARenderThatHasNoOtherEnd) {
  auto f = passes_of(0);
  f.max_seconds = 0.2f;
  const auto status = end_of(f);
  EXPECT_EQ(status.state, LUMICUT_DONE);
  EXPECT_GE(status.passes_done, 1u);
  EXPECT_EQ(status.passes_total, 0u);
}

TEST(Passes, SpheresShrinkFromPassToPass) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device, 300);
  i.set("virtual_lights", "spheres");
  const auto mean_radius = [&](uint32_t n) {
    const api::Render r(i, s, passes_of(n, 16, 12));
    r.wait();
    double sum = 0, count = 0;
    for (const lumicut_vpl& l : i.lights())  // of the last pass
      if (l.kind == LUMICUT_VPL_SPHERE) sum += static_cast<double>(l.cos_outer), count += 1;
    return sum / count;
  };
  // The fourth root of 16; other lights lie a little otherwise.
  EXPECT_NEAR(mean_radius(16) / mean_radius(1), 0.5, 0.05);
}

namespace {
void expect_refused_with_the_hosts_lights(const char* parameter) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 60);
  ASSERT_EQ(lumicut_integrator_set(i.get(), parameter, "true"), LUMICUT_OK);
  lumicut_vpl light{};
  light.position[2] = 0.5f;
  light.intensity[0] = light.intensity[1] = light.intensity[2] = 1;
  ASSERT_EQ(lumicut_integrator_set_lights(i.get(), &light, 1), LUMICUT_OK);
  lumicut_render render = nullptr;
  const auto f = frame(8, 8);
  EXPECT_EQ(lumicut_render_start(i.get(), s.get(), &f, &render), LUMICUT_INVALID_ARGUMENT);
  EXPECT_NE(std::string(lumicut_last_error()).find(parameter), std::string::npos);
}
}  // namespace

TEST(Passes, OnlyTracedLightsAreCompensated) { expect_refused_with_the_hosts_lights("compensate"); }

TEST(Passes, ImportanceIsRefusedWithTheHostsLights) { expect_refused_with_the_hosts_lights("importance"); }

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

// The certificate: intervals from passes hold the path tracer's radiance as often as they say.
TEST(Passes, IntervalsHoldThePathTracersRadianceAsOftenAsTheySay) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  constexpr uint32_t kWidth = 16, kHeight = 12;
  const auto luminance = [](const std::vector<float>& rgb, size_t k) {
    return 0.2126 * rgb[3 * k] + 0.7152 * rgb[3 * k + 1] + 0.0722 * rgb[3 * k + 2];
  };
  api::Integrator tracer = integrator(device, 1, "path_tracer");
  tracer.set("samples", "40");
  auto f = frame(kWidth, kHeight);
  f.samples = 144;
  const api::Render reference(tracer, s, f);
  reference.wait();
  const auto truth = reference.read("radiance");
  double inside = 0, all = 0, sum = 0, truth_sum = 0;
  for (int seed = 1; seed <= 12; ++seed) {
    api::Integrator i = integrator(device, 150, "lightcuts");
    i.set("compensate", "true");
    i.set("seed", std::to_string(seed));
    const Pictures p = pictures(i, s, passes_of(12, kWidth, kHeight));
    for (size_t k = 0; k < p.error.size(); ++k) {
      const double value = luminance(p.radiance, k), right = luminance(truth, k);
      inside += std::abs(value - right) <= p.error[k];
      all += 1, sum += value, truth_sum += right;
    }
  }
  // The reference has 5,760 paths a pixel, a noise of about a tenth of the intervals'. Twelve sets of passes whose
  // pixels share lights: the share itself is known to about 1 %.
  EXPECT_GT(inside / all, 0.93);
  // More than they say, too, for the camera's samples of passes are stratified and counted as if they were not.
  EXPECT_LT(inside / all, 0.995);
  EXPECT_NEAR(sum / truth_sum, 1.0, 0.01);
}

}  // namespace
