// Binary trees over boxes, by several builders. The bottom-up ones stand on accel/agglomerate.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"

namespace lumicut {

// 32 bytes. Children lie side by side; node 0 is the root.
struct TreeNode {
  Vec3f lo;
  uint32_t first = 0;  // inner: the left child, the right one follows. leaf: index into Tree::prims
  Vec3f hi;
  uint32_t count = 0;  // 0: inner; else the primitives of a leaf
  bool leaf() const { return count > 0; }
  Aabb box() const { return {lo, hi}; }
};

struct Tree {
  std::vector<TreeNode> nodes;  // 2N-1 for N primitives, one a leaf; empty when there are none
  std::vector<uint32_t> prims;  // in the order of the leaves, left to right
};

enum class Builder : uint8_t {
  agglomerative,           // exact, locally ordered, one thread
  agglomerative_parallel,  // the same tree, on the caller's arena
  binned_agglomerative,    // binned SAH down to 4096 primitives, exact agglomeration below, on the caller's arena
  binned,                  // divisive, 16 bins on each of 3 axes. [Wald 2007]
  binned_longest,          // divisive, 16 bins on the longest axis: the rival of Walter et al. 2008
  sweep,                   // divisive, every split of 3 axes
};

struct BuildOptions {
  Builder builder = Builder::binned_agglomerative;
  // Reinsertion optimisation afterwards: passes over this share of the largest nodes. [Bittner et al. 2013; Meister and
  // Bittner 2018]
  float reinsert_share = 0.0f;
  int reinsert_passes = 0;
};

// A builder's name: "agglomerative", "agglomerative-parallel", "binned-agglomerative", "binned", "binned-longest" or
// "sweep" ("parallel" and "buckets" are earlier names of the second and the third); then, optionally, "+reinsert" (20 %
// in 8 passes) or "+reinsert:P" with P the percentage, or "+reinsert:PxN" with N passes. "": kDefaultBuilder. Throws
// Error on anything else.
inline constexpr const char* kDefaultBuilder = "binned-agglomerative+reinsert:5x3";
BuildOptions build_options_of(const std::string& text);

// Depth of no tree exceeds this: what lies deeper is split by halves. Agglomeration alone may be as deep as N.
inline constexpr int kMaxTreeDepth = 128;

// The same tree on any number of threads. Boxes must be finite and not empty. Throws Error(cancelled).
Tree build_tree(std::span<const Aabb> boxes, const BuildOptions& options, Progress* progress = nullptr);

// Expected work of a line through the root's box, one test a box and one a primitive. [Walter et al. 2008, sec. 4.1,
// Fig. 6]
//   E(boxes) = 1 + 2·Σ p(inner), E(tris) = Σ n·p(leaf), E(cost) = E(boxes)/2 + E(tris); p = area / area of the root.
struct TreeCost {
  double boxes = 0, tris = 0, cost = 0;
  int depth = 0;
};
TreeCost cost_of(const Tree& tree);

}  // namespace lumicut
