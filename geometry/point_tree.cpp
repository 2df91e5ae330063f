#include "geometry/point_tree.h"

#include <algorithm>
#include <numeric>

namespace lumicut {

PointTree::PointTree(std::span<const Point2> points)
    : points_(points.begin(), points.end()),
      ids_(points.size()),
      slot_(points.size()),
      leaf_of_(points.size()),
      flags_(points.size(), 0) {
  std::iota(ids_.begin(), ids_.end(), 0u);
  nodes_.reserve(points.size() / 2 + 1);
  if (!points.empty()) build(0, static_cast<uint32_t>(points.size()), 0);
  for (uint32_t i = 0; i < ids_.size(); ++i) points_[i] = points[ids_[i]], slot_[ids_[i]] = i;
}

// points_ still lies in the input's order while building; ids_ is what moves. Halves by rank, so depth is log2(n).
uint32_t PointTree::build(uint32_t begin, uint32_t end, uint32_t parent) {
  const auto n = static_cast<uint32_t>(nodes_.size());
  Node node{points_[ids_[begin]], points_[ids_[begin]], begin, end, 0, parent, 0};
  for (uint32_t i = begin + 1; i < end; ++i) {
    const Point2& p = points_[ids_[i]];
    node.lo = {std::min(node.lo.x, p.x), std::min(node.lo.y, p.y)};
    node.hi = {std::max(node.hi.x, p.x), std::max(node.hi.y, p.y)};
  }
  nodes_.push_back(node);
  if (end - begin <= kLeaf) {
    for (uint32_t i = begin; i < end; ++i) leaf_of_[i] = n;
    return n;
  }
  const bool by_x = node.hi.x - node.lo.x >= node.hi.y - node.lo.y;
  const uint32_t mid = begin + (end - begin) / 2;
  std::nth_element(ids_.begin() + begin, ids_.begin() + mid, ids_.begin() + end, [&](uint32_t a, uint32_t b) {
    const double u = by_x ? points_[a].x : points_[a].y, v = by_x ? points_[b].x : points_[b].y;
    return u < v || (u == v && a < b);
  });
  build(begin, mid, n);
  const uint32_t right = build(mid, end, n);
  nodes_[n].right = right;
  return n;
}

size_t PointTree::count_in(const Disk& d) const {
  size_t count = 0;
  for_each_in(d, [&](uint32_t) { ++count; });
  return count;
}

void PointTree::set_flag(uint32_t id, bool flagged) {
  const uint32_t i = slot_[id];
  if ((flags_[i] != 0) == flagged) return;
  flags_[i] = flagged ? 1 : 0;
  for (uint32_t n = leaf_of_[i];; n = nodes_[n].parent) {
    nodes_[n].flagged += flagged ? 1u : ~0u;
    if (n == 0) break;
  }
}

void PointTree::clear_flags() {
  std::fill(flags_.begin(), flags_.end(), uint8_t{0});
  for (Node& n : nodes_) n.flagged = 0;
}

bool PointTree::any_flagged_in(const Disk& d) const {
  uint32_t stack[64];
  int top = 0;
  if (!points_.empty()) stack[top++] = 0;
  while (top > 0) {
    const uint32_t n = stack[--top];
    const Node& node = nodes_[n];
    if (node.flagged == 0 || !touches(node, d)) continue;
    if (node.right == 0) {
      for (uint32_t i = node.begin; i < node.end; ++i)
        if (flags_[i] && hits(points_[i], d)) return true;
    } else {
      stack[top++] = node.right;
      stack[top++] = n + 1;
    }
  }
  return false;
}

}  // namespace lumicut
