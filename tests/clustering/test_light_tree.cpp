#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "clustering/light_tree.h"
#include "core/cone.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/clustering/random_lighting.h"

namespace lumicut {

namespace {

void check_tree(const LightTree& tree, const std::vector<Vpl>& lights) {
  ASSERT_EQ(tree.lights().size(), lights.size());
  std::set<uint32_t> seen;
  for (uint32_t root : tree.roots()) {
    std::vector<uint32_t> stack{root};
    while (!stack.empty()) {
      const uint32_t i = stack.back();
      stack.pop_back();
      const LightNode& node = tree.node(i);
      EXPECT_EQ(node.kind, tree.node(root).kind);
      if (node.leaf()) {
        EXPECT_TRUE(seen.insert(node.light).second);
        EXPECT_EQ(tree.lights()[node.light].kind, node.kind);
        continue;
      }
      const LightNode &a = tree.node(node.first_child), &b = tree.node(node.first_child + 1);
      EXPECT_TRUE(node.light == a.light || node.light == b.light) << "a node's representative is a child's";
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(node.intensity[k], a.intensity[k] + b.intensity[k], 1e-4f * node.intensity[k]);
        if (node.kind == VplKind::directional) continue;
        for (const LightNode* c : {&a, &b}) {
          EXPECT_LE(node.center[k] - node.half[k], c->center[k] - c->half[k] + 1e-6f);
          EXPECT_GE(node.center[k] + node.half[k], c->center[k] + c->half[k] - 1e-6f);
        }
      }
      stack.push_back(node.first_child);
      stack.push_back(node.first_child + 1);
    }
  }
  EXPECT_EQ(seen.size(), lights.size()) << "every light lies in one leaf";
}

}  // namespace

TEST(LightTree, HoldsEveryLightOnceInATreeOfItsKind) {
  const auto lights = test::mixed_lights(3000);
  for (auto method :
       {LightTree::Method::agglomerative, LightTree::Method::divisive_3d, LightTree::Method::divisive_6d}) {
    Progress progress;
    const LightTree tree = LightTree::build(lights, {method, 4.0f, 3, 1}, progress);
    EXPECT_EQ(tree.roots().size(), 4u);
    EXPECT_EQ(tree.slot_count(), 3u);
    check_tree(tree, lights);
  }
}

TEST(LightTree, ConeHoldsEveryDirectionBelow) {
  for (uint32_t trial = 0; trial < 300; ++trial) {
    Rng rng(trial, Stage::test, 2);
    const auto lights = test::random_cluster(rng, VplKind::oriented, 20);
    Progress progress;
    const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, 1}, progress);
    const LightNode& root = tree.node(tree.roots()[0]);
    for (const Vpl& v : lights) EXPECT_GE(dot(v.normal, root.axis), root.cos_half) << trial;
  }
}

TEST(LightTree, RepresentativesAreDrawnByIntensity) {
  std::vector<Vpl> lights(2);
  lights[0].intensity = {3, 3, 3}, lights[1].intensity = {1, 1, 1};
  lights[1].position = {1, 0, 0};
  int bright = 0;
  constexpr int kTrials = 4000;
  for (int seed = 0; seed < kTrials; ++seed) {
    Progress progress;
    const LightTree tree =
        LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, static_cast<uint64_t>(seed)}, progress);
    bright += tree.lights()[tree.node(tree.roots()[0]).light].intensity.x == 3.0f;
  }
  EXPECT_NEAR(static_cast<double>(bright) / kTrials, 0.75, 0.03);  // four standard deviations
}

TEST(LightTree, IsTheSameOnOneAndFourThreads) {
  const auto lights = test::mixed_lights(20000);
  std::vector<LightNode> first;
  for (int threads : {1, 4}) {
    Arena arena(threads);
    Progress progress;
    const LightTree tree = arena.run([&] {
      return LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, 1}, progress);
    });
    std::vector<LightNode> nodes;
    for (uint32_t i = 0; i < tree.node_count(); ++i) nodes.push_back(tree.node(i));
    if (first.empty()) first = nodes;
    ASSERT_EQ(nodes.size(), first.size());
    EXPECT_EQ(std::memcmp(nodes.data(), first.data(), nodes.size() * sizeof(LightNode)), 0);
  }
}

TEST(LightTree, DegenerateInputBuilds) {
  Progress progress;
  EXPECT_TRUE(LightTree::build({}, {}, progress).roots().empty());
  std::vector<Vpl> black(10);
  EXPECT_TRUE(LightTree::build(black, {}, progress).roots().empty()) << "lights of no intensity are left out";
  std::vector<Vpl> same(100000);
  for (Vpl& v : same) v.intensity = {1, 1, 1};
  for (auto method :
       {LightTree::Method::agglomerative, LightTree::Method::divisive_3d, LightTree::Method::divisive_6d}) {
    const LightTree tree = LightTree::build(same, {method, 1.0f, 1, 1}, progress);
    EXPECT_EQ(tree.node_count(), 2 * same.size() - 1);
    EXPECT_NEAR(tree.node(tree.roots()[0]).intensity.x, 100000.0f, 1.0f);
  }
}

TEST(LightTree, StopsWhenCancelled) {
  const auto lights = test::mixed_lights(5000);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(LightTree::build(lights, {}, progress), Error);
}

}  // namespace lumicut
