// Directions that light paths have shown to rays of compensation.
#include "render/glint_guide.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/rng.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

// On a wall, thrown from a small patch before it; and some from a second one, beside that.
std::vector<Glint> glints_of_two_patches() {
  Rng rng(3, Stage::test);
  std::vector<Glint> glints;
  for (int i = 0; i < 400; ++i) {
    const Vec3f place{0, 2 * rng.next_float() - 1, 2 * rng.next_float() - 1};
    const bool second = i % 4 == 0;
    glints.push_back({place,
                      {1.5f, (second ? 1.0f : 0.0f) + 0.1f * rng.next_float(), 0.1f * rng.next_float()},
                      0.5f + rng.next_float()});
  }
  return glints;
}

// Of 96 parts of one size on the sphere: height, then turn.
constexpr int kHeights = 8, kTurns = 12, kParts = kHeights * kTurns;
int part_of(const Vec3f& d) {
  const double turn = std::atan2(d.y, d.x) / (2 * std::numbers::pi);
  const int height = std::clamp(static_cast<int>((d.z + 1.0f) / 2 * kHeights), 0, kHeights - 1);
  return height * kTurns + std::min(static_cast<int>((turn < 0 ? turn + 1 : turn) * kTurns), kTurns - 1);
}

TEST(GlintGuide, SamplesAsItsDensityHasItWhichSumsToOne) {
  const auto glints = glints_of_two_patches();
  const GlintGuide guide(glints, nullptr);
  BallQueryTree::Scratch scratch;
  for (const Vec3f place : {Vec3f{0, 0, 0}, Vec3f{0, 0.9f, -0.7f}, Vec3f{0, 0.5f, 0.1f}}) {
    const auto directions = guide.at(place, {1, 0, 0}, scratch);
    ASSERT_FALSE(directions.empty());
    Rng rng(7, Stage::test);
    const size_t samples = test::trimmed(400000);
    std::vector<double> drawn(kParts), expected(kParts);
    for (size_t i = 0; i < samples; ++i) {
      const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
      const Vec3f d = directions.sample(choice, u, v);
      ASSERT_NEAR(length(d), 1.0f, 1e-5f);
      drawn[static_cast<size_t>(part_of(d))] += 1;
    }
    // The integral of the density over each part, by its midpoints.
    constexpr int kFine = 100;
    double all = 0;
    for (int h = 0; h < kHeights * kFine; ++h)
      for (int t = 0; t < kTurns * kFine; ++t) {
        const double z = (h + 0.5) / (kHeights * kFine) * 2 - 1,
                     turn = (t + 0.5) / (kTurns * kFine) * 2 * std::numbers::pi, r = std::sqrt(1 - z * z);
        const Vec3f d{static_cast<float>(r * std::cos(turn)), static_cast<float>(r * std::sin(turn)),
                      static_cast<float>(z)};
        const double p = directions.pdf(d) * 4 * std::numbers::pi / (kParts * kFine * kFine);
        expected[static_cast<size_t>(h / kFine * kTurns + t / kFine)] += p, all += p;
      }
    EXPECT_NEAR(all, 1.0, 2e-3) << "a lobe of 1 degree is a few of the midpoints wide";
    // Chi-squared of the parts with at least 20; of k of them it is about k ± √(2k).
    double chi2 = 0;
    int parts = 0;
    for (size_t i = 0; i < kParts; ++i) {
      const double wanted = expected[i] * static_cast<double>(samples);
      if (wanted < 20) continue;
      chi2 += (drawn[i] - wanted) * (drawn[i] - wanted) / wanted, ++parts;
    }
    EXPECT_GE(parts, 2);
    EXPECT_LT(chi2, parts + 4 * std::sqrt(2.0 * parts) + 4);
  }
}

TEST(GlintGuide, LooksWhereTheLightCameFrom) {
  const auto glints = glints_of_two_patches();
  const GlintGuide guide(glints, nullptr);
  BallQueryTree::Scratch scratch;
  const auto directions = guide.at({0, 0, 0}, {1, 0, 0}, scratch);
  const float first = directions.pdf(normalize(Vec3f{1.5f, 0.05f, 0.05f})),
              second = directions.pdf(normalize(Vec3f{1.5f, 1.05f, 0.05f})),
              elsewhere = directions.pdf(normalize(Vec3f{0.7f, -1, 0}));
  EXPECT_GT(first, 1.0f) << "evenly it would be .08";
  EXPECT_GT(first, second) << "a fourth of the light comes from there";
  EXPECT_GT(second, 0.02f);
  EXPECT_LT(elsewhere, 1e-3f);
}

TEST(GlintGuide, KnowsNothingOfFewGlintsNorOfThoseFromBelow) {
  BallQueryTree::Scratch scratch;
  const auto at = [&](const std::vector<Glint>& glints, const Vec3f& normal) {
    return GlintGuide(glints, nullptr).at({0, 0, 0}, normal, scratch);
  };
  EXPECT_TRUE(at({}, {0, 0, 1}).empty());
  EXPECT_TRUE(at({{{0.1f, 0, 0}, {0, 0, 1}, 1}}, {0, 0, 1}).empty());
  const std::vector<Glint> two{{{0.1f, 0, 0}, {0, 0, 1}, 1}, {{0, 0.1f, 0}, {0, 0, 1}, 1}};
  EXPECT_FALSE(at(two, {0, 0, 1}).empty());
  EXPECT_TRUE(at(two, {0, 0, -1}).empty());
  // All at the place itself, from the place itself, and without power.
  EXPECT_TRUE(at(std::vector<Glint>(20, {{0, 0, 0}, {0, 0, 0}, 1}), {0, 0, 1}).empty());
  EXPECT_TRUE(at(std::vector<Glint>(20, {{0.1f, 0, 0}, {0, 0, 1}, 0}), {0, 0, 1}).empty());
}

}  // namespace
}  // namespace lumicut
