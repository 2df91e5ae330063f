#include "geometry/balltree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/ball_query_tree.h"

namespace lumicut {
namespace {

constexpr BallTreeBuilder kBuilders[] = {BallTreeBuilder::kd, BallTreeBuilder::top_down, BallTreeBuilder::insertion,
                                         BallTreeBuilder::cheap_insertion, BallTreeBuilder::bottom_up};

struct Balls {
  int dim;
  std::vector<double> centres, radii;
  size_t size() const { return radii.size(); }
  std::span<const double> centre(size_t i) const { return {&centres[i * dim], static_cast<size_t>(dim)}; }
};

// Values in single precision, so that bottom-up sees just these. On a grid balls coincide, touch and nest.
Balls random_balls(uint64_t seed, size_t n, int dim, bool grid) {
  Rng rng(seed, Stage::test);
  Balls b{dim, {}, {}};
  for (size_t i = 0; i < n; ++i) {
    for (int j = 0; j < dim; ++j) b.centres.push_back(grid ? rng.next_below(4) * 0.25 : rng.next_float());
    b.radii.push_back(grid ? rng.next_below(3) * 0.25 : 0.2f * rng.next_float());
  }
  return b;
}

double gap(const Balls& b, size_t i, std::span<const double> q) {
  double sum = 0;
  for (int j = 0; j < b.dim; ++j) sum += (b.centres[i * b.dim + j] - q[j]) * (b.centres[i * b.dim + j] - q[j]);
  return std::sqrt(sum);
}
double joint(const Balls& b, size_t i, std::span<const double> q, double r) {
  const double d = gap(b, i, q);
  if (d + r <= b.radii[i]) return b.radii[i];
  if (d + b.radii[i] <= r) return r;
  return 0.5 * (d + r + b.radii[i]);
}

void expect_queries(const BallTree& t, const Balls& b, const std::vector<uint8_t>& alive, uint64_t seed, bool grid) {
  const Balls q = random_balls(seed, 40, b.dim, grid);
  for (size_t k = 0; k < q.size(); ++k) {
    const auto c = q.centre(k);
    const double r = q.radii[k];
    std::vector<uint32_t> containing, intersecting, contained;
    std::vector<std::pair<double, uint32_t>> order;
    std::pair<double, uint32_t> mate{std::numeric_limits<double>::infinity(), BallTree::kNone};
    for (uint32_t i = 0; i < b.size(); ++i) {
      if (!alive[i]) continue;
      const double d = gap(b, i, c);
      if (d + r <= b.radii[i]) containing.push_back(i);
      if (d <= r + b.radii[i]) intersecting.push_back(i);
      if (d + b.radii[i] <= r) contained.push_back(i);
      order.emplace_back(d, i);
      if (i != 3) mate = std::min(mate, {joint(b, i, c, r), i});
    }
    ASSERT_EQ(t.containing(c, r), containing);
    ASSERT_EQ(t.intersecting(c, r), intersecting);
    ASSERT_EQ(t.contained(c, r), contained);
    std::sort(order.begin(), order.end());
    const size_t m = std::min<size_t>(order.size(), 1 + k % 9);
    const auto found = t.nearest(c, m);
    ASSERT_EQ(found.size(), m);
    for (size_t i = 0; i < m; ++i) ASSERT_EQ(found[i], order[i].second);
    ASSERT_EQ(t.best_mate(c, r, 3), mate.second);
  }
}

TEST(BallTree, EveryBuildersQueriesEqualBruteForce) {
  for (const BallTreeBuilder builder : kBuilders)
    for (const int dim : {1, 2, 5, 10})
      for (const size_t n : {1u, 2u, 17u, 200u})
        for (const bool grid : {false, true}) {
          const Balls b = random_balls(n + 1000 * dim, n, dim, grid);
          const BallTree t = BallTree::build(b.centres, b.radii, dim, builder);
          ASSERT_EQ(t.size(), n);
          ASSERT_TRUE(t.valid());
          expect_queries(t, b, std::vector<uint8_t>(n, 1), n, grid);
        }
}

TEST(BallTree, InsertionsAndRemovalsKeepQueriesRight) {
  for (const bool cheap : {false, true}) {
    Balls b = random_balls(7, 150, 3, false);
    BallTree t(3);
    std::vector<uint8_t> alive(b.size(), 0);
    Rng rng(8, Stage::test);
    for (uint32_t i = 0; i < b.size(); ++i) {
      ASSERT_EQ(t.insert(b.centre(i), b.radii[i], cheap), i);
      alive[i] = 1;
    }
    for (int step = 0; step < 600; ++step) {
      const uint32_t i = rng.next_below(150);
      if (alive[i]) {
        t.remove(i);
        alive[i] = 0;
        EXPECT_THROW(t.remove(i), Error);
        if (step % 3 == 0) {  // an id that was given back comes again
          ASSERT_EQ(t.insert(b.centre(i), b.radii[i], cheap), i);
          alive[i] = 1;
        } else {
          b.radii[i] *= 0.5;
          ASSERT_EQ(t.insert(b.centre(i), b.radii[i], cheap), i);
          alive[i] = 1;
        }
      }
      if (step % 50 == 0) {
        ASSERT_TRUE(t.valid());
        expect_queries(t, b, alive, static_cast<uint64_t>(step), false);
      }
    }
    for (uint32_t i = 0; i < 150; ++i) t.remove(i), alive[i] = 0;
    EXPECT_EQ(t.size(), 0u);
    EXPECT_TRUE(t.valid());
    EXPECT_TRUE(t.nearest(b.centre(0), 5).empty());
    EXPECT_EQ(t.best_mate(b.centre(0), 1), BallTree::kNone);
  }
}

// The paper's brute force: all pairs of current balls, the least joint ball first.
double greedy_volume(const Balls& b) {
  Balls now = b;
  double sum = 0;
  while (now.size() > 1) {
    double best = std::numeric_limits<double>::infinity();
    size_t x = 0, y = 1;
    for (size_t i = 0; i < now.size(); ++i)
      for (size_t j = i + 1; j < now.size(); ++j)
        if (const double r = joint(now, i, now.centre(j), now.radii[j]); r < best) best = r, x = i, y = j;
    const double d = gap(now, x, now.centre(y)), rx = now.radii[x], ry = now.radii[y];
    std::vector<double> c(now.centre(x).begin(), now.centre(x).end());
    if (d + rx <= ry) {
      c.assign(now.centre(y).begin(), now.centre(y).end());
    } else if (d + ry > rx) {
      for (int k = 0; k < b.dim; ++k) c[k] += (now.centres[y * b.dim + k] - c[k]) * ((best - rx) / d);
    }
    sum += std::pow(best, b.dim);
    now.radii[x] = best;
    std::copy(c.begin(), c.end(), now.centres.begin() + static_cast<std::ptrdiff_t>(x * b.dim));
    now.radii.erase(now.radii.begin() + static_cast<std::ptrdiff_t>(y));
    now.centres.erase(now.centres.begin() + static_cast<std::ptrdiff_t>(y * b.dim),
                      now.centres.begin() + static_cast<std::ptrdiff_t>((y + 1) * b.dim));
  }
  return sum;
}

TEST(BallTree, BottomUpHasTheVolumeOfGreedyOverAllPairs) {
  for (const int dim : {2, 5, 10})
    for (uint64_t seed = 0; seed < 8; ++seed) {
      Balls b = random_balls(seed, 120, dim, false);
      if (seed % 2) std::fill(b.radii.begin(), b.radii.end(), 0.0);
      const BallTree t = BallTree::build(b.centres, b.radii, dim, BallTreeBuilder::bottom_up);
      const double expected = greedy_volume(b);
      // Inner balls are widened by 4e-15·sqrt(d) of their size a level.
      EXPECT_NEAR(t.total_volume() / expected, 1.0, 1e-12) << "dim " << dim << " seed " << seed;
    }
}

// Far from the origin, where single precision has steps as large as the distances between the balls. Steps of 2^-20
// around 2^24 are exact in double precision, and so are the differences.
TEST(BallTree, BottomUpIsAsGoodFarFromTheOrigin) {
  for (const int dim : {2, 5})
    for (uint64_t seed = 0; seed < 4; ++seed) {
      Rng rng(seed, Stage::test, 8);
      Balls b;
      b.dim = dim;
      for (size_t i = 0; i < 120; ++i) {
        for (int j = 0; j < dim; ++j) b.centres.push_back(rng.next_below(1u << 20) * 0x1p-20);
        b.radii.push_back(0);
      }
      const double expected = greedy_volume(b);
      for (double& x : b.centres) x += 0x1p24;
      const BallTree t = BallTree::build(b.centres, b.radii, dim, BallTreeBuilder::bottom_up);
      EXPECT_TRUE(t.valid());
      // Inner balls are widened by roundings of their coordinates, 4e-9 here, of radii from .01.
      EXPECT_NEAR(t.total_volume() / expected, 1.0, 1e-5) << "dim " << dim << " seed " << seed;
    }
}

TEST(BallTree, TinyBallsInTenDimensionsDoNotVanish) {
  Balls b = random_balls(3, 100, 10, false);
  for (double& x : b.centres) x *= 1e-4;
  for (double& r : b.radii) r *= 1e-4;
  for (const BallTreeBuilder builder : kBuilders) {
    const BallTree t = BallTree::build(b.centres, b.radii, 10, builder);
    EXPECT_TRUE(t.valid());
    EXPECT_GT(t.total_volume(), 0.0);
    EXPECT_LT(t.depth(), 60u);  // ties of underflown volumes would degenerate the tree
  }
}

TEST(BallTree, DuplicatesHaveNoVolume) {
  const std::vector<double> c(200, 0.5);
  for (const BallTreeBuilder builder : kBuilders) {
    const BallTree t = BallTree::build(c, {}, 2, builder);
    EXPECT_EQ(t.size(), 100u);
    EXPECT_EQ(t.total_volume(), 0.0);
    EXPECT_EQ(t.containing(std::span<const double>(c.data(), 2), 0).size(), 100u);
  }
}

// A chain of them would take minutes.
TEST(BallTree, ManyBallsThatAreAlikeTakeNoQuadraticTime) {
  constexpr size_t kCount = 200000;
  const std::vector<double> c(2 * kCount, 0.5), r(kCount, 1.0);
  for (const BallTreeBuilder builder : kBuilders)
    for (const bool points : {false, true}) {
      const BallTree t = BallTree::build(c, points ? std::span<const double>() : r, 2, builder);
      EXPECT_EQ(t.size(), kCount);
    }
}

TEST(BallTree, RefusesBadInputByName) {
  EXPECT_THROW(BallTree(0), Error);
  const std::vector<double> c{0, 0, 1, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_THROW(BallTree::build(c, {}, 2, BallTreeBuilder::kd), Error);
  const std::vector<double> ok{0, 0, 1, 1}, negative{1, -1};
  EXPECT_THROW(BallTree::build(ok, negative, 2, BallTreeBuilder::kd), Error);
  EXPECT_THROW(BallTree::build(ok, {}, 3, BallTreeBuilder::kd), Error);
  EXPECT_EQ(BallTree::build({}, {}, 2, BallTreeBuilder::top_down).size(), 0u);
}

TEST(BallQueryTree, NearestEqualsBruteForce) {
  for (const int dim : {1, 2, 3, 5, 10, 17})
    for (const size_t n : {0u, 1u, 15u, 16u, 17u, 1000u})
      for (const bool grid : {false, true}) {
        const Balls b = random_balls(n + 10 * dim, n, dim, grid);
        const BallQueryTree t(b.centres, dim);
        ASSERT_EQ(t.size(), n);
        BallQueryTree::Scratch scratch;
        const Balls q = random_balls(99, 50, dim, grid);
        for (size_t i = 0; i < q.size(); ++i) {
          std::vector<std::pair<double, uint32_t>> order;
          for (uint32_t p = 0; p < n; ++p) {
            double sum = 0;
            for (int j = 0; j < dim; ++j)
              sum +=
                  (b.centres[p * dim + j] - q.centres[i * dim + j]) * (b.centres[p * dim + j] - q.centres[i * dim + j]);
            order.emplace_back(sum, p);
          }
          std::sort(order.begin(), order.end());
          uint32_t index[12];
          double dist2[12];
          const size_t k = 1 + i % 12, found = t.nearest(&q.centres[i * dim], k, index, dist2, scratch);
          ASSERT_EQ(found, std::min(k, n));
          for (size_t j = 0; j < found; ++j) {
            ASSERT_EQ(dist2[j], order[j].first);
            ASSERT_EQ(index[j], order[j].second);
          }
          // Distances alone, of all but a range of points.
          const BallQueryTree::Range without{static_cast<uint32_t>(n / 3), static_cast<uint32_t>(n / 2)};
          std::erase_if(order, [&](const auto& p) { return p.second >= n / 3 && p.second < n / 3 + n / 2; });
          const size_t left = t.nearest_distances(&q.centres[i * dim], k, dist2, scratch, without);
          ASSERT_EQ(left, std::min(k, order.size()));
          for (size_t j = 0; j < left; ++j) ASSERT_EQ(dist2[j], order[j].first);
        }
      }
}

}  // namespace
}  // namespace lumicut
