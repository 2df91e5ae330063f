// Top-down builder: splits by the surface area heuristic over 16 bins of the boxes' centres.
// [Wald 2007, On fast Construction of SAH-based Bounding Volume Hierarchies]
// Departs: bins on all three axes or on the longest only, and optionally subtrees of few primitives are built by
// agglomeration. One primitive per leaf: collapse() decides about larger leaves.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "accel/bvh/builders.h"

namespace lumicut {
namespace {

class BinnedBuilder {
 public:
  BinnedBuilder(std::span<const Aabb> boxes, Tree& tree, bool all_axes, size_t agglomerate_up_to, Progress* progress)
      : boxes_(boxes),
        tree_(tree),
        all_axes_(all_axes),
        agglomerate_up_to_(agglomerate_up_to),
        progress_(progress),
        items_(boxes.size()) {
    for (uint32_t i = 0; i < items_.size(); ++i) items_[i] = i;
  }

  void build() { build(0, items_.size(), {0, 1, 0}); }

 private:
  static constexpr int kBins = 16;

  void build(size_t begin, size_t end, SubtreeSlots at) {
    for (;;) {
      const size_t n = end - begin;
      if (n > 1024 && progress_ != nullptr) progress_->check();
      TreeNode& node = tree_.nodes[at.root];
      if (n <= agglomerate_up_to_) {
        agglomerate(begin, end, at);
        return;
      }
      Aabb box, centres;
      for (size_t i = begin; i < end; ++i) {
        box.extend(boxes_[items_[i]]);
        centres.extend(boxes_[items_[i]].lo + boxes_[items_[i]].hi);
      }
      set_box(node, box);
      if (n == 1) {
        node.first = at.first, node.count = 1;
        tree_.prims[at.first] = items_[begin];
        return;
      }
      const size_t middle = split(begin, end, centres);
      node.first = at.free, node.count = 0;
      if (!build_halves(begin, middle, end, at, [&](size_t b, size_t e, SubtreeSlots s) { build(b, e, s); })) return;
    }
  }

  void agglomerate(size_t begin, size_t end, SubtreeSlots at) {
    // Sorted: ties are broken by index.
    std::sort(items_.begin() + static_cast<ptrdiff_t>(begin), items_.begin() + static_cast<ptrdiff_t>(end));
    std::vector<Aabb> inside;
    inside.reserve(end - begin);
    for (size_t i = begin; i < end; ++i) inside.push_back(boxes_[items_[i]]);
    place_merges(agglomerate_boxes(inside, Strategy::locally_ordered, progress_), {items_.data() + begin, end - begin},
                 boxes_, tree_, at);
  }

  // Partitions items_[begin, end) at the cheapest bin boundary; the index of the first item on the right.
  size_t split(size_t begin, size_t end, const Aabb& centres) {
    const Vec3f extent = centres.extent();
    const int longest = centres.longest_axis();
    float best = std::numeric_limits<float>::max();
    int best_axis = -1, best_bin = 0;
    struct Bin {
      Aabb box;
      size_t count = 0;
    };
    std::array<std::array<Bin, kBins>, 3> bins;
    const auto scale_of = [&](int axis) { return static_cast<float>(kBins) * 0.9999f / extent[axis]; };
    const auto bin_of = [&](const Aabb& b, int axis, float scale) {
      return std::min(kBins - 1, std::max(0, static_cast<int>((b.lo[axis] + b.hi[axis] - centres.lo[axis]) * scale)));
    };
    bool axes[3];
    float scales[3];
    for (int axis = 0; axis < 3; ++axis) {
      axes[axis] = (all_axes_ || axis == longest) && extent[axis] > 0.0f && std::isfinite(scale_of(axis));
      scales[axis] = axes[axis] ? scale_of(axis) : 0.0f;
    }
    for (size_t i = begin; i < end; ++i) {
      const Aabb& b = boxes_[items_[i]];
      for (int axis = 0; axis < 3; ++axis) {
        if (!axes[axis]) continue;
        Bin& bin = bins[static_cast<size_t>(axis)][static_cast<size_t>(bin_of(b, axis, scales[axis]))];
        bin.box.extend(b);
        ++bin.count;
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (!axes[axis]) continue;
      const auto& row = bins[static_cast<size_t>(axis)];
      float right_cost[kBins];
      Aabb box;
      size_t count = 0;
      for (int i = kBins - 1; i > 0; --i) {
        box.extend(row[static_cast<size_t>(i)].box);
        count += row[static_cast<size_t>(i)].count;
        right_cost[i] = count == 0 ? -1.0f : box.half_area() * static_cast<float>(count);
      }
      box = {};
      count = 0;
      for (int i = 0; i + 1 < kBins; ++i) {
        box.extend(row[static_cast<size_t>(i)].box);
        count += row[static_cast<size_t>(i)].count;
        if (count == 0 || right_cost[i + 1] < 0.0f) continue;
        const float cost = box.half_area() * static_cast<float>(count) + right_cost[i + 1];
        if (cost < best) best = cost, best_axis = axis, best_bin = i;
      }
    }
    size_t middle = (begin + end) / 2;  // where all centres coincide
    if (best_axis >= 0) {
      const auto first = items_.begin();
      middle = static_cast<size_t>(
          std::partition(first + static_cast<ptrdiff_t>(begin), first + static_cast<ptrdiff_t>(end),
                         [&](uint32_t i) { return bin_of(boxes_[i], best_axis, scales[best_axis]) <= best_bin; }) -
          first);
    }
    return middle;
  }

  std::span<const Aabb> boxes_;
  Tree& tree_;
  bool all_axes_;
  size_t agglomerate_up_to_;
  Progress* progress_;
  std::vector<uint32_t> items_;
};

}  // namespace

void build_binned(std::span<const Aabb> boxes, bool all_axes, size_t agglomerate_up_to, Tree& tree,
                  Progress* progress) {
  BinnedBuilder(boxes, tree, all_axes, agglomerate_up_to, progress).build();
}

}  // namespace lumicut
