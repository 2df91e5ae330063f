// Dynamic hull of a sliding window on a simple chain, beside two stacks of Melkman hulls and beside building anew.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "bench_util.h"
#include "core/rng.h"
#include "geometry/dynamic_hull.h"
#include "two_stack_hull.h"

namespace lumicut::bench {
namespace {

// Simple chains, by the number of the point. Walk: x-monotone noise, few hull vertices. Zigzag: teeth on a large
// circle, half of the window on the hull. Spiral: outward, one turn every 300 points.
Point2 chain_point(const char* kind, size_t i, size_t window) {
  Rng rng(1, Stage::test, i);
  const double t = static_cast<double>(i);
  if (!std::strcmp(kind, "walk")) return {t, rng.next_float() * 1000.0};
  if (!std::strcmp(kind, "zigzag")) {
    const double a = t * 4.0 / static_cast<double>(window), r = i % 2 ? 1.0 : 0.9;
    return {r * std::cos(a), r * std::sin(a)};
  }
  const double a = t * (6.283185307179586 / 300), r = 1.0 + a;
  return {r * std::cos(a), r * std::sin(a)};
}

void monotone_chain(std::vector<Point2> p, std::vector<Point2>& h) {
  std::sort(p.begin(), p.end(),
            [](const Point2& a, const Point2& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
  h.resize(2 * p.size() + 1);
  size_t k = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    while (k >= 2 && orientation(h[k - 2], h[k - 1], p[i]) <= 0) --k;
    h[k++] = p[i];
  }
  for (size_t i = p.size() - 1, t = k + 1; i-- > 0;) {
    while (k >= t && orientation(h[k - 2], h[k - 1], p[i]) <= 0) --k;
    h[k++] = p[i];
  }
  h.resize(p.size() > 1 ? k - 1 : k);
}

double support_x(const std::vector<Point2>& h) {
  double best = -1e300;
  for (const Point2& p : h) best = std::max(best, p.x + 0.3 * p.y);
  return best;
}

}  // namespace
}  // namespace lumicut::bench

int main(int argc, char** argv) {
  using namespace lumicut;
  using namespace lumicut::bench;
  print_header("Dynamic hull: microseconds an update (an insertion or a deletion), median of 5 runs", argc, argv, 1);
  std::printf("%-8s %9s %10s %10s %10s %12s %12s %10s\n", "chain", "window", "dynamic", "two-stack", "hull size",
              "melkman anew", "sorted anew", "equal");
  for (const char* kind : {"walk", "zigzag", "spiral"})
    for (size_t w = 100; w <= sized<size_t>(1000000, 1000); w *= 10) {
      const size_t steps = std::max<size_t>(sized(400000, 4000), 3 * w);
      std::vector<Point2> points(w + steps);
      // The zigzag's window spans 4 radians, so that the chain stays simple within any window.
      for (size_t i = 0; i < points.size(); ++i) points[i] = chain_point(kind, i, w);
      double dynamic[5], stacks[5], melkman = 0, sorted = 0;
      size_t hull_size = 0;
      bool equal = true;
      for (int run = 0; run < 5; ++run) {
        DynamicHull d;
        TwoStackHull s;
        for (size_t i = 0; i < w; ++i) d.push_front(points[i]), s.push_front(points[i]);
        dynamic[run] = time_of([&] {
          for (size_t i = w; i < points.size(); ++i) d.push_front(points[i]), d.pop_back();
        });
        stacks[run] = time_of([&] {
          for (size_t i = w; i < points.size(); ++i) s.push_front(points[i]), s.pop_back();
        });
        hull_size = d.hull_size();
        std::vector<Point2> window(points.end() - static_cast<std::ptrdiff_t>(w), points.end()), h, mine, both;
        monotone_chain(window, h);
        d.hull(mine);
        s.for_each_vertex([&](const Point2& p) { both.push_back(p); });
        equal = equal && h.size() == mine.size() && support_x(h) == support_x(mine) && support_x(h) == support_x(both);
      }
      if (w <= 1000) {
        const auto rebuilds = sized<size_t>(2000, 20);
        MelkmanDeque deque;
        melkman = time_of([&] {
                    for (size_t r = 0; r < rebuilds; ++r) {
                      deque.reset(w);
                      for (size_t i = 0; i < w; ++i) deque.push(points[r + i], [](size_t, const Point2&) {});
                    }
                  }) *
                  1e6 / static_cast<double>(rebuilds);
        std::vector<Point2> h;
        sorted = time_of([&] {
                   for (size_t r = 0; r < rebuilds; ++r)
                     monotone_chain({points.begin() + static_cast<std::ptrdiff_t>(r),
                                     points.begin() + static_cast<std::ptrdiff_t>(r + w)},
                                    h);
                 }) *
                 1e6 / static_cast<double>(rebuilds);
      }
      std::sort(dynamic, dynamic + 5), std::sort(stacks, stacks + 5);
      const double per = 1e6 / (2.0 * static_cast<double>(steps));
      std::printf("%-8s %9zu %10.4f %10.4f %10zu ", kind, w, dynamic[2] * per, stacks[2] * per, hull_size);
      if (w <= 1000)
        std::printf("%12.3f %12.3f ", melkman, sorted);
      else
        std::printf("%12s %12s ", "-", "-");
      std::printf("%10s\n", equal ? "yes" : "NO");
    }
}
