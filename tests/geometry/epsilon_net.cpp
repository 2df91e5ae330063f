#include "geometry/epsilon_net.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/predicates.h"

namespace lumicut {
namespace {

std::vector<Point2> random_points(size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test);
  std::vector<Point2> p(n);
  for (Point2& q : p) q = {rng.next_float(), rng.next_float()};
  return p;
}

// Sign of the lifted determinant in long double: points are random, so no case is close.
int circle_side(const Point2& a, const Point2& b, const Point2& c, const Point2& q) {
  const long double ax = a.x - q.x, ay = a.y - q.y, bx = b.x - q.x, by = b.y - q.y, cx = c.x - q.x, cy = c.y - q.y;
  const long double det = (ax * ax + ay * ay) * (bx * cy - by * cx) - (bx * bx + by * by) * (ax * cy - ay * cx) +
                          (cx * cx + cy * cy) * (ax * by - ay * bx);
  return det > 0 ? 1 : det < 0 ? -1 : 0;
}

// Brute force for points in general position: a heaviest disk may be moved until three points lie on its rim (two, for
// a half-plane), and any of those may then be had inside or outside.
double heaviest_by_triples(const std::vector<Point2>& p, const std::vector<double>& w, const std::vector<bool>& net) {
  const size_t n = p.size();
  double best = 0;
  const auto consider = [&](auto&& inside, std::initializer_list<size_t> rim) {
    double sum = 0;
    for (size_t q = 0; q < n; ++q) {
      if (std::find(rim.begin(), rim.end(), q) != rim.end()) {
        if (!net[q]) sum += w[q];
      } else if (inside(q)) {
        if (net[q]) return;
        sum += w[q];
      }
    }
    best = std::max(best, sum);
  };
  for (size_t a = 0; a < n; ++a)
    for (size_t b = 0; b < n; ++b) {
      if (a == b) continue;
      consider([&](size_t q) { return orientation(p[a], p[b], p[q]) > 0; }, {a, b});
      for (size_t c = 0; c < n; ++c) {
        if (c == a || c == b || orientation(p[a], p[b], p[c]) <= 0) continue;
        consider([&](size_t q) { return circle_side(p[a], p[b], p[c], p[q]) > 0; }, {a, b, c});
      }
    }
  return best;
}

TEST(EpsilonNet, OracleEqualsBruteForceOverAllTriples) {
  for (uint64_t seed = 0; seed < 150; ++seed) {
    Rng rng(seed, Stage::test, 1);
    const size_t n = 4 + rng.next_below(12);
    const auto p = random_points(n, seed);
    std::vector<double> w(n);
    for (double& x : w) x = 1 + rng.next_below(5);
    std::vector<bool> in(n, false);
    std::vector<uint32_t> net;
    const uint32_t share = 1 + rng.next_below(6);
    for (uint32_t q = 0; q < n; ++q)
      if (rng.next_below(share) == 0) in[q] = true, net.push_back(q);
    std::vector<uint32_t> members;
    const double found = heaviest_unhit_disk(p, w, net, &members);
    double expected = heaviest_by_triples(p, w, in);
    if (net.empty()) expected = std::accumulate(w.begin(), w.end(), 0.0);
    ASSERT_EQ(found, expected) << "seed " << seed << ", n " << n << ", net " << net.size();
    double sum = 0;
    for (const uint32_t q : members) {
      sum += w[q];
      EXPECT_FALSE(in[q]);
    }
    EXPECT_EQ(sum, found);
  }
}

// Nets of one point, of two, and on a line: there is no triangle to sweep.
TEST(EpsilonNet, OracleEqualsBruteForceWhereTheNetIsDegenerate) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    auto p = random_points(10, seed + 1000);
    const size_t k = seed % 4;  // 1 point, 2 points, or 3 and 4 points on a line
    std::vector<uint32_t> net;
    std::vector<bool> in(p.size(), false);
    for (uint32_t i = 0; i <= k; ++i) {
      if (k >= 2) p[i] = {0.25 + 0.125 * i, 0.5 + 0.0625 * i};
      net.push_back(i), in[i] = true;
    }
    const std::vector<double> w(p.size(), 1.0);
    // The net's own collinear points on one rim cannot be moved freely; but they are all outside, so it does not
    // matter.
    ASSERT_EQ(heaviest_unhit_disk(p, {}, net), heaviest_by_triples(p, w, in)) << "seed " << seed << " k " << k;
  }
}

// A disk beyond a hull vertex of the net meets no second point of it: the case that Lemma 6.8's proof leaves out.
TEST(EpsilonNet, OracleSeesDisksBeyondAHullVertex) {
  std::vector<Point2> p{{0, 0}, {-100, 1}, {-100, -1}};  // the net: a needle whose tip is the origin
  for (int i = -20; i <= 20; ++i) {                      // a disk's rim around (1.001, 0)
    const double a = 3.1 * i / 20;
    p.push_back({1.001 + std::cos(a), std::sin(a)});
  }
  const std::vector<uint32_t> net{0, 1, 2};
  EXPECT_EQ(heaviest_unhit_disk(p, {}, net), 41.0);
}

TEST(EpsilonNet, CertifiedNetsLeaveNoHeavyDiskUnhit) {
  for (const double epsilon : {0.5, 0.1, 0.02}) {
    for (uint64_t seed = 0; seed < 4; ++seed) {
      const auto p = random_points(3000, seed);
      std::vector<double> w(p.size(), 1.0);
      if (seed % 2) {
        Rng rng(seed, Stage::test, 2);
        for (double& x : w) x = std::exp2(static_cast<double>(rng.next_below(12)));
      }
      const double total = std::accumulate(w.begin(), w.end(), 0.0);
      EpsilonNetOptions options;
      options.seed = seed;
      const EpsilonNet net = epsilon_net(p, w, epsilon, options);
      EXPECT_LT(heaviest_unhit_disk(p, w, net.points), epsilon * total);
      EXPECT_LE(static_cast<double>(net.points.size()),
                4.0 / epsilon);  // 2.5/epsilon asymptotically; small ones vary more
      options.mode = EpsilonNetOptions::Mode::thesis;
      const EpsilonNet thesis = epsilon_net(p, w, epsilon, options);
      EXPECT_LT(heaviest_unhit_disk(p, w, thesis.points), epsilon * total);
    }
  }
}

TEST(EpsilonNet, SameSeedGivesTheSameNet) {
  const auto p = random_points(2000, 5);
  EXPECT_EQ(epsilon_net(p, {}, 0.02).points, epsilon_net(p, {}, 0.02).points);
}

// Grids are co-circular and collinear everywhere. Disks through their points, shrunk and grown by a hair, must be hit.
TEST(EpsilonNet, HoldsOnGridsAndRepeatedPoints) {
  std::vector<Point2> p;
  for (int copy = 0; copy < 2; ++copy)
    for (int x = 0; x < 15; ++x)
      for (int y = 0; y < 15; ++y) p.push_back({static_cast<double>(x), static_cast<double>(y)});
  const double epsilon = 0.06, threshold = epsilon * static_cast<double>(p.size());
  for (const auto mode : {EpsilonNetOptions::Mode::certified, EpsilonNetOptions::Mode::thesis}) {
    EpsilonNetOptions options;
    options.mode = mode;
    const EpsilonNet net = epsilon_net(p, {}, epsilon, options);
    const double heaviest = heaviest_unhit_disk(p, {}, net.points);
    EXPECT_LT(heaviest, threshold);
    double seen = 0;
    for (int cx = -8; cx <= 36; ++cx)
      for (int cy = -8; cy <= 36; ++cy)
        for (int r2 = 1; r2 < 400; r2 += 1) {
          const Disk d{{cx * 0.5, cy * 0.5}, std::sqrt(r2 * 0.25) * (1 - 1e-9)};
          if (std::any_of(net.points.begin(), net.points.end(), [&](uint32_t q) { return hits(p[q], d); })) break;
          seen = std::max(seen, static_cast<double>(
                                    std::count_if(p.begin(), p.end(), [&](const Point2& q) { return hits(q, d); })));
        }
    EXPECT_LE(seen, heaviest);
    EXPECT_GT(seen, 0.0);
  }
}

TEST(EpsilonNet, DegenerateInputGivesSmallNets) {
  EXPECT_TRUE(epsilon_net({}, {}, 0.5).points.empty());
  const std::vector<Point2> one{{1, 2}};
  EXPECT_EQ(epsilon_net(one, {}, 0.5).points, std::vector<uint32_t>{0});
  const std::vector<Point2> same(100, Point2{3, 4});
  const auto net = epsilon_net(same, {}, 0.5);
  EXPECT_FALSE(net.points.empty());
  EXPECT_LE(net.points.size(), 2u);
  EXPECT_EQ(heaviest_unhit_disk(same, {}, net.points), 0.0);
  std::vector<Point2> line;
  for (int i = 0; i < 1000; ++i) line.push_back({0.5 * i, 0.25 * i});
  const auto on_line = epsilon_net(line, {}, 0.1);
  EXPECT_LE(on_line.points.size(), 10u);  // 1/epsilon is best possible on a line
  EXPECT_LT(heaviest_unhit_disk(line, {}, on_line.points), 100.0);
  const std::vector<double> nothing(1000, 0.0);
  EXPECT_TRUE(epsilon_net(line, nothing, 0.1).points.empty());
}

TEST(EpsilonNet, RefusesBadInputByName) {
  const auto p = random_points(10, 1);
  auto bad = p;
  bad[3].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(epsilon_net(bad, {}, 0.5), Error);
  EXPECT_THROW(epsilon_net(p, {}, 0.0), Error);
  EXPECT_THROW(epsilon_net(p, {}, 1.5), Error);
  EXPECT_THROW(epsilon_net(p, std::vector<double>(3, 1.0), 0.5), Error);
  EXPECT_THROW(epsilon_net(p, std::vector<double>(10, -1.0), 0.5), Error);
  EXPECT_THROW(heaviest_unhit_disk(p, {}, std::vector<uint32_t>{10}), Error);
}

}  // namespace
}  // namespace lumicut
