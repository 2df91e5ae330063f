// Collapses a binary tree to eight-wide nodes by dynamic programming over its nodes, for the least expected cost.
// [Ylitie et al. 2017, Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs, sec. 3.1]
// Departs: costs are those of SIMD tests of eight boxes and of four primitives, and children are stored in the order in
// which any-hit rays visit them.
#include "accel/bvh/wide_bvh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "accel/accel.h"

namespace lumicut {
namespace {

// Relative cost of testing eight boxes, and a block of four primitives; measured.
constexpr float kNodeCost = 1.0f, kBlockCost = 0.7f;

class Collapse {
 public:
  Collapse(const Tree& tree, std::span<const float> area, int leaf_size, const FillBlock& fill, Progress* progress)
      : tree_(tree),
        leaf_size_(static_cast<uint32_t>(leaf_size)),
        fill_(fill),
        progress_(progress),
        plans_(tree.nodes.size()) {
    plan(area);
  }

  WideBvh run() {
    std::vector<WideNode> nodes;
    std::vector<LeafBlock> blocks;
    WideBvh out;
    struct Work {
      uint32_t from, to;
    };
    std::vector<Work> stack;
    if (plans_[0].leaf) {
      out.root = leaf_word(0, blocks);
    } else {
      out.root = 0;
      nodes.emplace_back();
      stack.push_back({0, 0});
    }
    while (!stack.empty()) {
      const Work work = stack.back();
      stack.pop_back();
      if ((nodes.size() & 0xfff) == 0 && progress_ != nullptr) progress_->check();
      uint32_t children[8];
      int count = 0;
      gather(work.from, children, count);
      // Insertion sort of at most eight, stable.
      for (int i = 1; i < count; ++i)
        for (int j = i; j > 0 && plans_[children[j]].promise > plans_[children[j - 1]].promise; --j)
          std::swap(children[j], children[j - 1]);
      WideNode node;
      std::memset(&node, 0, sizeof(node));
      for (int i = 0; i < 8; ++i) {
        if (i >= count) {
          for (int axis = 0; axis < 3; ++axis) {
            node.planes[2 * axis][i] = std::numeric_limits<float>::infinity();
            node.planes[2 * axis + 1][i] = -std::numeric_limits<float>::infinity();
          }
          node.child[i] = kEmptyChild;
          continue;
        }
        const TreeNode& child = tree_.nodes[children[i]];
        for (int axis = 0; axis < 3; ++axis)
          node.planes[2 * axis][i] = child.lo[axis], node.planes[2 * axis + 1][i] = child.hi[axis];
        if (plans_[children[i]].leaf) {
          node.child[i] = leaf_word(children[i], blocks);
        } else {
          node.child[i] = static_cast<uint32_t>(nodes.size());
          nodes.emplace_back();
        }
      }
      for (int i = count - 1; i >= 0; --i)
        if (!plans_[children[i]].leaf) stack.push_back({children[i], node.child[i]});
      nodes[work.to] = node;
    }
    out.nodes = HugeArray<WideNode>(nodes.size());
    out.leaves = HugeArray<LeafBlock>(blocks.size());
    if (!nodes.empty()) std::memcpy(out.nodes.data(), nodes.data(), nodes.size() * sizeof(WideNode));
    if (!blocks.empty()) std::memcpy(out.leaves.data(), blocks.data(), blocks.size() * sizeof(LeafBlock));
    return out;
  }

 private:
  struct Plan {
    // Expected cost of the subtree: [0] as a wide node of up to 8 children, [i] as up to i children of the node above.
    float cost[8];
    uint8_t share[8];  // children that come from the left subtree; kSame: i children are no better than i - 1
    bool leaf = false;
    float promise = 0.0f;  // probability of a hit, by cost
  };
  static constexpr uint8_t kSame = 255;

  // Fills plans_, bottom-up. `area`: surface area of each primitive.
  void plan(std::span<const float> area) {
    std::vector<uint32_t> count(tree_.nodes.size()), order;
    std::vector<float> covered(tree_.nodes.size());
    order.reserve(tree_.nodes.size());
    for (std::vector<uint32_t> stack{0}; !stack.empty();) {
      const uint32_t i = stack.back();
      stack.pop_back();
      order.push_back(i);
      if (!tree_.nodes[i].leaf()) stack.push_back(tree_.nodes[i].first + 1), stack.push_back(tree_.nodes[i].first);
    }
    for (auto i = order.rbegin(); i != order.rend(); ++i) {
      const TreeNode& node = tree_.nodes[*i];
      Plan& p = plans_[*i];
      const float half_area = node.box().half_area();
      if (node.leaf()) {
        count[*i] = 1;
        covered[*i] = area[tree_.prims[node.first]];
        std::fill_n(p.cost, 8, half_area * kBlockCost);
        std::fill_n(p.share, 8, uint8_t{kSame});
        p.leaf = true;
      } else {
        const Plan &l = plans_[node.first], &r = plans_[node.first + 1];
        count[*i] = count[node.first] + count[node.first + 1];
        covered[*i] = covered[node.first] + covered[node.first + 1];
        const auto divide = [&](int children, uint8_t& share) {
          float best = std::numeric_limits<float>::infinity();
          for (int k = 1; k < children; ++k) {
            const float cost = l.cost[k] + r.cost[children - k];
            if (cost < best || k == 1) best = cost, share = static_cast<uint8_t>(k);
          }
          return best;
        };
        p.cost[0] = half_area * kNodeCost + divide(8, p.share[0]);
        const float as_leaf = count[*i] <= leaf_size_ ? half_area * kBlockCost : std::numeric_limits<float>::infinity();
        p.leaf = as_leaf <= p.cost[0];
        p.cost[1] = std::min(as_leaf, p.cost[0]);
        p.share[1] = kSame;
        for (int j = 2; j < 8; ++j) {
          uint8_t share = 1;
          const float cost = divide(j, share);
          const bool better = cost < p.cost[j - 1];
          p.cost[j] = better ? cost : p.cost[j - 1];
          p.share[j] = better ? share : kSame;
        }
      }
      const float hit = half_area > 0.0f ? 1.0f - std::exp(-covered[*i] / half_area) : 1.0f;
      const float cost = half_area > 0.0f ? p.cost[1] / half_area : kBlockCost;
      p.promise = hit / cost;
    }
  }

  // The binary nodes that become the children of wide node `from`.
  void gather(uint32_t from, uint32_t* children, int& count) const {
    struct Part {
      uint32_t node;
      int budget;
    };
    Part stack[16];
    int top = 0;
    const auto divide = [&](uint32_t node, int budget, int share) {
      stack[top++] = {tree_.nodes[node].first + 1, budget - share};
      stack[top++] = {tree_.nodes[node].first, share};
    };
    divide(from, 8, plans_[from].share[0]);
    while (top > 0) {
      Part part = stack[--top];
      const Plan& p = plans_[part.node];
      while (part.budget > 1 && p.share[part.budget] == kSame) --part.budget;
      if (part.budget == 1 || tree_.nodes[part.node].leaf())
        children[count++] = part.node;
      else
        divide(part.node, part.budget, p.share[part.budget]);
    }
  }

  // The child word of a leaf; appends its block.
  uint32_t leaf_word(uint32_t from, std::vector<LeafBlock>& blocks) {
    if (!fill_) return kLeafBit | tree_.prims[tree_.nodes[from].first];
    LeafBlock block;
    std::memset(&block, 0, sizeof(block));
    std::fill_n(block.prim, 4, kNoId);
    std::fill_n(block.geom, 4, kNoId);
    int lane = 0;
    uint32_t stack[8];
    int top = 0;
    stack[top++] = from;
    while (top > 0) {
      const TreeNode& node = tree_.nodes[stack[--top]];
      if (node.leaf())
        fill_(block, lane++, tree_.prims[node.first]);
      else
        stack[top++] = node.first + 1, stack[top++] = node.first;
    }
    blocks.push_back(block);
    return kLeafBit | static_cast<uint32_t>(blocks.size() - 1);
  }

  const Tree& tree_;
  uint32_t leaf_size_;
  const FillBlock& fill_;
  Progress* progress_;
  std::vector<Plan> plans_;
};

}  // namespace

WideBvh collapse(const Tree& tree, std::span<const float> area, int leaf_size, const FillBlock& fill,
                 Progress* progress) {
  if (tree.nodes.empty()) return {};
  if (tree.prims.size() > 0x7ffffffeu) throw Error(ErrorCode::unsupported, "bvh: more than 2^31 primitives");
  return Collapse(tree, area, fill ? leaf_size : 1, fill, progress).run();
}

}  // namespace lumicut
