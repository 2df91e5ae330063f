// Kd-tree over points of the plane, for disks: report their points, or ask whether one of them is flagged. O(n) memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

class PointTree {
 public:
  explicit PointTree(std::span<const Point2> points);

  size_t size() const { return points_.size(); }
  // fn(id) for every point in the closed disk, in the tree's order.
  template <typename Fn>
  void for_each_in(const Disk& d, Fn&& fn) const {
    uint32_t stack[64];
    int top = 0;
    if (!points_.empty()) stack[top++] = 0;
    while (top > 0) {
      const uint32_t n = stack[--top];
      const Node& node = nodes_[n];
      if (!touches(node, d)) continue;
      if (node.right == 0) {
        for (uint32_t i = node.begin; i < node.end; ++i)
          if (hits(points_[i], d)) fn(ids_[i]);
      } else {
        stack[top++] = node.right;
        stack[top++] = n + 1;
      }
    }
  }
  size_t count_in(const Disk& d) const;
  // Where a point stands in the tree's order.
  uint32_t place(uint32_t id) const { return slot_[id]; }

  // Flags are for "is this disk hit by the set so far".
  void set_flag(uint32_t id, bool flagged);
  bool flagged(uint32_t id) const { return flags_[slot_[id]] != 0; }
  void clear_flags();
  bool any_flagged_in(const Disk& d) const;

 private:
  struct Node {
    Point2 lo, hi;
    uint32_t begin, end, right, parent;  // left child: the next node; right 0: leaf
    uint32_t flagged;
  };
  static constexpr uint32_t kLeaf = 8;

  uint32_t build(uint32_t begin, uint32_t end, uint32_t parent);
  static bool touches(const Node& n, const Disk& d) {
    const double dx = d.centre.x < n.lo.x ? n.lo.x - d.centre.x : d.centre.x > n.hi.x ? d.centre.x - n.hi.x : 0.0;
    const double dy = d.centre.y < n.lo.y ? n.lo.y - d.centre.y : d.centre.y > n.hi.y ? d.centre.y - n.hi.y : 0.0;
    return dx * dx + dy * dy <= d.radius * d.radius;
  }

  std::vector<Point2> points_;  // in the tree's order
  std::vector<uint32_t> ids_, slot_, leaf_of_;
  std::vector<uint8_t> flags_;
  std::vector<Node> nodes_;
};

}  // namespace lumicut
