// Builders of binary trees: tight boxes, the same tree on any number of threads, costs, depth.
#include "accel/bvh_build.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <string>

#include "accel/accel.h"
#include "accel/agglomerate.h"
#include "core/error.h"
#include "tests/accel/meshes.h"
#include "tests/accel/trees.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

using test::boxes_of;
using test::expect_good_tree;
using test::Mesh;
constexpr const char* kBuilders[] = {
    "agglomerative", "agglomerative-parallel",        "binned-agglomerative", "binned", "binned-longest",
    "sweep",         "binned-agglomerative+reinsert", "sweep+reinsert:50x4",  ""};

TEST(AgglomerativeBvh, EarlierNamesStillWork) {
  EXPECT_EQ(accel_kind_of("agglomerative"), accel_kind_of("bvh"));
  EXPECT_EQ(build_options_of("buckets").builder, build_options_of("binned-agglomerative").builder);
  EXPECT_EQ(build_options_of("parallel").builder, build_options_of("agglomerative-parallel").builder);
  EXPECT_EQ(build_options_of("buckets+reinsert:5x3").reinsert_passes, build_options_of("").reinsert_passes);
}

bool same(const Tree& a, const Tree& b) {
  if (a.prims != b.prims || a.nodes.size() != b.nodes.size()) return false;
  for (size_t i = 0; i < a.nodes.size(); ++i)
    if (!(a.nodes[i].lo == b.nodes[i].lo && a.nodes[i].hi == b.nodes[i].hi && a.nodes[i].first == b.nodes[i].first &&
          a.nodes[i].count == b.nodes[i].count))
      return false;
  return true;
}

TEST(BvhBuild, EveryBuilderHoldsEachPrimitiveOnceInTightBoxes) {
  for (const size_t n : {0u, 1u, 2u, 3u, 5u, 100u, 6000u}) {
    const auto boxes = boxes_of(test::random_soup(n, 0.1f, n + 1));
    for (const char* name : kBuilders) {
      SCOPED_TRACE(std::string(name) + " " + std::to_string(n));
      expect_good_tree(build_tree(boxes, build_options_of(name)), boxes);
    }
  }
}

TEST(BvhBuild, TreesDoNotDependOnTheNumberOfThreads) {
  const auto boxes = boxes_of(test::random_soup(test::trimmed(30000), 0.03f, 2));
  for (const char* name : kBuilders) {
    Tree trees[2];
    for (int i = 0; i < 2; ++i)
      tbb::task_arena(i == 0 ? 1 : 4).execute([&] { trees[i] = build_tree(boxes, build_options_of(name)); });
    EXPECT_TRUE(same(trees[0], trees[1])) << name;
  }
  EXPECT_TRUE(same(build_tree(boxes, build_options_of("agglomerative")),
                   build_tree(boxes, build_options_of("agglomerative-parallel"))));
}

TEST(BvhBuild, CostIsThatOfThePaper) {
  // Two unit cubes side by side: root 2x1x1, half area 5; each leaf 3.
  const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{1, 0, 0}, {2, 1, 1}}};
  for (const char* name : {"agglomerative", "binned", "sweep"}) {
    const TreeCost cost = cost_of(build_tree(boxes, build_options_of(name)));
    EXPECT_DOUBLE_EQ(cost.boxes, 3.0);
    EXPECT_NEAR(cost.tris, 2 * 3.0 / 5.0, 1e-6);
    EXPECT_NEAR(cost.cost, 1.5 + 1.2, 1e-6);
    EXPECT_EQ(cost.depth, 1);
  }
  EXPECT_EQ(cost_of({}).cost, 0.0);
}

TEST(BvhBuild, ReinsertionLowersTheCostOfEveryTree) {
  for (const auto& boxes : {boxes_of(test::random_soup(5000, 0.1f, 3)), boxes_of(test::sphere(40, 60))})
    for (const std::string name : {"agglomerative", "binned", "sweep"}) {
      const double before = cost_of(build_tree(boxes, build_options_of(name))).cost;
      const double little = cost_of(build_tree(boxes, build_options_of(name + "+reinsert:5x1"))).cost;
      const double much = cost_of(build_tree(boxes, build_options_of(name + "+reinsert:20x8"))).cost;
      EXPECT_LE(little, before) << name;
      EXPECT_LT(much, little) << name;
    }
}

TEST(BvhBuild, AgglomerationBeatsTheLongestAxisOnArchitecture) {
  // Walls and small boxes before them: where the paper finds a gain.
  std::vector<Aabb> boxes;
  Rng rng(4, Stage::test);
  for (int i = 0; i < 40; ++i) {
    const float x = static_cast<float>(i);
    boxes.push_back({{x, 0, 0}, {x, 40, 3}});
    boxes.push_back({{0, x, 0}, {40, x, 3}});
  }
  for (int i = 0; i < 4000; ++i) {
    const Vec3f p{40 * rng.next_float(), 40 * rng.next_float(), rng.next_float()};
    boxes.push_back({p, p + test::random_point(rng) * 0.3f});
  }
  EXPECT_LT(cost_of(build_tree(boxes, build_options_of("agglomerative"))).cost,
            cost_of(build_tree(boxes, build_options_of("binned-longest"))).cost);
}

TEST(BvhBuild, DepthIsBounded) {
  // Each box twice as far as the one before: greed makes a chain.
  std::vector<Aabb> boxes;
  float x = 1e-18f;
  for (int i = 0; i < 110; ++i, x *= 2.0f)
    for (int k = 0; k < 3; ++k) boxes.push_back({{0, 0, 0}, {x * (1.0f + 0.1f * static_cast<float>(k)), x, x}});
  const auto merges = agglomerate_boxes(boxes, Strategy::locally_ordered);
  for (const char* name : kBuilders) {
    const Tree tree = build_tree(boxes, build_options_of(name));
    expect_good_tree(tree, boxes);
    EXPECT_LE(cost_of(tree).depth, kMaxTreeDepth) << name;
  }
}

TEST(BvhBuild, UnknownBuildersAreNamed) {
  for (const char* name : {"fast", "sweep+", "sweep+reinsert:", "sweep+reinsert:0x1", "sweep+reinsert:5x3 ",
                           "+reinsert", "sweep+reinsert:101x2", "binned+reinsert:nan"}) {
    try {
      build_options_of(name);
      ADD_FAILURE() << name;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(std::string("'") + name + "'"), std::string::npos);
    }
  }
  EXPECT_EQ(build_options_of("sweep+reinsert:10x2").reinsert_passes, 2);
  EXPECT_FLOAT_EQ(build_options_of("sweep+reinsert:10").reinsert_share, 0.1f);
  EXPECT_EQ(build_options_of("sweep+reinsert").reinsert_passes, 8);
}

TEST(BvhBuild, CancelIsSeen) {
  const Mesh mesh = test::random_soup(20000, 0.05f, 1);
  for (const char* name : kBuilders) {
    Progress progress;
    progress.cancel();
    EXPECT_THROW(build_tree(boxes_of(mesh), build_options_of(name), &progress), Error) << name;
  }
}

}  // namespace
}  // namespace lumicut
