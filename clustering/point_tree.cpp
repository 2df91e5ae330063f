#include "clustering/point_tree.h"

#include <tbb/parallel_invoke.h>

#include <numbers>
#include <numeric>

#include "core/parallel.h"

namespace lumicut {

namespace {

struct Splitter {
  const ShadePoints& batch;
  std::vector<uint32_t>& order;
  float scale[6];
  Progress& progress;
  const std::vector<float>* reflectance = nullptr;  // diffuse and specular, or not compared
  float per_reflectance = 0.0f;

  const float* feature(int axis) const {
    return axis < 3   ? batch.position[axis].data()
           : axis < 6 ? batch.normal[axis - 3].data()
                      : reflectance[axis - 6].data();
  }

  // Splits [begin, end) until every leaf stands alone. What a node becomes depends on its points, never on who does it.
  void split(size_t begin, size_t end) const {
    const size_t n = end - begin;
    if (n <= PointTree::kLeaf) return;
    if (n > PointTree::kRegion) progress.check();
    int widest = 0;
    float low = 0.0f, high = -1.0f, width = -1.0f;
    for (int a = 0; a < (reflectance != nullptr ? 8 : 6); ++a) {
      const float* f = feature(a);
      const float per = a < 6 ? scale[a] : per_reflectance;
      float lo = std::numeric_limits<float>::infinity(), hi = -lo;
      for (size_t i = begin; i < end; ++i) lo = std::min(lo, f[order[i]]), hi = std::max(hi, f[order[i]]);
      if ((hi - lo) * per > width) widest = a, low = lo, high = hi, width = (hi - lo) * per;
    }
    // The middle of the axis, on the nearest multiple of what a child of this node's level holds.
    size_t granule = PointTree::kLeaf;
    while (granule * kLanes < n) granule *= kLanes;
    const float* f = feature(widest);
    const float middle = 0.5f * (low + high);
    size_t below = 0;
    for (size_t i = begin; i < end; ++i) below += f[order[i]] < middle;
    const size_t last = (n - 1) / granule * granule;  // the remainder stays on the right
    const size_t mid = begin + std::clamp((below + granule / 2) / granule * granule, granule, last);
    std::nth_element(order.begin() + static_cast<ptrdiff_t>(begin), order.begin() + static_cast<ptrdiff_t>(mid),
                     order.begin() + static_cast<ptrdiff_t>(end),
                     [f](uint32_t a, uint32_t b) { return f[a] < f[b] || (f[a] == f[b] && a < b); });
    if (n > PointTree::kRegion) {
      tbb::parallel_invoke([&] { split(begin, mid); }, [&] { split(mid, end); });
    } else {
      split(begin, mid);
      split(mid, end);
    }
  }
};

}  // namespace

PointTree PointTree::build(const ShadePoints& batch, float length, Progress& progress, float material) {
  PointTree tree;
  const size_t n = batch.size();
  if (n == 0) return tree;
  tree.order.resize(n);
  std::iota(tree.order.begin(), tree.order.end(), 0u);
  const float per_length = length > 0.0f ? 1.0f / length : 0.0f;
  Splitter splitter{batch, tree.order, {per_length, per_length, per_length, 1, 1, 1}, progress};
  std::vector<float> reflectance[2];
  if (material > 0.0f) {
    for (size_t i = 0; i < n; ++i) {
      const SurfacePoint p = batch.get(i);
      reflectance[0].push_back(luminance(p.diffuse) * std::numbers::pi_v<float>);
      reflectance[1].push_back(luminance(p.specular));
    }
    splitter.reflectance = reflectance, splitter.per_reflectance = material;
  }
  splitter.split(0, n);
  progress.check();

  tree.points.reserve(n);
  for (uint32_t i : tree.order) tree.points.push(batch.get(i));
  tree.points.finish();

  const auto fill = [&](std::vector<PointNodes>& nodes, size_t per_lane) {
    const size_t per_block = per_lane * kLanes;
    nodes.resize((n + per_block - 1) / per_block);
    parallel_chunks(nodes.size(), 4, [&](size_t first, size_t last) {
      for (size_t b = first; b < last; ++b) {
        size_t lane = 0;
        for (size_t at = b * per_block; lane < kLanes && at < n; ++lane, at += per_lane)
          nodes[b].set(lane, tree.points, at, std::min(per_lane, n - at));
        if (lane < kLanes) nodes[b].pad(lane);
      }
    });
  };
  fill(tree.leaves, kLeaf);
  fill(tree.groups, kGroup);
  return tree;
}

}  // namespace lumicut
