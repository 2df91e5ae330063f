// Agglomeration by comparing all pairs before each merge, in O(N³): the oracle of tests. [Walter et al. 2008, Fig. 2]
// Departs: among equal costs the pair with the least leaves is merged first, as in all strategies.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_NAIVE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_NAIVE_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_NAIVE_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_NAIVE_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Merges `active` to one cluster.
template <ClusterPolicy Policy>
void merge_naively(Clusters<Policy>& clusters, std::vector<uint32_t> active) {
  while (active.size() > 1) {
    clusters.check();
    float best = kInfinity;
    uint32_t best_lo = kNone, best_hi = kNone;
    size_t left = 0, right = 1;
    for (size_t i = 0; i < active.size(); ++i)
      for (size_t j = i + 1; j < active.size(); ++j) {
        const float cost = clusters.pair_cost(active[i], active[j]);
        const auto [lo, hi] = std::minmax({clusters.least(active[i]), clusters.least(active[j])});
        if (cost < best || (cost == best && (lo < best_lo || (lo == best_lo && hi < best_hi))))
          best = cost, best_lo = lo, best_hi = hi, left = i, right = j;
      }
    clusters.join(active[left], active[right], best);
    active.erase(active.begin() + static_cast<ptrdiff_t>(right));
  }
}

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_NAIVE_INL_H_
