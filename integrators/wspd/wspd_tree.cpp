#include "integrators/wspd/wspd_tree.h"

#include <tbb/parallel_sort.h>

#include <bit>

#include "core/parallel.h"
#include "core/rng.h"

namespace lumicut {

namespace {

// Bits of x (21 of them), two apart.
uint64_t spread_bits(uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

}  // namespace

uint64_t WspdTree::Cube::code(const Vec3f& p) const {
  uint64_t out = 0;
  for (int k = 0; k < 3; ++k) {
    // The lights fill half of the cube, somewhere in it: the random shift of the octree.
    const double x = 0.5 * ((static_cast<double>(p[k]) - lower[k]) / side + shift[static_cast<size_t>(k)]);
    const auto cell = static_cast<uint64_t>(std::clamp(x, 0.0, 1.0) * 2097151.0);
    out |= spread_bits(cell) << (2 - k);
  }
  return out;
}

uint32_t WspdTree::add_octree(const std::vector<Vpl>& lights, std::vector<uint32_t> members, bool distant,
                              const Cube& cube) {
  if (members.empty()) return WspdNode::kNone;
  std::vector<std::pair<uint64_t, uint32_t>> order(members.size());
  parallel_chunks(members.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vpl& v = lights[members[i]];
      order[i] = {cube.code(distant ? v.normal : v.position), members[i]};
    }
  });
  tbb::parallel_sort(order.begin(), order.end());
  const auto base = static_cast<uint32_t>(lights_.size());
  for (const auto& [code, index] : order) lights_.push_back(lights[index]);
  const auto root = static_cast<uint32_t>(nodes_.size());
  WspdNode top;
  top.first = base, top.last = static_cast<uint32_t>(lights_.size());
  nodes_.push_back(top);
  // Breadth first; a node's children are split at the highest place where its codes differ, however deep that lies.
  for (uint32_t n = root; n < nodes_.size(); ++n) {
    const uint32_t first = nodes_[n].first, last = nodes_[n].last;
    const uint64_t differ = order[first - base].first ^ order[last - 1 - base].first;
    if (differ == 0) continue;
    const int shift = (63 - std::countl_zero(differ)) / 3 * 3;
    const auto digit = [&](uint32_t light) { return order[light - base].first >> shift & 7; };
    nodes_[n].first_child = static_cast<uint32_t>(nodes_.size());
    for (uint32_t begin = first; begin < last;) {
      uint32_t low = begin + 1, high = last;  // the first light of another digit
      const uint64_t own = digit(begin);
      while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (digit(middle) == own)
          low = middle + 1;
        else
          high = middle;
      }
      WspdNode child;
      child.first = begin, child.last = low, child.parent = n;
      nodes_.push_back(child);
      ++nodes_[n].child_count;
      begin = low;
    }
  }
  if (!distant) {
    for (const auto& [code, index] : order) codes_.push_back(code);
    leaf_.resize(order.size());
    for (uint32_t n = root; n < nodes_.size(); ++n)
      if (nodes_[n].leaf()) std::fill(leaf_.begin() + nodes_[n].first, leaf_.begin() + nodes_[n].last, n);
  }
  return root;
}

void WspdTree::find_balls(Progress& progress) {
  parallel_chunks(nodes_.size(), 256, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      if (progress.cancelled()) return;
      WspdNode& node = nodes_[n];
      Aabb box;
      double power = 0;
      const auto place = [&](uint32_t i) {
        return lights_[i].kind == VplKind::directional ? lights_[i].normal : lights_[i].position;
      };
      for (uint32_t i = node.first; i < node.last; ++i) {
        box.extend(place(i));
        power += static_cast<double>(luminance(lights_[i].intensity));
        if (lights_[i].kind == VplKind::sphere)
          node.largest_sphere = std::max(node.largest_sphere, lights_[i].radius());
      }
      node.center = node.last - node.first == 1 ? place(node.first) : box.center();
      float radius2 = 0.0f;
      for (uint32_t i = node.first; i < node.last; ++i) radius2 = std::max(radius2, length2(place(i) - node.center));
      node.radius = std::sqrt(radius2);
      node.power = static_cast<float>(power);
    }
  });
  progress.check();
}

// Alg. 1. The first pairs are found one by one; from them tasks go on alone, and are joined in their order.
void WspdTree::find_pairs(float separation, Progress& progress) {
  using Pair = std::pair<uint32_t, uint32_t>;
  pair_begin_.assign(nodes_.size() + 1, 0);
  if (root_ == WspdNode::kNone) return;
  // Either keeps {w, v} or puts what it is split into on `next`.
  const auto step = [&](Pair pair, std::vector<Pair>& found, std::vector<Pair>& next) {
    auto [w, v] = pair;
    if (w == v) {
      const WspdNode& n = nodes_[w];
      for (uint32_t i = 0; i < n.child_count; ++i)
        for (uint32_t j = i; j < n.child_count; ++j) next.emplace_back(n.first_child + i, n.first_child + j);
      return;
    }
    if ((nodes_[w].leaf() && nodes_[v].leaf()) || well_separated(nodes_[w], nodes_[v], separation)) {
      found.emplace_back(w, v);
      return;
    }
    if (nodes_[w].leaf() || (!nodes_[v].leaf() && nodes_[w].radius < nodes_[v].radius)) std::swap(w, v);
    for (uint32_t i = 0; i < nodes_[w].child_count; ++i) next.emplace_back(nodes_[w].first_child + i, v);
  };
  std::vector<std::vector<Pair>> found(1);
  std::vector<Pair> open{{root_, root_}};
  while (!open.empty() && open.size() < 4096) {
    std::vector<Pair> next;
    for (const Pair& p : open) step(p, found[0], next);
    open = std::move(next);
  }
  progress.begin("well-separated pairs", open.size());
  found.resize(open.size() + 1);
  std::atomic<uint64_t> total{0};
  parallel_chunks(open.size(), 4, [&](size_t begin, size_t end) {
    std::vector<Pair> stack;
    for (size_t i = begin; i < end; ++i) {
      stack.assign(1, open[i]);
      for (uint32_t steps = 0; !stack.empty(); ++steps) {
        if (steps % 65536 == 0 && (progress.cancelled() || total > 0xffffffffull / 2)) return;
        const Pair p = stack.back();
        stack.pop_back();
        step(p, found[i + 1], stack);
      }
      total += found[i + 1].size();
    }
    progress.advance(end - begin);
  });
  progress.check();
  if (total + found[0].size() > 0xffffffffull / 2)
    throw Error(ErrorCode::out_of_memory, "wspd: more than 2^32 pairs; raise the separation or take fewer lights");
  for (const auto& part : found)
    for (const auto& [w, v] : part) ++pair_begin_[w + 1], ++pair_begin_[v + 1];
  for (size_t n = 0; n < nodes_.size(); ++n) pair_begin_[n + 1] += pair_begin_[n];
  pairs_.resize(pair_begin_.back());
  std::vector<uint64_t> at(pair_begin_.begin(), pair_begin_.end() - 1);
  for (auto& part : found) {
    for (const auto& [w, v] : part) pairs_[at[w]++] = v, pairs_[at[v]++] = w;
    part = {};
  }
}

WspdTree WspdTree::build(const std::vector<Vpl>& lights, const Options& options, Progress& progress) {
  WspdTree tree;
  progress.begin("octree", 1);
  std::vector<uint32_t> placed, distant;
  Aabb box;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    if (!(luminance(lights[i].intensity) > 0.0f)) continue;
    if (lights[i].kind == VplKind::directional) {
      distant.push_back(i);
    } else {
      placed.push_back(i);
      box.extend(lights[i].position);
    }
  }
  tree.lights_.reserve(placed.size() + distant.size());
  if (!placed.empty()) {
    tree.cube_.lower = box.lo;
    tree.cube_.side = max_component(box.extent());
    if (!(tree.cube_.side > 0.0f)) tree.cube_.side = 1.0f;
    Rng rng(options.seed, Stage::octree_shift);
    for (double& s : tree.cube_.shift) s = static_cast<double>(rng.next_float());
  }
  tree.root_ = tree.add_octree(lights, placed, false, tree.cube_);
  Cube sphere;
  sphere.lower = {-1, -1, -1}, sphere.side = 2.0f;
  const uint32_t distant_root = tree.add_octree(lights, distant, true, sphere);
  tree.find_balls(progress);
  // Distant lights: directions count as points at distance 1.
  if (distant_root != WspdNode::kNone) {
    std::vector<uint32_t> stack{distant_root};
    while (!stack.empty()) {
      const uint32_t n = stack.back();
      stack.pop_back();
      if (tree.nodes_[n].leaf() || tree.nodes_[n].radius < options.separation)
        tree.distant_.push_back(n);
      else
        for (uint32_t c = 0; c < tree.nodes_[n].child_count; ++c) stack.push_back(tree.nodes_[n].first_child + c);
    }
  }
  tree.find_pairs(options.separation, progress);
  tree.find_groups(options, progress);
  if (options.accel != nullptr) tree.find_cubemaps(options, progress);
  return tree;
}

uint32_t WspdTree::near_leaf(const Vec3f& p) const {
  const uint64_t code = cube_.code(p);
  const auto after = static_cast<size_t>(std::lower_bound(codes_.begin(), codes_.end(), code) - codes_.begin());
  // The longest common prefix is with a neighbour in the order.
  if (after == codes_.size()) return leaf_.back();
  if (after > 0 && (codes_[after - 1] ^ code) < (codes_[after] ^ code)) return leaf_[after - 1];
  return leaf_[after];
}

}  // namespace lumicut
