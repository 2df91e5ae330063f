// Parallel agglomeration: chains run concurrently in regions of space, until each stalls at a best match outside; then
// in new regions over what is left, and the last clusters on one thread.
// Serves the aim of [Walter et al. 2008, sec. 3.3] by other means. A region is a subtree of the search tree; its size
// depends on the number of clusters only, so the tree is the same on any number of threads.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_PARALLEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_PARALLEL_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_PARALLEL_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_PARALLEL_INL_H_
#endif

#include <algorithm>
#include <utility>
#include <vector>

#include "accel/agglomerate/locally_ordered-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Merges `active` to one cluster.
template <ClusterPolicy Policy>
void merge_in_regions(Clusters<Policy>& clusters, std::vector<uint32_t> active) {
  BestMatchTree<Policy> tree(clusters), before(clusters);
  std::vector<uint32_t> in_slot;
  HugeArray<Merge> made(active.size());  // in each region from its first slot on
  std::vector<typename Clusters<Policy>::PartMerges> parts;
  for (;;) {
    const size_t m = active.size(), top = m > (1u << 21) ? 4 : (m > (1u << 14) ? 3 : 2),
                 span = size_t{1} << (3 * (top + 1));
    if (m < 4 * span) return merge_locally_ordered(clusters, std::move(active));
    sort_in_space(clusters, active);
    tree.build(active);
    before.copy(tree);
    in_slot = active;
    parts.assign((m + span - 1) / span, {});
    clusters.for_chunks(parts.size(), 1, [&](size_t region, size_t) {
      const size_t begin = region * span, end = std::min(m, begin + span);
      Merge* merges = made.data() + begin;
      const uint32_t first_id = clusters.next_id() + static_cast<uint32_t>(begin);
      const size_t count = merge_chains_within(clusters, tree, &before, top, begin, end, 1, first_id, in_slot, merges);
      parts[region] = {merges, count, first_id, {in_slot.data() + begin, end - begin}};
    });
    clusters.append(parts);
    clusters.keep(in_slot, active);
    // Regions that merge little gain nothing over one chain.
    if (active.size() > m - m / 8) return merge_locally_ordered(clusters, std::move(active));
  }
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_PARALLEL_INL_H_
