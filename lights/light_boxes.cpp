#include "lights/light_boxes.h"

#include <algorithm>
#include <numeric>

namespace lumicut {

uint32_t halve(const std::vector<Aabb>& boxes, const Aabb& middles, std::vector<uint32_t>& order, uint32_t begin,
               uint32_t end) {
  const int axis = middles.longest_axis();
  const uint32_t half = begin + (end - begin) / 2;
  std::nth_element(order.begin() + begin, order.begin() + half, order.begin() + end, [&](uint32_t a, uint32_t b) {
    const float x = boxes[a].center()[axis], y = boxes[b].center()[axis];
    return x != y ? x < y : a < b;
  });
  return half;
}

LightBoxes::LightBoxes(const std::vector<Aabb>& boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  if (!boxes.empty()) build(boxes, 0, static_cast<uint32_t>(boxes.size()));
}

void LightBoxes::build(const std::vector<Aabb>& boxes, uint32_t first, uint32_t last) {
  const size_t at = nodes_.size();
  nodes_.emplace_back();
  Aabb box, middles;
  for (uint32_t i = first; i < last; ++i) box.extend(boxes[order_[i]]), middles.extend(boxes[order_[i]].center());
  nodes_[at].box = box;
  if (last - first <= kLeaf) {
    nodes_[at].next = first, nodes_[at].count = last - first;
    return;
  }
  const uint32_t half = halve(boxes, middles, order_, first, last);
  build(boxes, first, half);
  nodes_[at].next = static_cast<uint32_t>(nodes_.size());
  build(boxes, half, last);
}

}  // namespace lumicut
