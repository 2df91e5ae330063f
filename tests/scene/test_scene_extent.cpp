#include "scene/scene_extent.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/rng.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

Aabb box_around(const Vec3f& center, const Vec3f& half) {
  Aabb box;
  box.extend(center - half), box.extend(center + half);
  return box;
}

// Small things all over a room of side 10, which stands at (3, 4, 5).
std::vector<Aabb> room() {
  std::vector<Aabb> boxes;
  Rng rng(1, Stage::test);
  for (int i = 0; i < 400; ++i)
    boxes.push_back(box_around(Vec3f{3, 4, 5} + test::random_point(rng, 5.0f), Vec3f{0.1f, 0.1f, 0.1f}));
  return boxes;
}

float shares_within(const SceneExtent& extent, const Vec3f& center, float distance) {
  float sum = 0.0f;
  for (const auto& p : extent.parts())
    if (length(p.center - center) + p.radius < distance) sum += p.share;
  return sum;
}

TEST(SceneExtent, HoldsAllGeometryInItsParts) {
  const auto boxes = room();
  const SceneExtent extent(boxes);
  ASSERT_LE(extent.parts().size(), SceneExtent::kMostParts);
  float sum = 0.0f;
  for (const auto& p : extent.parts()) sum += p.share;
  EXPECT_NEAR(sum, 1.0f, 1e-5f);
  for (const Aabb& b : boxes)
    for (const Vec3f& corner : {b.lo, b.hi}) {
      bool held = false;
      for (const auto& p : extent.parts()) held = held || length(corner - p.center) <= p.radius * 1.0001f;
      EXPECT_TRUE(held);
    }
}

TEST(SceneExtent, OfARoomIsAboutItsSize) {
  const SceneExtent extent(room());
  EXPECT_LT(length(extent.center() - Vec3f{3, 4, 5}), 3.0f);
  EXPECT_GT(extent.radius(), 4.0f);
  EXPECT_LT(extent.radius(), 9.0f);
}

TEST(SceneExtent, HardlyFeelsADistantObjectAGroundOrADome) {
  const SceneExtent alone(room());
  std::vector<std::vector<Aabb>> others(3);
  others[0].push_back(box_around({10000, 0, 0}, {1, 1, 1}));
  for (const float x : {-2500.0f, 2500.0f}) others[1].push_back(box_around({x, 0, 0}, {2500, 5000, 0}));
  for (int i = 0; i < 64; ++i)
    for (int k = 1; k < 16; ++k) {
      const float phi = static_cast<float>(i) * 0.098f, theta = static_cast<float>(k) * 0.098f;
      others[2].push_back(
          box_around(Vec3f{std::cos(phi) * std::sin(theta), std::sin(phi) * std::sin(theta), std::cos(theta)} * 2000.0f,
                     {100, 100, 100}));
    }
  for (const auto& other : others) {
    std::vector<Aabb> boxes = room();
    boxes.insert(boxes.end(), other.begin(), other.end());
    const SceneExtent extent(boxes);
    EXPECT_LT(length(extent.center() - Vec3f{3, 4, 5}), 5.0f);
    EXPECT_LT(extent.radius(), 2.5f * alone.radius());
    EXPECT_GT(extent.radius(), 0.4f * alone.radius());
    EXPECT_GT(shares_within(extent, {3, 4, 5}, 20.0f), 0.4f);
  }
}

// Share of light from above for each place of a ground that reaches far.
TEST(SceneExtent, AGroundFarBeyondAllElseHasSurroundingsThatThinOut) {
  std::vector<Aabb> boxes = room();
  for (const float x : {-2500.0f, 2500.0f}) boxes.push_back(box_around({x, 0, 0}, {2500, 5000, 0}));
  const SceneExtent extent(boxes);
  ASSERT_LE(extent.parts().size(), 2 * SceneExtent::kMostParts);
  const auto density = [&](float distance) {
    const Vec3f at = extent.center() + Vec3f{distance, 0, 0};
    double sum = 0.0;
    for (const auto& p : extent.parts())
      if (length(at - p.center) < p.radius)
        sum += static_cast<double>(p.share) / (static_cast<double>(p.radius) * static_cast<double>(p.radius));
    return sum;
  };
  // Ten times as far a hundred times as thin, and never much more at once.
  double before = density(30.0f);
  for (float distance = 60.0f; distance < 2000.0f; distance *= 2.0f) {
    const double here = density(distance);
    EXPECT_GT(here, 0.09 * before) << distance;
    EXPECT_LT(here, 1.01 * before) << distance;
    before = here;
  }
}

TEST(SceneExtent, OfNothingAndOfOnePointAreSmallSpheres) {
  EXPECT_EQ(SceneExtent().radius(), 1.0f);
  EXPECT_TRUE(SceneExtent(std::vector<Aabb>(3)).parts().empty());
  const SceneExtent point({box_around({1, 2, 3}, {})});
  ASSERT_EQ(point.parts().size(), 1u);
  EXPECT_GT(point.radius(), 0.0f);
  EXPECT_LT(point.radius(), 1e-4f);
}

}  // namespace
}  // namespace lumicut
