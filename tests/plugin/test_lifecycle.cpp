// What a host does a thousand times over, and from several threads at once; and how much memory that takes.
#include <dirent.h>
#include <malloc.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "box_scene.h"
#include "lumicut/lumicut_state.h"
#include "tests/support/backends.h"

using namespace box;

namespace {

// A line of /proc/self/status, as it stands: kB, or a count.
long process_status(const std::string& key) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.rfind(key + ":", 0) == 0) return std::strtol(line.c_str() + key.size() + 1, nullptr, 10);
  return 0;
}

long open_files() {
  long count = 0;
  DIR* const dir = opendir("/proc/self/fd");
  while (dir != nullptr && readdir(dir) != nullptr) ++count;
  if (dir != nullptr) closedir(dir);
  return count;
}

// A point light whose table nobody had before.
void add_measured_lamp(const api::Scene& s, int of_its_own) {
  std::vector<float> vertical(20000), values(vertical.size(), 1.0f);
  for (size_t i = 0; i < vertical.size(); ++i) vertical[i] = 1e-4f * static_cast<float>(i);
  values[7] = 1.0f + static_cast<float>(of_its_own);
  const float horizontal = 0;
  auto profile = make<lumicut_profile>();
  profile.vertical_count = static_cast<uint32_t>(vertical.size()), profile.horizontal_count = 1;
  profile.vertical = vertical.data(), profile.horizontal = &horizontal, profile.values = values.data();
  api::check(lumicut_scene_set_profiles(s.get(), &profile, 1));
  auto light = make<lumicut_light>();
  light.color[0] = light.color[1] = light.color[2] = light.value = 1;
  light.direction[1] = -1, light.position[2] = -1, light.profile = 1;
  const lumicut_light both[] = {lamp(), light};
  api::check(lumicut_scene_set_lights(s.get(), both, 2));
}

void lead_life(int n) {
  const std::vector<std::string> ids = integrator_ids();
  const api::Device device(2);
  const api::Scene s(device, n % 2 == 0 ? lumicut::test::last_backend() : "agglomerative");
  lumicut_scene_set_materials(s.get(), materials().data(), 4);
  const Geometry g = geometry();
  const lumicut_mesh mesh = g.mesh();
  api::check(lumicut_scene_add_mesh(s.get(), &mesh, nullptr));
  add_measured_lamp(s, n);
  const lumicut_camera c = camera();
  api::check(lumicut_scene_set_camera(s.get(), &c));
  api::check(lumicut_scene_commit(s.get()));
  const std::string& id = ids[static_cast<size_t>(n) % ids.size()];
  api::Integrator i(device, id.c_str());
  if (has_virtual_lights(id)) i.set("vpls", "60");
  lumicut_render_desc d = frame(24, 16);
  d.passes = 2, d.flags = LUMICUT_CHECKPOINTS;
  const api::Render r(i, s, d);
  if (n % 7 == 0) return;  // released while it runs
  r.wait();
  EXPECT_GT(mean(r.read("radiance")), 0.0);
  const void* data = nullptr;
  uint64_t size = 0;
  api::check(lumicut_render_checkpoint(r.get(), &data, &size));
  EXPECT_GT(size, 0u);
}

// LUMICUT_LIFECYCLES: how many; else 120.
TEST(Lifecycle, LeavesNothingBehind) {
  const char* const wanted = std::getenv("LUMICUT_LIFECYCLES");
  const int lives = wanted != nullptr ? std::atoi(wanted) : 120, warm = 40;
  long memory = 0, threads = 0, files = 0;
  for (int n = 0; n < lives; ++n) {
    if (n == warm) memory = process_status("VmRSS"), threads = process_status("Threads"), files = open_files();
    lead_life(n);
  }
  const long grown = process_status("VmRSS") - memory;
  std::printf("%d lives: %ld kB, %ld threads, %ld files more than after %d\n", lives, grown,
              process_status("Threads") - threads, open_files() - files, warm);
  EXPECT_LE(process_status("Threads"), threads);
  EXPECT_LE(open_files(), files);
#ifndef LUMICUT_SANITIZED
  // The allocator's arenas settle at their own pace, but not with the number of lives: a profile that stays is 320 kB.
  EXPECT_LT(grown, 4000 + (lives - warm));
#endif
}

// Tables of 160 kB: 1000 that stay would be 160 MB.
TEST(Lifecycle, ProfilesGoWithTheirScene) {
  const api::Device device(1);
  constexpr int kScenes = 1000, kWarm = 50;
  long memory = 0;
  for (int n = 0; n < kScenes; ++n) {
    if (n == kWarm) memory = process_status("VmRSS");
    const api::Scene s(device);
    add_measured_lamp(s, n);
    api::check(lumicut_scene_commit(s.get()));
  }
  const long grown = process_status("VmRSS") - memory;
  std::printf("%ld kB more after %d scenes\n", grown, kScenes - kWarm);
#ifndef LUMICUT_SANITIZED
  EXPECT_LT(grown, 4000) << "25 tables";
#endif
}

// A light's `profile` is a number within its scene, and a virtual light's a name: neither finds another scene's table.
TEST(Lifecycle, ScenesWithProfilesOfTheSameNumberDoNotMix) {
  const api::Device device(1);
  const auto lit_by = [&](int table) {
    api::Scene s(device);
    add_measured_lamp(s, table);
    api::check(lumicut_scene_commit(s.get()));
    return s;
  };
  const auto lights_of = [&](const api::Scene& s) {
    api::Integrator i = integrator(device, 10);
    i.prepare(s);
    auto lights = i.lights();
    std::erase_if(lights, [](const lumicut_vpl& v) { return v.profile == 0; });
    return lights;
  };
  const api::Scene one = lit_by(1);
  const auto alone = lights_of(one);
  ASSERT_EQ(alone.size(), 1u);
  api::Integrator host = integrator(device, 10);
  {
    const api::Scene other = lit_by(2);
    EXPECT_NE(lights_of(other)[0].profile, alone[0].profile);
    const auto again = lights_of(one);
    EXPECT_EQ(std::memcmp(again.data(), alone.data(), alone.size() * sizeof(lumicut_vpl)), 0);
    host.set_lights(lights_of(other));
  }
  host.prepare(one);  // the lights hold what they name, though its scene is gone
  const auto theirs = host.lights();
  api::Integrator late = integrator(device, 10);
  late.set_lights(theirs);
  host = integrator(device, 10), late = integrator(device, 10);
  EXPECT_CODE(lumicut_integrator_set_lights(late.get(), theirs.data(), theirs.size()), LUMICUT_INVALID_ARGUMENT,
              "is no profile that a scene was given");
}

TEST(Lifecycle, StatusCancelAndReleaseMayComeFromAnyThread) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  for (int n = 0; n < 40; ++n) {
    api::Integrator i = integrator(device, 100);
    lumicut_render_desc d = frame(32, 32);
    d.passes = n % 2 == 0 ? 3 : 1000000, d.flags = LUMICUT_CHECKPOINTS;
    api::Render r(i, s, d);
    std::vector<std::thread> others;
    for (int t = 0; t < 3; ++t)
      others.emplace_back([handle = static_cast<api::Handle<lumicut_render>>(r), t, n] {
        for (int k = 0; k < 20; ++k) {
          const lumicut_status status = handle.status();
          EXPECT_LE(status.tiles_done, status.tiles_total);
          const api::Handle<lumicut_render> copy = handle;
          std::vector<float> image(size_t{32} * 32 * 3);
          EXPECT_EQ(lumicut_render_read(copy.get(), "radiance", nullptr, image.data()), LUMICUT_OK);
          const lumicut_result waited = lumicut_render_wait(copy.get(), 0, nullptr);
          EXPECT_TRUE(waited == LUMICUT_OK || waited == LUMICUT_CANCELLED) << lumicut_last_error();
          if (t == 0 && k == n % 20 && n % 2 == 1) copy.cancel();
        }
      });
    i = api::Integrator(device, "exhaustive");
    r = api::Render(api::Integrator(device, "path_tracer"), scene(device), frame(8, 8));  // the others hold the first
    for (std::thread& t : others) t.join();
  }
}

class PeakMemory : public testing::TestWithParam<lumicut_render_desc> {};

// Within a quarter: films and checkpoints are counted, tiles at work and what the allocator rounds up are not.
TEST_P(PeakMemory, OfARenderIsWhatItsStatisticsSay) {
#ifdef LUMICUT_SANITIZED
  GTEST_SKIP() << "sanitizers keep memory of their own";
#endif
  mallopt(M_MMAP_THRESHOLD, 128 << 10);  // what is freed is gone
  const api::Device device(2);
  const api::Scene s = scene(device);
  auto second = lamp();
  second.group = 3;
  const lumicut_light lamps[] = {lamp(), second};
  api::check(lumicut_scene_set_lights(s.get(), lamps, 2));
  api::check(lumicut_scene_commit(s.get()));
  const api::Integrator i = integrator(device, 1);
  render(i, s, frame(128, 128));
  malloc_trim(0);
  {
    std::ofstream peak("/proc/self/clear_refs");
    peak << 5 << std::flush;
    if (!peak) GTEST_SKIP() << "/proc/self/clear_refs cannot be written: no peak of one render alone";
  }
  const long before = process_status("VmRSS");
  lumicut_render_desc d = GetParam();
  const api::Render r(i, s, d);
  const void* data = nullptr;
  uint64_t size = 0;
  if ((d.flags & LUMICUT_CHECKPOINTS) != 0)
    while (size == 0 && lumicut_render_wait(r.get(), 5, nullptr) == LUMICUT_OK)
      api::check(lumicut_render_checkpoint(r.get(), &data, &size));  // the first, kept to the end
  r.wait();
  const double took = 1024.0 * static_cast<double>(process_status("VmHWM") - before);
  const double estimated = nlohmann::json::parse(r.stats_json())["values"]["estimated_bytes"];
  std::printf("%.0f MB of %.0f MB estimated\n", took / 1e6, estimated / 1e6);
  EXPECT_GT(estimated, took / 1.25);
  EXPECT_LT(estimated, took * 1.25);
}

lumicut_render_desc large_frame(uint32_t passes, uint32_t flags) {
  auto d = make<lumicut_render_desc>();
  d.width = 600, d.height = 400, d.passes = passes, d.flags = flags;
  return d;
}

INSTANTIATE_TEST_SUITE_P(Of, PeakMemory,
                         testing::Values(large_frame(1, 0), large_frame(1, LUMICUT_GROUPS), large_frame(2, 0),
                                         large_frame(2, LUMICUT_GROUPS), large_frame(2, LUMICUT_DENOISE),
                                         large_frame(3, LUMICUT_CHECKPOINTS),
                                         large_frame(3, LUMICUT_CHECKPOINTS | LUMICUT_DENOISE),
                                         large_frame(3, LUMICUT_CHECKPOINTS | LUMICUT_GROUPS)),
                         [](const auto& of) {
                           const lumicut_render_desc& d = of.param;
                           return std::to_string(d.passes) + "passes" +
                                  ((d.flags & LUMICUT_CHECKPOINTS) != 0 ? "_checkpoints" : "") +
                                  ((d.flags & LUMICUT_DENOISE) != 0 ? "_denoised" : "") +
                                  ((d.flags & LUMICUT_GROUPS) != 0 ? "_groups" : "");
                         });

TEST(PeakMemory, OfARenderBeyondTheMachinesIsRefusedWithWhatItNeeds) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 1);
  lumicut_render_desc d = frame(65536, 65536);
  d.tile_size = 64, d.passes = 2;
  lumicut_render r = nullptr;
  // 65536² pixels of two films of 76 bytes, and the mean's 48.
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &d, &r), LUMICUT_OUT_OF_MEMORY, "needs 863 GB");
}

}  // namespace
