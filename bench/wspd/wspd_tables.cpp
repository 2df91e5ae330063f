// Well-separated pairs, counted: depths of octrees, pairs, subgroups, and the clusters that single points need. [Bus 2015
// (thesis), tables 2.1 to 2.3, Alg. 2] All figures are counts: the same on every machine.
//
//   lumicut render bench/scenes/conference.json -i exhaustive --vpls 100000 --size 16x12 --vpl-out a.vpl -o a.exr
//   lumicut render ... --seed 2 --vpl-out b.vpl            other lights, whose places are the points to be shaded
//   bench_wspd --lights a.vpl --points b.vpl
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <vector>

#include "bench/smoke.h"
#include "core/rng.h"
#include "integrators/wspd/wspd_tree.h"
#include "io/vpl_file.h"

using namespace lumicut;

namespace {

// On the walls of a box, where there is no file.
std::vector<Vpl> walls(size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test);
  std::vector<Vpl> lights(n);
  for (Vpl& v : lights) {
    const uint32_t side = rng.next_below(6);
    const int axis = static_cast<int>(side / 2);
    v.kind = VplKind::oriented;
    v.position = {rng.next_float(), rng.next_float(), rng.next_float()};
    v.position[axis] = static_cast<float>(side % 2);
    v.normal[axis] = side % 2 == 0 ? 1.0f : -1.0f;
    v.intensity = Rgb{1, 1, 1};
  }
  return lights;
}

// Oriented lights and omni lights; others are left out.
std::vector<Vpl> read(const std::string& path) {
  std::vector<Vpl> lights;
  for (const lumicut_vpl& in : io::read_vpls(path).lights) {
    if (in.kind != LUMICUT_VPL_ORIENTED && in.kind != LUMICUT_VPL_OMNI) continue;
    Vpl v;
    v.kind = in.kind == LUMICUT_VPL_OMNI ? VplKind::omni : VplKind::oriented;
    for (int k = 0; k < 3; ++k)
      v.position[k] = in.position[k], v.normal[k] = in.normal[k], v.intensity[k] = in.intensity[k];
    lights.push_back(v);
  }
  return lights;
}

// Levels below the root until every light has a cell of its own (or 21, where lights meet), without compression.
int octree_depth(const std::vector<Vpl>& lights) {
  Aabb box;
  for (const Vpl& v : lights) box.extend(v.position);
  const float side = std::max(max_component(box.extent()), 1e-30f);
  std::vector<uint64_t> codes;
  for (const Vpl& v : lights) {
    uint64_t code = 0;
    uint32_t cell[3];
    for (int k = 0; k < 3; ++k)
      cell[k] = std::min<uint32_t>(
          0x1fffff, static_cast<uint32_t>(static_cast<double>(v.position[k] - box.lo[k]) / side * 0x200000));
    for (int bit = 20; bit >= 0; --bit)
      for (int k = 0; k < 3; ++k) code = code << 1 | (cell[k] >> bit & 1);
    codes.push_back(code);
  }
  std::sort(codes.begin(), codes.end());
  int depth = 0;
  for (size_t i = 1; i < codes.size(); ++i) {
    const uint64_t differ = codes[i] ^ codes[i - 1];
    depth = std::max(depth, differ == 0 ? 21 : 21 - (63 - __builtin_clzll(differ)) / 3);
  }
  return depth;
}

int tree_depth(const WspdTree& tree) {
  int deepest = 0;
  std::vector<int> depth(tree.nodes().size(), 0);  // parents come before children
  for (uint32_t n = 0; n < tree.nodes().size(); ++n) {
    if (const uint32_t p = tree.node(n).parent; p != WspdNode::kNone) depth[n] = depth[p] + 1;
    deepest = std::max(deepest, depth[n]);
  }
  return deepest;
}

struct Clusters {
  size_t of_light = 0, all = 0;  // of the nearest light; of the point
  double groups = 0;
};
// Alg. 2 for one point. `printed`: a cluster stays where it is further from the light than d / ε; else where it is
// well-separated from the point with ε / (1 - ε), which Lemma 2.4 has the former give.
Clusters clusters_of(const WspdTree& tree, const Vec3f& p, float separation, bool printed) {
  Clusters out;
  Aabb at;
  at.extend(p);
  const uint32_t leaf = tree.near_leaf(p);
  const Vec3f light = tree.node(leaf).center;
  const float limit = length(p - light) / separation, exact = separation / (1 - separation);
  std::vector<uint32_t> stack;
  const auto refine = [&](uint32_t v) {
    stack.assign(1, v);
    while (!stack.empty()) {
      const WspdNode& n = tree.node(stack.back());
      stack.pop_back();
      if (n.leaf() || well_separated(at, n, exact))
        ++out.all, out.groups += n.group_count;
      else
        for (uint32_t c = 0; c < n.child_count; ++c) stack.push_back(n.first_child + c);
    }
  };
  ++out.of_light;
  refine(leaf);
  for (uint32_t w = leaf; w != WspdNode::kNone; w = tree.node(w).parent)
    for (const uint32_t v : tree.pairs(w)) {
      ++out.of_light;
      const WspdNode& n = tree.node(v);
      if (printed && length(light - n.center) - n.radius >= limit)
        ++out.all, out.groups += n.group_count;
      else
        refine(v);
    }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Well-separated pairs of virtual lights, counted");
  std::string lights_file, points_file;
  std::vector<float> separations{0.9f, 0.7f, 0.5f, 0.3f};
  size_t point_count = bench::sized<size_t>(20000, 200);
  app.add_option("--lights", lights_file, "VPL file (none: lights on the walls of a box)");
  app.add_option("--points", points_file, "VPL file whose places are the points (none: likewise)");
  app.add_option("--separations", separations, "Epsilon of Def. 2.1")->check(CLI::Range(0.01, 0.99));
  app.add_option("--count", point_count, "Points, at most");
  CLI11_PARSE(app, argc, argv);
  try {
    const size_t generated = bench::sized<size_t>(100000, 500);
    const std::vector<Vpl> lights = lights_file.empty() ? walls(generated, 1) : read(lights_file);
    std::vector<Vpl> points = points_file.empty() ? walls(generated, 2) : read(points_file);
    if (lights.empty() || points.empty()) throw std::runtime_error("no lights with a place");
    const size_t step = std::max<size_t>(1, points.size() / point_count);
    std::printf("%zu lights, %zu points; octree %d deep\n\n", lights.size(), (points.size() + step - 1) / step,
                octree_depth(lights));
    std::printf(
        "| ε | compressed octree | pairs a light | clusters a point, d/ε | added, mean | added, most | clusters a "
        "point, "
        "exact test | added, mean | most | subgroups a cluster |\n|---|---|---|---|---|---|---|---|---|---|\n");
    for (const float separation : separations) {
      Progress progress;
      WspdTree::Options options;
      options.separation = separation;
      const WspdTree tree = WspdTree::build(lights, options, progress);
      if (tree.root() == WspdNode::kNone) throw std::runtime_error("no light shines");
      double all[2] = {}, added[2] = {}, groups = 0;
      long long most[2] = {};
      size_t n = 0;
      for (size_t i = 0; i < points.size(); i += step, ++n)
        for (const bool printed : {true, false}) {
          const Clusters c = clusters_of(tree, points[i].position, separation, printed);
          const auto more = static_cast<long long>(c.all) - static_cast<long long>(c.of_light);
          all[printed] += static_cast<double>(c.all), added[printed] += static_cast<double>(more);
          most[printed] = std::max(most[printed], more);
          if (printed) groups += c.groups;
        }
      const auto count = static_cast<double>(n);
      std::printf("| %.2g | %d | %.1f | %.0f | %.1f | %lld | %.0f | %.1f | %lld | %.1f |\n",
                  static_cast<double>(separation), tree_depth(tree),
                  static_cast<double>(tree.pair_count()) / static_cast<double>(tree.lights().size()), all[1] / count,
                  added[1] / count, most[1], all[0] / count, added[0] / count, most[0], groups / all[1]);
      std::fflush(stdout);
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_wspd: %s\n", e.what());
    return 1;
  }
}
