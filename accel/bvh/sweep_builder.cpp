// Top-down builder: the surface area heuristic over all splits of the centres' order on three axes.
// [Wald, Boulos and Shirley 2007, Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies]
// Departs: the orders are sorted once and kept sorted by stable partitions, in linear time per level.
#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "accel/bvh/builders.h"

namespace lumicut {
namespace {

class SweepBuilder {
 public:
  SweepBuilder(std::span<const Aabb> boxes, Tree& tree, Progress* progress)
      : boxes_(boxes),
        tree_(tree),
        progress_(progress),
        left_(boxes.size()),
        cost_(boxes.size()),
        scratch_(boxes.size()) {
    for (int axis = 0; axis < 3; ++axis) {
      auto& order = order_[axis];
      order.resize(boxes.size());
      std::iota(order.begin(), order.end(), 0u);
      std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const float ca = boxes[a].lo[axis] + boxes[a].hi[axis], cb = boxes[b].lo[axis] + boxes[b].hi[axis];
        return ca != cb ? ca < cb : a < b;
      });
      if (progress != nullptr) progress->check();
    }
  }

  void build() { build(0, boxes_.size(), {0, 1, 0}); }

 private:
  void build(size_t begin, size_t end, SubtreeSlots at) {
    for (;;) {
      const size_t n = end - begin;
      if (n > 1024 && progress_ != nullptr) progress_->check();
      TreeNode& node = tree_.nodes[at.root];
      Aabb all;
      for (size_t i = begin; i < end; ++i) all.extend(boxes_[order_[0][i]]);
      set_box(node, all);
      if (n == 1) {
        node.first = at.first, node.count = 1;
        tree_.prims[at.first] = order_[0][begin];
        return;
      }
      float best = std::numeric_limits<float>::infinity();
      size_t middle = (begin + end) / 2;
      int best_axis = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const auto& order = order_[axis];
        Aabb box;
        for (size_t i = end - 1; i > begin; --i) {
          box.extend(boxes_[order[i]]);
          cost_[i] = box.half_area() * static_cast<float>(end - i);
        }
        box = {};
        for (size_t i = begin; i + 1 < end; ++i) {
          box.extend(boxes_[order[i]]);
          const float cost = box.half_area() * static_cast<float>(i + 1 - begin) + cost_[i + 1];
          if (cost < best) best = cost, best_axis = axis, middle = i + 1;
        }
      }
      for (size_t i = begin; i < end; ++i) left_[order_[best_axis][i]] = i < middle;
      for (int axis = 0; axis < 3; ++axis) {
        if (axis == best_axis) continue;
        auto& order = order_[axis];
        size_t l = begin, r = middle;
        for (size_t i = begin; i < end; ++i) scratch_[left_[order[i]] ? l++ : r++] = order[i];
        std::copy(scratch_.begin() + static_cast<ptrdiff_t>(begin), scratch_.begin() + static_cast<ptrdiff_t>(end),
                  order.begin() + static_cast<ptrdiff_t>(begin));
      }
      node.first = at.free, node.count = 0;
      if (!build_halves(begin, middle, end, at, [&](size_t b, size_t e, SubtreeSlots s) { build(b, e, s); })) return;
    }
  }

  std::span<const Aabb> boxes_;
  Tree& tree_;
  Progress* progress_;
  std::vector<uint32_t> order_[3];  // primitives by centre on each axis, within each subtree's range
  std::vector<uint8_t> left_;       // by primitive: 1 on the left of the current split
  std::vector<float> cost_;         // of the right side of a split before item i
  std::vector<uint32_t> scratch_;
};

}  // namespace

void build_sweep(std::span<const Aabb> boxes, Tree& tree, Progress* progress) {
  SweepBuilder(boxes, tree, progress).build();
}

}  // namespace lumicut
