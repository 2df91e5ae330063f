// Intersection of one ray with a block of four primitives: triangles or boxes, masks, cut-outs.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_LEAF_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_LEAF_INL_H_
#undef LUMICUT_ACCEL_BVH_LEAF_INL_H_
#else
#define LUMICUT_ACCEL_BVH_LEAF_INL_H_
#endif

#include "accel/bvh/triangle-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// Boxes are solid: a ray that starts inside hits at tnear.
HWY_INLINE uint32_t intersect_boxes(const LeafBlock& block, size_t i, const LaneRay& r, const V4& tnear, const V4& tfar,
                                    HitLanes& hits) {
  const D4 d;
  V4 in = tnear, out = tfar;
  for (int axis = 0; axis < 3; ++axis) {
    const V4 dir = r.d[axis], tiny = hn::Set(d, 1e-18f);
    const V4 rcp = hn::Div(hn::Set(d, 1.0f),
                           hn::IfThenElse(hn::Lt(hn::Abs(dir), tiny), hn::Or(tiny, hn::And(dir, hn::SignBit(d))), dir));
    const V4 t0 = hn::Mul(hn::Sub(hn::Load(d, block.v[0][axis] + i), r.o[axis]), rcp);
    const V4 t1 = hn::Mul(hn::Sub(hn::Load(d, block.v[1][axis] + i), r.o[axis]), rcp);
    in = hn::Max(in, hn::Min(t0, t1)), out = hn::Min(out, hn::Max(t0, t1));
  }
  hn::Store(in, d, hits.t + i);
  hn::Store(hn::Zero(d), d, hits.u + i);
  hn::Store(hn::Zero(d), d, hits.v + i);
  const uint32_t used = bits_of(D4u(), hn::Ne(hn::Load(D4u(), block.prim + i), hn::Set(D4u(), kNoId)));
  return bits_of(d, hn::And(hn::Le(in, out), hn::Lt(in, tfar))) & used;
}

// One bit per lane hit whose mesh has a bit in common with `mask`. kStore: fills `hits`.
template <class C, bool kStore>
HWY_INLINE uint32_t intersect_block(const TraceScene& scene, const LeafBlock& block, const LaneRay& r, const V4& tnear,
                                    const V4& tfar, uint32_t mask, HitLanes& hits) {
  uint32_t all = 0;
  for (size_t i = 0; i < 4; i += hn::Lanes(D4())) {  // once where vectors have four lanes
    uint32_t hit;
    if constexpr (C::kBoxes)
      hit = intersect_boxes(block, i, r, tnear, tfar, hits);
    else if constexpr (C::kRobust)
      hit = intersect_robust<kStore>(block, i, r, tnear, tfar, hits);
    else
      hit = intersect_fast<kStore>(block, i, r, tnear, tfar, hits);
    all |= hit << i;
  }
  (void)scene, (void)mask;
  if constexpr (C::kMasks)
    for (uint32_t m = all; m != 0; m &= m - 1) {
      const int lane = __builtin_ctz(m);
      if ((scene.mesh_masks[block.geom[lane]] & mask) == 0) all &= ~(1u << lane);
    }
  return all;
}

// True when some lane of `hit` stops the light of `ray`: cut-outs and glass may let it pass. Reads `hits` where the scene
// has filters.
template <class C>
HWY_INLINE bool any_lane_stops(const TraceScene& scene, const LeafBlock& block, uint32_t instance_id, const Ray& ray,
                               uint32_t hit, const HitLanes& hits) {
  (void)instance_id, (void)ray;
  if constexpr (C::kFilters) {
    for (; hit != 0; hit &= hit - 1) {
      const int lane = __builtin_ctz(hit);
      if (!(scene.filtered[block.geom[lane]] != 0 &&
            scene.filter->passes_light(
                {block.geom[lane], instance_id, block.prim[lane], hits.u[lane], hits.v[lane], ray.towards_light()})))
        return true;
    }
    return false;
  }
  return hit != 0;
}

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_LEAF_INL_H_
