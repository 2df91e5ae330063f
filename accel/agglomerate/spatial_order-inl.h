// Order of clusters in space, for the implicit search tree over them.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
#endif

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

template <ClusterPolicy Policy>
struct OrderItem {
  float point[Policy::kOrderDims];
  uint32_t cluster;
};

template <ClusterPolicy Policy>
struct OrderBounds {
  float lo[Policy::kOrderDims], hi[Policy::kOrderDims];
  OrderBounds() {
    for (int a = 0; a < Policy::kOrderDims; ++a) lo[a] = kInfinity, hi[a] = -kInfinity;
  }
  void extend(const float* low, const float* high) {
    for (int a = 0; a < Policy::kOrderDims; ++a) lo[a] = std::min(lo[a], low[a]), hi[a] = std::max(hi[a], high[a]);
  }
  void extend(const OrderItem<Policy>* items, size_t n) {
    for (size_t i = 0; i < n; ++i) extend(items[i].point, items[i].point);
  }
  int longest_axis() const {
    int axis = 0;
    for (int a = 1; a < Policy::kOrderDims; ++a)
      if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
    return axis;
  }
};

// Items in order along an axis; none of equal rank.
template <ClusterPolicy Policy>
auto along(int axis) {
  return [axis](const OrderItem<Policy>& a, const OrderItem<Policy>& b) {
    return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.cluster < b.cluster;
  };
}

// Halves n items at a multiple of `unit`, a power of 8 which it reduces to fit: where the second half begins.
inline size_t middle_of(size_t n, size_t& unit) {
  while (unit >= n) unit /= 8;
  if (unit < 8) unit = 8;
  return (n + unit - 1) / unit / 2 * unit;
}

// Median splits along the longest axis until at most eight items are left.
template <ClusterPolicy Policy>
void split_at_medians(OrderItem<Policy>* items, size_t n, size_t unit) {
  while (n > 8) {
    const size_t middle = middle_of(n, unit);
    OrderBounds<Policy> bounds;
    bounds.extend(items, n);
    std::nth_element(items, items + middle, items + n, along<Policy>(bounds.longest_axis()));
    split_at_medians<Policy>(items, middle, unit);
    items += middle, n -= middle;
  }
}

// Copies items to `to`, those that belong before `middle` along the longest axis in front: by counts in buckets, so
// that chunks need not wait for each other.
template <ClusterPolicy Policy>
void split_in_chunks(const Clusters<Policy>& clusters, const OrderItem<Policy>* from, OrderItem<Policy>* to, size_t n,
                     size_t middle) {
  constexpr size_t kChunk = 1 << 12, kBuckets = 256;
  const size_t chunks = (n + kChunk - 1) / kChunk;
  std::vector<OrderBounds<Policy>> bounds(chunks);
  clusters.for_chunks(n, kChunk,
                      [&](size_t begin, size_t end) { bounds[begin / kChunk].extend(from + begin, end - begin); });
  for (size_t c = 1; c < chunks; ++c) bounds[0].extend(bounds[c].lo, bounds[c].hi);
  const int axis = bounds[0].longest_axis();
  const float lo = bounds[0].lo[axis], scale = static_cast<float>(kBuckets) / (bounds[0].hi[axis] - lo);
  const auto bucket_of = [&](const OrderItem<Policy>& item) -> size_t {
    const float at = (item.point[axis] - lo) * scale;
    return at >= static_cast<float>(kBuckets) ? kBuckets - 1 : (at > 0.0f ? static_cast<size_t>(at) : 0);  // NaN: 0
  };
  std::vector<uint32_t> counts(chunks * kBuckets, 0);
  clusters.for_chunks(n, kChunk, [&](size_t begin, size_t end) {
    uint32_t* of_chunk = counts.data() + begin / kChunk * kBuckets;
    for (size_t i = begin; i < end; ++i) ++of_chunk[bucket_of(from[i])];
  });
  // The bucket of the median.
  size_t median = 0, before = 0, inside = 0;
  for (;; ++median, before += inside) {
    inside = 0;
    for (size_t c = 0; c < chunks; ++c) inside += counts[c * kBuckets + median];
    if (before + inside > middle) break;
  }
  struct Fill {
    size_t at[3];  // below the median's bucket, in it, above it
  };
  std::vector<Fill> fill(chunks);
  Fill next{{0, before, before + inside}};
  for (size_t c = 0; c < chunks; ++c) {
    fill[c] = next;
    const uint32_t* of_chunk = counts.data() + c * kBuckets;
    next.at[0] += std::accumulate(of_chunk, of_chunk + median, size_t{0});
    next.at[1] += of_chunk[median];
    next.at[2] += std::accumulate(of_chunk + median + 1, of_chunk + kBuckets, size_t{0});
  }
  clusters.for_chunks(n, kChunk, [&](size_t begin, size_t end) {
    Fill& of_chunk = fill[begin / kChunk];
    for (size_t i = begin; i < end; ++i) {
      const size_t bucket = bucket_of(from[i]);
      to[of_chunk.at[(bucket >= median) + (bucket > median)]++] = from[i];
    }
  });
  std::nth_element(to + before, to + middle, to + before + inside, along<Policy>(axis));
}

// Sorts clusters such that runs of 8, 64, 512... of them are close together.
template <ClusterPolicy Policy>
void sort_in_space(const Clusters<Policy>& clusters, std::vector<uint32_t>& active) {
  const size_t alone = std::max<size_t>(4096, active.size() / 32);  // what a thread splits further by itself
  struct Range {
    size_t begin, end, unit;
  };
  HugeArray<OrderItem<Policy>> items(active.size()), other(active.size() > alone ? active.size() : 0);
  clusters.for_chunks(active.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      clusters.policy().order_point(clusters.of(active[i]), items[i].point);
      items[i].cluster = active[i];
    }
  });
  if constexpr (requires { clusters.policy().schedule(); }) clusters.policy().schedule().begin_sort();
  size_t unit = 8;
  while (unit * 8 < items.size()) unit *= 8;
  std::vector<Range> ranges{{0, items.size(), unit}}, halves;
  const auto large = [alone](const Range& range) { return range.end - range.begin > alone; };
  while (std::any_of(ranges.begin(), ranges.end(), large)) {
    halves.clear();
    for (Range range : ranges) {
      clusters.check();
      if (!large(range)) {
        std::copy(items.data() + range.begin, items.data() + range.end, other.data() + range.begin);
        halves.push_back(range);
        continue;
      }
      const size_t n = range.end - range.begin, middle = middle_of(n, range.unit);
      split_in_chunks(clusters, items.data() + range.begin, other.data() + range.begin, n, middle);
      halves.push_back({range.begin, range.begin + middle, range.unit});
      halves.push_back({range.begin + middle, range.end, range.unit});
    }
    std::swap(items, other);
    std::swap(ranges, halves);
  }
  clusters.for_chunks(ranges.size(), 1, [&](size_t index, size_t) {
    const Range& range = ranges[index];
    clusters.check();
    split_at_medians<Policy>(items.data() + range.begin, range.end - range.begin, range.unit);
    for (size_t i = range.begin; i < range.end; ++i) active[i] = items[i].cluster;
  });
  if constexpr (requires { clusters.policy().schedule(); }) clusters.policy().schedule().end_sort();
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_SPATIAL_ORDER_INL_H_
