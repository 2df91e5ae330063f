// Stores a list of merges, bottom-up, as a Tree.
#include <algorithm>

#include "accel/bvh/builders.h"
#include "core/parallel.h"

namespace lumicut {
namespace {

class MergeLayout {
 public:
  MergeLayout(const std::vector<Merge>& merges, std::span<const uint32_t> prims, std::span<const Aabb> boxes,
              Tree& tree)
      : merges_(merges), prims_(prims), boxes_(boxes), tree_(tree), counts_(merges.size()) {
    for (size_t i = 0; i < merges.size(); ++i) counts_[i] = count_of(merges[i].left) + count_of(merges[i].right);
  }

  int place(SubtreeSlots at) {
    std::vector<Part> stack{{static_cast<uint32_t>(prims_.size() + merges_.size() - 1), 0, at}}, large, small;
    while (!stack.empty()) {
      const Part part = stack.back();
      stack.pop_back();
      if (count_of(part.id) <= kTaskPrimitives) {
        small.push_back(part);
        continue;
      }
      place_node(part, stack);
      large.push_back(part);
    }
    std::vector<int> depths(small.size());
    const auto place_small = [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) depths[i] = place_subtree(small[i]);
    };
    if (small.size() > 1)
      parallel_chunks(small.size(), 4, place_small);
    else
      place_small(0, small.size());
    for (auto part = large.rbegin(); part != large.rend(); ++part) join_children(*part);
    return *std::max_element(depths.begin(), depths.end());
  }

 private:
  struct Part {
    uint32_t id;
    int depth;
    SubtreeSlots at;
  };

  uint32_t count_of(uint32_t id) const { return id < prims_.size() ? 1u : counts_[id - prims_.size()]; }

  // All of a node but the box of an inner one. Pushes its children.
  void place_node(const Part& part, std::vector<Part>& children) {
    TreeNode& node = tree_.nodes[part.at.root];
    if (part.id < prims_.size()) {
      const uint32_t prim = prims_[part.id];
      set_box(node, boxes_[prim]);
      node.first = part.at.first, node.count = 1;
      tree_.prims[part.at.first] = prim;
      return;
    }
    const Merge& m = merges_[part.id - prims_.size()];
    node.first = part.at.free, node.count = 0;
    const auto [left, right] = children_of(part.at, count_of(m.left));
    children.push_back({m.right, part.depth + 1, right});
    children.push_back({m.left, part.depth + 1, left});
  }

  void join_children(const Part& part) {
    TreeNode& node = tree_.nodes[part.at.root];
    if (node.leaf()) return;
    const TreeNode &left = tree_.nodes[node.first], &right = tree_.nodes[node.first + 1];
    node.lo = min(left.lo, right.lo), node.hi = max(left.hi, right.hi);
  }

  // Returns the depth it reaches.
  int place_subtree(const Part& root) {
    std::vector<Part> stack{root}, placed;
    placed.reserve(2 * count_of(root.id) - 1);
    int depth = root.depth;
    while (!stack.empty()) {
      placed.push_back(stack.back());
      stack.pop_back();
      place_node(placed.back(), stack);
      depth = std::max(depth, placed.back().depth);
    }
    for (auto part = placed.rbegin(); part != placed.rend(); ++part) join_children(*part);
    return depth;
  }

  const std::vector<Merge>& merges_;
  std::span<const uint32_t> prims_;
  std::span<const Aabb> boxes_;
  Tree& tree_;
  std::vector<uint32_t> counts_;  // primitives below each merge
};

}  // namespace

int place_merges(const std::vector<Merge>& merges, std::span<const uint32_t> prims, std::span<const Aabb> boxes,
                 Tree& tree, SubtreeSlots at) {
  return MergeLayout(merges, prims, boxes, tree).place(at);
}

}  // namespace lumicut
