// The builders behind build_tree, and what they share. Each fills a Tree of 2N-1 nodes and N primitives, allocated by
// the caller, for N >= 2 boxes.
#pragma once

#include <tbb/parallel_invoke.h>

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "accel/agglomerate.h"
#include "accel/bvh_build.h"
#include "core/aabb.h"
#include "core/progress.h"

namespace lumicut {

// Subtrees of more primitives are built by tasks of their own.
inline constexpr size_t kTaskPrimitives = 8192;

inline void set_box(TreeNode& node, const Aabb& box) { node.lo = box.lo, node.hi = box.hi; }

// Half the surface area of the box around both.
inline float joint_half_area(const TreeNode& a, const TreeNode& b) {
  const Vec3f e = max(a.hi, b.hi) - min(a.lo, b.lo);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}
inline float half_area(const TreeNode& a) { return joint_half_area(a, a); }

// Where a subtree over n primitives is stored: nodes[root], and 2n-2 nodes from `free` on. Known before the subtree is
// built, so that subtrees can be built in any order.
struct SubtreeSlots {
  uint32_t root, free, first;  // first: index of the first primitive in Tree::prims
};
inline std::pair<SubtreeSlots, SubtreeSlots> children_of(const SubtreeSlots& at, size_t left_count) {
  const auto n = static_cast<uint32_t>(left_count);
  return {{at.free, at.free + 2, at.first}, {at.free + 1, at.free + 2 * n, at.first + n}};
}

// Builds both halves of primitives [begin, end) and returns false; or the smaller one alone, and narrows the range and
// its slots to the other for a loop to go on with, so that the stack stays below log2(n) frames.
template <typename Build>
bool build_halves(size_t& begin, size_t middle, size_t& end, SubtreeSlots& at, Build build) {
  const auto [left, right] = children_of(at, middle - begin);
  if (end - begin > kTaskPrimitives) {
    tbb::parallel_invoke([&, l = left] { build(begin, middle, l); }, [&, r = right] { build(middle, end, r); });
    return false;
  }
  if (middle - begin <= end - middle) {
    build(begin, middle, left);
    begin = middle, at = right;
  } else {
    build(middle, end, right);
    end = middle, at = left;
  }
  return true;
}

// binned_builder.cpp. `all_axes`: false for the longest axis only. `agglomerate_up_to`: subtrees of at most this many
// primitives are built by agglomeration; 0 for none.
void build_binned(std::span<const Aabb> boxes, bool all_axes, size_t agglomerate_up_to, Tree& tree, Progress* progress);

// sweep_builder.cpp
void build_sweep(std::span<const Aabb> boxes, Tree& tree, Progress* progress);

// merge_layout.cpp: stores the tree that a list of merges describes, and returns its depth. prims[i]: the primitive of
// leaf i.
int place_merges(const std::vector<Merge>& merges, std::span<const uint32_t> prims, std::span<const Aabb> boxes,
                 Tree& tree, SubtreeSlots at);

// reinsertion.cpp: passes over `share` (0 to 1) of the nodes. Leaves nodes in any order, and the tree may be deeper.
void optimize_by_reinsertion(Tree& tree, float share, int passes, Progress* progress);

// tree_order.cpp: the same tree with nodes and primitives in depth-first order; subtrees below kMaxTreeDepth are
// replaced by splits into halves.
Tree in_depth_first_order(const Tree& tree, std::span<const Aabb> boxes);
int depth_of(const Tree& tree);

}  // namespace lumicut
