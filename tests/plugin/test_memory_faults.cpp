// Memory runs out at the n-th allocation, for every n: no call aborts, each says LUMICUT_OUT_OF_MEMORY or succeeds, does
// what it should when it is called again with memory, and nothing leaks.
//
// LUMICUT_MEMORY_FAULTS=full tries every n (half an hour); else some of them, spread evenly.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "failing_memory.h"
#include "lumicut/lumicut.h"
#include "lumicut/lumicut_lights.h"
#include "lumicut/lumicut_state.h"
#include "tests/support/backends.h"

namespace {

// Written by a child process, read by its parent when the child has ended, however it did.
struct Report {
  long n;            // which allocation fails
  const char* call;  // and in which call; a literal, the same in both processes
  long failures;     // lives in which one failed
  char text[4096];   // what went wrong, a line each
};
Report* report = nullptr;
constexpr int kGoOn = 3;                // a child's exit code
constexpr unsigned kHangSeconds = 120;  // of one life, which takes milliseconds

__attribute__((format(printf, 1, 2))) void complain(const char* format, ...) {
  const size_t at = std::strlen(report->text);
  const int head =
      std::snprintf(report->text + at, sizeof(report->text) - at, "n = %ld, %s: ", report->n, report->call);
  const size_t from = at + static_cast<size_t>(head);
  if (from + 2 >= sizeof(report->text)) return;
  va_list list;
  va_start(list, format);
  const int body = std::vsnprintf(report->text + from, sizeof(report->text) - from - 1, format, list);
  va_end(list);
  const size_t end = from + static_cast<size_t>(body);
  if (end + 1 < sizeof(report->text)) std::strcpy(report->text + end, "\n");
}

template <typename T>
T make() {
  T t{};
  t.struct_size = sizeof(T);
  return t;
}

bool release_alone = false;  // memory is there for all other calls. How much a release takes depends on what runs then

// A call while memory may run out. Where it does, the same call is made again with memory, and must succeed.
template <typename Fn>
void call(const char* name, const Fn& fn) {
  report->call = name;
  lumicut_result result = LUMICUT_OK;
  if (release_alone) {
    result = fn();
  } else {
    const failing_memory::Scope scope;
    result = fn();
  }
  if (result == LUMICUT_OK) return;
  const std::string text = lumicut_last_error();
  const bool any = failing_memory::disarm() > 0;
  if (result != LUMICUT_OUT_OF_MEMORY || !any || text.empty()) complain("code %d (\"%s\")", result, text.c_str());
  const lumicut_result again = fn();
  if (again != LUMICUT_OK) complain("again, with memory: code %d (\"%s\")", again, lumicut_last_error());
}

// A handle that goes while memory may be out.
template <typename H>
struct Owned {
  Owned() = default;
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  ~Owned() { release(); }
  void release() {
    report->call = "release";
    const failing_memory::Scope scope;
    lumicut_release(std::exchange(handle, nullptr));
  }
  H handle = nullptr;
};

const float kPositions[] = {-2, 0, -2, -2, 0, 2, 2, 0, 2, 2, 0, -2, -2, 0, -2, 2, 0, -2, 2, 3, -2, -2, 3, -2};
const float kUvs[] = {0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 1, 0, 1, 1, 0, 1};
const uint32_t kIndices[] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
const uint32_t kMaterials[] = {0, 0, 1, 1};
const float kLamp[] = {-.5f, 2.5f, -.5f, .5f, 2.5f, -.5f, .5f, 2.5f, .5f, -.5f, 2.5f, .5f};
const uint32_t kLampIndices[] = {0, 1, 2, 0, 2, 3};
// Two of it: the scene has instances.
const float kTransforms[] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 0, 1, 0, -1, 0, 0, 1, 1};
constexpr uint32_t kSize = 12;

void fill(lumicut_scene scene) {
  std::vector<unsigned char> pixels(8 * 8 * 3, 200);
  auto texture = make<lumicut_texture>();
  texture.width = texture.height = 8, texture.channels = 3, texture.flags = LUMICUT_SRGB;
  texture.pixels = pixels.data();
  call("set_textures", [&] { return lumicut_scene_set_textures(scene, &texture, 1); });
  std::vector<lumicut_material> materials(3, make<lumicut_material>());
  for (auto& m : materials) m.diffuse[0] = m.diffuse[1] = m.diffuse[2] = .6f;
  materials[0].diffuse_texture = 1;
  materials[1].flags = LUMICUT_GGX, materials[1].roughness = .3f, materials[1].coat = .5f;
  materials[1].coat_roughness = .2f, materials[1].specular[0] = 1;
  materials[2].emission[0] = materials[2].emission[1] = 5;
  call("set_materials", [&] { return lumicut_scene_set_materials(scene, materials.data(), materials.size()); });
  auto mesh = make<lumicut_mesh>();
  mesh.positions = kPositions, mesh.uvs = kUvs, mesh.vertex_count = 8;
  mesh.indices = kIndices, mesh.materials = kMaterials, mesh.triangle_count = 4;
  uint32_t id = 0;
  call("add_mesh", [&] { return lumicut_scene_add_mesh(scene, &mesh, &id); });
  mesh = make<lumicut_mesh>();
  mesh.positions = kLamp, mesh.vertex_count = 4, mesh.indices = kLampIndices, mesh.triangle_count = 2;
  mesh.material = 2, mesh.transforms = kTransforms, mesh.transform_count = 2, mesh.group = 1;
  call("add_mesh (instances)", [&] { return lumicut_scene_add_mesh(scene, &mesh, &id); });
  call("update_mesh", [&] { return lumicut_scene_update_mesh(scene, id, kLamp, nullptr, kTransforms); });
  const float vertical[] = {0, 1, 2}, horizontal[] = {0}, values[] = {3, 2, 1};
  auto profile = make<lumicut_profile>();
  profile.vertical_count = 3, profile.horizontal_count = 1;
  profile.vertical = vertical, profile.horizontal = horizontal, profile.values = values;
  call("set_profiles", [&] { return lumicut_scene_set_profiles(scene, &profile, 1); });
  auto light = make<lumicut_light>();
  light.value = 3, light.color[0] = light.color[1] = light.color[2] = 1, light.position[1] = 2;
  light.profile = 1, light.direction[1] = -1;
  call("set_lights", [&] { return lumicut_scene_set_lights(scene, &light, 1); });
  auto environment = make<lumicut_environment>();
  environment.color[2] = .1f, environment.texture = 1;
  call("set_environment", [&] { return lumicut_scene_set_environment(scene, &environment); });
  auto camera = make<lumicut_camera>();
  camera.to_world[0] = camera.to_world[5] = camera.to_world[10] = 1;
  camera.to_world[7] = 1.2f, camera.to_world[11] = 4.5f, camera.fov_y = .8f;
  call("set_camera", [&] { return lumicut_scene_set_camera(scene, &camera); });
}

using Image = std::vector<float>;

// What every host does: describe, commit, prepare, render, read, and let all go.
Image lead_life(lumicut_device device, const char* id, const char* accel) {
  Image image(size_t{kSize} * kSize * 3), other(image.size());
  std::vector<lumicut_point> points(40);
  for (auto& p : points) p.normal[1] = p.geometric_normal[1] = p.to_viewer[1] = 1;
  std::vector<unsigned char> bytes(1 << 20);
  const bool virtual_lights = std::strcmp(id, "path_tracer") != 0;

  Owned<lumicut_scene> scene;
  auto scene_desc = make<lumicut_scene_desc>();
  scene_desc.accel = accel;
  call("scene_create", [&] { return lumicut_scene_create(device, &scene_desc, &scene.handle); });
  fill(scene.handle);
  call("commit", [&] { return lumicut_scene_commit(scene.handle); });

  Owned<lumicut_integrator> integrator;
  call("integrator_create", [&] { return lumicut_integrator_create(device, id, &integrator.handle); });
  if (virtual_lights) {
    call("integrator_set", [&] { return lumicut_integrator_set(integrator.handle, "vpls", "40"); });
    call("integrator_set", [&] { return lumicut_integrator_set(integrator.handle, "compensate", "true"); });
  }
  call("prepare", [&] { return lumicut_integrator_prepare(integrator.handle, scene.handle); });
  if (virtual_lights) {
    call("shade",
         [&] { return lumicut_integrator_shade(integrator.handle, points.data(), points.size(), other.data()); });
    const auto* state = static_cast<const lumicut_state_extension*>(lumicut_get_extension(LUMICUT_STATE_EXTENSION));
    uint64_t size = 0;
    bool has_state = true;
    call("save", [&] {
      size = bytes.size();
      const lumicut_result result = state->save(integrator.handle, bytes.data(), &size);
      has_state = result != LUMICUT_UNSUPPORTED;
      return has_state ? result : LUMICUT_OK;
    });
    if (has_state) call("load", [&] { return state->load(integrator.handle, scene.handle, bytes.data(), size); });
    const lumicut_vpl* lights = nullptr;
    uint64_t count = 0;
    call("get_lights", [&] { return lumicut_integrator_get_lights(integrator.handle, &lights, &count); });
    auto set = make<lumicut_vpl_set>();
    const auto* origins = static_cast<const lumicut_lights_extension*>(lumicut_get_extension(LUMICUT_LIGHTS_EXTENSION));
    call("get lights and origins", [&] { return origins->get(integrator.handle, &set); });
    Owned<lumicut_integrator> taker;
    call("integrator_create", [&] { return lumicut_integrator_create(device, id, &taker.handle); });
    call("set lights and origins", [&] { return origins->set(taker.handle, &set); });
  }

  Owned<lumicut_render> render;
  const auto run = [&](const lumicut_render_desc& d) {
    lumicut_release(std::exchange(render.handle, nullptr));
    const lumicut_result started = lumicut_render_start(integrator.handle, scene.handle, &d, &render.handle);
    return started != LUMICUT_OK ? started : lumicut_render_wait(render.handle, LUMICUT_FOREVER, nullptr);
  };
  auto desc = make<lumicut_render_desc>();
  desc.width = desc.height = kSize, desc.tile_size = 8;
  call("render", [&] { return run(desc); });
  desc.flags = LUMICUT_CHECKPOINTS, desc.passes = 2;
  if (virtual_lights) desc.flags |= LUMICUT_GROUPS;
  call("render of passes", [&] { return run(desc); });
  const void* data = nullptr;
  uint64_t size = 0;
  call("checkpoint", [&] { return lumicut_render_checkpoint(render.handle, &data, &size); });
  bytes.assign(static_cast<const unsigned char*>(data), static_cast<const unsigned char*>(data) + size);
  desc.passes = 3, desc.checkpoint = bytes.data(), desc.checkpoint_size = size;
  call("resumed render", [&] { return run(desc); });
  auto tile = make<lumicut_tile>();
  call("next_tile", [&] { return lumicut_render_next_tile(render.handle, &tile); });
  if (virtual_lights)
    call("read of a group", [&] { return lumicut_render_read(render.handle, "radiance.1", nullptr, other.data()); });
  call("read", [&] { return lumicut_render_read(render.handle, "radiance", nullptr, image.data()); });
  for (void* const handle : {static_cast<void*>(device), static_cast<void*>(scene.handle),
                             static_cast<void*>(integrator.handle), static_cast<void*>(render.handle)}) {
    auto status = make<lumicut_status>();
    if (handle != device) call("get_status", [&] { return lumicut_get_status(handle, &status); });
    call("stats_json", [&] { return lumicut_stats_json(handle) != nullptr ? LUMICUT_OK : LUMICUT_OUT_OF_MEMORY; });
  }
  return image;
}

// Rays against triangles alone, of either kind.
void trace_rays(lumicut_device device, const char* kind) {
  auto desc = make<lumicut_accel_desc>();
  desc.kind = kind, desc.positions = kPositions, desc.position_count = 8;
  desc.indices = kIndices, desc.triangle_count = 4;
  Owned<lumicut_accel> accel;
  call("accel_build", [&] { return lumicut_accel_build(device, &desc, &accel.handle); });
  auto info = make<lumicut_accel_info>();
  call("accel_get_info", [&] { return lumicut_accel_get_info(accel.handle, &info); });
  std::vector<lumicut_rayhit> rays(5000);  // more than one thread's share
  for (auto& r : rays) r.ray = {0, 1, 0, 0, 0, -1, 0, 0, 10, ~0u, 0, 0};
  call("accel_intersect", [&] { return lumicut_accel_intersect(accel.handle, rays.data(), rays.size()); });
  if (rays.back().hit.geom_id == LUMICUT_NO_ID) complain("a ray misses the floor");
}

lumicut_device new_device() {
  auto desc = make<lumicut_device_desc>();
  desc.abi_major = LUMICUT_ABI_MAJOR, desc.threads = 2;
  lumicut_device device = nullptr;
  call("device_create", [&] { return lumicut_device_create(&desc, &device); });
  return device;
}

bool full() {
  const char* const wanted = std::getenv("LUMICUT_MEMORY_FAULTS");
  return wanted != nullptr && std::strcmp(wanted, "full") == 0;
}

// Leads `life` on and on, with the allocation failing that comes `stride` behind the last, until none is left to fail.
// `apart`: only to the first that fails, because that changes what follows.
void lead_lives(const std::function<void()>& life, bool all_after, long tries, bool apart) {
  for (int i = 0; i < 3; ++i) life();  // what is made once is made now
  failing_memory::arm(LONG_MAX, false);
  life();
  const long stride = full() ? 1 : std::max(1L, failing_memory::seen() / tries);
  long failed = 1, lives = 0;
  const long blocks = failing_memory::live_blocks();
  for (; release_alone ? lives < tries : failed > 0; report->n += stride, ++lives) {
    alarm(kHangSeconds);
    failing_memory::arm(report->n, all_after);
    life();
    failed = failing_memory::disarm();
    report->failures += failed > 0 ? 1 : 0;
    if (apart && failed > 0) {
      life();
      report->n += stride;
      _exit(kGoOn);
    }
  }
  const long lost = failing_memory::live_blocks() - blocks;
  // Caches of oneTBB and of the C library come and go; Embree keeps the allocator of each thread that built: one a life,
  // and 248 whether 2,077 lives were led or 3,215.
  if (lost > lives + 400) complain("%ld blocks more than before %ld lives: some leak", lost, lives);
}

// The same in a process of its own: where that dies, this one tells at which allocation, and goes on behind it.
void sweep(const std::function<void()>& life, long tries, bool apart = false) {
  report =
      static_cast<Report*>(mmap(nullptr, sizeof(Report), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(report, MAP_FAILED);
  for (const bool all_after : {false, true}) {
    *report = {};
    int deaths = 0;
    for (bool ended = false; !ended && deaths < 10;) {
      std::fflush(nullptr);
      const pid_t child = fork();
      ASSERT_GE(child, 0);
      if (child == 0) {
        lead_lives(life, all_after, tries, apart);
        _exit(0);
      }
      int status = 0;
      ASSERT_EQ(waitpid(child, &status, 0), child);
      ended = WIFEXITED(status) && WEXITSTATUS(status) == 0;
      if (ended || (WIFEXITED(status) && WEXITSTATUS(status) == kGoOn)) continue;
      ++deaths;
      ADD_FAILURE() << (all_after ? "all allocations from number " : "allocation number ") << report->n
                    << " fails, and the process dies in " << report->call << " ("
                    << (WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "it exits") << ")";
      ++report->n;
    }
    EXPECT_STREQ(report->text, "") << (all_after ? "all from n on fail" : "one fails");
    EXPECT_TRUE(release_alone || report->failures > 0);
    if (full())
      std::printf("%s: %ld lives in which %s\n", testing::UnitTest::GetInstance()->current_test_info()->name(),
                  report->failures, all_after ? "all allocations from n on fail" : "allocation n alone fails");
  }
  munmap(report, sizeof(Report));
}

struct Case {
  std::string integrator, accel;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.integrator << " on " << c.accel; }
std::vector<Case> all_cases() {
  std::vector<Case> all;
  auto info = make<lumicut_integrator_info>();
  for (uint32_t i = 0; lumicut_get_integrator_info(i, &info) == LUMICUT_OK; ++i)
    for (const char* const accel : lumicut::test::backends()) all.push_back({info.id, accel});
  return all;
}

class MemoryFaults : public testing::TestWithParam<Case> {};

TEST_P(MemoryFaults, EveryCallOfALifeSaysSoAndStaysUsable) {
  lumicut_device device = nullptr;
  Image reference;
  sweep(
      [&] {
        if (device == nullptr) device = new_device();
        const Image image = lead_life(device, GetParam().integrator.c_str(), GetParam().accel.c_str());
        if (reference.empty()) reference = image;
        if (image != reference) complain("another image");
      },
      20);
}

INSTANTIATE_TEST_SUITE_P(All, MemoryFaults, testing::ValuesIn(all_cases()),
                         [](const auto& of) { return of.param.integrator + "_" + of.param.accel; });

TEST(MemoryFault, InAccelsAlone) {
  lumicut_device device = nullptr;
  sweep(
      [&] {
        if (device == nullptr) device = new_device();
        trace_rays(device, "agglomerative");
      },
      200);
}

// Embree's builds go other ways after the first that fails.
TEST(MemoryFault, InEmbreeAlone) {
  SKIP_WITHOUT_EMBREE();
  for (const bool apart : {false, true}) {
    lumicut_device device = nullptr;
    sweep(
        [&] {
          if (device == nullptr) device = new_device();
          trace_rays(device, "embree");
        },
        apart ? 30 : 200, apart);
  }
}

TEST(MemoryFault, OfADevice) {
  sweep(
      [] {
        Owned<lumicut_device> device;
        device.handle = new_device();
        trace_rays(device.handle, "agglomerative");
      },
      200);
}

TEST(MemoryFault, InTheReleaseOfARunningRender) {
  release_alone = true;
  lumicut_device device = nullptr;
  sweep(
      [&] {
        if (device == nullptr) device = new_device();
        lumicut_scene scene = nullptr;
        call("scene_create", [&] { return lumicut_scene_create(device, nullptr, &scene); });
        fill(scene);
        call("commit", [&] { return lumicut_scene_commit(scene); });
        lumicut_integrator integrator = nullptr;
        call("integrator_create", [&] { return lumicut_integrator_create(device, "lightcuts", &integrator); });
        auto desc = make<lumicut_render_desc>();
        desc.width = desc.height = kSize, desc.passes = 1000000;
        Owned<lumicut_render> render;
        call("render_start", [&] { return lumicut_render_start(integrator, scene, &desc, &render.handle); });
        lumicut_render_wait(render.handle, 2, nullptr);
        lumicut_release(integrator), lumicut_release(scene);
      },
      20);
  release_alone = false;
}

}  // namespace
