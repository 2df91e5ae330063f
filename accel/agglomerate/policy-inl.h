// Requirements on the policies of agglomeration: the features of a cluster, and a dissimilarity d of two clusters.
//
// A cluster is a vector of floats, its features. A policy chooses them such that
//   - the features of A∪B are not below those of A or of B: per feature the maximum, or the sum;
//   - d(A, B) does not decrease when a feature of B increases.
// (BallPolicy meets the first by other means.) Then
//   - d(A, B) <= d(A∪C, B) holds [Walter et al. 2008, Eq. 1], also in floating point, where every operation rounds
//     monotonically;
//   - d(A, M), with M the minimum of each feature over many clusters, is a lower bound of d(A, B) over all of them.
// So one formula, evaluated in SIMD lanes, serves both as the dissimilarity and as its bound over a node of a search
// tree. Multiplications and additions in policies must not be fused (-ffp-contract=off), so that all instruction sets
// build the same tree.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_POLICY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_POLICY_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_POLICY_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_POLICY_INL_H_
#endif

#include <hwy/highway.h>

#include <concepts>
#include <cstddef>
#include <type_traits>

// No function of its own: no HWY_BEFORE_NAMESPACE, which clang refuses where nothing uses it.
namespace lumicut::HWY_NAMESPACE::agglomeration {

namespace hn = hwy::HWY_NAMESPACE;

// Eight clusters side by side.
using Lanes8 = hn::CappedTag<float, 8>;

inline constexpr int kMaxFeatures = 64;

template <class P>
concept ClusterPolicy = requires(const P& policy, const float* a, const float* b, float* out, Lanes8 d) {
  // Whether Eq. 1 holds. The locally-ordered and parallel strategies refuse policies where it does not.
  typename std::bool_constant<P::kNonDecreasing>;

  // Number of features; kFeatures is 0 where it is known at run time only.
  requires P::kFeatures >= 0 && P::kFeatures <= kMaxFeatures;
  { policy.features() } -> std::same_as<size_t>;

  // Leaves coincide when their first key_features() features are equal. They are merged before all others.
  { policy.key_features() } -> std::same_as<size_t>;

  // Stores the features of A∪B. Symmetric in A and B; `out` does not overlap either.
  { policy.merge(a, b, out) } -> std::same_as<void>;

  // Stores a point of kOrderDims coordinates by which clusters are sorted in space. Affects speed only.
  requires P::kOrderDims >= 1;
  { policy.order_point(a, out) } -> std::same_as<void>;

  // What cost() reads of A; computed once per search. May keep the pointer.
  { policy.query(d, a) } -> std::same_as<typename P::template Query<Lanes8>>;

  // Lane i: d(A, B_i), where feature f of B_i is b[8 * f + i]. Features of infinity give infinity.
  { policy.cost(d, policy.query(d, a), b) } -> std::same_as<hn::Vec<Lanes8>>;
};

}  // namespace lumicut::HWY_NAMESPACE::agglomeration

#endif  // LUMICUT_ACCEL_AGGLOMERATE_POLICY_INL_H_
