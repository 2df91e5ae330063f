// Depth-first order of a tree's nodes and primitives, with a limit on its depth.
#include <algorithm>
#include <vector>

#include "accel/bvh/builders.h"

namespace lumicut {
namespace {

// The primitives below `node`, left to right.
std::vector<uint32_t> primitives_below(const Tree& tree, uint32_t node) {
  std::vector<uint32_t> prims;
  for (std::vector<uint32_t> stack{node}; !stack.empty();) {
    const TreeNode& n = tree.nodes[stack.back()];
    stack.pop_back();
    if (n.leaf())
      prims.push_back(tree.prims[n.first]);
    else
      stack.push_back(n.first + 1), stack.push_back(n.first);
  }
  return prims;
}

// A balanced subtree over the primitives in their order.
void place_by_halves(std::span<const uint32_t> prims, std::span<const Aabb> boxes, Tree& out,
                     const SubtreeSlots& slots) {
  struct Half {
    size_t begin, end;
    SubtreeSlots at;
  };
  for (std::vector<Half> halves{{0, prims.size(), slots}}; !halves.empty();) {
    const Half h = halves.back();
    halves.pop_back();
    Aabb box;
    for (size_t i = h.begin; i < h.end; ++i) box.extend(boxes[prims[i]]);
    TreeNode& to = out.nodes[h.at.root];
    set_box(to, box);
    if (h.end - h.begin == 1) {
      to.first = h.at.first, to.count = 1;
      out.prims[h.at.first] = prims[h.begin];
      continue;
    }
    const size_t middle = (h.begin + h.end) / 2;
    const auto [left, right] = children_of(h.at, middle - h.begin);
    to.first = h.at.free, to.count = 0;
    halves.push_back({middle, h.end, right});
    halves.push_back({h.begin, middle, left});
  }
}

// Number of primitives below each node.
std::vector<uint32_t> primitive_counts(const Tree& tree) {
  std::vector<uint32_t> count(tree.nodes.size()), order;
  order.reserve(tree.nodes.size());
  for (std::vector<uint32_t> stack{0}; !stack.empty();) {
    const uint32_t i = stack.back();
    stack.pop_back();
    order.push_back(i);
    if (!tree.nodes[i].leaf()) stack.push_back(tree.nodes[i].first + 1), stack.push_back(tree.nodes[i].first);
  }
  for (auto i = order.rbegin(); i != order.rend(); ++i) {
    const TreeNode& node = tree.nodes[*i];
    count[*i] = node.leaf() ? 1 : count[node.first] + count[node.first + 1];
  }
  return count;
}

}  // namespace

Tree in_depth_first_order(const Tree& in, std::span<const Aabb> boxes) {
  Tree out;
  out.nodes = HugeArray<TreeNode>(in.nodes.size());
  out.prims.resize(in.prims.size());
  const std::vector<uint32_t> count = primitive_counts(in);
  struct Item {
    uint32_t from;
    SubtreeSlots at;
    int depth;
  };
  constexpr int kDeepest = kMaxTreeDepth - 32;  // halving 2^32 primitives adds 32 levels
  for (std::vector<Item> stack{{0, {0, 1, 0}, 0}}; !stack.empty();) {
    const Item item = stack.back();
    stack.pop_back();
    const TreeNode& node = in.nodes[item.from];
    if (item.depth >= kDeepest && !node.leaf()) {
      place_by_halves(primitives_below(in, item.from), boxes, out, item.at);
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

}  // namespace lumicut
