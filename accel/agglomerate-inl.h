// Agglomerative clustering for any policy (accel/agglomerate/policy-inl.h). [Walter et al. 2008, Fast Agglomerative
// Clustering for Rendering, sec. 3]
// Departs: ties are broken by the least leaf of each cluster, so that every strategy builds the same tree, and leaves
// that coincide are merged in balanced subtrees first. The file of each strategy names its own departures.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#endif

#include <hwy/highway.h>

#include <utility>
#include <vector>

#include "accel/agglomerate.h"
#include "accel/agglomerate/coincident-inl.h"
#include "accel/agglomerate/heap-inl.h"
#include "accel/agglomerate/locally_ordered-inl.h"
#include "accel/agglomerate/naive-inl.h"
#include "accel/agglomerate/parallel-inl.h"
#include "core/error.h"
#include "core/progress.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

template <ClusterPolicy Policy>
class Core {
 public:
  // Leaves are uninitialised. `threads`: build in parallel, on the caller's arena. `policy` must outlive the Core.
  Core(const Policy& policy, size_t n, bool threads, Progress* progress) : clusters_(policy, n, threads, progress) {}

  // Where the features of leaf i are to be stored.
  float* leaf(size_t i) { return clusters_.leaf(i); }

  // fn(begin, end) over chunks of [0, n); in parallel with `threads`.
  template <class Fn>
  void for_chunks(size_t n, size_t chunk, Fn&& fn) const {
    clusters_.for_chunks(n, chunk, std::forward<Fn>(fn));
  }

  // The tree of all leaves; to be called once. Throws Error(invalid_argument) where the strategy does not suit the
  // policy, and Error(cancelled).
  std::vector<Merge> run(Strategy strategy) {
    clusters_.check();
    if constexpr (!Policy::kNonDecreasing)
      if (strategy == Strategy::locally_ordered || strategy == Strategy::parallel)
        fail_argument(
            "agglomerate: locally ordered strategies need a dissimilarity that never falls as clusters grow (Eq. 1)");
    std::vector<uint32_t> active = join_coincident(clusters_);
    if (active.size() > 1) {
      switch (strategy) {
        case Strategy::naive:
          merge_naively(clusters_, std::move(active));
          break;
        case Strategy::heap:
          merge_by_heap(clusters_, std::move(active));
          break;
        case Strategy::locally_ordered:
          merge_locally_ordered(clusters_, std::move(active));
          break;
        case Strategy::parallel:
          merge_in_regions(clusters_, std::move(active));
          break;
      }
    }
    return clusters_.canonical();
  }

 private:
  Clusters<Policy> clusters_;
};

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_INL_H_
