#include "lights/light_boxes.h"

#include <numeric>

namespace lumicut {

LightBoxes::LightBoxes(const std::vector<Aabb>& boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  if (!boxes.empty()) build(boxes, 0, static_cast<uint32_t>(boxes.size()));
}

// Halves by the middles along the longest axis, ties by number.
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
  const int axis = middles.longest_axis();
  const uint32_t half = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + half, order_.begin() + last, [&](uint32_t a, uint32_t b) {
    const float x = boxes[a].center()[axis], y = boxes[b].center()[axis];
    return x != y ? x < y : a < b;
  });
  build(boxes, first, half);
  nodes_[at].next = static_cast<uint32_t>(nodes_.size());
  build(boxes, half, last);
}

}  // namespace lumicut
