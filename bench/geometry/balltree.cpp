// Ball trees: volume and building time of the five builders on the paper's data (Omohundro 1989, figures 3-22), and
// nearest neighbours beside nanoflann and CGAL.
//
//   bench_balltree            all parts;   bench_balltree volumes | neighbours | figures   one of them
//   bench_balltree curves     figures 7-22 as CSV; bench/geometry/balltree_curves.py draws them
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "accel/agglomerate.h"
#include "bench_util.h"
#include "core/rng.h"
#include "geometry/ball_query_tree.h"
#include "geometry/balltree.h"
#include "point_sets.h"
#ifdef LUMICUT_HAS_NANOFLANN
#include <nanoflann.hpp>
#endif
#ifdef LUMICUT_HAS_CGAL
#include <CGAL/Dimension.h>
#include <CGAL/Euclidean_distance.h>
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits.h>
#endif

namespace lumicut::bench {
namespace {

struct Data {
  std::vector<double> centres, radii;
};

// The paper's four: uniform points, the Cantor set's product measure, a polynomial curve, uniform balls with radii to
// 0.1.
Data make(const char* kind, size_t n, int d, uint64_t seed) {
  Rng rng(seed, Stage::test, static_cast<uint64_t>(d));
  Data data;
  for (size_t i = 0; i < n; ++i) {
    const double t = uniform01(rng);
    for (int j = 0; j < d; ++j) {
      double x;
      if (!std::strcmp(kind, "cantor")) {
        x = 0;
        double digit = 2.0 / 3;
        for (int k = 0; k < 20; ++k, digit /= 3) x += rng.next_below(2) ? digit : 0;
      } else if (!std::strcmp(kind, "curve")) {
        x = std::pow(t, j + 1);
      } else {
        x = uniform01(rng);
      }
      data.centres.push_back(static_cast<double>(static_cast<float>(x)));
    }
    data.radii.push_back(std::strcmp(kind, "balls") ? 0.0 : static_cast<double>(0.1f * rng.next_float()));
  }
  return data;
}

constexpr BallTreeBuilder kBuilders[] = {BallTreeBuilder::kd, BallTreeBuilder::insertion,
                                         BallTreeBuilder::cheap_insertion, BallTreeBuilder::top_down,
                                         BallTreeBuilder::bottom_up};

void volumes() {
  std::printf("\n## total volume relative to kd, and seconds: kd, insertion, cheap insertion, top-down, bottom-up\n");
  std::printf("%-8s %2s %6s | %10s | %8s %8s %8s %8s | %8s %8s %8s %8s %8s\n", "data", "d", "leaves", "kd volume",
              "insert", "cheap", "top-down", "bottom", "kd", "insert", "cheap", "top-down", "bottom");
  for (const int d : {2, 5, 10})
    for (const char* kind : {"uniform", "cantor", "curve", "balls"})
      for (const size_t n : {100, 500, 3000}) {
        if (n > sized<size_t>(3000, 100)) break;
        const Data data = make(kind, n, d, 1);
        double volume[5], seconds[5];
        for (int b = 0; b < 5; ++b)
          seconds[b] =
              time_of([&] { volume[b] = BallTree::build(data.centres, data.radii, d, kBuilders[b]).total_volume(); });
        std::printf("%-8s %2d %6zu | %10.3g |", kind, d, n, volume[0]);
        for (int b = 1; b < 5; ++b) std::printf(" %8.3f", volume[b] / volume[0]);
        std::printf(" |");
        for (int b = 0; b < 5; ++b) std::printf(" %8.4f", seconds[b]);
        std::printf("\n");
      }
  const auto many = sized<size_t>(100000, 1000);
  std::printf("\n## bottom-up of %zu leaves, seconds\n", many);
  for (const int d : {2, 5, 10})
    for (const char* kind : {"uniform", "cantor", "curve", "balls"}) {
      const Data data = make(kind, many, d, 1);
      double volume = 0;
      const double s = time_of(
          [&] { volume = BallTree::build(data.centres, data.radii, d, BallTreeBuilder::bottom_up).total_volume(); });
      const double kd = BallTree::build(data.centres, data.radii, d, BallTreeBuilder::kd).total_volume();
      std::printf("%-8s %2d %8.2f s, volume %.3f of kd's\n", kind, d, s, volume / kd);
      std::fflush(stdout);
    }
}

// Figures 7-22.
void curves() {
  const char* names[] = {"kd", "insertion", "cheap insertion", "top-down", "bottom-up"};
  std::printf("data,dimension,leaves,builder,volume,seconds\n");
  for (const int d : {2, 5, 10})
    for (const char* kind : {"uniform", "cantor", "curve", "balls"})
      for (const size_t n : {20, 50, 100, 200, 500, 1000, 2000, 5000}) {
        if (n > sized<size_t>(5000, 50)) break;
        const Data data = make(kind, n, d, 1);
        for (int b = 0; b < 5; ++b) {
          double volume = 0, spent = 0;
          int builds = 0;  // short ones again and again
          do {
            spent +=
                time_of([&] { volume = BallTree::build(data.centres, data.radii, d, kBuilders[b]).total_volume(); });
            ++builds;
          } while (spent < sized(0.02, 0.0) && builds < 1000);
          std::printf("%s,%d,%zu,%s,%.6g,%.4g\n", kind, d, n, names[b], volume, spent / builds);
        }
        std::fflush(stdout);
      }
}

// Figures 3-5: brute force against the clever construction.
void figures() {
  std::printf(
      "\n## bottom-up by brute force and by best-match tree and heap, uniform points, milliseconds (figures 3-5)\n%6s",
      "leaves");
  for (const int d : {2, 5, 10}) std::printf(" %9s d=%-2d %9s d=%-2d", "brute", d, "heap", d);
  std::printf("\n");
  for (const size_t n : {40, 80, 120, 160, 200, 400}) {
    if (n > sized<size_t>(400, 80)) break;
    std::printf("%6zu", n);
    for (const int d : {2, 5, 10}) {
      const Data data = make("uniform", n, d, 1);
      const std::vector<float> c(data.centres.begin(), data.centres.end()), r(n, 0.0f);
      for (const Strategy s : {Strategy::naive, Strategy::heap})
        std::printf(" %14.3f", 1e3 * time_of([&] { agglomerate_balls(c, r, d, s); }));
    }
    std::printf("\n");
  }
}

#ifdef LUMICUT_HAS_NANOFLANN
struct Cloud {
  const std::vector<double>& p;
  size_t d;
  size_t kdtree_get_point_count() const { return p.size() / d; }
  double kdtree_get_pt(size_t i, size_t j) const { return p[i * d + j]; }
  template <typename B>
  bool kdtree_get_bbox(B&) const {
    return false;
  }
};
template <int D>
void with_nanoflann(const std::vector<double>& p, const std::vector<double>& q, size_t k, double& build, double& query,
                    double& sum) {
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, D, uint32_t>;
  const Cloud cloud{p, D};
  std::unique_ptr<Tree> tree;
  build = time_of([&] {
    tree = std::make_unique<Tree>(D, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    tree->buildIndex();
  });
  std::vector<uint32_t> index(k);
  std::vector<double> dist(k);
  sum = 0;
  query = time_of([&] {
    for (size_t i = 0; i < q.size(); i += D) tree->knnSearch(&q[i], k, index.data(), dist.data()), sum += dist[k - 1];
  });
}
#endif
#ifdef LUMICUT_HAS_CGAL
template <int D>
struct Coordinates {
  using result_type = const double*;
  const double* operator()(const std::array<double, D>& x) const { return x.data(); }
  const double* operator()(const std::array<double, D>& x, int) const { return x.data() + D; }
};
template <int D>
void with_cgal(const std::vector<double>& p, const std::vector<double>& q, size_t k, double& build, double& query,
               double& sum) {
  using Point = std::array<double, D>;
  using Traits = CGAL::Search_traits<double, Point, const double*, Coordinates<D>, CGAL::Dimension_tag<D>>;
  using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;
  using Tree = typename Search::Tree;
  std::vector<Point> points, queries;
  for (const auto& [from, to] : {std::pair{&p, &points}, std::pair{&q, &queries}})
    for (size_t i = 0; i < from->size(); i += D) {
      to->emplace_back();
      std::copy_n(from->begin() + static_cast<std::ptrdiff_t>(i), D, to->back().begin());
    }
  Tree tree(points.begin(), points.end());
  build = time_of([&] { tree.build(); });
  sum = 0;
  query = time_of([&] {
    for (const Point& x : queries) {
      Search search(tree, x, static_cast<unsigned>(k));
      double last = 0;
      for (const auto& r : search) last = r.second;
      sum += last;
    }
  });
}
#endif

template <int D>
void neighbours_in(const char* kind) {
  const size_t n = sized(100000, 1000), m = sized(10000, 100), k = 10;
  const Data data = make(kind, n, D, 1), queries = make(kind, m, D, 2);
  double best[3][2] = {{1e9, 1e9}, {1e9, 1e9}, {1e9, 1e9}}, sums[3] = {0, 0, 0};
  for (int run = 0; run < 3; ++run) {
    double build = 0, query = 0;
    std::unique_ptr<BallQueryTree> tree;
    build = time_of([&] { tree = std::make_unique<BallQueryTree>(data.centres, D); });
    BallQueryTree::Scratch scratch;
    std::vector<uint32_t> index(k);
    std::vector<double> dist(k);
    double sum = 0;
    query = time_of([&] {
      for (size_t i = 0; i < m; ++i)
        tree->nearest(&queries.centres[i * D], k, index.data(), dist.data(), scratch), sum += dist[k - 1];
    });
    best[0][0] = std::min(best[0][0], build), best[0][1] = std::min(best[0][1], query), sums[0] = sum;
#ifdef LUMICUT_HAS_NANOFLANN
    with_nanoflann<D>(data.centres, queries.centres, k, build, query, sums[1]);
    best[1][0] = std::min(best[1][0], build), best[1][1] = std::min(best[1][1], query);
#endif
#ifdef LUMICUT_HAS_CGAL
    with_cgal<D>(data.centres, queries.centres, k, build, query, sums[2]);
    best[2][0] = std::min(best[2][0], build), best[2][1] = std::min(best[2][1], query);
#endif
  }
  const double us = 1e6 / static_cast<double>(m);
  std::printf("%-8s %2d |", kind, D);
  for (const auto& b : best) std::printf(" %8.3f %8.2f |", b[0], b[1] * us);
  const auto same = [&](double s) { return s == 0 || std::fabs(s / sums[0] - 1) < 1e-9; };
  std::printf(" %6.2f %6.2f %s\n", best[0][1] / best[1][1], best[0][1] / best[2][1],
              same(sums[1]) && same(sums[2]) ? "" : "DIFFERENT ANSWERS");
  std::fflush(stdout);
}

void neighbours() {
  std::printf(
      "\n## 10 nearest of 100000 points: build seconds, microseconds a query (best of 3); ours, nanoflann, CGAL; "
      "ratios\n");
  for (const char* kind : {"uniform", "cantor", "curve"})
    neighbours_in<2>(kind), neighbours_in<5>(kind), neighbours_in<10>(kind);
}

}  // namespace
}  // namespace lumicut::bench

int main(int argc, char** argv) {
  using namespace lumicut::bench;
  if (argc > 1 && !std::strcmp(argv[1], "curves")) return curves(), 0;
  print_header("Ball trees", argc, argv, 1);
  const auto wanted = [&](const char* part) { return argc < 2 || !std::strcmp(argv[1], part); };
  if (wanted("figures")) figures();
  if (wanted("volumes")) volumes();
  if (wanted("neighbours")) neighbours();
}
