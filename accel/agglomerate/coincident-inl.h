// Coincident leaves, in linear time.
// Departs from the paper: greedy merging of n leaves at distance 0 would make a tree of depth n; here they become
// balanced subtrees before the rest is clustered.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_
#endif

#include <algorithm>
#include <cstring>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// For each leaf the least one with the same key. Leaves are partitioned by hash into shares, so that the hash table of
// a share fits a cache.
template <ClusterPolicy Policy>
std::vector<uint32_t> first_equal(const Clusters<Policy>& clusters) {
  const size_t n = clusters.leaf_count(), key = clusters.policy().key_features(), shares = n / 4096 + 1;
  std::vector<uint32_t> hashes(n), first(n), by_share(n), start(shares + 1, 0);
  clusters.for_chunks(n, 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* f = clusters.of(static_cast<uint32_t>(i));
      uint64_t hash = 0;
      for (size_t j = 0; j < key; ++j) {
        const float value = f[j] + 0.0f;  // -0 becomes 0
        uint32_t bits;
        std::memcpy(&bits, &value, sizeof(bits));
        hash = (hash ^ bits) * 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 32;
      }
      hashes[i] = static_cast<uint32_t>(hash);
    }
  });
  const auto share_of = [&](size_t i) { return static_cast<size_t>((uint64_t{hashes[i]} * shares) >> 32); };
  for (size_t i = 0; i < n; ++i) ++start[share_of(i) + 1];
  for (size_t s = 0; s < shares; ++s) start[s + 1] += start[s];
  std::vector<uint32_t> fill(start.begin(), start.end() - 1);
  for (size_t i = 0; i < n; ++i) by_share[fill[share_of(i)]++] = static_cast<uint32_t>(i);
  clusters.for_chunks(shares, 1, [&](size_t share, size_t) {
    clusters.check();
    const size_t count = start[share + 1] - start[share];
    size_t buckets = 16;
    while (buckets < 2 * count) buckets *= 2;
    std::vector<uint32_t> table(buckets, kNone);
    for (size_t d = start[share]; d < start[share + 1]; ++d) {
      const uint32_t i = by_share[d];
      for (size_t at = (hashes[i] * 0x9e3779b1u) & (buckets - 1);; at = (at + 1) & (buckets - 1)) {
        if (table[at] == kNone) table[at] = i;
        const uint32_t other = table[at];
        if (other == i ||
            (hashes[other] == hashes[i] && std::equal(clusters.of(i), clusters.of(i) + key, clusters.of(other)))) {
          first[i] = other;
          break;
        }
      }
    }
  });
  return first;
}

// Merges leaves with equal keys in balanced subtrees. Returns the remaining clusters in order of their least leaf.
template <ClusterPolicy Policy>
std::vector<uint32_t> join_coincident(Clusters<Policy>& clusters) {
  const std::vector<uint32_t> first = first_equal(clusters);
  const size_t n = clusters.leaf_count();
  std::vector<uint32_t> next(n, kNone), last(first);
  std::vector<uint32_t> active;
  active.reserve(n);
  for (uint32_t i = 0; i < n; ++i) {
    if (first[i] == i) {
      active.push_back(i);
    } else {
      next[last[first[i]]] = i;
      last[first[i]] = i;
    }
  }
  std::vector<uint32_t> group;
  for (const uint32_t cluster : active) {
    if (next[cluster] == kNone) continue;
    group.clear();
    for (uint32_t i = cluster; i != kNone; i = next[i]) group.push_back(i);
    while (group.size() > 1) {  // neighbours pairwise: depth log2 of the group
      size_t out = 0;
      for (size_t i = 0; i < group.size(); i += 2) {
        if ((clusters.merges().size() & 0xfff) == 0) clusters.check();
        if (i + 1 < group.size()) clusters.join(group[i], group[i + 1], clusters.pair_cost(group[i], group[i + 1]));
        group[out++] = group[i];
      }
      group.resize(out);
    }
  }
  return active;
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_
