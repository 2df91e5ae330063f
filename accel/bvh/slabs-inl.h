// Slab test of one ray against the eight boxes of a node.
// Near and far planes are selected by the signs of the direction. Fast: one fused multiply-subtract per plane. Robust:
// subtraction, then multiplication by the reciprocal widened by 3 ulp, so that rounding never misses a box.
// [Ize 2013, Robust BVH Ray Traversal]
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_SLABS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_SLABS_INL_H_
#undef LUMICUT_ACCEL_BVH_SLABS_INL_H_
#else
#define LUMICUT_ACCEL_BVH_SLABS_INL_H_
#endif

#include "accel/bvh/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// One ray against the boxes of a node.
template <bool kRobust>
struct Slabs {
  V8 origin[3];                     // fast: times the reciprocal of the direction
  V8 near_rcp[3], far_rcp[3];       // 1/direction; robust: widened
  int near_plane[3], far_plane[3];  // rows of WideNode::planes

  HWY_INLINE Slabs(const Vec3f& org, const Vec3f& dir) {
    const D8 d;
    for (int axis = 0; axis < 3; ++axis) {
      const float r = reciprocal(dir[axis]);
      origin[axis] = hn::Set(d, kRobust ? org[axis] : org[axis] * r);
      near_rcp[axis] = hn::Set(d, kRobust ? r * (1.0f - 3.0f * kUlp) : r);
      far_rcp[axis] = hn::Set(d, kRobust ? r * (1.0f + 3.0f * kUlp) : r);
      near_plane[axis] = 2 * axis + (r < 0.0f ? 1 : 0);
      far_plane[axis] = 2 * axis + (r < 0.0f ? 0 : 1);
    }
  }

  // Ray parameter at a plane of each child.
  HWY_INLINE V8 at(const float* plane, int axis, const V8& rcp) const {
    const D8 d;
    if constexpr (kRobust) return hn::Mul(hn::Sub(hn::Load(d, plane), origin[axis]), rcp);
    return hn::MulSub(hn::Load(d, plane), rcp, origin[axis]);
  }

  // One bit per child whose box the ray meets in [tnear, tfar]. `entry`, unless null: eight entry distances.
  HWY_INLINE uint32_t test(const WideNode& node, const V8& tnear, const V8& tfar, float* entry) const {
    const D8 d;
    uint32_t mask = 0;
    for (size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto x1 = at(node.planes[near_plane[0]] + i, 0, near_rcp[0]),
                 x2 = at(node.planes[far_plane[0]] + i, 0, far_rcp[0]);
      const auto y1 = at(node.planes[near_plane[1]] + i, 1, near_rcp[1]),
                 y2 = at(node.planes[far_plane[1]] + i, 1, far_rcp[1]);
      const auto z1 = at(node.planes[near_plane[2]] + i, 2, near_rcp[2]),
                 z2 = at(node.planes[far_plane[2]] + i, 2, far_rcp[2]);
      const auto in = hn::Max(hn::Max(x1, y1), hn::Max(z1, tnear)), out = hn::Min(hn::Min(x2, y2), hn::Min(z2, tfar));
      if (entry != nullptr) hn::Store(in, d, entry + i);
      mask |= bits_of(d, hn::Le(in, out)) << i;
    }
    return mask;
  }
};

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_SLABS_INL_H_
