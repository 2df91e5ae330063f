// Which bound of a cluster says best that it is well-separated? The compressed octree of the WSPD method stays as it
// is; its clusters are bounded by
//   ball, box centre   around the middle of their box, as wide as its lights are (what the renderer has)
//   ball, least        the smallest there is [Welzl 1991]
//   ball, merged       smallest around the balls of the children, upwards [Omohundro 1989]: refitted in no time
//   box                half its diagonal for the radius, the gap between boxes for the distance
// Pairs are found by thesis Alg. 1, and each point (no blocks, no sampled visibility, no splitting of bright clusters)
// is lit by Alg. 2: one shadow ray a cluster, from the strongest of a few of its lights.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "bench/experiments/experiment_scene.h"
#include "bench/experiments/experiments.h"
#include "bench/geometry/bench_util.h"
#include "clusters/light_kernel.h"
#include "clusters/wspd_tree.h"
#include "core/parallel.h"
#include "core/rng.h"

namespace lumicut::bench {
namespace {

struct Ball {
  Vec3d centre;
  double radius = 0;
};

Vec3d wide(const Vec3f& v) { return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)}; }

bool holds(const Ball& b, const Vec3d& p) { return length(p - b.centre) <= b.radius * (1 + 1e-9) + 1e-12; }

// Smallest ball through `n` points (at most 4); flat sets of them leave the last out.
Ball through(const std::array<Vec3d, 4>& p, int n) {
  if (n == 0) return {{}, -1};
  // centre = p0 + Σ x_i (p_i − p0), with (c − p0)·(p_i − p0) = |p_i − p0|²/2
  double a[3][4] = {};
  for (int i = 1; i < n; ++i) {
    for (int j = 1; j < n; ++j) a[i - 1][j - 1] = dot(p[i] - p[0], p[j] - p[0]);
    a[i - 1][3] = 0.5 * dot(p[i] - p[0], p[i] - p[0]);
  }
  const int m = n - 1;
  for (int k = 0; k < m; ++k) {
    int pivot = k;
    for (int i = k + 1; i < m; ++i)
      if (std::abs(a[i][k]) > std::abs(a[pivot][k])) pivot = i;
    if (std::abs(a[pivot][k]) < 1e-14) return through(p, n - 1);
    std::swap(a[k], a[pivot]);
    for (int i = 0; i < m; ++i) {
      if (i == k) continue;
      const double f = a[i][k] / a[k][k];
      for (int j = k; j < 4; ++j) a[i][j] -= f * a[k][j];
    }
  }
  Vec3d c = p[0];
  for (int k = 0; k < m; ++k) c += (p[k + 1] - p[0]) * (a[k][3] / a[k][k]);
  return {c, length(c - p[0])};
}

// Moves to the front what changed the ball. [Welzl 1991; Gärtner 1999]
Ball least(std::vector<Vec3d>& points, size_t n, std::array<Vec3d, 4>& support, int supports) {
  Ball b = through(support, supports);
  if (supports == 4) return b;
  for (size_t i = 0; i < n; ++i) {
    if (b.radius >= 0 && holds(b, points[i])) continue;
    support[static_cast<size_t>(supports)] = points[i];
    b = least(points, i, support, supports + 1);
    std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(i),
                points.begin() + static_cast<std::ptrdiff_t>(i) + 1);
  }
  return b;
}

Ball merged(const Ball& a, const Ball& b) {
  const double d = length(b.centre - a.centre);
  if (d + b.radius <= a.radius) return a;
  if (d + a.radius <= b.radius) return b;
  const double r = 0.5 * (d + a.radius + b.radius);
  return {a.centre + (b.centre - a.centre) * ((r - a.radius) / d), r};
}

enum class Bound { centre, least, merged, box };

struct Bounds {
  Bound kind;
  std::vector<Ball> balls;
  std::vector<Aabb> boxes;

  bool separated(uint32_t a, uint32_t b, double separation) const {
    if (kind == Bound::box)
      return 0.5 * static_cast<double>(std::max(boxes[a].diagonal(), boxes[b].diagonal())) <
             separation * std::sqrt(static_cast<double>(boxes[a].dist2(boxes[b])));
    return std::max(balls[a].radius, balls[b].radius) <
           separation * (length(balls[a].centre - balls[b].centre) - balls[a].radius - balls[b].radius);
  }
  bool separated(const Vec3f& p, uint32_t a, double separation) const {
    if (kind == Bound::box)
      return 0.5 * static_cast<double>(boxes[a].diagonal()) <
             separation * std::sqrt(static_cast<double>(boxes[a].dist2(p)));
    return balls[a].radius < separation * (length(balls[a].centre - wide(p)) - balls[a].radius);
  }
  double size(uint32_t a) const {
    return kind == Bound::box ? 0.5 * static_cast<double>(boxes[a].diagonal()) : balls[a].radius;
  }
};

Bounds make_bounds(const WspdTree& tree, Bound kind) {
  const size_t n = tree.nodes().size();
  Bounds out{kind, std::vector<Ball>(n), std::vector<Aabb>(n)};
  std::vector<Vec3d> points;
  for (size_t i = n; i-- > 0;) {  // children first
    const WspdNode& node = tree.nodes()[i];
    for (uint32_t l = node.first; l < node.last; ++l) out.boxes[i].extend(tree.lights()[l].position);
    Ball& b = out.balls[i];
    b = {wide(node.center), static_cast<double>(node.radius)};
    if (kind == Bound::merged && !node.leaf()) {
      b = out.balls[node.first_child];
      for (uint32_t c = 1; c < node.child_count; ++c) b = merged(b, out.balls[node.first_child + c]);
    } else if (kind == Bound::least && node.last - node.first > 1) {
      points.clear();
      for (uint32_t l = node.first; l < node.last; ++l) points.push_back(wide(tree.lights()[l].position));
      Rng rng(1, Stage::test, i);
      for (size_t k = points.size(); k > 1; --k)
        std::swap(points[k - 1], points[rng.next_below(static_cast<uint32_t>(k))]);
      std::array<Vec3d, 4> support{};
      const Ball tight = least(points, points.size(), support, 0);
      if (tight.radius < b.radius) b = tight;
    }
  }
  return out;
}

// Alg. 1. Pairs of each node.
std::vector<std::vector<uint32_t>> find_pairs(const WspdTree& tree, const Bounds& bounds, double separation,
                                              size_t& count) {
  std::vector<std::vector<uint32_t>> pairs(tree.nodes().size());
  std::vector<std::pair<uint32_t, uint32_t>> stack{{tree.root(), tree.root()}};
  count = 0;
  while (!stack.empty()) {
    auto [w, v] = stack.back();
    stack.pop_back();
    const WspdNode& n = tree.node(w);
    if (w == v) {
      for (uint32_t i = 0; i < n.child_count; ++i)
        for (uint32_t j = i; j < n.child_count; ++j) stack.emplace_back(n.first_child + i, n.first_child + j);
      continue;
    }
    if ((n.leaf() && tree.node(v).leaf()) || bounds.separated(w, v, separation)) {
      pairs[w].push_back(v), pairs[v].push_back(w);
      ++count;
      continue;
    }
    if (n.leaf() || (!tree.node(v).leaf() && bounds.size(w) < bounds.size(v))) std::swap(w, v);
    for (uint32_t i = 0; i < tree.node(w).child_count; ++i) stack.emplace_back(tree.node(w).first_child + i, v);
  }
  return pairs;
}

Vec3f shadow_origin(const WspdTree& tree, const WspdNode& n, const Vec3f& point) {
  const uint32_t step = std::max(1u, (n.last - n.first) / 8);
  uint32_t best = n.first;
  float most = -1;
  for (uint32_t i = n.first; i < n.last; i += step) {
    const Vpl& v = tree.lights()[i];
    const float c = std::max(0.0f, dot(v.normal, normalize(point - v.position))) * luminance(v.intensity);
    if (c > most) most = c, best = i;
  }
  return tree.lights()[best].position;
}

struct Result {
  std::vector<Rgb> image;
  uint64_t clusters = 0, rays = 0;
};

Result shade(const ExperimentScene& s, const WspdTree& tree, const Bounds& bounds,
             const std::vector<std::vector<uint32_t>>& pairs, double separation) {
  Result out;
  out.image.resize(s.points.size());
  std::vector<uint64_t> clusters(s.points.size()), rays(s.points.size());
  const double of_point = separation / (1 - separation);  // as in integrators/wspd.cpp
  parallel_chunks(s.points.size(), 64, [&](size_t begin, size_t end) {
    std::vector<uint32_t> stack;
    std::vector<uint32_t> cut;
    for (size_t i = begin; i < end; ++i) {
      const SurfacePoint p = s.points.get(i);
      cut.clear();
      const auto add = [&](uint32_t v) {
        stack.assign(1, v);
        while (!stack.empty()) {
          const uint32_t top = stack.back();
          stack.pop_back();
          const WspdNode& n = tree.node(top);
          if (n.leaf() || bounds.separated(p.position, top, of_point))
            cut.push_back(top);
          else
            for (uint32_t c = 0; c < n.child_count; ++c) stack.push_back(n.first_child + c);
        }
      };
      const uint32_t leaf = tree.near_leaf(p.position);
      add(leaf);
      for (uint32_t w = leaf; w != WspdNode::kNone; w = tree.node(w).parent)
        for (const uint32_t v : pairs[w]) add(v);
      clusters[i] = cut.size();
      for (const uint32_t c : cut) {
        const WspdNode& n = tree.node(c);
        Rgb light{};
        for (const Vpl& g : tree.groups(n)) light += light_point(g, g.intensity, s.clamp2, p);
        if (!(luminance(light) > 0)) continue;
        uint8_t occluded = 0;
        const Vec3f origin = n.leaf() ? tree.lights()[n.first].position : shadow_origin(tree, n, p.position);
        s.scene->accel().occluded_from_point(origin, false, &p.position.x, &p.position.y, &p.position.z, 1, &occluded);
        ++rays[i];
        if (occluded == 0) out.image[i] += light;
      }
    }
  });
  for (size_t i = 0; i < clusters.size(); ++i) out.clusters += clusters[i], out.rays += rays[i];
  return out;
}

}  // namespace

bool separation(const char* name) {
  const auto s = make_room(name, sized(64u, 12u), sized(1500u, 50u), sized(4500u, 150u));
  if (!s) return false;
  // With so wide a separation nearly every node is in a pair, and all below it have their subgroups.
  Progress progress;
  const WspdTree tree = WspdTree::build(s->lights.lights, {.separation = 100.0f}, progress);
  const auto points = static_cast<double>(s->points.size());
  std::printf("\n## separation, %s: %ux%u, %zu lights, %zu octree nodes\n", name, s->side, s->side,
              tree.lights().size(), tree.nodes().size());
  std::printf(
      "at equal mean error: beside \"ball, box centre\" at the separation that gives it (interpolated); CPU relative "
      "to "
      "\"ball, box centre\"\n");
  std::printf("%-5s %-17s | %8s | %8s %8s | %6s %6s | %-22s | %7s %7s | %s\n", "eps", "bound", "pairs", "clusters",
              "rays", "RMSE", "mean", "equal error: pairs rays", "bound.", "shade", "radius");
  struct Row {
    double pairs, clusters, rays, rmse, mean, bounding, shading, radius;
  };
  const auto measure = [&](Bound kind, double eps) {
    Row row{};
    Bounds bounds;
    std::vector<std::vector<uint32_t>> pairs;
    size_t count = 0;
    row.bounding = time_of([&] {
      bounds = make_bounds(tree, kind);
      pairs = find_pairs(tree, bounds, eps, count);
    });
    Result r;
    row.shading = time_of([&] { r = shade(*s, tree, bounds, pairs, eps); });
    for (uint32_t n = 0; n < tree.nodes().size(); ++n) row.radius += bounds.size(n);
    row.pairs = static_cast<double>(count);
    row.clusters = static_cast<double>(r.clusters) / points, row.rays = static_cast<double>(r.rays) / points;
    row.rmse = rmse(r.image, s->reference), row.mean = mean_error(r.image, s->reference);
    return row;
  };
  const double steps[] = {0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6};
  std::vector<Row> centre;
  for (const double eps : steps) centre.push_back(measure(Bound::centre, eps));
  // What "ball, box centre" takes for that mean error; logarithms between neighbours of the sweep. 0 beyond its ends.
  const auto at_equal_error = [&](double mean, double Row::*what) {
    for (size_t i = 0; i + 1 < centre.size(); ++i) {
      if (!(centre[i].mean <= mean && mean <= centre[i + 1].mean)) continue;
      const double t = std::log(mean / centre[i].mean) / std::log(centre[i + 1].mean / centre[i].mean);
      return centre[i].*what * std::pow(centre[i + 1].*what / (centre[i].*what), t);
    }
    return 0.0;
  };
  for (const size_t step : {2, 4, 6}) {
    const Row& first = centre[step];
    for (const auto& [label, kind] : {std::pair{"ball, box centre", Bound::centre},
                                      {"ball, least", Bound::least},
                                      {"ball, merged", Bound::merged},
                                      {"box", Bound::box}}) {
      const Row row = kind == Bound::centre ? first : measure(kind, steps[step]);
      const double equal_pairs = at_equal_error(row.mean, &Row::pairs),
                   equal_rays = at_equal_error(row.mean, &Row::rays);
      std::printf("%-5.2f %-17s | %8.0f | %8.1f %8.1f | %.4f %5.2f%% | %11.2f %11.2f | %7.2f %7.2f | %.3f\n",
                  steps[step], label, row.pairs, row.clusters, row.rays, row.rmse, 100 * row.mean,
                  equal_pairs > 0 ? row.pairs / equal_pairs : 0.0, equal_rays > 0 ? row.rays / equal_rays : 0.0,
                  row.bounding / first.bounding, row.shading / first.shading, row.radius / first.radius);
      std::fflush(stdout);
    }
  }
  return true;
}

}  // namespace lumicut::bench
