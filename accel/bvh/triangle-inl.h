// Intersection of one ray with the four triangles of a block.
// Fast: [Möller and Trumbore 1997, Fast, Minimum Storage Ray/Triangle Intersection].
// Robust: edge tests in Plücker coordinates relative to the ray's origin, so that two triangles give a shared edge the
// same answer [as in Embree]. Departs from Embree: the tests allow for their own rounding error, see kEdgeSlack and
// docs/decisions/accel-traversal.md.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_TRIANGLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_TRIANGLE_INL_H_
#undef LUMICUT_ACCEL_BVH_TRIANGLE_INL_H_
#else
#define LUMICUT_ACCEL_BVH_TRIANGLE_INL_H_
#endif

#include "accel/bvh/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// Upper bound of the rounding error of an edge test: about a dozen roundings, relative to direction × extent of the
// triangle × distance. At a corner all edge tests are within their error; without this slack every triangle around the
// corner may report a miss.
constexpr float kEdgeSlack = 4.0f * kUlp;
// Below this cosine between ray and plane a triangle is skipped: all its tests are within their error, and the adjacent
// triangles cover the ray.
constexpr float kEdgeOn = 1e-6f;

// One ray, repeated for the four primitives of a block.
struct LaneRay {
  V4 o[3], d[3];
  V4 slack;  // error bound of an edge test, per extent and distance
  HWY_INLINE LaneRay(const Vec3f& org, const Vec3f& dir) {
    const D4 tag;
    for (int axis = 0; axis < 3; ++axis) o[axis] = hn::Set(tag, org[axis]), d[axis] = hn::Set(tag, dir[axis]);
    slack = hn::Set(tag, kEdgeSlack * max_component(max(dir, -dir)));
  }
};
// Ray parameter and barycentric coordinates by lane.
struct HitLanes {
  HWY_ALIGN float t[4], u[4], v[4];
};

HWY_INLINE V4 dot4(const V4* a, const V4* b) {
  return hn::MulAdd(a[2], b[2], hn::MulAdd(a[0], b[0], hn::Mul(a[1], b[1])));
}
HWY_INLINE void cross4(const V4* a, const V4* b, V4* out) {
  out[0] = hn::MulSub(a[1], b[2], hn::Mul(a[2], b[1]));
  out[1] = hn::MulSub(a[2], b[0], hn::Mul(a[0], b[2]));
  out[2] = hn::MulSub(a[0], b[1], hn::Mul(a[1], b[0]));
}

// Möller and Trumbore 1997, on corner and edges. One bit per lane hit in (tnear, tfar); kStore: fills `hits`.
template <bool kStore>
HWY_INLINE uint32_t intersect_fast(const LeafBlock& b, size_t i, const LaneRay& r, const V4& tnear, const V4& tfar,
                                   HitLanes& hits) {
  const D4 d;
  V4 e1[3], e2[3], s[3], h[3], q[3];
  for (int axis = 0; axis < 3; ++axis) {
    e1[axis] = hn::Load(d, b.v[1][axis] + i), e2[axis] = hn::Load(d, b.v[2][axis] + i);
    s[axis] = hn::Sub(r.o[axis], hn::Load(d, b.v[0][axis] + i));
  }
  cross4(r.d, e2, h);
  const V4 det = dot4(e1, h), sign = hn::And(det, hn::SignBit(d)), abs_det = hn::Xor(det, sign), zero = hn::Zero(d);
  const V4 u = hn::Xor(dot4(s, h), sign);
  cross4(s, e1, q);
  const V4 v = hn::Xor(dot4(r.d, q), sign);
  auto hit = hn::And(hn::And(hn::Ge(u, zero), hn::Ge(v, zero)),
                     hn::And(hn::Le(hn::Add(u, v), abs_det), hn::Gt(abs_det, zero)));
  if (hn::AllFalse(d, hit)) return 0;
  const V4 t = hn::Xor(dot4(e2, q), sign);
  hit = hn::And(hit, hn::And(hn::Gt(t, hn::Mul(tnear, abs_det)), hn::Lt(t, hn::Mul(tfar, abs_det))));
  if constexpr (kStore) {
    hn::Store(hn::Div(t, abs_det), d, hits.t + i);
    hn::Store(hn::Div(u, abs_det), d, hits.u + i);
    hn::Store(hn::Div(v, abs_det), d, hits.v + i);
  }
  return bits_of(d, hit);
}

// Twice the vector part of an edge's Plücker coordinates: cross(p - q, p + q), for corners relative to the ray's
// origin.
HWY_INLINE void edge4(const V4* p, const V4* q, V4* out) {
  V4 e[3], s[3];
  for (int axis = 0; axis < 3; ++axis) e[axis] = hn::Sub(p[axis], q[axis]), s[axis] = hn::Add(p[axis], q[axis]);
  cross4(e, s, out);
}

HWY_INLINE V4 norm1(const V4* a) { return hn::Add(hn::Abs(a[0]), hn::Add(hn::Abs(a[1]), hn::Abs(a[2]))); }
// Extent times distance of each triangle; `a`: first corners relative to the ray's origin.
HWY_INLINE V4 edge_reach(const LeafBlock& block, size_t i, const V4* a) {
  const V4 extent = hn::Load(D4(), block.extent + i);
  return hn::Mul(extent, hn::Add(extent, hn::Max(hn::Abs(a[0]), hn::Max(hn::Abs(a[1]), hn::Abs(a[2])))));
}

// Edge tests in Plücker coordinates, on three corners. One bit per lane hit in (tnear, tfar); kStore: fills `hits`.
template <bool kStore>
HWY_INLINE uint32_t intersect_robust(const LeafBlock& block, size_t i, const LaneRay& r, const V4& tnear,
                                     const V4& tfar, HitLanes& hits) {
  const D4 d;
  V4 a[3], b[3], c[3], cross_u[3], cross_v[3], cross_w[3];
  for (int axis = 0; axis < 3; ++axis) {
    a[axis] = hn::Sub(hn::Load(d, block.v[0][axis] + i), r.o[axis]);
    b[axis] = hn::Sub(hn::Load(d, block.v[1][axis] + i), r.o[axis]);
    c[axis] = hn::Sub(hn::Load(d, block.v[2][axis] + i), r.o[axis]);
  }
  edge4(c, a, cross_u), edge4(a, b, cross_v), edge4(b, c, cross_w);
  const V4 u = dot4(cross_u, r.d), v = dot4(cross_v, r.d), w = dot4(cross_w, r.d);
  const V4 slack = hn::Mul(r.slack, edge_reach(block, i, a));
  auto hit = hn::Or(hn::Ge(hn::Min(u, hn::Min(v, w)), hn::Neg(slack)), hn::Le(hn::Max(u, hn::Max(v, w)), slack));
  if (hn::AllFalse(d, hit)) return 0;
  V4 e1[3], e2[3], ng[3];
  for (int axis = 0; axis < 3; ++axis) e1[axis] = hn::Sub(b[axis], a[axis]), e2[axis] = hn::Sub(c[axis], a[axis]);
  cross4(e1, e2, ng);
  const V4 den = dot4(ng, r.d), t = hn::Div(dot4(ng, a), den);
  const V4 edge_on = hn::Mul(hn::Mul(r.slack, hn::Set(d, kEdgeOn / kEdgeSlack)), norm1(ng));
  hit = hn::And(hit, hn::And(hn::And(hn::Gt(t, tnear), hn::Lt(t, tfar)), hn::Gt(hn::Abs(den), edge_on)));
  if constexpr (kStore) {
    const V4 sum = hn::Add(hn::Add(u, v), w);
    // 0 where the ray lies in the triangle's plane.
    const V4 rcp = hn::IfThenElse(hn::Ne(sum, hn::Zero(d)), hn::Div(hn::Set(d, 1.0f), sum), hn::Zero(d)),
             one = hn::Set(d, 1.0f);
    hn::Store(t, d, hits.t + i);
    hn::Store(hn::Max(hn::Min(hn::Mul(u, rcp), one), hn::Zero(d)), d, hits.u + i);
    hn::Store(hn::Max(hn::Min(hn::Mul(v, rcp), one), hn::Zero(d)), d, hits.v + i);
  }
  return bits_of(d, hit);
}

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_TRIANGLE_INL_H_
