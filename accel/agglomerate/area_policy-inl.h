// The policy of boxes.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_AREA_POLICY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_AREA_POLICY_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_AREA_POLICY_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_AREA_POLICY_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "accel/agglomerate/policy-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// d = half the surface area of the joint box. [Walter et al. 2008, sec. 4] Features: -lo, hi.
struct AreaPolicy {
  static constexpr bool kNonDecreasing = true;
  static constexpr int kFeatures = 6;
  static constexpr int kOrderDims = 3;
  size_t features() const { return 6; }
  size_t key_features() const { return 6; }
  void merge(const float* a, const float* b, float* out) const {
    for (int f = 0; f < 6; ++f) out[f] = std::max(a[f], b[f]);
  }
  void order_point(const float* a, float* point) const {
    for (int axis = 0; axis < 3; ++axis) point[axis] = a[3 + axis] - a[axis];  // twice the centre
  }
  template <class D>
  struct Query {
    hn::Vec<D> f[6];
  };
  template <class D>
  HWY_INLINE Query<D> query(D d, const float* a) const {
    return {
        {hn::Set(d, a[0]), hn::Set(d, a[1]), hn::Set(d, a[2]), hn::Set(d, a[3]), hn::Set(d, a[4]), hn::Set(d, a[5])}};
  }
  template <class D>
  HWY_INLINE hn::Vec<D> cost(D d, const Query<D>& a, const float* b) const {
    const auto x = hn::Add(hn::Max(a.f[0], hn::Load(d, b)), hn::Max(a.f[3], hn::Load(d, b + 24)));
    const auto y = hn::Add(hn::Max(a.f[1], hn::Load(d, b + 8)), hn::Max(a.f[4], hn::Load(d, b + 32)));
    const auto z = hn::Add(hn::Max(a.f[2], hn::Load(d, b + 16)), hn::Max(a.f[5], hn::Load(d, b + 40)));
    return hn::Add(hn::Mul(x, hn::Add(y, z)), hn::Mul(y, z));
  }
};
static_assert(ClusterPolicy<AreaPolicy>);

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif
