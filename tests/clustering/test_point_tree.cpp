#include <gtest/gtest.h>

#include "clustering/point_tree.h"
#include "core/parallel.h"
#include "tests/clustering/random_lighting.h"

namespace lumicut {

namespace {

PointTree tree_of(const ShadePoints& points, float length = 0.1f) {
  Progress progress;
  return PointTree::build(points, length, progress);
}

}  // namespace

TEST(PointTree, HoldsEveryPointOnceAndEveryLaneItsPoints) {
  for (size_t n : {1u, 15u, 16u, 17u, 255u, 257u, 300u, 4096u, 4097u, 9000u}) {
    Rng rng(n, Stage::test, 21);
    const ShadePoints batch = test::random_points(rng, n, 1.0f, true);
    const PointTree tree = tree_of(batch);
    ASSERT_EQ(tree.size(), n);
    std::vector<int> seen(n, 0);
    for (size_t i = 0; i < n; ++i) {
      ++seen[tree.order[i]];
      ASSERT_EQ(tree.points.position_at(i), batch.position_at(tree.order[i]));
    }
    for (int s : seen) ASSERT_EQ(s, 1);
    ASSERT_EQ(tree.leaf_count(), (n + 15) / 16);
    const auto check = [&](const std::vector<PointNodes>& nodes, size_t per_lane) {
      ASSERT_EQ(nodes.size(), (n + 16 * per_lane - 1) / (16 * per_lane));
      for (size_t i = 0; i < n; ++i) {
        const PointNodes& block = nodes[i / (16 * per_lane)];
        const size_t lane = i / per_lane % 16;
        ASSERT_TRUE(block.used >> lane & 1);
        const SurfacePoint p = tree.points.get(i);
        float normal_cosine = 0.0f;
        for (int k = 0; k < 3; ++k) {
          ASSERT_LE(std::abs(p.position[k] - block.center[k][lane]), block.half[k][lane] * 1.000001f + 1e-6f);
          ASSERT_LE(p.diffuse[k], block.diffuse[k][lane]);
          ASSERT_LE(p.specular[k], block.of_lobe[p.lobe].specular[k][lane]);
          ASSERT_LE(p.grazing[k], block.of_lobe[p.lobe].grazing[k][lane]);
          normal_cosine += p.normal[k] * block.normal[k][lane];
        }
        ASSERT_GE(normal_cosine, block.normal_cos[lane] - 1e-5f);
        ASSERT_GE(p.falloff, block.falloff[lane]);
        if (!(max_component(p.specular) > 0.0f)) continue;
        ASSERT_TRUE(block.has_lobe >> p.lobe & 1);
        ASSERT_LE(block.of_lobe[p.lobe].shape_low[lane], p.shape);
        ASSERT_GE(block.of_lobe[p.lobe].shape_high[lane], p.shape);
        ASSERT_LE(block.of_lobe[p.lobe].view_cosine[lane], dot(p.normal, p.mirror));
      }
    };
    check(tree.leaves, 16);
    check(tree.groups, 256);
  }
}

TEST(PointTree, HoldsUnlikeMaterialsApartWhereTheyWeigh) {
  Rng rng(3, Stage::test, 22);
  const ShadePoints random = test::random_points(rng, 512, 1.0f, true);
  ShadePoints batch;
  for (size_t i = 0; i < random.size(); ++i) {
    SurfacePoint p = random.get(i);
    p.normal = {0, 0, 1}, p.specular = {}, p.diffuse = i % 2 == 0 ? Rgb{0.05f, 0.05f, 0.05f} : Rgb{0.3f, 0.3f, 0.3f};
    batch.push(p);
  }
  batch.finish();
  Progress progress;
  const auto mixed_leaves = [&](float material) {
    const PointTree tree = PointTree::build(batch, 1.0f, progress, material);
    size_t mixed = 0;
    for (size_t leaf = 0; leaf < tree.leaf_count(); ++leaf) {
      size_t dark = 0;
      for (size_t i = 0; i < 16; ++i) dark += tree.points.get(leaf * 16 + i).diffuse.x < 0.1f;
      mixed += dark != 0 && dark != 16;
    }
    return mixed;
  };
  EXPECT_GT(mixed_leaves(0.0f), 24u);   // of 32: nothing is known of them
  EXPECT_EQ(mixed_leaves(100.0f), 0u);  // two halves of 256
}

TEST(PointTree, KeepsWallsThatFaceEachOtherApart) {
  // Two parallel planes a hair apart, points in random order: no full leaf may hold both sides.
  Rng rng(1, Stage::test, 22);
  ShadePoints batch;
  for (int i = 0; i < 8192; ++i) {
    SurfacePoint p = test::random_surface(rng, 1.0f, false);
    const float side = rng.next_below(2) == 0 ? 1.0f : -1.0f;
    p.position.z = 0.001f * side;
    p.normal = {0, 0, side};
    batch.push(p);
  }
  batch.finish();
  const PointTree tree = tree_of(batch, 1.0f);
  size_t mixed = 0;
  for (size_t leaf = 0; leaf < tree.leaf_count(); ++leaf) {
    bool up = false, down = false;
    for (size_t i = leaf * 16; i < std::min(tree.size(), leaf * 16 + 16); ++i)
      (tree.points.normal[2][i] > 0 ? up : down) = true;
    mixed += up && down;
  }
  // The border between the sides falls inside at most one leaf.
  EXPECT_LE(mixed, 1u);
}

TEST(PointTree, LeavesAreSmall) {
  // 4096 points of a unit square: a leaf of 16 covers 1/256 of it, 1/16 wide if square; twice that on average at worst.
  Rng rng(2, Stage::test, 23);
  ShadePoints batch;
  for (int i = 0; i < 4096; ++i) {
    SurfacePoint p = test::random_surface(rng, 1.0f, false);
    p.position = {rng.next_float(), rng.next_float(), 0.0f};
    p.normal = {0, 0, 1};
    batch.push(p);
  }
  batch.finish();
  const PointTree tree = tree_of(batch);
  double radius = 0;
  for (size_t leaf = 0; leaf < tree.leaf_count(); ++leaf)
    radius += std::sqrt(tree.leaves[leaf / 16].radius2[leaf % 16]) / static_cast<double>(tree.leaf_count());
  EXPECT_LT(radius, 2.0 * 0.5 * std::sqrt(2.0) / 16);
}

TEST(PointTree, IsTheSameOnAnyNumberOfThreadsAndInAnyScale) {
  Rng rng(3, Stage::test, 24);
  const ShadePoints batch = test::random_points(rng, 20000, 1.0f, true);
  ShadePoints large = batch;
  for (auto& axis : large.position)
    for (float& x : axis) x *= 1024.0f;
  Arena one(1), four(4);
  const PointTree a = one.run([&] { return tree_of(batch); }), b = four.run([&] { return tree_of(batch); });
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.order, tree_of(large, 102.4f).order);
}

TEST(PointTree, TakesNoPointsAndPointsInOnePlace) {
  EXPECT_EQ(tree_of(ShadePoints{}).region_count(), 0u);
  ShadePoints batch;
  SurfacePoint p;
  p.position = {1, 2, 3}, p.normal = p.mirror = {0, 0, 1};
  for (int i = 0; i < 1000; ++i) batch.push(p);
  batch.finish();
  EXPECT_EQ(tree_of(batch).leaf_count(), 63u);
  EXPECT_EQ(tree_of(batch, 0.0f).leaf_count(), 63u);
}

TEST(PointTree, IsCancelled) {
  Rng rng(4, Stage::test, 25);
  const ShadePoints batch = test::random_points(rng, 10000, 1.0f, false);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(PointTree::build(batch, 0.1f, progress), Error);
}

}  // namespace lumicut
