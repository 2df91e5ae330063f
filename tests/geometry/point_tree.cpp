#include "geometry/point_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/rng.h"

namespace lumicut {
namespace {

TEST(PointTree, ReportsAndFlagsAsBruteForceDoes) {
  Rng rng(3, Stage::test);
  for (const int n : {0, 1, 7, 9, 300}) {
    std::vector<Point2> p(n);
    // A coarse grid, so that points repeat and lie on rims.
    for (Point2& q : p) q = {rng.next_below(12) * 0.25, rng.next_below(12) * 0.25};
    PointTree tree(p);
    std::vector<bool> flag(n, false);
    for (int query = 0; query < 400; ++query) {
      if (n > 0) {
        const uint32_t id = rng.next_below(n);
        flag[id] = rng.next_below(4) == 0;
        tree.set_flag(id, flag[id]);
        EXPECT_EQ(tree.flagged(id), flag[id]);
      }
      const Disk d{{rng.next_below(12) * 0.25, rng.next_below(12) * 0.25}, rng.next_below(8) * 0.25};
      std::vector<uint32_t> found, expected;
      bool any = false;
      tree.for_each_in(d, [&](uint32_t id) { found.push_back(id); });
      for (int i = 0; i < n; ++i)
        if (hits(p[i], d)) expected.push_back(i), any = any || flag[i];
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found, expected);
      ASSERT_EQ(tree.count_in(d), expected.size());
      ASSERT_EQ(tree.any_flagged_in(d), any);
    }
    tree.clear_flags();
    EXPECT_FALSE(tree.any_flagged_in({{1, 1}, 100}));
  }
}

}  // namespace
}  // namespace lumicut
