// Agglomeration by a heap of each cluster's best match. [Walter et al. 2008, Fig. 3]
// Departs: lazy deletion. Pairs whose first cluster is gone are dropped, and where only the second is gone a new match
// is searched when the pair reaches the top.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_HEAP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_HEAP_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_HEAP_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_HEAP_INL_H_
#endif

#include <algorithm>
#include <queue>
#include <vector>

#include "accel/agglomerate/best_match_tree-inl.h"
#include "accel/agglomerate/spatial_order-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Merges `active` to one cluster.
template <ClusterPolicy Policy>
void merge_by_heap(Clusters<Policy>& clusters, std::vector<uint32_t> active) {
  struct Pair {
    float cost;
    uint32_t lo, hi;  // least leaves
    uint32_t owner, other, owner_node, other_node;
    bool operator<(const Pair& o) const {  // for std::priority_queue: the least on top
      return cost != o.cost ? cost > o.cost : (lo != o.lo ? lo > o.lo : hi > o.hi);
    }
  };
  BestMatchTree<Policy> tree(clusters);
  std::vector<uint32_t> slot_of(clusters.leaf_count(), kNone), in_slot;
  const auto rebuild = [&] {
    sort_in_space(clusters, active);
    tree.build(active);
    in_slot = active;
    for (size_t i = 0; i < active.size(); ++i) slot_of[active[i]] = static_cast<uint32_t>(i);
  };
  rebuild();
  size_t alive = active.size(), next_rebuild = alive / 2;
  std::priority_queue<Pair> queue;
  const auto push = [&](uint32_t cluster) {
    const Match match = tree.find(cluster, slot_of[cluster], {}, tree.levels() - 1, nullptr);
    const uint32_t other = in_slot[match.slot];
    const auto [lo, hi] = std::minmax({clusters.least(cluster), clusters.least(other)});
    queue.push({match.cost, lo, hi, cluster, other, clusters.node(cluster), clusters.node(other)});
  };
  for (size_t i = 0; i < active.size(); ++i) {
    if ((i & 0xfff) == 0) clusters.check();
    push(active[i]);
  }
  while (alive > 1) {
    const Pair pair = queue.top();
    queue.pop();
    if (slot_of[pair.owner] == kNone || clusters.node(pair.owner) != pair.owner_node) continue;
    if (slot_of[pair.other] == kNone || clusters.node(pair.other) != pair.other_node) {
      push(pair.owner);
      continue;
    }
    if ((clusters.merge_count() & 0xfff) == 0) clusters.check();
    clusters.join(pair.owner, pair.other, pair.cost);
    const uint32_t slot = slot_of[pair.other];
    slot_of[pair.other] = kNone, in_slot[slot] = kNone;
    tree.set(slot, kNone, tree.levels() - 1);
    tree.set(slot_of[pair.owner], pair.owner, tree.levels() - 1);
    if (--alive <= next_rebuild && alive > 64) {
      clusters.keep(in_slot, active);
      rebuild();
      next_rebuild = alive / 2;
    }
    if (alive > 1) push(pair.owner);
  }
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_HEAP_INL_H_
