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
#include <utility>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Merges leaves with equal keys in balanced subtrees. Returns the remaining clusters in order of their least leaf.
// Leaves are sorted by hash into shares, so that the hash table of a share fits a cache and shares need not wait for
// each other.
template <ClusterPolicy Policy>
std::vector<uint32_t> join_coincident(Clusters<Policy>& clusters) {
  const size_t n = clusters.leaf_count(), key = clusters.policy().key_features(), shares = n / 4096 + 1;
  const size_t chunk = std::max<size_t>(1 << 15, n / 64 + 1), chunks = (n + chunk - 1) / chunk;
  std::vector<uint32_t> hashes(n), by_share(n), fill(chunks * shares, 0), start(shares + 1, 0);
  const auto share_of = [&](size_t i) { return static_cast<size_t>((uint64_t{hashes[i]} * shares) >> 32); };
  clusters.for_chunks(n, chunk, [&](size_t begin, size_t end) {
    uint32_t* counts = fill.data() + begin / chunk * shares;
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
      ++counts[share_of(i)];
    }
  });
  uint32_t filled = 0;
  for (size_t s = 0; s < shares; ++s) {
    start[s] = filled;
    for (size_t c = 0; c < chunks; ++c) filled += std::exchange(fill[c * shares + s], filled);
  }
  start[shares] = filled;
  clusters.for_chunks(n, chunk, [&](size_t begin, size_t end) {
    uint32_t* to = fill.data() + begin / chunk * shares;
    for (size_t i = begin; i < end; ++i) by_share[to[share_of(i)]++] = static_cast<uint32_t>(i);
  });

  std::vector<uint32_t> firsts(n);  // the least leaf of each group, else kNone
  HugeArray<Merge> made(n);         // in each share from its start on
  std::vector<typename Clusters<Policy>::PartMerges> parts(shares);
  std::vector<std::vector<uint32_t>> joined(shares);
  clusters.for_chunks(shares, 1, [&](size_t share, size_t) {
    clusters.check();
    const size_t count = start[share + 1] - start[share];
    size_t buckets = 16;
    while (buckets < 2 * count) buckets *= 2;
    std::vector<uint32_t> table(buckets, kNone);
    std::vector<std::pair<uint32_t, uint32_t>> others;  // the least leaf of a group, and another
    for (size_t d = start[share]; d < start[share + 1]; ++d) {
      const uint32_t i = by_share[d];
      for (size_t at = (hashes[i] * 0x9e3779b1u) & (buckets - 1);; at = (at + 1) & (buckets - 1)) {
        const uint32_t other = table[at];
        if (other == kNone) {
          table[at] = firsts[i] = i;
          break;
        }
        if (hashes[other] == hashes[i] && std::equal(clusters.of(i), clusters.of(i) + key, clusters.of(other))) {
          others.push_back({other, i});
          firsts[i] = kNone;
          break;
        }
      }
    }
    std::sort(others.begin(), others.end());
    Merge* merges = made.data() + start[share];
    const auto first_id = static_cast<uint32_t>(n) + start[share];
    uint32_t merged = 0;
    std::vector<uint32_t> group;
    for (size_t i = 0; i < others.size();) {
      const uint32_t first = others[i].first;
      group.assign(1, first);
      for (; i < others.size() && others[i].first == first; ++i) group.push_back(others[i].second);
      while (group.size() > 1) {  // neighbours pairwise: depth log2 of the group
        size_t out = 0;
        for (size_t j = 0; j < group.size(); j += 2) {
          if ((merged & 0xfff) == 0) clusters.check();
          if (j + 1 < group.size()) {
            merges[merged] =
                clusters.join(group[j], group[j + 1], clusters.pair_cost(group[j], group[j + 1]), first_id + merged);
            ++merged;
          }
          group[out++] = group[j];
        }
        group.resize(out);
      }
      joined[share].push_back(first);
    }
    parts[share] = {merges, merged, first_id, joined[share]};
  });
  clusters.append(parts);
  std::vector<uint32_t> active;
  clusters.keep(firsts, active);
  return active;
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_COINCIDENT_INL_H_
