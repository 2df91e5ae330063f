// Order of clusters in space, for the implicit search tree over them.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#endif

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

template <ClusterPolicy Policy>
struct OrderItem {
  float point[Policy::kOrderDims];
  uint32_t cluster;
};

// Median splits along the longest axis, at multiples of `unit`, until at most eight items are left.
template <ClusterPolicy Policy>
void split_at_medians(const Clusters<Policy>& clusters, OrderItem<Policy>* items, size_t n, size_t unit) {
  using Item = OrderItem<Policy>;
  while (n > 8) {
    while (unit >= n) unit /= 8;
    if (unit < 8) unit = 8;
    const size_t middle = (n + unit - 1) / unit / 2 * unit;
    float lo[Policy::kOrderDims], hi[Policy::kOrderDims];
    for (int a = 0; a < Policy::kOrderDims; ++a) lo[a] = kInfinity, hi[a] = -kInfinity;
    for (size_t i = 0; i < n; ++i)
      for (int a = 0; a < Policy::kOrderDims; ++a) {
        lo[a] = std::min(lo[a], items[i].point[a]);
        hi[a] = std::max(hi[a], items[i].point[a]);
      }
    int axis = 0;
    for (int a = 1; a < Policy::kOrderDims; ++a)
      if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
    std::nth_element(items, items + middle, items + n, [axis](const Item& a, const Item& b) {
      return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.cluster < b.cluster;
    });
    if (n > 0x4000) clusters.check();
    if (clusters.threads() && n > 0x2000) {
      tbb::parallel_invoke([&] { split_at_medians(clusters, items, middle, unit); },
                           [&] { split_at_medians(clusters, items + middle, n - middle, unit); });
      return;
    }
    split_at_medians(clusters, items, middle, unit);
    items += middle, n -= middle;
  }
}

// Sorts clusters such that runs of 8, 64, 512... of them are close together.
template <ClusterPolicy Policy>
void sort_in_space(const Clusters<Policy>& clusters, std::vector<uint32_t>& active) {
  std::vector<OrderItem<Policy>> items(active.size());
  clusters.for_chunks(active.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      clusters.policy().order_point(clusters.of(active[i]), items[i].point);
      items[i].cluster = active[i];
    }
  });
  size_t unit = 8;
  while (unit * 8 < items.size()) unit *= 8;
  if constexpr (requires { clusters.policy().schedule(); }) clusters.policy().schedule().begin_sort();
  split_at_medians(clusters, items.data(), items.size(), unit);
  if constexpr (requires { clusters.policy().schedule(); }) clusters.policy().schedule().end_sort(items.size());
  for (size_t i = 0; i < active.size(); ++i) active[i] = items[i].cluster;
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
