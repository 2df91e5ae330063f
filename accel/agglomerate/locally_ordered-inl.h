// Locally-ordered agglomeration: a chain of best matches, whose last two clusters are merged once they are each other's
// best match. [Walter et al. 2008, Fig. 4]
// Departs: equal costs are ordered by least leaves. A merged cluster keeps the smaller least leaf, so Eq. 1 holds for
// that order too: no chain cycles, and the tree is the one of the other strategies.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_LOCALLY_ORDERED_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_LOCALLY_ORDERED_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_LOCALLY_ORDERED_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_LOCALLY_ORDERED_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "accel/agglomerate/best_match_tree-inl.h"
#include "accel/agglomerate/spatial_order-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Merges clusters in the slots [begin, end), which one block of level `top` spans, until `stop_at` are left. The chain
// is a stack: below a merge of its top it remains a chain of best matches. A chain stalls where a best match is outside
// of the slots, found in `outside`, a copy of the tree from before: outside clusters only grow, so by Eq. 1 no merge
// inside depends on what is merged there. `first_id`: id of the first merge; `in_slot`: the cluster in each slot, or
// kNone. Returns the number of merges.
template <ClusterPolicy Policy>
size_t merge_chains_within(Clusters<Policy>& clusters, BestMatchTree<Policy>& tree,
                           const BestMatchTree<Policy>* outside, size_t top, size_t begin, size_t end, size_t stop_at,
                           uint32_t first_id, std::vector<uint32_t>& in_slot, Merge* merges) {
  struct Link {
    uint32_t slot;
    Match match;  // the previous link, which a better match must beat
  };
  std::vector<Link> links;
  std::vector<uint8_t> stalled(outside != nullptr ? end - begin : 0, 0);
  const auto is_stalled = [&](size_t slot) { return outside != nullptr && stalled[slot - begin] != 0; };
  size_t alive = end - begin, scan = begin, made = 0;
  while (alive > stop_at) {
    if (links.empty()) {
      while (scan < end && (in_slot[scan] == kNone || is_stalled(scan))) ++scan;
      if (scan == end) break;
      links.push_back({static_cast<uint32_t>(scan), {}});
    }
    const Link last = links.back();
    const uint32_t cluster = in_slot[last.slot];
    clusters.expect(cluster != kNone);
    const Match match = tree.find(cluster, last.slot, last.match, top, outside);
    if (match.slot != last.match.slot) {
      if (match.slot < begin || match.slot >= end || is_stalled(match.slot)) {
        for (const Link& link : links) stalled[link.slot - begin] = 1;
        links.clear();
        continue;
      }
      links.push_back({match.slot, {match.cost, clusters.least(cluster), last.slot}});
      continue;
    }
    if (match.slot == kNone) break;  // no other cluster
    if ((made & 0x3ff) == 0) clusters.check();
    const uint32_t into = match.slot;
    clusters.expect(in_slot[into] != kNone && into != last.slot);
    links.resize(links.size() - 2);
    merges[made] = clusters.join(in_slot[into], cluster, match.cost, first_id + static_cast<uint32_t>(made));
    ++made;
    in_slot[last.slot] = kNone;
    tree.set(last.slot, kNone, top);
    tree.set(into, in_slot[into], top);
    scan = std::min<size_t>(scan, into);
    --alive;
  }
  return made;
}

// Merges `active` to one cluster. The search tree is rebuilt whenever half of the clusters are gone.
template <ClusterPolicy Policy>
void merge_locally_ordered(Clusters<Policy>& clusters, std::vector<uint32_t> active) {
  BestMatchTree<Policy> tree(clusters);
  std::vector<uint32_t> in_slot;
  while (active.size() > 1) {
    sort_in_space(clusters, active);
    tree.build(active);
    in_slot = active;
    const size_t stop_at = active.size() > 64 ? active.size() / 2 : 1;
    clusters.count_merges(merge_chains_within<Policy>(clusters, tree, nullptr, tree.levels() - 1, 0, active.size(),
                                                      stop_at, clusters.next_id(), in_slot, clusters.next_merge()));
    clusters.keep(in_slot, active);
  }
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_LOCALLY_ORDERED_INL_H_
