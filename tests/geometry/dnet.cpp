#include "geometry/dnet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/delaunay_reporter.h"
#include "geometry/hitting_set.h"
#include "geometry/instances.h"

namespace lumicut {
namespace {

TEST(Dnet, HitsEveryDiskAndStaysNearTheDefaultSolver) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    Rng rng(seed, Stage::test);
    std::vector<Point2> p(800);
    for (Point2& q : p) q = {rng.next_float(), rng.next_float()};
    std::vector<Disk> disks;
    // Even: a disk around each point, of which repeated ones in part; odd: random disks, some of them empty.
    for (const Point2& q : p)
      disks.push_back(seed % 2 ? Disk{{rng.next_float(), rng.next_float()}, 0.1 * rng.next_float()} : Disk{q, 0.06});
    DnetOptions o;
    o.drop_empty_disks = true;
    const DnetResult d = dnet_hitting_set(p, disks, o);
    std::vector<Disk> alive;
    for (const Disk& x : disks)
      for (const Point2& q : p)
        if (hits(q, x)) {
          alive.push_back(x);
          break;
        }
    EXPECT_EQ(d.empty_disks, disks.size() - alive.size());
    EXPECT_TRUE(unhit_disks(p, alive, d.points).empty());
    const HittingSet h = solve_hitting_set(p, alive);
    EXPECT_GE(d.points.size(), h.lower_bound);
    EXPECT_LE(static_cast<double>(d.points.size()),
              2.0 * static_cast<double>(h.points.size()));  // the paper: 1.3 on average
    o.prune = true;
    const DnetResult pruned = dnet_hitting_set(p, disks, o);
    EXPECT_TRUE(unhit_disks(p, alive, pruned.points).empty());
    EXPECT_LE(pruned.points.size(), d.points.size());
    EXPECT_EQ(dnet_hitting_set(p, disks, o).points, pruned.points);
  }
}

// Lemmas 7.2, 7.3: on grids, where points are cocircular, collinear and repeated, and on points at random; disks inside
// and outside the hull.
TEST(DelaunayReporter, ReportsThePointsOfEveryDiskThatTheNetDoesNotHit) {
  size_t reported = 0, unhit = 0;
  for (uint64_t seed = 0; seed < 120; ++seed) {
    Rng rng(seed, Stage::test, 9);
    const uint32_t grid = 3 + static_cast<uint32_t>(seed % 17);
    const bool random = seed % 3 == 0;
    const auto coordinate = [&](double scale) {
      return random ? scale * rng.next_float() : scale * rng.next_below(2 * grid + 1) / (2.0 * grid);
    };
    std::vector<Point2> p(60 + seed % 200);
    for (Point2& q : p) q = {std::floor(coordinate(2 * grid)), std::floor(coordinate(2 * grid))};
    if (random)
      for (Point2& q : p) q = {rng.next_float(), rng.next_float() * (seed % 2 ? 1e-6 : 1)};
    std::vector<uint32_t> net;
    for (uint32_t k = 0; k < seed % 20; ++k) net.push_back(rng.next_below(static_cast<uint32_t>(p.size())));
    const DelaunayReporter reporter(p, net);
    DelaunayNearest nearest(p);
    for (const uint32_t q : net) nearest.insert(q);
    for (int k = 0; k < 400; ++k) {
      const double span = random ? 1 : 2 * grid;
      Disk d{{-span + 0.5 * std::floor(6 * span * rng.next_float()),
              -span + 0.5 * std::floor(6 * span * rng.next_float())},
             0.5 * std::floor(2 * span * rng.next_float())};
      if (random)
        d = {{-1 + 3 * rng.next_float(), (-1 + 3 * rng.next_float()) * (seed % 2 ? 1e-6 : 1)}, rng.next_float()};
      const bool hit = std::any_of(net.begin(), net.end(), [&](uint32_t q) { return hits(p[q], d); });
      ASSERT_EQ(nearest.hit(d), hit);
      if (hit) continue;
      std::vector<uint32_t> found, expected;
      reporter.report(d, found);
      for (uint32_t i = 0; i < p.size(); ++i)
        if (hits(p[i], d)) expected.push_back(i);
      ASSERT_EQ(found, expected) << "seed " << seed << " disk " << k;
      reported += found.size(), ++unhit;
    }
  }
  EXPECT_GT(unhit, 5000u);
  EXPECT_GT(reported, 20000u);
}

TEST(Dnet, FindsTheSameSetsByDelaunayTriangulationsAsByAKdTree) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const auto p = seed % 2 ? gauss9_points(3000, seed) : uniform_points(3000, seed);
    const auto disks = seed < 2 ? random_disks(p, 3000, 0.1, seed) : fixed_disks(p, 0.02);
    DnetOptions o;
    o.net.mode = EpsilonNetOptions::Mode::thesis;
    const DnetResult kd = dnet_hitting_set(p, disks, o);
    o.structures = DnetOptions::Structures::delaunay;
    const DnetResult delaunay = dnet_hitting_set(p, disks, o);
    EXPECT_EQ(kd.points, delaunay.points);
    EXPECT_EQ(kd.reports, delaunay.reports);
    EXPECT_EQ(kd.reweighed, delaunay.reweighed);
  }
}

TEST(Dnet, DegenerateAndBadInput) {
  EXPECT_TRUE(dnet_hitting_set({}, {}).points.empty());
  const std::vector<Point2> p{{0, 0}, {0, 0}};
  EXPECT_FALSE(dnet_hitting_set(p, std::vector<Disk>{{{0, 0}, 1}}).points.empty());
  EXPECT_THROW(dnet_hitting_set(p, std::vector<Disk>{{{9, 0}, 1}}), Error);
  DnetOptions o;
  o.prune = true;
  EXPECT_EQ(dnet_hitting_set(p, std::vector<Disk>{{{0, 0}, 1}}, o).points.size(), 1u);
  o.c2 = -1;
  EXPECT_THROW(dnet_hitting_set(p, std::vector<Disk>{{{0, 0}, 1}}, o), Error);
}

}  // namespace
}  // namespace lumicut
