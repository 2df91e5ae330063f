// Eight-wide BVH: nodes in structure of arrays, and leaves of blocks of four primitives. [layout after Embree's BVH8]
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "accel/bvh_build.h"
#include "core/huge_array.h"

namespace lumicut {

// A child word: kLeafBit and the index of a block (or of an instance), the index of a node, or kEmptyChild.
inline constexpr uint32_t kLeafBit = 0x80000000u;
inline constexpr uint32_t kEmptyChild = 0xffffffffu;

struct alignas(64) WideNode {
  float planes[6][8];  // lo.x, hi.x, lo.y, hi.y, lo.z, hi.z of eight children; empty slots are inverted boxes
  uint32_t child[8];   // child words, in the order in which any-hit rays visit them
  uint32_t unused[8];
};
static_assert(sizeof(WideNode) == 256);

// Four primitives in structure of arrays. Triangles: three corners, or for the fast test a corner and two edges. Boxes:
// lo, hi.
struct alignas(64) LeafBlock {
  float v[3][3][4];           // [corner][axis][lane]
  uint32_t prim[4], geom[4];  // prim is kNoId in unused lanes
  float extent[4];            // longest side of each triangle's box; scales the error bounds of edge tests
};
static_assert(sizeof(LeafBlock) == 192);

struct WideBvh {
  HugeArray<WideNode> nodes;
  HugeArray<LeafBlock> leaves;
  uint32_t root = kEmptyChild;  // a child word
  size_t bytes() const { return nodes.size() * sizeof(WideNode) + leaves.size() * sizeof(LeafBlock); }
};

// Size of traversal stacks: seven pending children per level.
inline constexpr int kTraversalStack = 7 * kMaxTreeDepth + 8;

// Fills one lane of a block, which is preset as unused.
using FillBlock = std::function<void(LeafBlock& block, int lane, uint32_t prim)>;

// Selects the nodes of the binary tree that become wide nodes, and the subtrees of at most `leaf_size` (1 to 4)
// primitives that become blocks, for the least expected cost. Children are ordered for any-hit rays: greatest
// probability of a hit per cost first, where a ray through a box hits with p = 1 - exp(-area of its primitives / half
// the area of the box). `area`: of each primitive. Without `fill`, leaf words hold the index of a primitive instead of
// a block (leaf_size 1).
WideBvh collapse(const Tree& tree, std::span<const float> area, int leaf_size, const FillBlock& fill,
                 Progress* progress);

}  // namespace lumicut
