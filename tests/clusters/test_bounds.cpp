#include <gtest/gtest.h>

#include "clusters/bounds.h"
#include "clusters/light_kernel.h"
#include "tests/clusters/random_lighting.h"

namespace lumicut {

TEST(Bounds, AMillionRandomPairsNeverPassTheBoundOfTheirCluster) {
  uint64_t pairs = 0, tight = 0, zero_bounds = 0;
  for (uint32_t trial = 0; pairs < 1200000; ++trial) {
    Rng rng(trial, Stage::test);
    const auto kind = static_cast<VplKind>(trial % 4);
    const bool glossy = rng.next_below(2) == 0;
    const std::vector<Vpl> lights = test::random_cluster(rng, kind, 2 + rng.next_below(40));
    const ShadePoints points = test::random_points(rng, kLanes, 1.5f, glossy);
    PointBlock block;
    block.load(points, 0);
    const float clamp = rng.next_below(3) == 0 ? 0.0f : 0.2f * rng.next_float();
    Progress progress;
    const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
    for (uint32_t n = 0; n < tree.node_count(); ++n) {
      const LightNode& node = tree.node(n);
      float bounds[kLanes];
      light_node_bounds(node, block, clamp * clamp, bounds);
      // Leaves below this node: the worst light takes all of the node's intensity, as a representative would.
      std::vector<uint32_t> stack{n};
      while (!stack.empty()) {
        const LightNode& below = tree.node(stack.back());
        stack.pop_back();
        if (!below.leaf()) {
          stack.push_back(below.first_child);
          stack.push_back(below.first_child + 1);
          continue;
        }
        for (size_t i = 0; i < kLanes; ++i) {
          const float value =
              luminance(light_point(tree.lights()[below.light], node.intensity, clamp * clamp, points.get(i)));
          ASSERT_LE(value, bounds[i]) << "trial " << trial << " node " << n << " point " << i << " kind "
                                      << static_cast<int>(kind) << " glossy " << glossy;
          tight += value > 0.9f * bounds[i];
          zero_bounds += bounds[i] == 0.0f;
          ++pairs;
        }
      }
    }
  }
  // A bound of infinity would pass as well: it must also be near, and able to say "nothing arrives".
  EXPECT_GT(tight, pairs / 20);
  EXPECT_GT(zero_bounds, pairs / 20);
}

TEST(Bounds, DoNotDependOnTheScaleOfTheScene) {
  for (uint32_t trial = 0; trial < 200; ++trial) {
    Rng rng(trial, Stage::test, 7);
    const auto kind = static_cast<VplKind>(trial % 4);
    std::vector<Vpl> lights = test::random_cluster(rng, kind, 8);
    ShadePoints points = test::random_points(rng, kLanes, 1.5f, true);
    float bounds[2][kLanes];
    for (int scaled = 0; scaled < 2; ++scaled) {
      const float s = scaled ? 1024.0f : 1.0f;  // a power of two: no rounding of its own
      if (scaled) {
        for (Vpl& v : lights)
          v.position = v.position * s,
          v.intensity = v.kind == VplKind::directional ? v.intensity : v.intensity * (s * s);
        for (auto& axis : points.position)
          for (float& x : axis) x *= s;
      }
      PointBlock block;
      block.load(points, 0);
      Progress progress;
      const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f * s, 1, 1}, progress);
      light_node_bounds(tree.node(tree.roots()[0]), block, 0.01f * s * s, bounds[scaled]);
    }
    for (size_t i = 0; i < kLanes; ++i) EXPECT_NEAR(bounds[1][i], bounds[0][i], 1e-4f * bounds[0][i]) << trial;
  }
}

}  // namespace lumicut
