// What every backend of Accel promises. Parameterised over the backends' names; "host" answers through callbacks that
// search all triangles.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <set>
#include <thread>

#include <tbb/task_scheduler_observer.h>

#include "accel/accel.h"
#include "accel/host_accel.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/accel/meshes.h"
#include "tests/support/backends.h"

namespace lumicut {
namespace {

using test::Mesh;
using test::ray_of;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Möller–Trumbore in double: the truth.
bool hit_triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& o, const Vec3f& d, double& t, double& u,
                  double& v) {
  const auto wide = [](const Vec3f& x) { return Vec3d{x.x, x.y, x.z}; };
  const Vec3d e1 = wide(b) - wide(a), e2 = wide(c) - wide(a), p = cross(wide(d), e2), s = wide(o) - wide(a),
              q = cross(s, e1);
  const double det = dot(e1, p);
  if (det == 0.0) return false;
  u = dot(s, p) / det, v = dot(wide(d), q) / det, t = dot(e2, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1;
}

// The vector that `t` takes to `v`.
Vec3f solved(const Transform& t, const Vec3f& v) {
  const Vec3f a = t.vector({1, 0, 0}), b = t.vector({0, 1, 0}), c = t.vector({0, 0, 1});
  const float det = dot(a, cross(b, c));
  return Vec3f{dot(v, cross(b, c)), dot(v, cross(c, a)), dot(v, cross(a, b))} * (1.0f / det);
}

// A host whose ray tracing is a loop over all triangles.
struct LoopHost {
  AccelGeometry geometry;

  template <typename Fn>
  void each(const Ray& r, Fn&& fn) const {
    const size_t count = geometry.instances.empty() ? geometry.meshes.size() : geometry.instances.size();
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t m = geometry.instances.empty() ? i : geometry.instances[i].mesh;
      const MeshView& mesh = geometry.meshes[m];
      if ((mesh.mask & r.mask) == 0) continue;
      for (uint32_t k = 0; k < mesh.triangle_count; ++k) {
        Vec3f p[3];
        for (int c = 0; c < 3; ++c) {
          p[c] = mesh.positions[mesh.indices[3 * k + c]];
          if (!geometry.instances.empty()) p[c] = geometry.instances[i].to_world.point(p[c]);
        }
        double t, u, v;
        if (!hit_triangle(p[0], p[1], p[2], r.org, r.dir, t, u, v) || !(t > r.tnear && t < r.tfar)) continue;
        if (mesh.has_cutout && geometry.filter != nullptr) {
          Vec3f local = r.dir;
          if (!geometry.instances.empty()) local = solved(geometry.instances[i].to_world, r.dir);
          const uint32_t inst = geometry.instances.empty() ? kNoId : i;
          if (geometry.filter->passes({m, inst, k, static_cast<float>(u), static_cast<float>(v), local})) continue;
        }
        fn(m, k, geometry.instances.empty() ? kNoId : i, t, u, v);
      }
    }
  }
  static void intersect(void* user, RayHit* rays, size_t n) {
    for (size_t i = 0; i < n; ++i)
      static_cast<LoopHost*>(user)->each(rays[i].ray,
                                         [&](uint32_t m, uint32_t k, uint32_t inst, double t, double u, double v) {
                                           if (!(t < rays[i].ray.tfar)) return;
                                           rays[i].ray.tfar = static_cast<float>(t);
                                           rays[i].hit = {{}, static_cast<float>(u), static_cast<float>(v), k, m, inst};
                                         });
  }
  static void occluded(void* user, Ray* rays, size_t n) {
    for (size_t i = 0; i < n; ++i) {
      bool any = false;
      static_cast<LoopHost*>(user)->each(rays[i], [&](auto...) { any = true; });
      if (any) rays[i].tfar = -kInf;
    }
  }
};

class Backends : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Accel> make(const AccelGeometry& geometry, bool robust = true) {
    if (GetParam() == "host") {
      host_.geometry = geometry;
      return make_host_accel({LoopHost::intersect, LoopHost::occluded, &host_}, geometry);
    }
    AccelOptions options;
    options.robust = robust;
    return make_accel(GetParam(), geometry, options);
  }
  LoopHost host_;
};

RayHit first(const Accel& accel, RayHit r) {
  accel.intersect({&r, 1});
  return r;
}
bool blocked(const Accel& accel, const RayHit& r) {
  Ray ray = r.ray;
  accel.occluded({&ray, 1});
  EXPECT_TRUE(ray.tfar == r.ray.tfar || ray.tfar == -kInf || std::isnan(r.ray.tfar));
  return ray.tfar == -kInf;
}

Mesh unit_triangle(float z) {
  Mesh mesh;
  mesh.add({0, 0, z}, {1, 0, z}, {0, 1, z});
  return mesh;
}

TEST_P(Backends, HitFieldsOfOneTriangleAreAsEmbreeDefinesThem) {
  const Mesh mesh = unit_triangle(2);
  const auto accel = make({{mesh.view()}, {}, nullptr});
  const RayHit r = first(*accel, ray_of({0.25f, 0.5f, 0}, {0, 0, 0.5f}));
  EXPECT_EQ(r.hit.geom, 0u);
  EXPECT_EQ(r.hit.prim, 0u);
  EXPECT_EQ(r.hit.inst, kNoId);
  EXPECT_NEAR(r.ray.tfar, 4, 1e-5);  // in units of the direction's length; a few roundings
  EXPECT_NEAR(r.hit.u, 0.25, 1e-6);
  EXPECT_NEAR(r.hit.v, 0.5, 1e-6);
  EXPECT_NEAR(r.hit.ng.x, 0, 1e-6);
  EXPECT_NEAR(r.hit.ng.y, 0, 1e-6);
  EXPECT_NEAR(r.hit.ng.z, 1, 1e-6);
}

TEST_P(Backends, RangeOfTheRayIsKept) {
  const Mesh mesh = unit_triangle(2);
  const auto accel = make({{mesh.view()}, {}, nullptr});
  const auto seen = [&](float tnear, float tfar) {
    const RayHit r = ray_of({0.2f, 0.2f, 0}, {0, 0, 1}, tnear, tfar);
    const bool hit = first(*accel, r).hit.geom == 0;
    EXPECT_EQ(hit, blocked(*accel, r));
    return hit;
  };
  EXPECT_TRUE(seen(1.9f, 2.1f));
  EXPECT_FALSE(seen(2.1f, kInf));
  EXPECT_FALSE(seen(0, 1.9f));
  EXPECT_FALSE(seen(-kInf, 1.9f));
  EXPECT_TRUE(seen(-1, kInf));
  EXPECT_FALSE(seen(3, 1));
}

TEST_P(Backends, RaysWithNaNOrInfinityHitNothing) {
  const Mesh mesh = test::random_soup(50, 1.0f, 1);
  const auto accel = make({{mesh.view()}, {}, nullptr});
  for (int field = 0; field < 8; ++field)
    for (const float bad : {kNaN, kInf, -kInf}) {
      if (field >= 6 && bad != kNaN) continue;  // an infinite range is a good one
      RayHit r = ray_of({0.5f, 0.5f, -5}, {0, 0, 1});
      float* fields[] = {&r.ray.org.x, &r.ray.org.y, &r.ray.org.z, &r.ray.dir.x,
                         &r.ray.dir.y, &r.ray.dir.z, &r.ray.tnear, &r.ray.tfar};
      *fields[field] = bad;
      EXPECT_EQ(first(*accel, r).hit.geom, kNoId) << field << " " << bad;
      EXPECT_FALSE(blocked(*accel, r)) << field << " " << bad;
    }
  EXPECT_EQ(first(*accel, ray_of({0.5f, 0.5f, 0.5f}, {0, 0, 0})).hit.geom, kNoId);
  const float px[2] = {kNaN, 0.5f}, py[2] = {0.5f, 0.5f}, pz[2] = {0.5f, 0.5f};
  uint8_t out[2] = {7, 7};
  accel->occluded_from_point({{0.5f, 0.5f, 0.5f}, false}, px, py, pz, 2, out);
  EXPECT_EQ(out[0], 0);
  EXPECT_EQ(out[1], 0);  // a point at the light
  accel->occluded_from_point({{kNaN, 0, 0}, true}, px, py, pz, 2, out);
  EXPECT_EQ(out[0], 0);
  EXPECT_EQ(out[1], 0);
}

// Embree as Debian builds it ends the process on such rays, in an instance's space too.
TEST_P(Backends, RaysOutOfRangeHitNothing) {
  if (GetParam() == "host") return;  // a host keeps its own rules
  const Mesh mesh = test::random_soup(50, 1.0f, 1), large = test::random_soup(20, 1e9f, 2);
  Transform small, flat;
  for (const int k : {0, 5, 10}) small.m[k] = 1e-9f, flat.m[k] = 1.0f;
  flat.m[10] = 1e-25f;  // as good as none: nothing to hit
  const AccelGeometry geometries[] = {{{mesh.view()}, {}, nullptr},
                                      {{mesh.view(), large.view()}, {{0, {}}, {1, small}, {0, flat}}, nullptr}};
  for (const AccelGeometry& geometry : geometries) {
    const auto accel = make(geometry);
    EXPECT_NE(first(*accel, ray_of({0.5f, 0.5f, -5}, {0, 0, 1})).hit.geom, kNoId);
    for (int field = 0; field < 9; ++field)
      for (const float huge : {2e18f, -2e18f, 1e19f, 3e38f, -3e38f}) {
        RayHit r = ray_of({0.5f, 0.5f, -5}, {0, 0, 1});
        float* fields[] = {&r.ray.org.x, &r.ray.org.y, &r.ray.org.z, &r.ray.dir.x, &r.ray.dir.y,
                           &r.ray.dir.z, &r.ray.tnear, &r.ray.tfar,  &r.ray.time};
        *fields[field] = huge;
        const bool hit = first(*accel, r).hit.geom != kNoId;
        EXPECT_EQ(blocked(*accel, r), hit) << field << " " << huge;
        EXPECT_FALSE(field < 6 && hit) << field << " " << huge;
        if (field >= 3) continue;
        // The same place as a light, as a point, and as a sun's direction.
        const float x[2] = {r.ray.org.x, 0.5f}, y[2] = {r.ray.org.y, 0.5f}, z[2] = {r.ray.org.z, 0.5f};
        uint8_t out[2] = {7, 7};
        accel->occluded_from_point({r.ray.org, false}, x + 1, y + 1, z + 1, 1, out);
        EXPECT_EQ(out[0], 0);
        accel->occluded_from_point({{0.5f, 0.5f, -5}, false}, x, y, z, 2, out);
        EXPECT_EQ(out[0], 0);
        accel->occluded_from_point({{0, 0, -1}, true}, x, y, z, 2, out);
        EXPECT_EQ(out[0], 0);
        accel->occluded_from_point({r.ray.org, true}, x + 1, y + 1, z + 1, 1, out);
        EXPECT_EQ(out[0], 0);
      }
  }
}

TEST_P(Backends, EmptyGeometryIsNeverHit) {
  Mesh none;
  const AccelGeometry geometries[] = {{}, {{none.view()}, {}, nullptr}, {{none.view()}, {{0, {}}}, nullptr}};
  for (const AccelGeometry& g : geometries) {
    const auto accel = make(g);
    EXPECT_EQ(first(*accel, ray_of({0, 0, 0}, {0, 0, 1})).hit.geom, kNoId);
    EXPECT_FALSE(blocked(*accel, ray_of({0, 0, 0}, {0, 0, 1})));
    EXPECT_TRUE(accel->info().bounds.empty());
    accel->intersect({});
    accel->occluded({});
    accel->occluded_from_point({}, nullptr, nullptr, nullptr, 0, nullptr);
  }
}

TEST_P(Backends, MaskHidesAMesh) {
  const Mesh front = unit_triangle(1), back = unit_triangle(2);
  AccelGeometry geometry{{front.view(), back.view()}, {}, nullptr};
  geometry.meshes[0].mask = 0b01;
  geometry.meshes[1].mask = 0b10;
  const auto accel = make(geometry);
  for (const auto& [mask, expected] : {std::pair{0b11u, 0u}, {0b01u, 0u}, {0b10u, 1u}, {0b100u, kNoId}}) {
    RayHit r = ray_of({0.2f, 0.2f, 0}, {0, 0, 1});
    r.ray.mask = mask;
    EXPECT_EQ(first(*accel, r).hit.geom, expected);
    EXPECT_EQ(blocked(*accel, r), expected != kNoId);
  }
}

// A hole where u < 1/2, on every triangle of mesh `mesh`.
struct HalfHole : HitFilter {
  bool passes(const CandidateHit& hit) const override { return hit.u < 0.5f; }
};

TEST_P(Backends, CutOutLetsTheRayThrough) {
  const Mesh front = unit_triangle(1), back = unit_triangle(2);
  const HalfHole filter;
  AccelGeometry geometry{{front.view(), back.view()}, {}, &filter};
  geometry.meshes[0].has_cutout = true;
  const auto accel = make(geometry);
  EXPECT_EQ(first(*accel, ray_of({0.2f, 0.2f, 0}, {0, 0, 1})).hit.geom, 1u);
  EXPECT_EQ(first(*accel, ray_of({0.7f, 0.2f, 0}, {0, 0, 1})).hit.geom, 0u);
  EXPECT_FALSE(blocked(*accel, ray_of({0.2f, 0.2f, 0}, {0, 0, 1}, 0, 1.5f)));
  EXPECT_TRUE(blocked(*accel, ray_of({0.2f, 0.2f, 0}, {0, 0, 1}, 0, 2.5f)));
  EXPECT_TRUE(blocked(*accel, ray_of({0.7f, 0.2f, 0}, {0, 0, 1}, 0, 1.5f)));
  const float px[2] = {0.2f, 0.7f}, py[2] = {0.2f, 0.2f}, pz[2] = {1.5f, 1.5f};
  uint8_t out[2] = {7, 7};
  accel->occluded_from_point({{0.45f, 0.2f, -1e5f}, false}, px, py, pz, 2, out);
  EXPECT_EQ(out[0], 0);
  EXPECT_EQ(out[1], 1);
}

// A hole for rays that go up in the mesh's own space.
struct HoleFromBelow : HitFilter {
  bool passes(const CandidateHit& hit) const override { return hit.dir.z > 0.0f; }
};

TEST_P(Backends, FiltersAreToldTheDirectionInTheMeshsSpace) {
  const Mesh mesh = unit_triangle(0);
  const HoleFromBelow filter;
  Transform over;
  over.m[10] = -1;  // what is up is down
  AccelGeometry geometry{{mesh.view()}, {{0, Transform{}}, {0, over}}, &filter};
  geometry.meshes[0].has_cutout = true;
  const auto accel = make(geometry);
  EXPECT_EQ(first(*accel, ray_of({0.2f, 0.2f, -1}, {0, 0, 1})).hit.inst, 1u);
  EXPECT_EQ(first(*accel, ray_of({0.2f, 0.2f, 1}, {0, 0, -1})).hit.inst, 0u);
  geometry.instances = {{0, Transform{}}};
  const auto one = make(geometry);
  EXPECT_EQ(first(*one, ray_of({0.2f, 0.2f, -1}, {0, 0, 1})).hit.geom, kNoId);
  EXPECT_TRUE(blocked(*one, ray_of({0.2f, 0.2f, 1}, {0, 0, -1})));
  EXPECT_FALSE(blocked(*one, ray_of({0.2f, 0.2f, -1}, {0, 0, 1})));
}

TEST_P(Backends, InstancesMoveMirrorAndScale) {
  const Mesh mesh = unit_triangle(0);
  Transform moved, mirrored, flat;
  moved.m[3] = 10;                                             // x
  mirrored.m[0] = -2, mirrored.m[3] = -5, mirrored.m[11] = 1;  // x' = -5 - 2x, z' = z + 1
  flat.m[0] = 0, flat.m[3] = 100;                              // no volume: never hit
  const auto accel = make({{mesh.view(), mesh.view()}, {{0, moved}, {1, mirrored}, {0, flat}}, nullptr});
  RayHit r = first(*accel, ray_of({10.2f, 0.2f, -1}, {0, 0, 1}));
  EXPECT_EQ(r.hit.inst, 0u);
  EXPECT_EQ(r.hit.geom, 0u);
  EXPECT_NEAR(r.ray.tfar, 1, 1e-6);
  r = first(*accel, ray_of({-5.5f, 0.5f, -1}, {0, 0, 1}));
  EXPECT_EQ(r.hit.inst, 1u);
  EXPECT_EQ(r.hit.geom, 1u);
  EXPECT_NEAR(r.ray.tfar, 2, 1e-6);
  EXPECT_NEAR(r.hit.u, 0.25, 1e-6);
  EXPECT_NEAR(r.hit.v, 0.5, 1e-6);
  EXPECT_NEAR(r.hit.ng.z, 1, 1e-6);  // in the space of the mesh
  EXPECT_EQ(first(*accel, ray_of({0.2f, 0.2f, -1}, {0, 0, 1})).hit.geom, kNoId);
  EXPECT_EQ(first(*accel, ray_of({100, 0.2f, -1}, {0, 0, 1})).hit.geom, kNoId);
  EXPECT_TRUE(blocked(*accel, ray_of({10.2f, 0.2f, -1}, {0, 0, 1})));
  EXPECT_FALSE(blocked(*accel, ray_of({10.2f, 0.2f, -1}, {0, 0, 1}, 0, 0.9f)));
}

// Turned, stretched and mirrored, and moved a little.
Transform random_transform(Rng& rng, float scale, bool mirrored) {
  const Frame frame(test::random_direction(rng));
  const Vec3f rows[3] = {frame.t * (0.7f * scale), frame.b * (1.3f * scale), frame.n * (mirrored ? -scale : scale)};
  Transform out;
  for (int row = 0; row < 3; ++row)
    for (int k = 0; k < 4; ++k) out.m[4 * row + k] = k < 3 ? rows[row][k] : rng.next_float();
  return out;
}

// Random soup, all features at once, against the loop over all triangles.
TEST_P(Backends, RandomRaysAgreeWithALoopOverAllTriangles) {
  const Mesh a = test::random_soup(60, 0.2f, 3), b = test::random_soup(40, 0.3f, 4), c = test::sphere(6, 8);
  const HalfHole filter;
  Rng rng(5, Stage::test);
  for (const bool instanced : {false, true}) {
    AccelGeometry geometry{{a.view(), b.view(), c.view()}, {}, &filter};
    geometry.meshes[0].mask = 1, geometry.meshes[1].mask = 2, geometry.meshes[1].has_cutout = true;
    if (instanced)
      for (uint32_t i = 0; i < 6; ++i) geometry.instances.push_back({i % 3, random_transform(rng, 1.0f, i % 2 != 0)});
    LoopHost truth{geometry};
    for (const bool robust : {true, false}) {
      const auto accel = make(geometry, robust);
      int hits = 0, differ = 0;
      const int n = 2000;
      for (int i = 0; i < n; ++i) {
        RayHit r = test::random_ray(rng, i % 3 ? kInf : 0.5f);
        r.ray.mask = static_cast<uint32_t>(i) % 4;
        RayHit expected = r;
        LoopHost::intersect(&truth, &expected, 1);
        const RayHit got = first(*accel, r);
        hits += expected.hit.geom != kNoId;
        const bool same =
            got.hit.geom == expected.hit.geom && got.hit.prim == expected.hit.prim && got.hit.inst == expected.hit.inst;
        // On an edge, a cut-out's rim or a tie the two may differ by rounding.
        if (!same || blocked(*accel, r) != (expected.hit.geom != kNoId)) {
          ++differ;
          continue;
        }
        if (same && got.hit.geom != kNoId) {
          EXPECT_NEAR(got.ray.tfar, expected.ray.tfar, 1e-4f);
        }
      }
      EXPECT_GT(hits, n / 10);
      EXPECT_LE(differ, n / 500);
    }
  }
}

// What a callee leaves uninitialised holds this afterwards. Packets that read such memory went on for ever.
__attribute__((noinline)) void fill_stack(uint8_t value) {
  volatile uint8_t memory[65536];
  for (volatile uint8_t& byte : memory) byte = value;
}

// Bundles of 1 to 333 points around each other, to a light or a sun, against single rays.
void expect_bundles_agree_with_single_rays(const Accel& accel, uint64_t seed, uint32_t mask = 0xffffffffu) {
  Rng rng(seed, Stage::test);
  for (const size_t n : {size_t{1}, size_t{7}, size_t{16}, size_t{17}, size_t{64}, size_t{100}, size_t{333}}) {
    for (const bool directional : {false, true}) {
      const Vec3f light = directional ? test::random_direction(rng) : test::random_point(rng);
      const Vec3f centre = test::random_point(rng);
      std::vector<float> px(n), py(n), pz(n);
      std::vector<uint8_t> out(n + 1, 9);
      for (size_t i = 0; i < n; ++i) {
        const Vec3f p = centre + test::random_direction(rng) * 0.2f;
        px[i] = p.x, py[i] = p.y, pz[i] = p.z;
      }
      fill_stack(n % 2 == 0 ? 0xff : 0x00);
      accel.occluded_from_point({light, directional, mask}, px.data(), py.data(), pz.data(), n, out.data());
      size_t differ = 0;
      for (size_t i = 0; i < n; ++i) {
        const Vec3f p{px[i], py[i], pz[i]};
        RayHit r = directional ? ray_of(p, light) : ray_of(light, p - light, 0, 1);
        r.ray.mask = mask;
        differ += blocked(accel, r) != (out[i] == 1);
        EXPECT_LE(out[i], 1);
      }
      EXPECT_LE(differ, n / 100);  // edges may round the other way
      EXPECT_EQ(out[n], 9);
    }
  }
}

TEST_P(Backends, ManyPointsToOneLightAgreeWithSingleRays) {
  const Mesh a = test::random_soup(500, 0.08f, 7);
  expect_bundles_agree_with_single_rays(*make({{a.view()}, {}, nullptr}), 8);
}

TEST_P(Backends, ManyPointsToOneLightAgreeWithSingleRaysOnInstances) {
  const Mesh a = test::random_soup(60, 0.2f, 7), b = test::random_soup(40, 0.1f, 9);
  for (uint64_t seed = 1; seed <= 14; ++seed) {
    Rng rng(seed, Stage::test);
    AccelGeometry geometry{{a.view(), b.view()}, {}, nullptr};
    for (uint32_t i = 0; i < 2 + seed % 5; ++i)
      geometry.instances.push_back({i % 2, random_transform(rng, 0.5f + rng.next_float(), i % 3 == 0)});
    for (const bool robust : {true, false}) expect_bundles_agree_with_single_rays(*make(geometry, robust), seed);
  }
}

TEST_P(Backends, ManyPointsToOneLightSeeMeshesByTheirMask) {
  const Mesh a = test::random_soup(300, 0.1f, 7), b = test::random_soup(300, 0.1f, 9),
             c = test::random_soup(90, 0.1f, 3);
  for (const uint32_t mask : {1u, 2u, 4u, 8u}) {
    AccelGeometry geometry{{a.view(), b.view(), c.view()}, {}, nullptr};
    geometry.meshes[0].mask = 1, geometry.meshes[1].mask = 2, geometry.meshes[2].mask = 2 | 4;
    for (const bool robust : {true, false}) expect_bundles_agree_with_single_rays(*make(geometry, robust), 8, mask);
  }
}

TEST_P(Backends, ManyPointsToOneLightAgreeWithSingleRaysThroughCutOuts) {
  const Mesh a = test::random_soup(200, 0.15f, 7);
  const HalfHole filter;
  AccelGeometry geometry{{a.view()}, {}, &filter};
  geometry.meshes[0].has_cutout = true;
  for (const bool robust : {true, false}) expect_bundles_agree_with_single_rays(*make(geometry, robust), 11);
}

TEST_P(Backends, BadGeometryIsNamed) {
  const auto message = [&](const AccelGeometry& g) -> std::string {
    try {
      make(g);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::invalid_argument);
      return e.what();
    }
    return "no error";
  };
  const Mesh good = unit_triangle(0);
  Mesh bad = good;
  bad.positions[1].y = kNaN;
  EXPECT_NE(message({{good.view(), bad.view()}, {}, nullptr}).find("mesh 1: position 1 is not finite: (1.000000, nan"),
            std::string::npos);
  bad = good;
  bad.indices[2] = 3;
  EXPECT_EQ(message({{bad.view()}, {}, nullptr}), "mesh 0: index 2 is 3, but there are 3 positions");
  EXPECT_EQ(message({{good.view()}, {{4, {}}}, nullptr}), "instance 0: mesh is 4, but there are 1 meshes");
  Transform t;
  t.m[5] = kInf;
  EXPECT_EQ(message({{good.view()}, {{0, t}}, nullptr}), "instance 0: to_world[5] is not finite: inf");
  MeshView null = good.view();
  null.indices = nullptr;
  EXPECT_EQ(message({{null}, {}, nullptr}), "mesh 0: has 1 triangles and no positions or indices");
}

TEST_P(Backends, TrianglesWithHugeCoordinatesAreLeftOutAndTheRestIsSeen) {
  if (GetParam() == "host") return;  // a host keeps its own rules
  Mesh mesh = unit_triangle(1);
  mesh.add({-3e38f, -3e38f, 2}, {3e38f, -3e38f, 2}, {0, 3e38f, 2});
  mesh.add({0, 0, 3}, {0, 0, 3}, {0, 0, 3});
  const auto accel = make({{mesh.view()}, {}, nullptr});
  EXPECT_EQ(first(*accel, ray_of({0.2f, 0.2f, 0}, {0, 0, 1})).hit.prim, 0u);
  EXPECT_EQ(first(*accel, ray_of({-5, 0.2f, 0}, {0, 0, 1})).hit.geom, kNoId);
}

INSTANTIATE_TEST_SUITE_P(All, Backends, testing::ValuesIn([] {
                           auto all = test::backends();
                           all.push_back("host");
                           return std::vector<std::string>(all.begin(), all.end());
                         }()),
                         [](const auto& backend) { return backend.param; });

TEST(MakeAccel, UnknownNameIsNamed) {
  try {
    make_accel("optix", {}, {});
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("'optix'"), std::string::npos);
  }
}

TEST(MakeAccel, EmbreeIsRefusedByNameWhereItIsNotBuiltIn) {
  if (test::kHasEmbree) GTEST_SKIP() << "this build has Embree";
  try {
    make_accel("embree", {}, {});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::unsupported);
    EXPECT_NE(std::string(e.what()).find("'embree' is not in this library"), std::string::npos);
  }
}

TEST(MakeAccel, CancelStopsTheBuild) {
  const Mesh mesh = test::random_soup(200000, 0.01f, 9);
  for (const char* name : test::backends()) {
    Progress progress;
    progress.cancel();
    EXPECT_THROW(make_accel(name, {{mesh.view()}, {}, nullptr}, {}, &progress), Error);
    // Also in the midst of it.
    Progress later;
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      later.cancel();
    });
    try {
      make_accel(name, {{mesh.view()}, {}, nullptr}, {}, &later);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::cancelled);
    }
    other.join();
  }
}

TEST(EmbreeBackend, BuildStaysInTheCallersArena) {
  SKIP_WITHOUT_EMBREE();
  const Mesh mesh = test::random_soup(100000, 0.01f, 9);
  std::atomic<int> inside{0}, most{0};
  struct Watch : tbb::task_scheduler_observer {
    Watch(tbb::task_arena& a, std::atomic<int>& i, std::atomic<int>& m)
        : tbb::task_scheduler_observer(a), in(i), top(m) {
      observe(true);
    }
    ~Watch() override { observe(false); }
    void on_scheduler_entry(bool) override {
      const int now = ++in;
      for (int old = top; old < now && !top.compare_exchange_weak(old, now);) {
      }
    }
    void on_scheduler_exit(bool) override { --in; }
    std::atomic<int>&in, &top;
  };
  tbb::task_arena arena(1);
  Watch watch(arena, inside, most);
  clock_t cpu = clock();
  const auto wall = std::chrono::steady_clock::now();
  arena.execute([&] { make_accel("embree", {{mesh.view()}, {}, nullptr}, {}); });
  const double used = static_cast<double>(clock() - cpu) / CLOCKS_PER_SEC;
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();
  EXPECT_LE(most.load(), 1);
  EXPECT_LT(used, 1.5 * took + 0.05);  // one thread's work; two would use twice the time
}

TEST(HostBackend, CallbackThatDoesNothingMeansNoHit) {
  const Mesh mesh = unit_triangle(1);
  const auto accel = make_host_accel({[](void*, RayHit*, size_t) {}, [](void*, Ray*, size_t) {}, nullptr},
                                     {{mesh.view()}, {}, nullptr});
  RayHit r = ray_of({0.2f, 0.2f, 0}, {0, 0, 1});
  r.hit.geom = 0;  // left over from before
  EXPECT_EQ(first(*accel, r).hit.geom, kNoId);
  EXPECT_FALSE(blocked(*accel, r));
}

TEST(HostBackend, WrongAnswersAreNamed) {
  const Mesh mesh = unit_triangle(1);
  struct Answer {
    Hit hit;
    float t;
  };
  const auto message = [&](Answer answer) -> std::string {
    const auto accel = make_host_accel({[](void* user, RayHit* r, size_t) {
                                          r->hit = static_cast<Answer*>(user)->hit;
                                          r->ray.tfar = static_cast<Answer*>(user)->t;
                                        },
                                        [](void*, Ray*, size_t) {}, &answer},
                                       {{mesh.view()}, {}, nullptr});
    try {
      first(*accel, ray_of({0.2f, 0.2f, 0}, {0, 0, 1}));
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_EQ(message({{{}, 0.2f, 0.2f, 0, 0, kNoId}, 1}), "no error");
  EXPECT_NE(message({{{}, 0.2f, 0.2f, 0, 3, kNoId}, 1}).find("hit.geom is 3"), std::string::npos);
  EXPECT_NE(message({{{}, 0.2f, 0.2f, 5, 0, kNoId}, 1}).find("hit.prim is 5"), std::string::npos);
  EXPECT_NE(message({{{}, 0.2f, 0.2f, 0, 0, 1}, 1}).find("hit.inst is 1"), std::string::npos);
  EXPECT_NE(message({{{}, 2.0f, 0.2f, 0, 0, kNoId}, 1}).find("hit.u + hit.v is 2"), std::string::npos);
  EXPECT_NE(message({{{}, 0.2f, 0.2f, 0, 0, kNoId}, -1}).find("ray.tfar is -1"), std::string::npos);
  EXPECT_NE(message({{{}, 0.2f, 0.2f, 0, 0, kNoId}, kNaN}).find("ray.tfar is nan"), std::string::npos);
  EXPECT_NE(message({{{}, kNaN, 0.2f, 0, 0, kNoId}, 1}).find("hit.u"), std::string::npos);
}

}  // namespace
}  // namespace lumicut
