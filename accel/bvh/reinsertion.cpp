// Optimisation of a finished tree: subtrees are removed and reinserted where they add the least surface area.
// [Bittner et al. 2013, Fast Insertion-Based Optimization of Bounding Volume Hierarchies; Meister and Bittner 2018,
// Parallel Reinsertion for Bounding Volume Hierarchy Optimization]
// Departs from the latter: searches run in parallel batches, and the moves of a batch are applied in order of gain,
// those that share a node with an earlier move being dropped. The result does not depend on the number of threads.
#include <algorithm>
#include <vector>

#include "accel/bvh/builders.h"
#include "core/parallel.h"

namespace lumicut {
namespace {

class Reinsertion {
 public:
  Reinsertion(Tree& tree, Progress* progress)
      : nodes_(tree.nodes), progress_(progress), parents_(tree.nodes.size(), 0) {
    for (uint32_t i = 0; i < nodes_.size(); ++i)
      if (!nodes_[i].leaf()) parents_[nodes_[i].first] = parents_[nodes_[i].first + 1] = i;
  }

  // Ranks nodes for removal: how much larger the parent's area is than its children's. [Bittner et al. 2013, sec. 4.3]
  float inefficiency(uint32_t i) const {
    const TreeNode& parent = nodes_[parents_[i]];
    const float area = half_area(parent), a = half_area(nodes_[parent.first]), b = half_area(nodes_[parent.first + 1]);
    return area * (area / std::max(0.5f * (a + b), 1e-30f)) * (area / std::max(std::min(a, b), 1e-6f * area));
  }

  // Reinserts up to `share` of the nodes, ranked by inefficiency or by area.
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
    // In batches, so that most searches see the result of earlier moves.
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

  // Children are adjacent from node 1 on: odd nodes are left children.
  uint32_t sibling(uint32_t i) const { return i % 2 == 1 ? i + 1 : i - 1; }

  // The position with the greatest gain for `from`, by branch and bound. Climbs from the parent and searches the other
  // subtree of each ancestor. `gain`: area saved by the removal minus growth of the nodes descended through; a subtree
  // is skipped when a descent without further growth could not exceed the best gain.
  Move find(uint32_t from, std::vector<std::pair<float, uint32_t>>& stack) const {
    Move best{from, 0, 0.0f};
    const uint32_t parent = parents_[from];
    if (from == 0 || parent == 0) return best;  // children of the root stay: the sibling would become the root
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

  // The node pair of `from` and its sibling becomes the children of `to`: `from`, and what was at `to`. The sibling
  // replaces the parent.
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
  // Recomputes the boxes from node i up to the root.
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

  HugeArray<TreeNode>& nodes_;
  Progress* progress_;
  std::vector<uint32_t> parents_;
};

}  // namespace

void optimize_by_reinsertion(Tree& tree, float share, int passes, Progress* progress) {
  Reinsertion reinsertion(tree, progress);
  // Every fourth pass takes the largest nodes, which the ranking by inefficiency selects rarely.
  for (int pass = 0; pass < passes; ++pass) reinsertion.pass(share, pass % 4 != 3);
}

}  // namespace lumicut
