#include "geometry/dnet.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/hitting_set.h"

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
