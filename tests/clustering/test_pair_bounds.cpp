#include <gtest/gtest.h>

#include "clustering/bounds.h"
#include "clustering/light_kernel.h"
#include "clustering/pair_bounds.h"
#include "core/aabb.h"
#include "tests/clustering/random_lighting.h"

namespace lumicut {

namespace {

// Points gathered around a place and a facing, from tight to everywhere.
ShadePoints point_cluster(Rng& rng, size_t n, bool glossy) {
  const Vec3f center = test::random_point(rng, 1.5f), facing = test::random_direction(rng),
              shine = test::random_direction(rng);
  const float spread = std::pow(10.0f, -3.0f * rng.next_float()),
              turn = std::pow(10.0f, 0.5f - 3.0f * rng.next_float());
  ShadePoints points;
  for (size_t i = 0; i < n; ++i) {
    SurfacePoint p = test::random_surface(rng, 1.0f, glossy);
    p.position = center + p.position * spread;
    p.normal = normalize(facing + test::random_direction(rng) * turn);
    p.mirror = normalize(shine + test::random_direction(rng) * turn);
    // GGX's points are seen from above their surface.
    if (const float c = dot(p.normal, p.mirror); p.lobe != kCosineLobe && c < 0.01f)
      p.mirror = normalize(p.mirror + p.normal * (0.011f - c));
    points.push(p);
  }
  points.finish();
  return points;
}

}  // namespace

TEST(PairBounds, AMillionRandomPairsOfEachKindOfLightNeverPassTheBoundOfTheirClusters) {
  uint64_t pairs = 0, plain = 0, tight = 0, zero_bounds = 0;
  for (uint32_t trial = 0; pairs < 1200000 * kVplKinds; ++trial) {
    Rng rng(trial, Stage::test, 11);
    const auto kind = static_cast<VplKind>(trial % kVplKinds);
    std::vector<Vpl> lights = test::random_cluster(rng, kind, 2 + rng.next_below(24));
    const float clamp = rng.next_below(3) == 0 ? 0.0f : 0.2f;
    for (Vpl& v : lights) v.clamp2 = clamp * clamp * rng.next_float() * rng.next_float();
    const size_t used = 1 + rng.next_below(kLanes);
    const bool glossy = rng.next_below(2) == 0;
    PointNodes nodes;
    std::vector<ShadePoints> clusters;
    for (size_t lane = 0; lane < used; ++lane) {
      clusters.push_back(point_cluster(rng, 1 + rng.next_below(6), glossy));
      nodes.set(lane, clusters.back(), 0, clusters.back().size());
    }
    if (used < kLanes) nodes.pad(used);
    ASSERT_EQ(nodes.used, (1u << used) - 1);
    Progress progress;
    const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
    for (uint32_t n = 0; n < tree.node_count(); ++n) {
      const LightNode& node = tree.node(n);
      float bounds[kLanes], distances2[kLanes];
      pair_bounds(node, nodes, bounds);
      pair_distances2(node, nodes, distances2);
      for (const uint32_t l : test::lights_below(tree, n)) {
        const Vpl& light = tree.lights()[l];
        for (size_t lane = 0; lane < used; ++lane) {
          for (size_t i = 0; i < clusters[lane].size(); ++i) {
            const SurfacePoint p = clusters[lane].get(i);
            // The worst light takes all of the node's intensity, as a representative would.
            const float value = luminance(light_point(light, node.intensity, Falloff(test::random_profiles()), p));
            ASSERT_LE(value, bounds[lane]) << "trial " << trial << " node " << n << " lane " << lane << " kind "
                                           << static_cast<int>(kind) << " glossy " << glossy;
            if (kind != VplKind::directional) {
              const float least2 = kind == VplKind::sphere ? light.radius() * light.radius() : light.clamp2;
              // Rounding of positions of up to 4 units.
              ASSERT_LE(distances2[lane], std::max(least2, length2(light.position - p.position)) + 1e-5f);
            }
            const bool is_plain = !p.bent() && !p.grooved() && kind != VplKind::lobed;
            plain += is_plain;
            tight += is_plain && value > 0.8f * bounds[lane];
            zero_bounds += bounds[lane] == 0.0f;
            ++pairs;
          }
        }
      }
    }
  }
  // A bound of infinity would pass as well: it must also be near, and able to say "nothing arrives". Near where normals
  // are not bent and nothing is rough: it does not know how much of the light the others lose.
  EXPECT_GT(tight, plain / 50);
  EXPECT_GT(zero_bounds, pairs / 50);
}

TEST(PairBounds, OfSinglePointsAreThoseOfTheLightNode) {
  for (uint32_t trial = 0; trial < 400; ++trial) {
    Rng rng(trial, Stage::test, 12);
    const auto kind = static_cast<VplKind>(trial % 4);
    const ShadePoints points = test::random_points(rng, kLanes, 1.5f, false);
    PointNodes nodes;
    for (size_t lane = 0; lane < kLanes; ++lane) nodes.set(lane, points, lane, 1);
    PointBlock block;
    block.load(points, 0);
    Progress progress;
    std::vector<Vpl> lights = test::random_cluster(rng, kind, 9);
    for (Vpl& v : lights) v.clamp2 = 1.0f;
    const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
    float pair[kLanes], single[kLanes];
    pair_bounds(tree.node(tree.roots()[0]), nodes, pair);
    light_node_bounds(tree.node(tree.roots()[0]), block, single);
    // The cone of one direction is opened by 1e-5 of cosine against rounding, 0.0045 radians: of nine lights of
    // intensity 1 at distance 1, on surfaces of at most 0.3.
    for (size_t i = 0; i < kLanes; ++i) {
      EXPECT_GE(pair[i], 0.999f * single[i]);
      EXPECT_LE(pair[i], single[i] + 9 * 0.3f * 0.0045f) << trial;
    }
  }
}

}  // namespace lumicut
