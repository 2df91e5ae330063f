#include "geometry/hitting_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/independent_set.h"
#include "geometry/instances.h"

namespace lumicut {
namespace {

struct Instance {
  std::vector<Point2> points;
  std::vector<Disk> disks;
};

// Points on a coarse grid (they repeat, and lie on rims); every disk holds a point.
Instance random_instance(uint64_t seed, uint32_t n, uint32_t m, uint32_t grid, uint32_t largest) {
  Rng rng(seed, Stage::test);
  Instance in;
  for (uint32_t i = 0; i < n; ++i)
    in.points.push_back({static_cast<double>(rng.next_below(grid)), static_cast<double>(rng.next_below(grid))});
  while (in.disks.size() < m) {
    const Disk d{{rng.next_below(2 * grid) * 0.5, rng.next_below(2 * grid) * 0.5},
                 rng.next_below(2 * largest + 1) * 0.5};
    if (std::any_of(in.points.begin(), in.points.end(), [&](const Point2& p) { return hits(p, d); }))
      in.disks.push_back(d);
  }
  return in;
}

// Points of each disk, as bits.
std::vector<uint32_t> masks(const Instance& in) {
  std::vector<uint32_t> m;
  for (const Disk& d : in.disks) {
    m.push_back(0);
    for (size_t p = 0; p < in.points.size(); ++p)
      if (hits(in.points[p], d)) m.back() |= 1u << p;
  }
  return m;
}
bool hits_all(const std::vector<uint32_t>& disks, uint32_t set) {
  return std::all_of(disks.begin(), disks.end(), [&](uint32_t d) { return (d & set) != 0; });
}
size_t optimum(const Instance& in) {
  const auto disks = masks(in);
  int best = 32;
  for (uint32_t set = 0; set < 1u << in.points.size(); ++set)
    if (std::popcount(set) < best && hits_all(disks, set)) best = std::popcount(set);
  return static_cast<size_t>(best);
}
uint32_t as_bits(const std::vector<uint32_t>& set) {
  uint32_t bits = 0;
  for (const uint32_t p : set) bits |= 1u << p;
  return bits;
}

TEST(HittingSet, StandsBetweenItsBoundAndGreedyAndHitsEverything) {
  size_t proven = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Instance in = random_instance(seed, 14, 5 + seed % 40, 4 + seed % 9, 2);
    const HittingSet h = solve_hitting_set(in.points, in.disks);
    const size_t best = optimum(in);
    EXPECT_TRUE(unhit_disks(in.points, in.disks, h.points).empty());
    EXPECT_TRUE(hits_all(masks(in), as_bits(h.points)));
    EXPECT_GE(h.points.size(), best);
    EXPECT_LE(h.lower_bound, best) << seed;
    EXPECT_LE(h.points.size(), greedy_hitting_set(in.points, in.disks, false).size());
    proven += h.points.size() == h.lower_bound;
  }
  EXPECT_GT(proven, 150u);  // on such small instances the bound is nearly always the optimum
}

// Exhaustive check that no three points can be replaced by two, no two by one, and none be dropped.
TEST(LocalSearch, LeavesNoImprovingMoveOnSmallInstances) {
  for (const int k : {2, 3, 4})
    for (uint64_t seed = 0; seed < 150; ++seed) {
      const Instance in = random_instance(seed + 1000, 13, 10 + seed % 50, 5 + seed % 8, 3);
      std::vector<uint32_t> all(in.points.size());
      std::iota(all.begin(), all.end(), 0u);
      const auto set = improve_hitting_set(in.points, in.disks, all, k);
      const auto disks = masks(in);
      const uint32_t s = as_bits(set);
      ASSERT_TRUE(hits_all(disks, s));
      for (uint32_t x = s; x != 0; x = (x - 1) & s) {
        const int nx = std::popcount(x);
        if (nx > k) continue;
        for (uint32_t y = 0; y < 1u << in.points.size(); ++y)
          if (std::popcount(y) < nx) {
            ASSERT_FALSE(hits_all(disks, (s & ~x) | y))
                << "seed " << seed << " k " << k << ": " << nx << " by " << std::popcount(y);
          }
      }
      if (k > 2) {
        EXPECT_LE(set.size(), (k == 3 ? 8 : 5) * optimum(in));  // Theorem 8.1, and the remark at Theorem 8.2
      }
    }
}

// Theorem 8.5: a hitting set nearly eight times too large that no (3,2) move improves.
TEST(TightInstance, StopsExchangesOfThreeAndNotOfFour) {
  for (const int side : {1, 2, 3, 7, 24}) {
    const TightInstance t = tight_instance(side);
    const auto s = static_cast<size_t>(side);
    ASSERT_EQ(t.small, (s + 1) * (s + 2) / 2);
    ASSERT_EQ(t.start.size(), 4 * s * s);
    ASSERT_EQ(t.disks.size(), 9 * s * s);
    for (const Disk& d : t.disks) {  // one point of each set, and no other
      size_t of_small = 0, of_start = 0;
      for (size_t p = 0; p < t.points.size(); ++p) (p < t.small ? of_small : of_start) += hits(t.points[p], d);
      ASSERT_EQ(of_small, 1u) << side;
      ASSERT_EQ(of_start, 1u) << side;
    }
    EXPECT_EQ(improve_hitting_set(t.points, t.disks, t.start, 3), t.start);
    if (side > 1) {
      EXPECT_LT(improve_hitting_set(t.points, t.disks, t.start, 4).size(), 5 * t.small);
    }
  }
  const TightInstance t = tight_instance(60);
  EXPECT_GT(t.start.size(), 7.6 * static_cast<double>(t.small));
  EXPECT_THROW(tight_instance(0), Error);
}

// Squares are pseudodisks; lists of any kind go the same way as disks.
TEST(HittingSet, OfRangesIsThatOfTheDisksWithThesePoints) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const Instance in = random_instance(seed + 300, 14, 5 + seed % 40, 4 + seed % 9, 2);
    Ranges ranges;
    for (const Disk& d : in.disks) {
      for (uint32_t p = 0; p < in.points.size(); ++p)
        if (hits(in.points[p], d)) ranges.members.push_back(p), ranges.members.push_back(p);  // named twice
      ranges.offsets.push_back(ranges.members.size());
    }
    const HittingSet a = solve_hitting_set(in.points, in.disks);
    const HittingSet b = solve_hitting_set(in.points.size(), ranges.offsets, ranges.members);
    EXPECT_EQ(a.points, b.points);
    EXPECT_EQ(a.lower_bound, b.lower_bound);
    std::vector<uint32_t> all(in.points.size());
    std::iota(all.begin(), all.end(), 0u);
    for (const int k : {2, 3, 4})
      EXPECT_EQ(improve_hitting_set(in.points, in.disks, all, k),
                improve_hitting_set(in.points.size(), ranges.offsets, ranges.members, all, k));
  }
}

TEST(HittingSet, PointsInCopiesOfAShapeAreThoseOfItsHalfPlanes) {
  const std::vector<Point2> hexagon{{2, 0}, {1, 2}, {-1, 2}, {-2, 0}, {-1, -2}, {1, -2}};
  const auto inside = [&](const Point2& p, const Disk& d) {  // all numbers are small multiples of a half: exact
    for (size_t i = 0; i < hexagon.size(); ++i) {
      const Point2 &a = hexagon[i], &b = hexagon[(i + 1) % hexagon.size()];
      if ((b.x - a.x) * (p.y - d.centre.y - d.radius * a.y) - (b.y - a.y) * (p.x - d.centre.x - d.radius * a.x) < 0)
        return false;
    }
    return true;
  };
  const Instance in = random_instance(5, 300, 200, 20, 6);
  const Ranges ranges = points_in_copies(in.points, hexagon, in.disks);
  for (size_t i = 0; i < in.disks.size(); ++i) {
    std::vector<uint32_t> found(ranges.members.begin() + static_cast<ptrdiff_t>(ranges.offsets[i]),
                                ranges.members.begin() + static_cast<ptrdiff_t>(ranges.offsets[i + 1])),
        expected;
    std::sort(found.begin(), found.end());
    for (uint32_t p = 0; p < in.points.size(); ++p)
      if (inside(in.points[p], in.disks[i])) expected.push_back(p);
    EXPECT_EQ(found, expected);
  }
  for (const std::vector<Point2>& shape : {std::vector<Point2>{},
                                           {{1, 0}, {0, 1}},
                                           {{1, 0}, {-1, -1}, {0, 1}},
                                           {{1, 0}, {2, 0}, {2, 1}},
                                           {{1, 1}, {3, 1}, {2, 3}}})
    EXPECT_THROW(points_in_copies(in.points, shape, in.disks), Error);
}

// Exhaustive check that no disks can be given up for more.
TEST(IndependentDisks, LeaveNoImprovingMoveAndTouchNot) {
  for (const int k : {2, 3, 4})
    for (uint64_t seed = 0; seed < 150; ++seed) {
      Rng rng(seed + 50, Stage::test);
      std::vector<Disk> disks;
      for (int i = 0; i < 14; ++i)
        disks.push_back({{0.5 * rng.next_below(20), 0.5 * rng.next_below(20)}, 0.5 * rng.next_below(6)});
      std::vector<uint32_t> touching(disks.size(), 0);
      for (size_t i = 0; i < disks.size(); ++i)
        for (size_t j = 0; j < disks.size(); ++j) {
          const double sum = disks[i].radius + disks[j].radius;
          if (i != j && dist2(disks[i].centre, disks[j].centre) <= sum * sum) touching[i] |= 1u << j;
        }
      const auto independent = [&](uint32_t set) {
        for (size_t i = 0; i < disks.size(); ++i)
          if ((set >> i & 1) != 0 && (touching[i] & set) != 0) return false;
        return true;
      };
      std::vector<uint32_t> start{static_cast<uint32_t>(seed % 14)};
      for (const auto& set : {independent_disks(disks, k), independent_disks(disks, k, start)}) {
        const uint32_t s = as_bits(set);
        ASSERT_TRUE(independent(s));
        for (uint32_t other = 0; other < 1u << disks.size(); ++other) {
          if (std::popcount(other) <= std::popcount(s) || std::popcount(s & ~other) >= k) continue;
          ASSERT_FALSE(independent(other)) << "seed " << seed << " k " << k;
        }
      }
    }
  EXPECT_TRUE(independent_disks({}, 3).empty());
  const std::vector<Disk> two{{{0, 0}, 1}, {{2, 0}, 1}};
  EXPECT_EQ(independent_disks(two, 3).size(), 1u) << "closed disks";
  EXPECT_THROW(independent_disks(two, 3, std::vector<uint32_t>{0, 1}), Error);
  EXPECT_THROW(independent_disks(two, 5), Error);
}

TEST(HittingSet, MemoryBoundedPathHitsEverythingToo) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Instance in = random_instance(seed, 400, 300, 60, 8);
    HittingSetOptions o;
    const HittingSet full = solve_hitting_set(in.points, in.disks, o);
    EXPECT_EQ(full.candidates, in.points.size());
    for (const size_t room : {10u, 300u, 1500u}) {
      o.max_incidences = room;
      const HittingSet h = solve_hitting_set(in.points, in.disks, o);
      EXPECT_TRUE(unhit_disks(in.points, in.disks, h.points).empty());
      EXPECT_LT(h.candidates, in.points.size());
      EXPECT_LE(h.lower_bound, full.points.size());
      EXPECT_GE(h.lower_bound, 1u);
    }
  }
}

TEST(HittingSet, DisjointDisksNeedAPointEach) {
  Instance in;
  for (int i = 0; i < 50; ++i) {
    in.points.push_back({10.0 * i, 0});
    in.points.push_back({10.0 * i + 1, 0});
    in.disks.push_back({{10.0 * i, 0}, 2});
  }
  const HittingSet h = solve_hitting_set(in.points, in.disks);
  EXPECT_EQ(h.points.size(), 50u);
  EXPECT_EQ(h.lower_bound, 50u);
  EXPECT_EQ(h.gap(), 0.0);
}

TEST(HittingSet, DegenerateInput) {
  EXPECT_TRUE(solve_hitting_set({}, {}).points.empty());
  const std::vector<Point2> p{{0, 0}, {0, 0}, {0, 0}};
  EXPECT_TRUE(solve_hitting_set(p, {}).points.empty());
  const std::vector<Disk> d{{{0, 0}, 0}, {{0, 0}, 0}, {{3, 0}, 3}};
  EXPECT_EQ(solve_hitting_set(p, d).points, std::vector<uint32_t>{0});
}

TEST(HittingSet, RefusesBadInputByName) {
  const std::vector<Point2> p{{0, 0}, {1, 1}};
  const auto message = [&](const std::vector<Point2>& points, const std::vector<Disk>& disks) -> std::string {
    try {
      solve_hitting_set(points, disks);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::invalid_argument);
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message(p, {{{0, 0}, 1}, {{5, 5}, 1}}).find("disk 1 holds no point"), std::string::npos);
  EXPECT_NE(message(p, {{{0, 0}, -1}}).find("radius of disk 0"), std::string::npos);
  EXPECT_NE(message({{0, std::numeric_limits<double>::quiet_NaN()}}, {}).find("point 0"), std::string::npos);
  HittingSetOptions o;
  o.drop_empty_disks = true;
  const HittingSet h = solve_hitting_set(p, std::vector<Disk>{{{5, 5}, 1}, {{0, 0}, 1}}, o);
  EXPECT_EQ(h.empty_disks, 1u);
  EXPECT_EQ(h.points, std::vector<uint32_t>{0});
  EXPECT_THROW(improve_hitting_set(p, std::vector<Disk>{{{0, 0}, 1}}, std::vector<uint32_t>{1}, 3), Error);
  EXPECT_THROW(improve_hitting_set(p, {}, {}, 5), Error);
  EXPECT_THROW(solve_hitting_set(2, std::vector<size_t>{0, 1}, std::vector<uint32_t>{2}), Error);
  EXPECT_THROW(solve_hitting_set(2, std::vector<size_t>{0, 2, 1}, std::vector<uint32_t>{0, 1}), Error);
  EXPECT_THROW(solve_hitting_set(2, std::vector<size_t>{0, 0}, {}), Error);
}

}  // namespace
}  // namespace lumicut
