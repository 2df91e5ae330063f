// Intersection of a bundle of rays of one origin with the triangles of a block.
// Both tests of triangle-inl.h, rearranged: relative to the shared origin all cross products are the same for every
// ray, and three or four dot products per ray and triangle remain. Vectors hold rays here, not triangles.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_BUNDLE_TRIANGLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_BUNDLE_TRIANGLE_INL_H_
#undef LUMICUT_ACCEL_BVH_BUNDLE_TRIANGLE_INL_H_
#else
#define LUMICUT_ACCEL_BVH_BUNDLE_TRIANGLE_INL_H_
#endif

#include "accel/bvh/bundle-inl.h"
#include "accel/bvh/triangle-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// Per triangle of a block, what all rays share: vectors of which each test takes the dot product with a direction.
struct SharedRows {
  HWY_ALIGN float u[3][4], v[3][4], w[3][4], n[3][4], t[4], slack[4], edge_on[4];
};
HWY_INLINE void store(const V4* from, float (*to)[4], size_t i) {
  for (int axis = 0; axis < 3; ++axis) hn::Store(from[axis], D4(), to[axis] + i);
}
HWY_INLINE VN dot_dir(const float (*row)[4], int lane, const VN* dir) {
  const DN d;
  return hn::MulAdd(hn::Set(d, row[2][lane]), dir[2],
                    hn::MulAdd(hn::Set(d, row[0][lane]), dir[0], hn::Mul(hn::Set(d, row[1][lane]), dir[1])));
}

// Rays that test_lane(lane, directions) reports, for each triangle and each vector of rays not yet stopped. `unseen`: a
// bit per triangle to leave out, of scenes with masks.
template <bool masks, class Test>
HWY_INLINE uint64_t stopped_rays(const LeafBlock& block, const Bundle& bundle, uint64_t rays, uint32_t unseen,
                                 const Test& test_lane) {
  const DN d;
  constexpr size_t kLanes = hn::MaxLanes(DN());
  const uint64_t lanes_mask = (uint64_t{1} << kLanes) - 1;
  uint64_t stopped = 0;
  for (size_t i = 0; i < kBundle; i += kLanes) {
    uint64_t wanted = (rays >> i) & lanes_mask;
    if (wanted == 0) continue;
    const VN dir[3] = {hn::Load(d, bundle.dir[0] + i), hn::Load(d, bundle.dir[1] + i), hn::Load(d, bundle.dir[2] + i)};
    for (int lane = 0; lane < 4 && block.prim[lane] != kNoId; ++lane) {
      if (masks && (unseen >> lane & 1) != 0) continue;
      const uint64_t hit = static_cast<uint64_t>(bits_of(d, test_lane(lane, dir))) & wanted;
      stopped |= hit << i;
      wanted &= ~hit;
      if (wanted == 0) break;
    }
  }
  return stopped;
}

// Möller and Trumbore with s = o - v0: det = d·(e2×e1), u = d·(e2×s), v = d·(s×e1), t = e2·(s×e1). Only d differs
// between rays.
template <bool masks>
HWY_INLINE uint64_t bundle_triangles_fast(const LeafBlock& block, const Bundle& bundle, uint64_t rays,
                                          uint32_t unseen) {
  const D4 d4;
  SharedRows rows;
  for (size_t i = 0; i < 4; i += hn::Lanes(d4)) {
    V4 e1[3], e2[3], s[3], p[3], q[3], n[3];
    for (int axis = 0; axis < 3; ++axis) {
      e1[axis] = hn::Load(d4, block.v[1][axis] + i), e2[axis] = hn::Load(d4, block.v[2][axis] + i);
      s[axis] = hn::Sub(hn::Set(d4, bundle.common[axis]), hn::Load(d4, block.v[0][axis] + i));
    }
    cross4(e2, s, p), cross4(s, e1, q), cross4(e2, e1, n);
    store(p, rows.u, i), store(q, rows.v, i), store(n, rows.n, i);
    hn::Store(dot4(e2, q), d4, rows.t + i);
  }
  return stopped_rays<masks>(block, bundle, rays, unseen, [&](int lane, const VN* dir) HWY_ATTR {
    const DN d;
    const VN det = dot_dir(rows.n, lane, dir), sign = hn::And(det, hn::SignBit(d)), abs_det = hn::Xor(det, sign),
             zero = hn::Zero(d);
    const VN u = hn::Xor(dot_dir(rows.u, lane, dir), sign), v = hn::Xor(dot_dir(rows.v, lane, dir), sign);
    const VN t = hn::Xor(hn::Set(d, rows.t[lane]), sign);
    const auto inside = hn::And(hn::And(hn::Ge(u, zero), hn::Ge(v, zero)), hn::Le(hn::Add(u, v), abs_det));
    return hn::And(inside, hn::And(hn::Gt(t, zero), hn::Lt(t, hn::Mul(hn::Set(d, bundle.tfar), abs_det))));
  });
}

// Plücker edge tests. `max_dir`: the greatest absolute component of an active direction; scales the error bounds.
template <bool masks>
HWY_INLINE uint64_t bundle_triangles_robust(const LeafBlock& block, const Bundle& bundle, float max_dir, uint64_t rays,
                                            uint32_t unseen) {
  const D4 d4;
  SharedRows rows;
  for (size_t i = 0; i < 4; i += hn::Lanes(d4)) {
    V4 a[3], b[3], c[3], row[3], e1[3], e2[3];
    for (int axis = 0; axis < 3; ++axis) {
      const V4 o = hn::Set(d4, bundle.common[axis]);
      a[axis] = hn::Sub(hn::Load(d4, block.v[0][axis] + i), o);
      b[axis] = hn::Sub(hn::Load(d4, block.v[1][axis] + i), o);
      c[axis] = hn::Sub(hn::Load(d4, block.v[2][axis] + i), o);
      e1[axis] = hn::Sub(b[axis], a[axis]), e2[axis] = hn::Sub(c[axis], a[axis]);
    }
    edge4(c, a, row), store(row, rows.u, i);
    edge4(a, b, row), store(row, rows.v, i);
    edge4(b, c, row), store(row, rows.w, i);
    cross4(e1, e2, row), store(row, rows.n, i);
    hn::Store(dot4(row, a), d4, rows.t + i);
    hn::Store(hn::Mul(edge_reach(block, i, a), hn::Set(d4, kEdgeSlack * max_dir)), d4, rows.slack + i);
    hn::Store(hn::Mul(norm1(row), hn::Set(d4, kEdgeOn * max_dir)), d4, rows.edge_on + i);
  }
  return stopped_rays<masks>(block, bundle, rays, unseen, [&](int lane, const VN* dir) HWY_ATTR {
    const DN d;
    const VN u = dot_dir(rows.u, lane, dir), v = dot_dir(rows.v, lane, dir), w = dot_dir(rows.w, lane, dir);
    const VN slack = hn::Set(d, rows.slack[lane]);
    const auto inside =
        hn::Or(hn::Ge(hn::Min(u, hn::Min(v, w)), hn::Neg(slack)), hn::Le(hn::Max(u, hn::Max(v, w)), slack));
    const VN den = dot_dir(rows.n, lane, dir), sign = hn::And(den, hn::SignBit(d)), abs_den = hn::Xor(den, sign);
    const VN t = hn::Xor(hn::Set(d, rows.t[lane]), sign);
    const auto between = hn::And(hn::Gt(t, hn::Zero(d)), hn::Lt(t, hn::Mul(hn::Set(d, bundle.tfar), abs_den)));
    return hn::And(inside, hn::And(between, hn::Gt(abs_den, hn::Set(d, rows.edge_on[lane]))));
  });
}

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_BUNDLE_TRIANGLE_INL_H_
