#include "geometry/dynamic_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <unordered_set>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/predicates.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

// Andrew's monotone chain on the exact predicate: strictly convex, counter-clockwise, from the lexicographically least.
std::vector<Point2> static_hull(std::vector<Point2> p) {
  const auto less = [](const Point2& a, const Point2& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); };
  std::sort(p.begin(), p.end(), less);
  p.erase(std::unique(p.begin(), p.end()), p.end());
  if (p.size() < 3) return p;
  std::vector<Point2> h(2 * p.size());
  size_t k = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    while (k >= 2 && orientation(h[k - 2], h[k - 1], p[i]) <= 0) --k;
    h[k++] = p[i];
  }
  for (size_t i = p.size() - 1, t = k + 1; i-- > 0;) {
    while (k >= t && orientation(h[k - 2], h[k - 1], p[i]) <= 0) --k;
    h[k++] = p[i];
  }
  h.resize(k - 1);
  return h;
}

std::vector<Point2> canonical(const DynamicHull& hull) {
  std::vector<Point2> h;
  hull.hull(h);
  EXPECT_EQ(h.size(), hull.hull_size());
  if (h.empty()) return h;
  const auto less = [](const Point2& a, const Point2& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); };
  std::rotate(h.begin(), std::min_element(h.begin(), h.end(), less), h.end());
  return h;
}

// A window on a chain, its hull, and the oracle after every operation.
struct Fuzz {
  DynamicHull hull;
  std::deque<Point2> window;
  std::vector<Point2> scratch;
  size_t operations = 0;
  bool good = true;

  void push(const Point2& p) { window.push_back(p), hull.push_front(p), check(); }
  void pop() { window.pop_front(), hull.pop_back(), check(); }
  void check() {
    ++operations;
    scratch.assign(window.begin(), window.end());
    good = good && hull.size() == window.size() && canonical(hull) == static_hull(scratch);
  }
};

bool segments_touch(const Point2& a, const Point2& b, const Point2& c, const Point2& d) {
  const int o1 = orientation(a, b, c), o2 = orientation(a, b, d), o3 = orientation(c, d, a), o4 = orientation(c, d, b);
  return (o1 * o2 < 0 && o3 * o4 < 0) || (o1 == 0 && between(a, b, c)) || (o2 == 0 && between(a, b, d)) ||
         (o3 == 0 && between(c, d, a)) || (o4 == 0 && between(c, d, b));
}

// May the chain go on to p without touching itself? Going straight on is allowed, folding back is not.
bool stays_simple(const std::deque<Point2>& w, const Point2& p) {
  if (w.empty() || w.back() == p) return true;
  const Point2 q = w.back();
  size_t n = w.size();
  while (n > 0 && w[n - 1] == q) --n;  // repeated ends
  if (n == 0) return true;
  if (orientation(w[n - 1], q, p) == 0 && (between(w[n - 1], q, p) || between(q, p, w[n - 1]))) return false;
  for (size_t i = 0; i + 1 < n; ++i)
    if (segments_touch(q, p, w[i], w[i + 1])) return false;
  return true;
}

// A snake of integer points: it grows by random simple steps, and sheds its tail when it is long or caught.
void crawl(Fuzz& f, Rng& rng, int range, int step, size_t longest, size_t operations) {
  bool shrink = false;
  while (f.operations < operations && f.good) {
    if (f.window.size() >= longest) shrink = true;
    if (f.window.empty()) shrink = false;
    if (shrink) {
      f.pop();
      if (rng.next_below(20) == 0) shrink = false;
      continue;
    }
    if (rng.next_below(400) == 0) shrink = true;
    bool moved = false;
    for (int attempt = 0; attempt < 8 && !moved; ++attempt) {
      Point2 p;
      if (f.window.empty()) {
        p = {static_cast<double>(rng.next_below(range)), static_cast<double>(rng.next_below(range))};
      } else {
        p.x = f.window.back().x + static_cast<int>(rng.next_below(2 * step + 1)) - step;
        p.y = f.window.back().y + static_cast<int>(rng.next_below(2 * step + 1)) - step;
        if (p.x < 0 || p.y < 0 || p.x >= range || p.y >= range) continue;
      }
      if (!stays_simple(f.window, p)) continue;
      f.push(p);
      moved = true;
    }
    if (!moved && !f.window.empty()) f.pop();
  }
}

TEST(DynamicHull, EqualsTheStaticHullAfterEveryOneOfAMillionOperations) {
  size_t total = 0;
  uint64_t seed = 0;
  // Coarse grids make collinear runs the rule, fine ones general position; long windows many phases and states.
  for (const int range : {3, 6, 12, 40, 1000})
    for (const int step : {1, 2, 5, 300})
      for (const size_t longest : {4u, 12u, 40u, 120u}) {
        if (step > range || (longest > 40 && step > 5)) continue;
        Rng rng(++seed, Stage::test);
        Fuzz f;
        crawl(f, rng, range, step, longest, test::trimmed(23000));
        ASSERT_TRUE(f.good) << "range " << range << " step " << step << " longest " << longest << " at operation "
                            << f.operations;
        total += f.operations;
      }
  EXPECT_GE(total, test::trimmed(1000000));
}

TEST(DynamicHull, FollowsSpiralsAndMonotoneWalksInDoubles) {
  for (const double growth : {1.01, 0.99, 1.0005}) {
    Fuzz f;
    for (int i = 0; i < 3000 && f.good; ++i) {
      const double r = std::pow(growth, i), t = i * 0.37;
      f.push({r * std::cos(t), r * std::sin(t)});
      if (f.window.size() > 60)
        for (int k = 0; k < 1 + i % 2 && f.window.size() > 30; ++k) f.pop();
    }
    EXPECT_TRUE(f.good) << growth;
  }
  Fuzz f;
  Rng rng(5, Stage::test);
  for (int i = 0; i < 5000 && f.good; ++i) {
    f.push({static_cast<double>(i), rng.next_float() * 100.0});
    if (i % 700 > 50) f.pop();
  }
  EXPECT_TRUE(f.good);
}

// All points of the chain within one rounding error of a line: only exact signs keep the hull right.
TEST(DynamicHull, IsExactWhereRoundingHidesTheTurn) {
  Fuzz f;
  Rng rng(9, Stage::test);
  double x = 0.1;
  for (int i = 0; i < 4000 && f.good; ++i) {
    x = std::nextafter(x + 1e-9 * rng.next_float(), 1.0);
    double y = x * 1.3;
    for (uint32_t k = rng.next_below(3); k > 0; --k) y = std::nextafter(y, 2.0);
    f.push({x, y});
    if (i > 25) f.pop();
  }
  EXPECT_TRUE(f.good);
}

TEST(DynamicHull, RepeatedPointsLeaveOneByOne) {
  Fuzz f;
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) f.push({static_cast<double>(i), static_cast<double>(i * i)});
    while (!f.window.empty()) f.pop();
  }
  EXPECT_TRUE(f.good);
  EXPECT_TRUE(f.hull.empty());
}

TEST(DynamicHull, CollinearChainsGiveTheirTwoEnds) {
  Fuzz f;
  for (int i = 0; i < 40; ++i) {
    f.push({0.1 * i, 0.0});
    if (i > 10) f.pop();
  }
  EXPECT_TRUE(f.good);
  EXPECT_EQ(f.hull.hull_size(), 2u);
}

TEST(DynamicHull, RefusesBadInputByName) {
  DynamicHull hull;
  EXPECT_THROW(hull.pop_back(), Error);
  EXPECT_THROW(hull.push_front({std::numeric_limits<double>::quiet_NaN(), 0}), Error);
  EXPECT_THROW(hull.push_front({0, std::numeric_limits<double>::infinity()}), Error);
  hull.push_front({1, 2});
  EXPECT_EQ(hull.hull_size(), 1u);
}

TEST(DynamicHull, DebugCheckNoticesACrossingAndAFold) {
  DynamicHull::Options options;
  options.check_simple = true;
  DynamicHull hull(options);
  for (const Point2 p : {Point2{0, 0}, Point2{2, 0}, Point2{2, 2}}) hull.push_front(p);
  EXPECT_THROW(hull.push_front({1, -1}), Error);  // crosses the first segment
  EXPECT_THROW(hull.push_front({2, 1}), Error);   // folds back on the last
  EXPECT_THROW(hull.push_front({0, 0}), Error);   // touches the first point
  hull.push_front({0, 2});
  EXPECT_EQ(hull.hull_size(), 4u);
}

// A chain that crosses itself may give a wrong hull or an error, but neither a crash nor a hang.
TEST(DynamicHull, SurvivesChainsThatAreNotSimple) {
  int errors = 0;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    Rng rng(seed, Stage::test);
    DynamicHull hull;
    try {
      for (int i = 0; i < 400; ++i) {
        hull.push_front({static_cast<double>(rng.next_below(9)), static_cast<double>(rng.next_below(9))});
        if (rng.next_below(2) && i > 10) hull.pop_back();
      }
    } catch (const Error&) {
      ++errors;
    }
  }
  EXPECT_GT(errors, 0);
}

TEST(Orientation, ExactStageSettlesWhatTheFilterCannot) {
  const Point2 a{0.5, 0.5}, b{12, 12};
  EXPECT_EQ(orientation(a, b, {24, 24}), 0);
  const double up = std::nextafter(24.0, 25.0), down = std::nextafter(24.0, 23.0);
  EXPECT_EQ(orientation(a, b, {24, up}), 1);
  EXPECT_EQ(orientation(a, b, {24, down}), -1);
  // Shewchuk's grid: a step of 2^-53 in either coordinate of (0.5, 0.5) against the line through (12, 12) and (24, 24).
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j) {
      const Point2 p{0.5 + i * 0x1p-53, 0.5 + j * 0x1p-53};
      const int expected = (p.y > p.x) - (p.y < p.x);  // left of the diagonal, which runs up
      EXPECT_EQ(orientation({12, 12}, {24, 24}, p), expected);
      EXPECT_EQ(orientation({24, 24}, p, {12, 12}), expected);
    }
}

}  // namespace
}  // namespace lumicut
