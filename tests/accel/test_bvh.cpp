// The eight-wide tree and its traversal; Embree and loops over all primitives are the oracles.
#include "accel/bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>

#include "core/error.h"
#include "core/parallel.h"
#include "tests/accel/meshes.h"
#include "tests/accel/trees.h"
#include "tests/support/backends.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

using test::boxes_of;
using test::expect_good_tree;
using test::Mesh;
using test::ray_of;
constexpr float kInf = std::numeric_limits<float>::infinity();

Mesh with_troubles(Mesh mesh) {
  mesh.add({0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f}, {0.5f, 0.5f, 0.5f});        // a point
  mesh.add({0.1f, 0.2f, 0.3f}, {0.5f, 0.6f, 0.7f}, {0.9f, 1.0f, 1.1f});        // a line
  mesh.add({-1e6f, -1e6f, -0.25f}, {2e6f, -1e6f, -0.25f}, {0, 3e6f, -0.25f});  // a plain, as wide as the world
  mesh.add({0.2f, 0.2f, 0.2f}, {0.8f, 0.2f, 0.2f}, {0.2f, 0.8f, 0.2f});        // axis-parallel
  return mesh;
}

TEST(AgglomerativeBvh, HitsEqualEmbreeOnAMillionRaysAScene) {
  SKIP_WITHOUT_EMBREE();
  const Mesh scenes[] = {with_troubles(test::random_soup(20000, 0.04f, 1)), with_troubles(test::sphere(60, 90))};
  for (const Mesh& mesh : scenes)
    for (const bool robust : {true, false}) {
      AccelOptions options;
      options.robust = robust;
      const AccelGeometry geometry{{mesh.view()}, {}, nullptr};
      const auto ours = make_accel("bvh", geometry, options), theirs = make_accel("embree", geometry, options);
      // A million a scene, in both modes; fewer where each instruction set takes its turn.
      const size_t kRays = std::getenv("LUMICUT_TEST_INSTRUCTION_SET") == nullptr ? test::trimmed(500000) : 50000,
                   kChunk = 5000;
      std::atomic<size_t> different{0}, hits{0}, occlusion_different{0};
      parallel_chunks(kRays, kChunk, [&](size_t begin, size_t end) {
        Rng rng(begin, Stage::test, robust);
        std::vector<RayHit> a;
        for (size_t i = begin; i < end; ++i) {
          RayHit r = test::random_ray(rng);
          if (i % 4 == 1)
            r.ray.dir = Vec3f{}, r.ray.dir[static_cast<int>(i / 4 % 3)] = i % 8 < 4 ? 1.0f : -1.0f;  // axis-parallel
          if (i % 4 == 2) {  // from a surface, with a range
            const uint32_t* t = &mesh.indices[3 * rng.next_below(static_cast<uint32_t>(mesh.indices.size() / 3))];
            r.ray.org = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0f;
            r.ray.tnear = 1e-3f, r.ray.tfar = 0.5f;
          }
          if (i % 16 == 3) r.ray.dir *= 1000.0f * rng.next_float();
          a.push_back(r);
        }
        std::vector<RayHit> b = a;
        std::vector<Ray> c, d;
        for (const RayHit& r : a) c.push_back(r.ray);
        d = c;
        ours->intersect(a), theirs->intersect(b);
        ours->occluded(c), theirs->occluded(d);
        for (size_t i = 0; i < a.size(); ++i) {
          hits += a[i].hit.geom == 0;
          // Coplanar and touching triangles tie; what must agree then is the distance, to a few roundings of the
          // coordinates.
          const float scale = length(a[i].ray.dir);
          const bool alike = a[i].hit.prim == b[i].hit.prim ||
                             (a[i].hit.geom == b[i].hit.geom &&
                              std::abs(a[i].ray.tfar - b[i].ray.tfar) * scale <= 4e-6f * (1 + a[i].ray.tfar * scale));
          different += !alike;
          occlusion_different += c[i].tfar != d[i].tfar;
          // Distances agree to a few roundings of the coordinates, more where the ray grazes; the troubled ones have no
          // plane.
          if (a[i].hit.geom == 0 && a[i].hit.prim == b[i].hit.prim && a[i].hit.prim + 4 < mesh.indices.size() / 3) {
            const Vec3f ng = a[i].hit.ng, dir = a[i].ray.dir;
            const float cosine = std::abs(dot(ng, dir)) / (length(ng) * length(dir)) + 1e-6f;
            EXPECT_NEAR(a[i].ray.tfar * scale, b[i].ray.tfar * scale, 3e-6f * (1 + a[i].ray.tfar * scale) / cosine);
            EXPECT_GT(dot(a[i].hit.ng, b[i].hit.ng), 0);
          }
        }
      });
      EXPECT_GT(hits.load(), kRays / 3);
      // Rays through an edge or within a plane may go either way: a few in a million.
      EXPECT_LE(different.load(), kRays / 20000) << robust;
      EXPECT_LE(occlusion_different.load(), kRays / 20000) << robust;
    }
}

TEST(AgglomerativeBvh, RobustMissesNothingOnAClosedMesh) {
  const Mesh mesh = test::sphere(50, 70);
  const auto accel = make_accel("bvh", {{mesh.view()}, {}, nullptr}, {});
  Rng rng(1, Stage::test);
  size_t missed = 0, passed = 0, bundles_missed = 0;
  for (int i = 0; i < 100000; ++i) {
    const Vec3f from = test::random_direction(rng) * (0.9f * rng.next_float());
    const uint32_t* t = &mesh.indices[3 * rng.next_below(static_cast<uint32_t>(mesh.indices.size() / 3))];
    const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]];
    // At corners, and anywhere on edges.
    const float w = i % 2 == 0 ? 0.0f : rng.next_float();
    const Vec3f target = a + (b - a) * w;
    RayHit r = ray_of(from, target - from);
    accel->intersect({&r, 1});
    missed += r.hit.geom != 0;
    Ray o = ray_of(from, target - from).ray;
    accel->occluded({&o, 1});
    passed += o.tfar != -kInf;
    if (i % 50 == 0) {
      float x[16], y[16], z[16];
      uint8_t out[16];
      for (int k = 0; k < 16; ++k) {
        const uint32_t* e =
            &mesh.indices[3 * ((rng.next_below(8) + static_cast<uint32_t>(t - mesh.indices.data()) / 3) %
                               (mesh.indices.size() / 3))];
        const Vec3f p = from + (mesh.positions[e[0]] - from) * 1.5f;
        x[k] = p.x, y[k] = p.y, z[k] = p.z;
      }
      accel->occluded_from_point({from, false}, x, y, z, 16, out);
      for (const uint8_t blocked : out) bundles_missed += blocked == 0;
    }
  }
  EXPECT_EQ(missed, 0u);
  EXPECT_EQ(passed, 0u);
  EXPECT_EQ(bundles_missed, 0u);
}

TEST(AgglomerativeBvh, BundlesAnswerAsSingleRaysDo) {
  const Mesh mesh = with_troubles(test::random_soup(5000, 0.08f, 2));
  for (const bool robust : {true, false})
    for (const bool instanced : {true, false}) {
      AccelGeometry geometry{{mesh.view()}, {}, nullptr};
      Transform t;
      t.m[0] = 2, t.m[3] = 0.5f;
      if (instanced) geometry.instances = {{0, {}}, {0, t}};
      AccelOptions options;
      options.robust = robust;
      const auto accel = make_accel("bvh", geometry, options);
      Rng rng(3, Stage::test);
      size_t different = 0, blocked = 0;
      for (int i = 0; i < 600; ++i) {
        const bool sun = i % 3 == 0;
        // Near each other, all around the light, or anywhere.
        const float spread = i % 4 == 0 ? 0.01f : (i % 4 == 1 ? 0.1f : 1.0f);
        const Vec3f light = sun ? test::random_direction(rng) : test::random_point(rng),
                    centre = test::random_point(rng);
        float x[70], y[70], z[70];
        uint8_t out[70];
        for (int k = 0; k < 70; ++k) {
          const Vec3f p = (i % 5 == 0 && !sun ? light : centre) + test::random_direction(rng) * spread;
          x[k] = p.x, y[k] = p.y, z[k] = p.z;
        }
        accel->occluded_from_point({light, sun}, x, y, z, 70, out);
        for (int k = 0; k < 70; ++k) {
          const Vec3f p{x[k], y[k], z[k]};
          Ray r = (sun ? ray_of(p, light) : ray_of(light, p - light, 0, 0x1.fffffep-1f)).ray;
          accel->occluded({&r, 1});
          different += (out[k] == 1) != (r.tfar == -kInf);
          blocked += out[k];
        }
      }
      EXPECT_GT(blocked, 5000u);
      EXPECT_LE(different, 4u);  // of 42000: products are summed in another order, and edges may go either way
    }
}

TEST(AgglomerativeBvh, AMillionCoincidentTrianglesBuildAndAreHit) {
  Mesh mesh;
  for (int i = 0; i < 3; ++i) mesh.positions.push_back({i == 1 ? 1.0f : 0.0f, i == 2 ? 1.0f : 0.0f, 1.0f});
  for (size_t i = 0; i < test::trimmed(1000000); ++i) mesh.indices.insert(mesh.indices.end(), {0, 1, 2});
  const auto accel = make_accel("bvh", {{mesh.view()}, {}, nullptr}, {});
  RayHit r = ray_of({0.2f, 0.2f, 0}, {0, 0, 1});
  accel->intersect({&r, 1});
  EXPECT_EQ(r.hit.geom, 0u);
  EXPECT_FLOAT_EQ(r.ray.tfar, 1.0f);
  Ray o = ray_of({0.2f, 0.2f, 0}, {0, 0, 1}).ray;
  accel->occluded({&o, 1});
  EXPECT_EQ(o.tfar, -kInf);
}

TEST(AgglomerativeBvh, DeepTreesAreTraversed) {
  Mesh mesh;
  float s = 1e-12f;  // to 1e12: products of three coordinates stay in range
  std::vector<float> sizes;
  for (int i = 0; i < 80; ++i, s *= 2.0f) {
    mesh.add({-s, -s, s}, {s, -s, s}, {0, s, s});
    sizes.push_back(s);
  }
  for (const char* builder : {"agglomerative", ""}) {
    AccelOptions options;
    options.builder = builder;
    const auto accel = make_accel("bvh", {{mesh.view()}, {}, nullptr}, options);
    for (size_t i = 0; i < sizes.size(); ++i) {
      RayHit r = ray_of({0, 0, sizes[i] * 0.75f}, {0, 0, 1});
      accel->intersect({&r, 1});
      EXPECT_EQ(r.hit.prim, i);
    }
  }
}

TEST(AgglomerativeBvh, InfoTellsTheTree) {
  const Mesh mesh = test::random_soup(1000, 0.1f, 4);
  const auto bvh = Bvh::from_geometry({{mesh.view()}, {}, nullptr}, {}, nullptr, true);
  const AccelInfo info = bvh->info();
  EXPECT_EQ(info.triangles, 1000u);
  EXPECT_EQ(info.nodes, 1999u);
  EXPECT_GT(info.bytes, 1000u * 36);
  EXPECT_GT(info.expected_cost, 1.0);
  EXPECT_DOUBLE_EQ(info.expected_cost, 0.5 * info.expected_boxes + info.expected_tris);
  expect_good_tree(bvh->tree(), boxes_of(mesh));
  EXPECT_EQ(info.bounds.lo, bvh->tree().nodes[0].lo);
  EXPECT_EQ(bvh->primitives().size(), 1000u);
}

TEST(AgglomerativeBvh, PrimitivesOfSeveralMeshesAreNumberedThrough) {
  const Mesh a = test::random_soup(10, 0.1f, 4), b = test::random_soup(5, 0.1f, 5);
  const auto bvh = Bvh::from_geometry({{a.view(), b.view()}, {}, nullptr}, {}, nullptr, true);
  std::vector<uint32_t> prims(bvh->primitives().begin(), bvh->primitives().end());
  std::sort(prims.begin(), prims.end());
  for (uint32_t i = 0; i < 15; ++i) EXPECT_EQ(prims[i], i);
}

// Arrays that a host has may begin at any float, and end where they end.
TEST(AgglomerativeBvh, PointsToOneLightMayLieAtAnyAddress) {
  const Mesh mesh = test::random_soup(300, 0.1f, 7);
  const auto bvh = make_accel("bvh", {{mesh.view()}, {}, nullptr}, {});
  Rng rng(5, Stage::test);
  for (const size_t n : {size_t{1}, size_t{3}, size_t{5}, size_t{63}, size_t{67}}) {
    std::vector<Vec3f> points;
    for (size_t i = 0; i < n; ++i) points.push_back(test::random_point(rng));
    std::vector<std::vector<uint8_t>> seen;
    for (size_t offset = 0; offset < 4; ++offset) {
      std::vector<float> x(offset), y(offset), z(offset);
      for (const Vec3f& p : points) x.push_back(p.x), y.push_back(p.y), z.push_back(p.z);
      std::vector<uint8_t> out(n);
      bvh->occluded_from_point({{0.5f, 0.5f, 0.5f}, false}, x.data() + offset, y.data() + offset, z.data() + offset, n,
                               out.data());
      seen.push_back(out);
    }
    for (const auto& out : seen) EXPECT_EQ(out, seen[0]) << n;
  }
}

TEST(AgglomerativeBvh, RaysHitBoxesThemselves) {
  const std::vector<Aabb> boxes{{{1, -1, -1}, {2, 1, 1}}, {{4, -1, -1}, {5, 1, 1}}};
  const auto bvh = Bvh::from_boxes(boxes, {});
  RayHit r = ray_of({0, 0.1f, 0.2f}, {2, 0, 0});
  bvh->intersect({&r, 1});
  EXPECT_EQ(r.hit.prim, 0u);
  EXPECT_EQ(r.hit.geom, 0u);
  EXPECT_FLOAT_EQ(r.ray.tfar, 0.5f);
  EXPECT_EQ(r.hit.ng, (Vec3f{-1, 0, 0}));
  r = ray_of({1.5f, 0.1f, 0.2f}, {1, 0, 0}, 0.125f);
  bvh->intersect({&r, 1});
  EXPECT_EQ(r.hit.prim, 0u);
  EXPECT_FLOAT_EQ(r.ray.tfar, 0.125f);  // solid
  r = ray_of({0, 3, 0}, {1, 0, 0});
  bvh->intersect({&r, 1});
  EXPECT_EQ(r.hit.geom, kNoId);
}

TEST(AgglomerativeBvh, BoxHitsEqualALoopOverAllBoxes) {
  const auto boxes = boxes_of(test::random_soup(2000, 0.05f, 6));
  const auto bvh = Bvh::from_boxes(boxes, {});
  Rng rng(7, Stage::test);
  size_t hits = 0, different = 0;
  for (int i = 0; i < 8000; ++i) {
    RayHit r = test::random_ray(rng);
    const Vec3f o = r.ray.org, d = r.ray.dir;
    float best = kInf;
    for (const Aabb& b : boxes) {
      float in = 0, out = kInf;
      for (int a = 0; a < 3; ++a) {
        const float t0 = (b.lo[a] - o[a]) / d[a], t1 = (b.hi[a] - o[a]) / d[a];
        in = std::max(in, std::min(t0, t1)), out = std::min(out, std::max(t0, t1));
      }
      if (in <= out) best = std::min(best, in);
    }
    Ray any = r.ray;
    bvh->intersect({&r, 1});
    bvh->occluded({&any, 1});
    hits += best < kInf;
    if ((r.hit.geom == 0) != (best < kInf) || (any.tfar == -kInf) != (best < kInf)) {
      ++different;  // grazing an edge
      continue;
    }
    if (best < kInf) {
      EXPECT_NEAR(r.ray.tfar, best, 1e-5f);
    }
  }
  EXPECT_GT(hits, 500u);
  EXPECT_LE(different, 5u);
  float x[3] = {0.9f, 0.1f, 5}, y[3] = {0.5f, 0.5f, 5}, z[3] = {0.5f, 0.5f, 6};
  uint8_t out[3];
  bvh->occluded_from_point({{5, 5, 5}, false}, x, y, z, 3, out);
  EXPECT_EQ(out[2], 0);
}

TEST(AgglomerativeBvh, BadBoxesAreNamed) {
  for (const Aabb& bad : {Aabb{{0, 0, 0}, {1, -1, 1}}, Aabb{{0, 0, 0}, {1, NAN, 1}}, Aabb{{0, 0, 0}, {1, kInf, 1}}}) {
    try {
      Bvh::from_boxes(std::vector<Aabb>{{{0, 0, 0}, {1, 1, 1}}, bad}, {});
      ADD_FAILURE();
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("box 1"), std::string::npos);
    }
  }
  EXPECT_EQ(Bvh::from_boxes({}, {})->info().triangles, 0u);
}

TEST(AgglomerativeBvh, ManyInstancesAgreeWithEmbree) {
  SKIP_WITHOUT_EMBREE();
  const Mesh a = test::random_soup(300, 0.2f, 8), b = test::sphere(10, 14);
  AccelGeometry geometry{{a.view(), b.view()}, {}, nullptr};
  geometry.meshes[1].mask = 2;
  Rng rng(9, Stage::test);
  for (uint32_t i = 0; i < 200; ++i) {
    InstanceView instance;
    instance.mesh = i % 2;
    const Frame frame(test::random_direction(rng));
    const Vec3f rows[3] = {frame.t * (0.2f + rng.next_float()), frame.b * (i % 3 ? 1.0f : -0.5f), frame.n};
    for (int row = 0; row < 3; ++row)
      for (int k = 0; k < 4; ++k) instance.to_world.m[4 * row + k] = k < 3 ? rows[row][k] : 20 * rng.next_float();
    geometry.instances.push_back(instance);
  }
  const auto ours = make_accel("bvh", geometry, {}), theirs = make_accel("embree", geometry, {});
  size_t different = 0, hits = 0;
  for (int i = 0; i < 50000; ++i) {
    const Vec3f org = test::random_point(rng) * 20.0f;
    RayHit r = ray_of(org, test::random_direction(rng));
    r.ray.mask = 1 + static_cast<uint32_t>(i) % 3;
    RayHit s = r;
    Ray o = r.ray;
    ours->intersect({&r, 1}), theirs->intersect({&s, 1}), ours->occluded({&o, 1});
    hits += r.hit.geom != kNoId;
    different += r.hit.geom != s.hit.geom || r.hit.prim != s.hit.prim || r.hit.inst != s.hit.inst ||
                 (o.tfar == -kInf) != (s.hit.geom != kNoId);
  }
  EXPECT_GT(hits, 10000u);
  EXPECT_LE(different, 10u);  // edges and ties
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(ours->info().bounds.lo[k], theirs->info().bounds.lo[k],
                0.5f);  // Embree bounds the box of the mesh, not its points
    EXPECT_LE(ours->info().bounds.hi[k], theirs->info().bounds.hi[k] + 1e-3f);
  }
}

}  // namespace
}  // namespace lumicut
