// Binary trees over boxes, by the builders in accel/bvh/. The bottom-up ones use accel/agglomerate.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/huge_array.h"
#include "core/progress.h"

namespace lumicut {

// 32 bytes. Children are adjacent; node 0 is the root.
struct TreeNode {
  Vec3f lo;
  uint32_t first = 0;  // inner node: its left child, followed by the right. leaf: index into Tree::prims
  Vec3f hi;
  uint32_t count = 0;  // 0: inner node; else number of primitives of the leaf
  bool leaf() const { return count > 0; }
  Aabb box() const { return {lo, hi}; }
};

struct Tree {
  HugeArray<TreeNode> nodes;    // 2N-1 for N primitives, one per leaf; empty for none
  std::vector<uint32_t> prims;  // in the order of the leaves, left to right
};

enum class Builder : uint8_t {
  agglomerative,           // locally ordered, one thread. [Walter et al. 2008]
  agglomerative_parallel,  // the same tree, on the caller's arena
  binned_agglomerative,    // binned SAH down to 4096 primitives, agglomeration below, on the caller's arena
  binned,                  // top-down, 16 bins on each of 3 axes. [Wald 2007]
  binned_longest,          // top-down, 16 bins on the longest axis: what Walter et al. 2008 compare with
  sweep,                   // top-down, all splits of 3 axes
};

struct BuildOptions {
  Builder builder = Builder::binned_agglomerative;
  // Optimisation by reinsertion: passes over this share (0 to 1) of the nodes. [Meister and Bittner 2018]
  float reinsert_share = 0.0f;
  int reinsert_passes = 0;
};

// A builder's name: "agglomerative", "agglomerative-parallel", "binned-agglomerative", "binned", "binned-longest" or
// "sweep" ("parallel" and "buckets" are earlier names of the second and the third); then, optionally, "+reinsert" (20 %
// in 8 passes) or "+reinsert:P" with P the percentage, or "+reinsert:PxN" with N passes. "": kDefaultBuilder. Throws
// Error on anything else.
inline constexpr const char* kDefaultBuilder = "binned-agglomerative+reinsert:5x3";
BuildOptions build_options_of(const std::string& text);

// No tree is deeper: deeper subtrees are replaced by halving. Agglomeration alone may be as deep as N.
inline constexpr int kMaxTreeDepth = 128;

// The same tree on any number of threads. Boxes must be finite and not empty. Throws Error(cancelled).
Tree build_tree(std::span<const Aabb> boxes, const BuildOptions& options, Progress* progress = nullptr);

// Expected tests of boxes and of primitives by a line through the root's box. [Walter et al. 2008, sec. 4.1, Fig. 6]
//   E(boxes) = 1 + 2·Σ p(inner), E(tris) = Σ n·p(leaf), E(cost) = E(boxes)/2 + E(tris); p = area / area of the root.
struct TreeCost {
  double boxes = 0, tris = 0, cost = 0;
  int depth = 0;
};
TreeCost cost_of(const Tree& tree);

}  // namespace lumicut
