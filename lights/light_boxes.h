// Boxes of lights in a tree: those that a ray may meet, all of them, however many lie in one place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/aabb.h"

namespace lumicut {

// Puts the half of order[begin, end) first whose boxes' middles come first along the longest axis of `middles`, their box;
// ties by number. Returns where the other half begins.
uint32_t halve(const std::vector<Aabb>& boxes, const Aabb& middles, std::vector<uint32_t>& order, uint32_t begin,
               uint32_t end);

class LightBoxes {
 public:
  LightBoxes() = default;
  // Their numbers are those of this list.
  explicit LightBoxes(const std::vector<Aabb>& boxes);

  // `fn(number)` for each box between the ray's origin and `far`, and for some that the ray misses. `direction`: unit.
  template <typename Fn>
  void for_each(const Vec3f& origin, const Vec3f& direction, float far, Fn&& fn) const {
    if (nodes_.empty()) return;
    const auto inverse = [](float d) { return 1.0f / (std::abs(d) < 1e-30f ? std::copysign(1e-30f, d) : d); };
    const Vec3f over{inverse(direction.x), inverse(direction.y), inverse(direction.z)};
    std::array<uint32_t, kMostDepth> stack;
    size_t depth = 0;
    for (uint32_t at = 0;;) {
      const Node& node = nodes_[at];
      if (met(node.box, origin, over, far)) {
        if (node.count == 0) {
          stack[depth++] = node.next;
          ++at;
          continue;
        }
        for (uint32_t i = 0; i < node.count; ++i) fn(order_[node.next + i]);
      }
      if (depth == 0) return;
      at = stack[--depth];
    }
  }

 private:
  struct Node {
    Aabb box;
    uint32_t next = 0;   // the second child (the first follows its parent), or of a leaf the first place in order_
    uint32_t count = 0;  // 0: two children
  };
  static constexpr uint32_t kLeaf = 4;
  static constexpr size_t kMostDepth = 64;  // halves of at most 2^32

  static bool met(const Aabb& box, const Vec3f& origin, const Vec3f& over, float far) {
    float near = 0.0f;
    for (int k = 0; k < 3; ++k) {
      const float a = (box.lo[k] - origin[k]) * over[k], b = (box.hi[k] - origin[k]) * over[k];
      near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
    }
    return near <= far * 1.00001f;
  }
  void build(const std::vector<Aabb>& boxes, uint32_t first, uint32_t last);

  std::vector<Node> nodes_;
  std::vector<uint32_t> order_;
};

}  // namespace lumicut
