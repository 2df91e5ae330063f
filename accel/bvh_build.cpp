// Builders of binary trees: agglomerative [Walter et al. 2008], binned [Wald 2007], full sweep, and a mix of both;
// reinsertion after Meister and Bittner 2018 (batches of searches in parallel, applied from the greatest gain down
// where they do not clash).
#include "accel/bvh_build.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <numeric>

#include "accel/agglomerate.h"
#include "core/error.h"
#include "core/parallel.h"

namespace lumicut {
namespace {

constexpr size_t kBucket = 4096;
constexpr size_t kParallel = 8192;  // primitives below which a subtree stays in its task

void set_box(TreeNode& node, const Aabb& box) { node.lo = box.lo, node.hi = box.hi; }

float joint_half_area(const TreeNode& a, const TreeNode& b) {
  const Vec3f e = max(a.hi, b.hi) - min(a.lo, b.lo);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}
float half_area(const TreeNode& a) { return joint_half_area(a, a); }

// A subtree over n primitives fills nodes[root] and the 2n-2 nodes from `free` on: each place is known before it is
// built, so that subtrees can be built in any order.
struct Place {
  uint32_t root, free, first;  // first: its first primitive in Tree::prims
};
std::pair<Place, Place> children_of(const Place& at, size_t left_count) {
  const auto n = static_cast<uint32_t>(left_count);
  return {{at.free, at.free + 2, at.first}, {at.free + 1, at.free + 2 * n, at.first + n}};
}

// Lays a list of merges out. `prims`: what leaf i of the merges stands for.
void place_merges(const std::vector<Merge>& merges, std::span<const uint32_t> prims, std::span<const Aabb> boxes,
                  Tree& tree, Place at) {
  const auto n = static_cast<uint32_t>(prims.size());
  std::vector<uint32_t> counts(merges.size());
  std::vector<Aabb> joint(merges.size());
  const auto box = [&](uint32_t id) -> const Aabb& { return id < n ? boxes[prims[id]] : joint[id - n]; };
  const auto count = [&](uint32_t id) { return id < n ? 1u : counts[id - n]; };
  for (size_t i = 0; i < merges.size(); ++i) {
    joint[i] = merge(box(merges[i].left), box(merges[i].right));
    counts[i] = count(merges[i].left) + count(merges[i].right);
  }
  std::vector<std::pair<uint32_t, Place>> stack{{static_cast<uint32_t>(n + merges.size() - 1), at}};
  while (!stack.empty()) {
    const auto [id, place] = stack.back();
    stack.pop_back();
    TreeNode& node = tree.nodes[place.root];
    set_box(node, box(id));
    if (id < n) {
      node.first = place.first, node.count = 1;
      tree.prims[place.first] = prims[id];
      continue;
    }
    const Merge& m = merges[id - n];
    node.first = place.free, node.count = 0;
    const auto [left, right] = children_of(place, count(m.left));
    stack.push_back({m.right, right});
    stack.push_back({m.left, left});
  }
}

// Splits by surface area. [Wald 2007: 16 bins]
class BinnedBuilder {
 public:
  BinnedBuilder(std::span<const Aabb> boxes, Tree& tree, bool all_axes, bool buckets, Progress* progress)
      : boxes_(boxes), tree_(tree), all_axes_(all_axes), buckets_(buckets), progress_(progress), items_(boxes.size()) {
    for (uint32_t i = 0; i < items_.size(); ++i) items_[i] = i;
  }

  void build() { build(0, items_.size(), {0, 1, 0}); }

 private:
  static constexpr int kBins = 16;

  void build(size_t begin, size_t end, Place at) {
    for (;;) {
      const size_t n = end - begin;
      if (n > 1024 && progress_ != nullptr) progress_->check();
      TreeNode& node = tree_.nodes[at.root];
      if (buckets_ && n <= kBucket) {
        bucket(begin, end, at);
        return;
      }
      Aabb box, centres;
      for (size_t i = begin; i < end; ++i) {
        box.extend(boxes_[items_[i]]);
        centres.extend(boxes_[items_[i]].lo + boxes_[items_[i]].hi);
      }
      set_box(node, box);
      if (n == 1) {
        node.first = at.first, node.count = 1;
        tree_.prims[at.first] = items_[begin];
        return;
      }
      const size_t middle = split(begin, end, centres);
      node.first = at.free, node.count = 0;
      const auto [left, right] = children_of(at, middle - begin);
      if (n > kParallel) {
        tbb::parallel_invoke([&, l = left] { build(begin, middle, l); }, [&, r = right] { build(middle, end, r); });
        return;
      }
      // The smaller half by recursion: no input makes the stack deep.
      if (middle - begin <= end - middle) {
        build(begin, middle, left);
        begin = middle, at = right;
      } else {
        build(middle, end, right);
        end = middle, at = left;
      }
    }
  }

  void bucket(size_t begin, size_t end, Place at) {
    std::sort(items_.begin() + static_cast<ptrdiff_t>(begin), items_.begin() + static_cast<ptrdiff_t>(end));
    std::vector<Aabb> inside;
    inside.reserve(end - begin);
    for (size_t i = begin; i < end; ++i) inside.push_back(boxes_[items_[i]]);
    place_merges(agglomerate_boxes(inside, Strategy::locally_ordered, progress_), {items_.data() + begin, end - begin},
                 boxes_, tree_, at);
  }

  size_t split(size_t begin, size_t end, const Aabb& centres) {
    const Vec3f extent = centres.extent();
    const int longest = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
    float best = std::numeric_limits<float>::max();
    int best_axis = -1, best_bin = 0;
    struct Bin {
      Aabb box;
      size_t count = 0;
    };
    std::array<std::array<Bin, kBins>, 3> bins;
    const auto scale_of = [&](int axis) { return static_cast<float>(kBins) * 0.9999f / extent[axis]; };
    const auto bin_of = [&](const Aabb& b, int axis, float scale) {
      return std::min(kBins - 1, std::max(0, static_cast<int>((b.lo[axis] + b.hi[axis] - centres.lo[axis]) * scale)));
    };
    bool axes[3];
    float scales[3];
    for (int axis = 0; axis < 3; ++axis) {
      axes[axis] = (all_axes_ || axis == longest) && extent[axis] > 0.0f && std::isfinite(scale_of(axis));
      scales[axis] = axes[axis] ? scale_of(axis) : 0.0f;
    }
    for (size_t i = begin; i < end; ++i) {
      const Aabb& b = boxes_[items_[i]];
      for (int axis = 0; axis < 3; ++axis) {
        if (!axes[axis]) continue;
        Bin& bin = bins[static_cast<size_t>(axis)][static_cast<size_t>(bin_of(b, axis, scales[axis]))];
        bin.box.extend(b);
        ++bin.count;
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (!axes[axis]) continue;
      const auto& row = bins[static_cast<size_t>(axis)];
      float right_cost[kBins];
      Aabb box;
      size_t count = 0;
      for (int i = kBins - 1; i > 0; --i) {
        box.extend(row[static_cast<size_t>(i)].box);
        count += row[static_cast<size_t>(i)].count;
        right_cost[i] = count == 0 ? -1.0f : box.half_area() * static_cast<float>(count);
      }
      box = {};
      count = 0;
      for (int i = 0; i + 1 < kBins; ++i) {
        box.extend(row[static_cast<size_t>(i)].box);
        count += row[static_cast<size_t>(i)].count;
        if (count == 0 || right_cost[i + 1] < 0.0f) continue;
        const float cost = box.half_area() * static_cast<float>(count) + right_cost[i + 1];
        if (cost < best) best = cost, best_axis = axis, best_bin = i;
      }
    }
    size_t middle = (begin + end) / 2;  // where all centres fall together
    if (best_axis >= 0) {
      const auto first = items_.begin();
      middle = static_cast<size_t>(
          std::partition(first + static_cast<ptrdiff_t>(begin), first + static_cast<ptrdiff_t>(end),
                         [&](uint32_t i) { return bin_of(boxes_[i], best_axis, scales[best_axis]) <= best_bin; }) -
          first);
    }
    return middle;
  }

  std::span<const Aabb> boxes_;
  Tree& tree_;
  bool all_axes_, buckets_;
  Progress* progress_;
  std::vector<uint32_t> items_;
};

// Every split of the centres' order on each axis.
class SweepBuilder {
 public:
  SweepBuilder(std::span<const Aabb> boxes, Tree& tree, Progress* progress)
      : boxes_(boxes),
        tree_(tree),
        progress_(progress),
        left_(boxes.size()),
        cost_(boxes.size()),
        scratch_(boxes.size()) {
    for (int axis = 0; axis < 3; ++axis) {
      auto& order = order_[axis];
      order.resize(boxes.size());
      std::iota(order.begin(), order.end(), 0u);
      std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const float ca = boxes[a].lo[axis] + boxes[a].hi[axis], cb = boxes[b].lo[axis] + boxes[b].hi[axis];
        return ca != cb ? ca < cb : a < b;
      });
      if (progress != nullptr) progress->check();
    }
  }

  void build() { build(0, boxes_.size(), {0, 1, 0}); }

 private:
  void build(size_t begin, size_t end, Place at) {
    for (;;) {
      const size_t n = end - begin;
      if (n > 1024 && progress_ != nullptr) progress_->check();
      TreeNode& node = tree_.nodes[at.root];
      Aabb all;
      for (size_t i = begin; i < end; ++i) all.extend(boxes_[order_[0][i]]);
      set_box(node, all);
      if (n == 1) {
        node.first = at.first, node.count = 1;
        tree_.prims[at.first] = order_[0][begin];
        return;
      }
      float best = std::numeric_limits<float>::infinity();
      size_t middle = (begin + end) / 2;
      int best_axis = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const auto& order = order_[axis];
        Aabb box;
        for (size_t i = end - 1; i > begin; --i) {
          box.extend(boxes_[order[i]]);
          cost_[i] = box.half_area() * static_cast<float>(end - i);
        }
        box = {};
        for (size_t i = begin; i + 1 < end; ++i) {
          box.extend(boxes_[order[i]]);
          const float cost = box.half_area() * static_cast<float>(i + 1 - begin) + cost_[i + 1];
          if (cost < best) best = cost, best_axis = axis, middle = i + 1;
        }
      }
      for (size_t i = begin; i < end; ++i) left_[order_[best_axis][i]] = i < middle;
      for (int axis = 0; axis < 3; ++axis) {
        if (axis == best_axis) continue;
        auto& order = order_[axis];
        size_t l = begin, r = middle;
        for (size_t i = begin; i < end; ++i) scratch_[left_[order[i]] ? l++ : r++] = order[i];
        std::copy(scratch_.begin() + static_cast<ptrdiff_t>(begin), scratch_.begin() + static_cast<ptrdiff_t>(end),
                  order.begin() + static_cast<ptrdiff_t>(begin));
      }
      node.first = at.free, node.count = 0;
      const auto [left, right] = children_of(at, middle - begin);
      if (n > kParallel) {
        tbb::parallel_invoke([&, l = left] { build(begin, middle, l); }, [&, r = right] { build(middle, end, r); });
        return;
      }
      if (middle - begin <= end - middle) {
        build(begin, middle, left);
        begin = middle, at = right;
      } else {
        build(middle, end, right);
        end = middle, at = left;
      }
    }
  }

  std::span<const Aabb> boxes_;
  Tree& tree_;
  Progress* progress_;
  std::vector<uint32_t> order_[3];
  std::vector<uint8_t> left_;
  std::vector<float> cost_;
  std::vector<uint32_t> scratch_;
};

// Takes subtrees out and puts them where they cost least.
class Reinsertion {
 public:
  Reinsertion(Tree& tree, Progress* progress)
      : nodes_(tree.nodes), progress_(progress), parents_(tree.nodes.size(), 0) {
    for (uint32_t i = 0; i < nodes_.size(); ++i)
      if (!nodes_[i].leaf()) parents_[nodes_[i].first] = parents_[nodes_[i].first + 1] = i;
  }

  // How much larger its parent is than the children call for: what to take out first. [Bittner et al. 2013, sec. 4.3]
  float inefficiency(uint32_t i) const {
    const TreeNode& parent = nodes_[parents_[i]];
    const float area = half_area(parent), a = half_area(nodes_[parent.first]), b = half_area(nodes_[parent.first + 1]);
    return area * (area / std::max(0.5f * (a + b), 1e-30f)) * (area / std::max(std::min(a, b), 1e-6f * area));
  }

  // `share` of the nodes are tried, ranked by their parents' inefficiency or by their own area.
  void pass(float share, bool by_inefficiency) {
    const size_t wanted = std::max<size_t>(1, static_cast<size_t>(share * static_cast<float>(nodes_.size())));
    std::vector<std::pair<float, uint32_t>> candidates;
    candidates.reserve(nodes_.size());
    for (uint32_t i = 1; i < nodes_.size(); ++i)
      candidates.push_back({by_inefficiency ? -inefficiency(i) : -half_area(nodes_[i]), i});
    const size_t n = std::min(wanted, candidates.size());
    std::nth_element(candidates.begin(), candidates.begin() + static_cast<ptrdiff_t>(n - 1), candidates.end());
    candidates.resize(n);
    std::sort(candidates.begin(), candidates.end());
    // In batches, so that many searches see the tree as the ones before have left it.
    const size_t batch = std::max<size_t>(512, n / 8);
    std::vector<Move> moves;
    std::vector<uint8_t> touched(nodes_.size(), 0);
    std::vector<uint32_t> marked;
    for (size_t begin = 0; begin < n; begin += batch) {
      const size_t end = std::min(n, begin + batch);
      moves.assign(end - begin, {});
      parallel_chunks(end - begin, 64, [&](size_t b, size_t e) {
        if (progress_ != nullptr) progress_->check();
        std::vector<std::pair<float, uint32_t>> stack;
        for (size_t i = b; i < e; ++i) moves[i] = find(candidates[begin + i].second, stack);
      });
      std::sort(moves.begin(), moves.end(),
                [](const Move& a, const Move& b) { return a.gain != b.gain ? a.gain > b.gain : a.from < b.from; });
      marked.clear();
      for (const Move& m : moves) {
        if (!(m.gain > 0.0f)) break;
        const uint32_t involved[] = {m.from, m.to, sibling(m.from), parents_[m.from], parents_[m.to]};
        if (std::any_of(std::begin(involved), std::end(involved), [&](uint32_t i) { return touched[i] != 0; }))
          continue;
        for (const uint32_t i : involved) touched[i] = 1, marked.push_back(i);
        apply(m);
      }
      for (const uint32_t i : marked) touched[i] = 0;
    }
  }

 private:
  struct Move {
    uint32_t from = 0, to = 0;
    float gain = 0.0f;  // in half areas
  };

  // Children lie side by side from node 1 on: an odd node is a left one.
  uint32_t sibling(uint32_t i) const { return i % 2 == 1 ? i + 1 : i - 1; }

  // Best place for `from`. Going up from its parent, each ancestor's other side is searched; boxes on the way shrink by
  // what leaves them, and boxes on the way down grow. A subtree is left out when even a free descent in it could not
  // win.
  Move find(uint32_t from, std::vector<std::pair<float, uint32_t>>& stack) const {
    Move best{from, 0, 0.0f};
    const uint32_t parent = parents_[from];
    if (from == 0 || parent == 0) return best;  // a child of the root: its sibling would become the root
    const TreeNode& node = nodes_[from];
    const float area = half_area(node);
    TreeNode pivot = nodes_[sibling(from)];
    float saved = half_area(nodes_[parent]);
    uint32_t other = sibling(from);
    for (uint32_t up = parent;;) {
      stack.clear();
      stack.push_back({saved, other});
      while (!stack.empty()) {
        const auto [gain, id] = stack.back();
        stack.pop_back();
        if (gain - area <= best.gain) continue;
        const float joint = joint_half_area(nodes_[id], node);
        if (gain - joint > best.gain && id != sibling(from)) best.gain = gain - joint, best.to = id;
        if (nodes_[id].leaf()) continue;
        const float below = gain - joint + half_area(nodes_[id]);
        stack.push_back({below, nodes_[id].first});
        stack.push_back({below, nodes_[id].first + 1});
      }
      if (up != parent) {
        pivot.lo = min(pivot.lo, nodes_[other].lo), pivot.hi = max(pivot.hi, nodes_[other].hi);
        saved += half_area(nodes_[up]) - half_area(pivot);
      }
      if (up == 0) break;
      other = sibling(up);
      up = parents_[up];
    }
    if (best.to == parent) best = {from, 0, 0.0f};
    return best;
  }

  // The pair of `from` and its sibling moves below `to`; the sibling's place takes what was at `to`.
  void apply(const Move& m) {
    const uint32_t parent = parents_[m.from], beside = sibling(m.from);
    const TreeNode sibling_node = nodes_[beside], target = nodes_[m.to];
    nodes_[m.to].first = std::min(m.from, beside);
    nodes_[m.to].count = 0;
    put(beside, target);
    put(parent, sibling_node);
    parents_[beside] = parents_[m.from] = m.to;
    refit(m.to);
    refit(parent);
  }
  void put(uint32_t at, const TreeNode& node) {
    nodes_[at] = node;
    if (!node.leaf()) parents_[node.first] = parents_[node.first + 1] = at;
  }
  void refit(uint32_t i) {
    for (;; i = parents_[i]) {
      TreeNode& node = nodes_[i];
      if (!node.leaf()) {
        const TreeNode &l = nodes_[node.first], &r = nodes_[node.first + 1];
        node.lo = min(l.lo, r.lo), node.hi = max(l.hi, r.hi);
      }
      if (i == 0) return;
    }
  }

  std::vector<TreeNode>& nodes_;
  Progress* progress_;
  std::vector<uint32_t> parents_;
};

// Puts nodes and primitives in the order in which they are met, and splits what lies too deep by halves.
Tree in_order(const Tree& in, std::span<const Aabb> boxes) {
  Tree out;
  const size_t n = in.prims.size();
  out.nodes.resize(in.nodes.size());
  out.prims.resize(n);
  std::vector<uint32_t> count(in.nodes.size()), order;
  order.reserve(in.nodes.size());
  for (std::vector<uint32_t> stack{0}; !stack.empty();) {
    const uint32_t i = stack.back();
    stack.pop_back();
    order.push_back(i);
    if (!in.nodes[i].leaf()) stack.push_back(in.nodes[i].first + 1), stack.push_back(in.nodes[i].first);
  }
  for (auto i = order.rbegin(); i != order.rend(); ++i) {
    const TreeNode& node = in.nodes[*i];
    count[*i] = node.leaf() ? 1 : count[node.first] + count[node.first + 1];
  }
  struct Item {
    uint32_t from;
    Place at;
    int depth;
  };
  constexpr int kDeepest = kMaxTreeDepth - 32;  // halves of 2^32 primitives add 32
  std::vector<uint32_t> inside;
  for (std::vector<Item> stack{{0, {0, 1, 0}, 0}}; !stack.empty();) {
    const Item item = stack.back();
    stack.pop_back();
    const TreeNode& node = in.nodes[item.from];
    if (item.depth >= kDeepest && !node.leaf()) {
      inside.clear();
      for (std::vector<uint32_t> below{item.from}; !below.empty();) {
        const TreeNode& b = in.nodes[below.back()];
        below.pop_back();
        if (b.leaf())
          inside.push_back(in.prims[b.first]);
        else
          below.push_back(b.first + 1), below.push_back(b.first);
      }
      struct Half {
        size_t begin, end;
        Place at;
      };
      for (std::vector<Half> halves{{0, inside.size(), item.at}}; !halves.empty();) {
        const Half h = halves.back();
        halves.pop_back();
        Aabb box;
        for (size_t i = h.begin; i < h.end; ++i) box.extend(boxes[inside[i]]);
        TreeNode& to = out.nodes[h.at.root];
        set_box(to, box);
        if (h.end - h.begin == 1) {
          to.first = h.at.first, to.count = 1;
          out.prims[h.at.first] = inside[h.begin];
          continue;
        }
        const size_t middle = (h.begin + h.end) / 2;
        const auto [left, right] = children_of(h.at, middle - h.begin);
        to.first = h.at.free, to.count = 0;
        halves.push_back({middle, h.end, right});
        halves.push_back({h.begin, middle, left});
      }
      continue;
    }
    TreeNode& to = out.nodes[item.at.root];
    to = node;
    if (node.leaf()) {
      to.first = item.at.first;
      out.prims[item.at.first] = in.prims[node.first];
      continue;
    }
    to.first = item.at.free;
    const auto [left, right] = children_of(item.at, count[node.first]);
    stack.push_back({node.first + 1, right, item.depth + 1});
    stack.push_back({node.first, left, item.depth + 1});
  }
  return out;
}

int depth_of(const Tree& tree) {
  int depth = 0;
  for (std::vector<std::pair<uint32_t, int>> stack{{0, 0}}; !stack.empty();) {
    const auto [i, d] = stack.back();
    stack.pop_back();
    depth = std::max(depth, d);
    if (!tree.nodes[i].leaf())
      stack.push_back({tree.nodes[i].first + 1, d + 1}), stack.push_back({tree.nodes[i].first, d + 1});
  }
  return depth;
}

}  // namespace

BuildOptions build_options_of(const std::string& text) {
  if (text.empty()) return build_options_of(kDefaultBuilder);
  BuildOptions options;
  const size_t plus = text.find('+');
  const std::string name = text.substr(0, plus);
  constexpr std::pair<const char*, Builder> kNames[] = {
      {"agglomerative", Builder::agglomerative},     {"agglomerative-parallel", Builder::agglomerative_parallel},
      {"parallel", Builder::agglomerative_parallel}, {"binned-agglomerative", Builder::binned_agglomerative},
      {"buckets", Builder::binned_agglomerative},    {"binned", Builder::binned},
      {"binned-longest", Builder::binned_longest},   {"sweep", Builder::sweep}};
  bool known = false;
  for (const auto& [n, builder] : kNames)
    if (name == n) options.builder = builder, known = true;
  if (plus != std::string::npos && known) {
    // "reinsert", "reinsert:P" or "reinsert:PxN", digits and a point alone.
    const std::string rest = text.substr(plus + 1);
    float percent = 20.0f;
    int passes = 8;
    if (rest != "reinsert") {
      const char *at = rest.data() + std::min(rest.size(), std::strlen("reinsert:")), *end = rest.data() + rest.size();
      known = rest.rfind("reinsert:", 0) == 0;
      const auto share = std::from_chars(at, end, percent, std::chars_format::fixed);
      known = known && share.ec == std::errc();
      if (known && share.ptr != end) {
        const auto count = std::from_chars(share.ptr + 1, end, passes);
        known = *share.ptr == 'x' && count.ec == std::errc() && count.ptr == end;
      }
    }
    known = known && percent > 0.0f && percent <= 100.0f && passes > 0 && passes <= 1000;
    options.reinsert_share = percent / 100.0f;
    options.reinsert_passes = passes;
  }
  if (!known)
    fail_argument("builder '" + text +
                  "' is none of agglomerative, agglomerative-parallel, binned-agglomerative, binned, binned-longest, "
                  "sweep, with or without '+reinsert', "
                  "'+reinsert:PERCENT' or '+reinsert:PERCENTxPASSES'");
  return options;
}

Tree build_tree(std::span<const Aabb> boxes, const BuildOptions& options, Progress* progress) {
  Tree tree;
  if (boxes.empty()) return tree;
  tree.nodes.resize(2 * boxes.size() - 1);
  tree.prims.resize(boxes.size());
  if (boxes.size() == 1) {
    set_box(tree.nodes[0], boxes[0]);
    tree.nodes[0].count = 1;
    return tree;
  }
  switch (options.builder) {
    case Builder::agglomerative:
    case Builder::agglomerative_parallel: {
      std::vector<uint32_t> prims(boxes.size());
      std::iota(prims.begin(), prims.end(), 0u);
      const Strategy strategy =
          options.builder == Builder::agglomerative_parallel ? Strategy::parallel : Strategy::locally_ordered;
      place_merges(agglomerate_boxes(boxes, strategy, progress), prims, boxes, tree, {0, 1, 0});
      break;
    }
    case Builder::binned_agglomerative:
      BinnedBuilder(boxes, tree, true, true, progress).build();
      break;
    case Builder::binned:
      BinnedBuilder(boxes, tree, true, false, progress).build();
      break;
    case Builder::binned_longest:
      BinnedBuilder(boxes, tree, false, false, progress).build();
      break;
    case Builder::sweep:
      SweepBuilder(boxes, tree, progress).build();
      break;
  }
  bool moved = false;
  if (options.reinsert_passes > 0 && options.reinsert_share > 0.0f && boxes.size() > 4) {
    Reinsertion reinsertion(tree, progress);
    // Inefficient parents first; now and then the largest nodes, which that ranking leaves for long.
    for (int pass = 0; pass < options.reinsert_passes; ++pass) reinsertion.pass(options.reinsert_share, pass % 4 != 3);
    moved = true;
  }
  if (moved || depth_of(tree) >= kMaxTreeDepth) tree = in_order(tree, boxes);
  return tree;
}

TreeCost cost_of(const Tree& tree) {
  TreeCost cost;
  if (tree.nodes.empty()) return cost;
  cost.depth = depth_of(tree);
  const double root = half_area(tree.nodes[0]);
  cost.boxes = 1;
  for (const TreeNode& node : tree.nodes) {
    const double p = root > 0 ? half_area(node) / root : 1.0;
    if (node.leaf())
      cost.tris += node.count * p;
    else
      cost.boxes += 2 * p;
  }
  cost.cost = 0.5 * cost.boxes + cost.tris;
  return cost;
}

}  // namespace lumicut
