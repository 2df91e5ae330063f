// No integrator goes on for ever, or for long after it was cancelled.
#include <gtest/gtest.h>

#include <ctime>

#include <thread>

#include "tests/support/backends.h"
#include "tests/support/render.h"

namespace lumicut {
namespace {

std::vector<const char*> ids() {
  std::vector<const char*> all;
  for (const IntegratorEntry& entry : integrators()) all.push_back(entry.id);
  return all;
}

// Parameters with which a point costs about as much as it can.
test::Settings heavy_settings(const std::string& id) {
  if (id == "lightcuts" || id == "multidimensional_lightcuts") return {{"error", "0"}};
  if (id == "illumination_cut") return {{"error", "0"}, {"visibility", "full"}};
  if (id == "stochastic_lightcuts") return {{"lights", "100000"}};
  if (id == "light_slice") return {{"columns", "3000"}, {"representatives", "4"}};
  if (id == "row_column_sampling") return {{"rows", "2000"}, {"columns", "3000"}};
  if (id == "path_tracer") return {{"samples", "100000"}};
  return {};
}

// Cancels when so many rays were traced, and counts those after it.
struct RayWatch {
  Progress* progress = nullptr;
  uint64_t cancel_at = 0;
  std::atomic<uint64_t> traced{0}, after{0};

  void count(uint64_t rays) {
    if (progress == nullptr) return;
    if (progress->cancelled()) after += rays;
    if ((traced += rays) >= cancel_at) progress->cancel();
  }
};

class WatchedAccel final : public Accel {
 public:
  WatchedAccel(const AccelGeometry& geometry, RayWatch& watch)
      : inner_(make_accel(kDefaultAccel, geometry, {})), watch_(watch) {}
  AccelInfo info() const override { return inner_->info(); }
  void intersect(std::span<RayHit> rays) const override {
    watch_.count(rays.size());
    inner_->intersect(rays);
  }
  void occluded(std::span<Ray> rays) const override {
    watch_.count(rays.size());
    inner_->occluded(rays);
  }
  void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz, size_t n,
                           uint8_t* out) const override {
    watch_.count(n);
    inner_->occluded_from_point(origin, px, py, pz, n, out);
  }

 private:
  std::unique_ptr<Accel> inner_;
  RayWatch& watch_;
};

class Cancelling : public testing::TestWithParam<const char*> {
 protected:
  // true: it ended by Error(cancelled). `frame` null: prepares and no more.
  static bool cancelled(const Scene& scene, const char* id, const VplSet& vpls, const test::Settings& settings,
                        const test::RenderOptions* frame, Progress& progress) {
    Preparation preparation = test::preparation_of(id, vpls, settings);
    Stats stats;
    Arena arena(2);
    try {
      if (frame == nullptr) {
        arena.run([&] { preparation.prepare(scene, nullptr, preparation.params, progress, stats); });
      } else {
        RenderLoop loop(preparation, scene, nullptr, test::frame_of(*frame), {}, {});
        arena.run([&] { loop.run(progress, stats, [](const Rect&) {}); });
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::cancelled) << error.what();
      return true;
    }
    return false;
  }
};

INSTANTIATE_TEST_SUITE_P(Registry, Cancelling, testing::ValuesIn(ids()),
                         [](const auto& entry) { return std::string(entry.param); });

TEST_P(Cancelling, FewRaysAreTracedAfterIt) {
  RayWatch watch;
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 10000);
  scene->set_trace([&](const AccelGeometry& geometry) { return std::make_unique<WatchedAccel>(geometry, watch); });
  Progress unseen;
  scene->commit(unseen);
  // Camera rays of one batch, the many samples that a coarse tile has; then what is shaded.
  struct Case {
    uint32_t samples;
    bool compensate;
    uint64_t cancel_at;
  };
  for (const auto& [samples, compensate, cancel_at] :
       {Case{256, false, 1}, Case{1, false, 5000}, Case{16, false, 200000}, Case{64, true, 1000000}}) {
    Progress progress;
    watch.progress = &progress, watch.cancel_at = cancel_at, watch.traced = 0, watch.after = 0;
    test::Settings settings = heavy_settings(GetParam());
    if (compensate) settings.insert(settings.end(), {{"compensate", "true"}, {"clamp_distance", "0.1"}});
    const test::RenderOptions frame{.samples = samples, .tile_size = 64};
    const bool stopped = cancelled(*scene, GetParam(), vpls, settings, &frame, progress);
    EXPECT_TRUE(stopped || watch.traced < cancel_at);
    // Two threads, each within some batches of rays. A million a second is slow: a tenth of a second.
    EXPECT_LT(watch.after, 200000u) << samples << " samples, cancelled at " << cancel_at;
  }
}

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// In processor time, which other work on the machine does not stretch.
TEST_P(Cancelling, EndsPreparingSoon) {
  const auto scene = test::make_room();
  Rng rng(1, Stage::test);
  VplSet vpls;
  for (int i = 0; i < 100000; ++i) {
    Vpl v;
    v.kind = VplKind::oriented;
    v.position = test::random_point(rng, 1.0f), v.normal = test::random_direction(rng);
    v.intensity = {1, 1, 1};
    vpls.lights.push_back(v);
  }
  for (const double moment : {0.005, 0.04, 0.2}) {
    Progress progress;
    std::atomic<bool> done{false};
    std::thread work([&] {
      cancelled(*scene, GetParam(), vpls, {}, nullptr, progress);
      done = true;
    });
    const double start = cpu_seconds();
    while (!done && cpu_seconds() - start < moment) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const double before = cpu_seconds();
    progress.cancel();
    work.join();
    // .2 s of each thread are promised; sanitizers and old processors take several times as long.
    EXPECT_LT(cpu_seconds() - before, 3.0) << "cancelled after " << moment << " s";
  }
}

// Meshes that are turned, stretched, mirrored and moved; a light and a sun.
std::unique_ptr<Scene> instanced_scene(uint64_t seed, const char* accel) {
  auto scene = std::make_unique<Scene>(Scene::Config{accel, true, ""});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Rng rng(seed, Stage::test);
  Mesh mesh;
  if (seed == 0) {
    test::add_quad(mesh, {-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, 0);
    Transform moved;
    moved.m[3] = 0.5f, moved.m[7] = 0.3f;
    mesh.instances = {Transform{}, moved};
  } else {
    for (int i = 0; i < 20; ++i)
      test::add_quad(mesh, test::random_point(rng, 1), test::random_point(rng, 1), test::random_point(rng, 1),
                     test::random_point(rng, 1), 0);
    for (uint64_t i = 0; i < 2 + seed % 4; ++i) {
      Transform t;
      for (int k = 0; k < 12; ++k) t.m[k] += 0.4f * (rng.next_float() - 0.5f);
      if (i % 3 == 2) t.m[0] = -t.m[0];
      mesh.instances.push_back(t);
    }
  }
  scene->add_mesh(std::move(mesh));
  Light lamp, sun;
  lamp.position = {0, 2, 0.5f}, lamp.value = {5, 5, 5};
  sun.type = LightType::sun, sun.direction = {0, -1, 0}, sun.value = {1, 1, 1};
  scene->set_lights(seed % 2 == 0 ? std::vector<Light>{lamp} : std::vector<Light>{lamp, sun});
  Camera camera;
  camera.position = {0, 2, 4};
  camera.right = {1, 0, 0}, camera.forward = normalize(Vec3f{0, -0.5f, -1});
  camera.up = cross(camera.right, camera.forward);
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

class InstancedScenes : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Registry, InstancedScenes, testing::ValuesIn(ids()),
                         [](const auto& entry) { return std::string(entry.param); });

TEST_P(InstancedScenes, EndOnEmbreeToo) {
  SKIP_WITHOUT_EMBREE();
  const auto mean = [&](const Scene& scene, const VplSet& vpls) {
    double sum = 0;
    for (const Rgb& c : test::render(scene, GetParam(), vpls, {}, {.width = 24, .height = 18}).radiance)
      sum += luminance(c);
    return sum;
  };
  for (uint64_t seed = 0; seed <= 14; ++seed) {
    const auto embree = instanced_scene(seed, "embree"), ours = instanced_scene(seed, "bvh");
    const VplSet vpls = test::lights_of(*ours, 60);
    // Triangles that meet at a ray's end may hide it or not, by rounding; sampling methods then draw otherwise. Noise of
    // 432 points.
    const double a = mean(*embree, vpls), b = mean(*ours, vpls);
    EXPECT_NEAR(a, b, 0.15 * b) << seed;
  }
}

// A room of metals from smooth to rough, some of them instances, under a light of 50 kW: one that is alone, or beside a
// light of 1 W and a strong sun through the open side. What is bright there is 10^4 times what is dim, and lobes are narrow.
std::unique_ptr<Scene> metal_room(const char* accel, bool more_lamps) {
  auto scene = std::make_unique<Scene>(Scene::Config{accel, true, ""});
  std::vector<Material> materials = {test::diffuse(0.7f, 0.7f, 0.7f)};
  for (int i = 1; i <= 9; ++i) {
    Material metal = test::diffuse(0.9f, 0.7f, 0.4f);
    metal.lobe = LobeModel::ggx;
    metal.specular = {1, 1, 1}, metal.metallic = 1.0f, metal.roughness = 0.1f * static_cast<float>(i);
    materials.push_back(metal);
  }
  scene->set_materials(std::move(materials));
  Mesh room;
  test::add_box(room, {-2, 0, -2}, {2, 3, 2}, 0, true);
  if (more_lamps) room.indices.resize(room.indices.size() - 6), room.triangle_materials.resize(room.indices.size() / 3);
  test::add_quad(room, {-2, 0.001f, 2}, {2, 0.001f, 2}, {2, 0.001f, -2}, {-2, 0.001f, -2}, 4);
  scene->add_mesh(std::move(room));
  Rng rng(5, Stage::test);
  for (uint32_t i = 1; i <= 9; ++i) {
    Mesh box;
    test::add_box(box, {-0.2f, -0.2f, -0.2f}, {0.2f, 0.2f, 0.2f}, i, false);
    for (int copy = 0; copy < 4; ++copy) {
      Transform t;
      for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) t.m[4 * row + column] += 0.4f * (rng.next_float() - 0.5f);
      const Vec3f at = test::random_point(rng, 1.6f);
      t.m[3] = at.x, t.m[7] = 1.5f + 0.7f * at.y, t.m[11] = at.z;
      box.instances.push_back(t);
    }
    scene->add_mesh(std::move(box));
  }
  constexpr float kSphere = 4.0f * 3.14159265f;
  Light strong, dim, sun;
  strong.position = {0.3f, 2.5f, 0.2f}, strong.value = Rgb{1, 1, 1} * (50000.0f / kSphere);
  dim.position = {-1.5f, 0.5f, 1.5f}, dim.value = Rgb{1, 1, 1} * (1.0f / kSphere);
  sun.type = LightType::sun, sun.direction = normalize(Vec3f{-1, -0.5f, 0.2f}), sun.value = {1000, 1000, 1000};
  scene->set_lights(more_lamps ? std::vector<Light>{strong, dim, sun} : std::vector<Light>{strong});
  Camera camera;
  camera.position = {0, 1.6f, 1.9f};
  camera.right = {1, 0, 0}, camera.forward = normalize(Vec3f{0, -0.1f, -1});
  camera.up = cross(camera.right, camera.forward);
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

class Work : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Registry, Work, testing::ValuesIn(ids()),
                         [](const auto& entry) { return std::string(entry.param); });

// Exhaustive sums each light at each point: one term and one ray. At worst, a method that clusters lights looks at all
// nodes of its tree, twice as many as lights, and sums all lights: four steps where exhaustive has two.
TEST_P(Work, IsAtMostTwiceThatOfSummingAllLights) {
  if (find_integrator(GetParam())->light_source != LightSource::virtual_lights)
    GTEST_SKIP() << "it has no virtual lights";
  for (const char* accel : test::backends())
    for (const bool more_lamps : {false, true}) {
      const auto scene = metal_room(accel, more_lamps);
      const VplSet vpls = test::lights_of(*scene, 2000);
      for (const bool heavy : {false, true}) {
        // Of the methods that sample, the heavy settings are a number of samples that the user asks for.
        const bool sampling = std::string(GetParam()) == "stochastic_lightcuts" ||
                              std::string(GetParam()) == "light_slice" ||
                              std::string(GetParam()) == "row_column_sampling";
        if (heavy && sampling) continue;
        const test::Settings settings = heavy ? heavy_settings(GetParam()) : test::Settings{};
        const Counters c = test::render(*scene, GetParam(), vpls, settings, {.width = 40, .height = 30}).counters;
        const double pairs = static_cast<double>(c.points) * static_cast<double>(vpls.lights.size());
        const double work = static_cast<double>(c.rays + c.bounds + c.clusters) / (2.0 * pairs);
        std::printf("%s, %s lamps, %s: %.4f of exhaustive's\n", accel, more_lamps ? "three" : "one",
                    heavy ? "no error" : "as it comes", work);
        EXPECT_GT(work, 0.0);
        EXPECT_LE(work, 2.0);
      }
    }
}

}  // namespace
}  // namespace lumicut
