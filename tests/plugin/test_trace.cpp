// A host that traces rays itself.
#include <atomic>

#include "box_scene.h"
#include "brute_force.h"

namespace {

using namespace box;

struct Host {
  Geometry geometry = box::geometry();
  std::vector<std::array<float, 3>> offsets{{0, 0, 0}};  // instances
  bool instanced = false;
  std::atomic<uint64_t> largest{0}, rays{0};

  void saw(uint64_t count) {
    rays += count;
    uint64_t before = largest;
    while (before < count && !largest.compare_exchange_weak(before, count)) {
    }
  }
  lumicut_trace trace(uint32_t batch = 0) {
    auto t = make<lumicut_trace>();
    t.batch = batch;
    t.user = this;
    t.intersect = [](void* user, lumicut_rayhit* r, uint64_t count) {
      auto& h = *static_cast<Host*>(user);
      h.saw(count);
      for (uint64_t i = 0; i < count; ++i) h.closest(r[i]);
    };
    t.occluded = [](void* user, lumicut_ray* r, uint64_t count) {
      auto& h = *static_cast<Host*>(user);
      h.saw(count);
      for (uint64_t i = 0; i < count; ++i) {
        lumicut_rayhit both{r[i], {}};
        both.hit.geom_id = LUMICUT_NO_ID;
        h.closest(both);
        if (both.hit.geom_id != LUMICUT_NO_ID) r[i].tfar = -INFINITY;
      }
    };
    return t;
  }
  void closest(lumicut_rayhit& r) const {
    for (uint32_t i = 0; i < offsets.size(); ++i)
      brute_force::intersect(geometry, r, {offsets[i][0], offsets[i][1], offsets[i][2]}, 0,
                             instanced ? i : LUMICUT_NO_ID);
  }
};

// Shares of pixels that differ by more than one percent of the mean: at edges, where two tracers may round differently.
double differing(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  const double limit = 0.01 * mean(a);
  size_t n = 0;
  for (size_t i = 0; i < a.size(); ++i) n += std::abs(a[i] - b[i]) > limit;
  return static_cast<double>(n) / static_cast<double>(a.size());
}

TEST(HostTrace, GivesTheImageOfTheLibrarysOwnTracer) {
  const api::Device device(2);
  api::Scene s = scene(device);
  // Light paths part where two tracers round differently, so both get the same lights.
  const api::Integrator own = integrator(device, 200).set("clamp_distance", "0.1");
  const auto expected = render(own, s);

  Host host;
  s.set_trace(host.trace());
  s.commit();
  api::Integrator theirs = integrator(device, 200).set("clamp_distance", "0.1");
  theirs.set_lights(own.lights());
  const auto image = render(theirs, s);
  EXPECT_GT(mean(image), 0.01);
  EXPECT_LT(differing(expected, image), 0.01);
  EXPECT_GT(host.rays, 48u * 32u * 50u);

  s.clear_trace();
  s.commit();
  const uint64_t rays = host.rays;
  EXPECT_EQ(render(own, s), expected);
  EXPECT_EQ(host.rays, rays);
}

TEST(HostTrace, InstancesAreCountedByMesh) {
  const float transforms[24] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 2.5f, 0, 1, 0, 0, 0, 0, 1, 0};
  const api::Device device(2);
  api::Scene s(device);
  s.set_materials(materials());
  const Geometry g = geometry();
  auto mesh = g.mesh();
  mesh.transforms = transforms, mesh.transform_count = 2;
  s.add_mesh(mesh);
  s.set_lights({lamp()});
  auto c = camera();
  c.to_world[3] = 1.2f, c.to_world[11] = 3;
  s.set_camera(c);
  s.commit();
  const api::Integrator own = integrator(device, 100).set("clamp_distance", "0.1");
  const auto expected = render(own, s);

  Host host;
  host.offsets = {{0, 0, 0}, {2.5f, 0, 0}};
  host.instanced = true;
  s.set_trace(host.trace());
  s.commit();
  api::Integrator theirs = integrator(device, 100).set("clamp_distance", "0.1");
  theirs.set_lights(own.lights());
  EXPECT_LT(differing(expected, render(theirs, s)), 0.01);
}

TEST(HostTrace, CallbacksThatDoNothingMeanThatNothingIsHit) {
  const api::Device device(2);
  api::Scene s = scene(device, false);
  auto t = make<lumicut_trace>();
  t.intersect = [](void*, lumicut_rayhit*, uint64_t) {};
  t.occluded = [](void*, lumicut_ray*, uint64_t) {};
  s.set_trace(t);
  auto e = make<lumicut_environment>();
  e.color[0] = 0.25f, e.color[1] = 0.5f, e.color[2] = 1;
  s.set_environment(e);
  s.commit();
  const auto image = render(integrator(device, 50), s);
  for (size_t i = 0; i < image.size(); ++i) ASSERT_EQ(image[i], e.color[i % 3]);
}

TEST(HostTrace, BatchesAreNoLargerThanTheHostWants) {
  const api::Device device(2);
  api::Scene s = scene(device, false);
  Host host;
  s.set_trace(host.trace(100));
  s.commit();
  render(integrator(device, 20), s);
  EXPECT_LE(host.largest, 100u);
  EXPECT_GT(host.largest, 50u);
}

TEST(HostTrace, AnswersThatCannotBeFailTheRenderAndNotTheProcess) {
  const api::Device device(2);
  const struct {
    void (*intersect)(void*, lumicut_rayhit*, uint64_t);
    const char* text;
  } liars[] = {
      {[](void*, lumicut_rayhit* r, uint64_t n) {
         for (uint64_t i = 0; i < n; ++i) r[i].hit.geom_id = 7, r[i].hit.prim_id = 0, r[i].ray.tfar = 1;
       },
       "geom"},
      {[](void*, lumicut_rayhit* r, uint64_t n) {
         for (uint64_t i = 0; i < n; ++i) r[i].hit.geom_id = 0, r[i].hit.prim_id = 1u << 30, r[i].ray.tfar = 1;
       },
       "prim"},
      {[](void*, lumicut_rayhit* r, uint64_t n) {
         for (uint64_t i = 0; i < n; ++i)
           r[i].hit.geom_id = 0, r[i].hit.prim_id = 0, r[i].hit.inst_id = 5, r[i].ray.tfar = 1;
       },
       "inst_id 5"},
      {[](void*, lumicut_rayhit* r, uint64_t n) {
         for (uint64_t i = 0; i < n; ++i) r[i].hit.geom_id = 0, r[i].hit.prim_id = 0, r[i].ray.tfar = NAN;
       },
       "tfar"},
  };
  for (const auto& liar : liars) {
    api::Scene s = scene(device, false);
    auto t = make<lumicut_trace>();
    t.intersect = liar.intersect;
    t.occluded = [](void*, lumicut_ray*, uint64_t) {};
    s.set_trace(t);
    s.commit();
    const api::Integrator i = integrator(device, 50).set("clamp_distance", "0.1");
    const api::Render r(i, s, frame());
    auto status = make<lumicut_status>();
    EXPECT_CODE(lumicut_render_wait(r.get(), LUMICUT_FOREVER, &status), LUMICUT_INVALID_ARGUMENT, liar.text);
    EXPECT_EQ(status.state, LUMICUT_FAILED);
    // Scene and integrator are free again, and work once the host's tracer is gone.
    s.clear_trace();
    s.commit();
    EXPECT_GT(mean(render(i, s)), 0.01);
  }
}

}  // namespace
