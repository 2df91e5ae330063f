// Eight-wide nodes made from a binary tree, and the blocks of four primitives in their leaves. [layout after Embree's
// BVH8]
#pragma once

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "accel/bvh_build.h"
#include "core/error.h"

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace lumicut {

// A fixed array that asks for huge pages: traversal touches memory at random, and page walks cost as much as misses.
template <typename T>
class HugeArray {
 public:
  HugeArray() = default;
  explicit HugeArray(size_t n) : size_(n) {
    if (n == 0) return;
    const size_t page = n * sizeof(T) >= (size_t{4} << 20) ? size_t{2} << 20 : 256;
    const size_t bytes = (n * sizeof(T) + page - 1) / page * page;
    data_.reset(static_cast<T*>(std::aligned_alloc(page, bytes)));
    if (!data_) throw Error(ErrorCode::out_of_memory, "no memory for " + std::to_string(bytes) + " bytes of a BVH");
#ifdef __linux__
    if (page > 256) madvise(data_.get(), bytes, MADV_HUGEPAGE);
#endif
  }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  size_t size() const { return size_; }
  T& operator[](size_t i) { return data_.get()[i]; }
  const T& operator[](size_t i) const { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  std::unique_ptr<T, Free> data_;
  size_t size_ = 0;
};

// A child word: kLeafBit and the index of a block (or of an instance), the index of a node, or kEmptyChild.
inline constexpr uint32_t kLeafBit = 0x80000000u;
inline constexpr uint32_t kEmptyChild = 0xffffffffu;

struct alignas(64) WideNode {
  float planes[6][8];  // lo.x, hi.x, lo.y, hi.y, lo.z, hi.z of eight children; empty ones are inverted
  uint32_t child[8];   // in the order in which an any-hit ray should visit them
  uint32_t unused[8];
};
static_assert(sizeof(WideNode) == 256);

// Four primitives side by side. Triangles: the corners, or for the fast test corner and two edges. Boxes: lo, hi.
struct alignas(64) LeafBlock {
  float v[3][3][4];           // [corner][axis][lane]
  uint32_t prim[4], geom[4];  // prim is kNoId in lanes without a primitive
  float extent[4];            // longest side of the triangle's box: what rounding of its edges is measured by
};
static_assert(sizeof(LeafBlock) == 192);

struct WideBvh {
  HugeArray<WideNode> nodes;
  HugeArray<LeafBlock> leaves;
  uint32_t root = kEmptyChild;  // a child word
  size_t bytes() const { return nodes.size() * sizeof(WideNode) + leaves.size() * sizeof(LeafBlock); }
};

// The deepest stack a traversal needs: seven waiting children a level.
inline constexpr int kTraversalStack = 7 * kMaxTreeDepth + 8;

// What goes into a block; lanes come preset as empty.
using FillBlock = std::function<void(LeafBlock& block, int lane, uint32_t prim)>;

// Chooses by dynamic programming which nodes of the binary tree become wide ones and which subtrees of at most
// `leaf_size` (1 to 4) primitives become one block, for the least expected cost. [after Ylitie et al. 2017, sec. 3.1]
// The order of children is baked for any-hit rays: greatest chance of a hit per cost first, where a child is hit with
// p = 1 - exp(-areas of its primitives / half the area of its box). `area`: of each primitive.
// Without `fill`, leaves hold their primitive itself in place of a block (leaf_size 1).
WideBvh collapse(const Tree& tree, std::span<const float> area, int leaf_size, const FillBlock& fill,
                 Progress* progress);

}  // namespace lumicut
