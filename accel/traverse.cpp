// Traversal of eight-wide BVHs. The slabs' near and far planes are picked by the ray's octant; any-hit rays take
// children in the order baked by collapse(), closest-hit rays by distance. Fast: triangles by Möller and Trumbore 1997,
// slabs with fused multiplications. Robust: slabs widened by 3 ulp [Ize 2013], and Plücker edge tests relative to the
// ray's origin, which give two triangles the same answer on a shared edge [as in Embree]. Bundles: rays that share
// their origin share all of a triangle's products but three dot products a ray; children are culled for the whole
// bundle by interval arithmetic before single rays are tested.
#include "accel/traverse.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "accel/traverse.cpp"
#include <hwy/foreach_target.h>
// foreach_target comes first.
#include <hwy/highway.h>

#include "accel/validate.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D8 = hn::CappedTag<float, 8>;
using V8 = hn::Vec<D8>;
using D4 = hn::CappedTag<float, 4>;
using V4 = hn::Vec<D4>;
using D4u = hn::CappedTag<uint32_t, 4>;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kUlp = 1.1920929e-7f;

// How a scene is traversed.
template <bool robust, bool boxes, bool masks, bool filters, bool instances>
struct Config {
  static constexpr bool kRobust = robust, kBoxes = boxes, kMasks = masks, kFilters = filters, kInstances = instances;
};

template <class D>
HWY_INLINE uint32_t bits_of(D d, hn::Mask<D> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  uint32_t bits = bytes[0];
  if constexpr (hn::MaxLanes(D()) > 8) bits |= static_cast<uint32_t>(bytes[1]) << 8;
  return bits;
}

// 1/d, of a tiny component as of a small one: no infinities, no 0·inf.
HWY_INLINE float reciprocal(float d) { return 1.0f / (std::abs(d) < 1e-18f ? std::copysign(1e-18f, d) : d); }

// A ray against the boxes of a node.
template <bool kRobust>
struct Slabs {
  V8 o[3];  // fast: origin times reciprocal
  V8 near_r[3], far_r[3];
  int near_plane[3], far_plane[3];

  HWY_INLINE Slabs(const Vec3f& org, const Vec3f& dir) {
    const D8 d;
    for (int axis = 0; axis < 3; ++axis) {
      const float r = reciprocal(dir[axis]);
      o[axis] = hn::Set(d, kRobust ? org[axis] : org[axis] * r);
      near_r[axis] = hn::Set(d, kRobust ? r * (1.0f - 3.0f * kUlp) : r);
      far_r[axis] = hn::Set(d, kRobust ? r * (1.0f + 3.0f * kUlp) : r);
      near_plane[axis] = 2 * axis + (r < 0.0f ? 1 : 0);
      far_plane[axis] = 2 * axis + (r < 0.0f ? 0 : 1);
    }
  }

  HWY_INLINE V8 at(const float* plane, int axis, const V8& r) const {
    const D8 d;
    if constexpr (kRobust) return hn::Mul(hn::Sub(hn::Load(d, plane), o[axis]), r);
    return hn::MulSub(hn::Load(d, plane), r, o[axis]);
  }

  // One bit a child that the ray meets between tnear and tfar; `entry`: where.
  HWY_INLINE uint32_t test(const WideNode& node, const V8& tnear, const V8& tfar, float* entry) const {
    const D8 d;
    uint32_t mask = 0;
    for (size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto x1 = at(node.planes[near_plane[0]] + i, 0, near_r[0]),
                 x2 = at(node.planes[far_plane[0]] + i, 0, far_r[0]);
      const auto y1 = at(node.planes[near_plane[1]] + i, 1, near_r[1]),
                 y2 = at(node.planes[far_plane[1]] + i, 1, far_r[1]);
      const auto z1 = at(node.planes[near_plane[2]] + i, 2, near_r[2]),
                 z2 = at(node.planes[far_plane[2]] + i, 2, far_r[2]);
      const auto in = hn::Max(hn::Max(x1, y1), hn::Max(z1, tnear)), out = hn::Min(hn::Min(x2, y2), hn::Min(z2, tfar));
      if (entry != nullptr) hn::Store(in, d, entry + i);
      mask |= bits_of(d, hn::Le(in, out)) << i;
    }
    return mask;
  }
};

// An edge test is off by no more than this, times the direction, the triangle's extent and its distance: a dozen
// roundings. Where a ray meets a corner all tests around it are noise, and without slack all triangles may say no
// (Embree's may).
constexpr float kEdgeSlack = 4.0f * kUlp;
// Triangles seen so edge-on are left to their neighbours: all their tests are noise.
constexpr float kEdgeOn = 1e-6f;

// A ray against the four primitives of a block.
struct LaneRay {
  V4 o[3], d[3];
  V4 slack;  // robust: of an edge test, per extent and distance
  HWY_INLINE LaneRay(const Vec3f& org, const Vec3f& dir) {
    const D4 tag;
    for (int axis = 0; axis < 3; ++axis) o[axis] = hn::Set(tag, org[axis]), d[axis] = hn::Set(tag, dir[axis]);
    slack = hn::Set(tag, kEdgeSlack * max_component(max(dir, -dir)));
  }
};
struct Lanes4 {
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

// The lanes hit in (tnear, tfar). `kWhere`: also where.
template <bool kWhere>
HWY_INLINE uint32_t hit_triangles_fast(const LeafBlock& b, size_t i, const LaneRay& r, const V4& tnear, const V4& tfar,
                                       Lanes4& where) {
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
  if constexpr (kWhere) {
    hn::Store(hn::Div(t, abs_det), d, where.t + i);
    hn::Store(hn::Div(u, abs_det), d, where.u + i);
    hn::Store(hn::Div(v, abs_det), d, where.v + i);
  }
  return bits_of(d, hit);
}

// Twice the edge's Plücker product with the ray: cross(p - q, p + q), for corners relative to the origin.
HWY_INLINE void edge4(const V4* p, const V4* q, V4* out) {
  V4 e[3], s[3];
  for (int axis = 0; axis < 3; ++axis) e[axis] = hn::Sub(p[axis], q[axis]), s[axis] = hn::Add(p[axis], q[axis]);
  cross4(e, s, out);
}

HWY_INLINE V4 norm1(const V4* a) { return hn::Add(hn::Abs(a[0]), hn::Add(hn::Abs(a[1]), hn::Abs(a[2]))); }
// Extent times distance, of triangles whose first corner lies at `a` from the origin.
HWY_INLINE V4 edge_reach(const LeafBlock& block, size_t i, const V4* a) {
  const V4 extent = hn::Load(D4(), block.extent + i);
  return hn::Mul(extent, hn::Add(extent, hn::Max(hn::Abs(a[0]), hn::Max(hn::Abs(a[1]), hn::Abs(a[2])))));
}

template <bool kWhere>
HWY_INLINE uint32_t hit_triangles_robust(const LeafBlock& block, size_t i, const LaneRay& r, const V4& tnear,
                                         const V4& tfar, Lanes4& where) {
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
  if constexpr (kWhere) {
    const V4 sum = hn::Add(hn::Add(u, v), w);
    // The sum vanishes where the ray lies in the triangle's plane.
    const V4 rcp = hn::IfThenElse(hn::Ne(sum, hn::Zero(d)), hn::Div(hn::Set(d, 1.0f), sum), hn::Zero(d)),
             one = hn::Set(d, 1.0f);
    hn::Store(t, d, where.t + i);
    hn::Store(hn::Max(hn::Min(hn::Mul(u, rcp), one), hn::Zero(d)), d, where.u + i);
    hn::Store(hn::Max(hn::Min(hn::Mul(v, rcp), one), hn::Zero(d)), d, where.v + i);
  }
  return bits_of(d, hit);
}

// Boxes are solid: a ray that starts inside hits where it starts.
HWY_INLINE uint32_t hit_boxes(const LeafBlock& block, size_t i, const LaneRay& r, const V4& tnear, const V4& tfar,
                              Lanes4& where) {
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
  hn::Store(in, d, where.t + i);
  hn::Store(hn::Zero(d), d, where.u + i);
  hn::Store(hn::Zero(d), d, where.v + i);
  const uint32_t there = bits_of(D4u(), hn::Ne(hn::Load(D4u(), block.prim + i), hn::Set(D4u(), kNoId)));
  return bits_of(d, hn::And(hn::Le(in, out), hn::Lt(in, tfar))) & there;
}

template <class C, bool kWhere>
HWY_INLINE uint32_t hit_block(const TraceScene& scene, const LeafBlock& block, const LaneRay& r, const V4& tnear,
                              const V4& tfar, uint32_t mask, Lanes4& where) {
  uint32_t all = 0;
  for (size_t i = 0; i < 4; i += hn::Lanes(D4())) {  // once, but where there are no vectors of four
    uint32_t hit;
    if constexpr (C::kBoxes)
      hit = hit_boxes(block, i, r, tnear, tfar, where);
    else if constexpr (C::kRobust)
      hit = hit_triangles_robust<kWhere>(block, i, r, tnear, tfar, where);
    else
      hit = hit_triangles_fast<kWhere>(block, i, r, tnear, tfar, where);
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

HWY_INLINE void prefetch(const WideBvh& bvh, uint32_t child) {
  const char* at = (child & kLeafBit) != 0 ? reinterpret_cast<const char*>(bvh.leaves.data() + (child & ~kLeafBit))
                                           : reinterpret_cast<const char*>(bvh.nodes.data() + child);
  __builtin_prefetch(at);
  __builtin_prefetch(at + 64);
  __builtin_prefetch(at + 128);
}

// The same ray in the space of an instance.
HWY_INLINE Vec3f local_point(const TraceScene::Instance& instance, const Vec3f& p) { return instance.inverse.point(p); }
HWY_INLINE Vec3f local_vector(const TraceScene::Instance& instance, const Vec3f& v) {
  return instance.inverse.vector(v);
}

// ---- Any hit, one ray ----

template <class C>
HWY_NOINLINE bool any_hit(const TraceScene& scene, const WideBvh& bvh, uint32_t start, const Ray& r) {
  const D8 d8;
  const D4 d4;
  const Slabs<C::kRobust> slabs(r.org, r.dir);
  const LaneRay lanes(r.org, r.dir);
  const V8 tnear = hn::Set(d8, r.tnear), tfar = hn::Set(d8, r.tfar);
  const V4 tnear4 = hn::Set(d4, r.tnear), tfar4 = hn::Set(d4, r.tfar);
  uint32_t stack[kTraversalStack];
  int top = 0;
  uint32_t current = start;
  for (;;) {
    while ((current & kLeafBit) == 0) {
      const WideNode& node = bvh.nodes[current];
      uint32_t mask = slabs.test(node, tnear, tfar, nullptr);
      if (mask == 0) {
        if (top == 0) return false;
        current = stack[--top];
        continue;
      }
      while ((mask & (mask - 1)) != 0) {
        const int last = 31 - __builtin_clz(mask);
        mask ^= 1u << last;
        const uint32_t child = node.child[last];
        if constexpr (!C::kInstances) prefetch(bvh, child);
        stack[top++] = child;
      }
      current = node.child[__builtin_ctz(mask)];
      if constexpr (!C::kInstances) prefetch(bvh, current);
    }
    if constexpr (C::kInstances) {
      const TraceScene::Instance& instance = scene.instances[current & ~kLeafBit];
      Ray local = r;
      local.org = local_point(instance, r.org), local.dir = local_vector(instance, r.dir);
      using Inner = Config<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;
      if (any_hit<Inner>(scene, *instance.bvh, instance.bvh->root, local)) return true;
    } else {
      const LeafBlock& block = bvh.leaves[current & ~kLeafBit];
      Lanes4 where;
      uint32_t hit = hit_block<C, C::kFilters>(scene, block, lanes, tnear4, tfar4, r.mask, where);
      if constexpr (C::kFilters) {
        for (; hit != 0; hit &= hit - 1) {
          const int lane = __builtin_ctz(hit);
          if (!(scene.has_cutout[block.geom[lane]] != 0 &&
                scene.filter->passes(block.geom[lane], block.prim[lane], where.u[lane], where.v[lane])))
            return true;
        }
      } else if (hit != 0) {
        return true;
      }
    }
    if (top == 0) return false;
    current = stack[--top];
  }
}

// ---- Closest hit, one ray ----

template <class C>
HWY_NOINLINE void closest_hit(const TraceScene& scene, const WideBvh& bvh, uint32_t instance_id, const Vec3f& org,
                              const Vec3f& dir, RayHit& r) {
  const D8 d8;
  const D4 d4;
  const Slabs<C::kRobust> slabs(org, dir);
  const LaneRay lanes(org, dir);
  const float start = std::max(r.ray.tnear, 0.0f);
  const V8 tnear = hn::Set(d8, start);
  const V4 tnear4 = hn::Set(d4, start);
  V8 tfar = hn::Set(d8, r.ray.tfar);
  V4 tfar4 = hn::Set(d4, r.ray.tfar);
  struct Waiting {
    uint32_t child;
    float entry;
  };
  Waiting stack[kTraversalStack];
  int top = 0;
  uint32_t current = bvh.root;
  for (;;) {
    bool missed = false;
    while ((current & kLeafBit) == 0) {
      const WideNode& node = bvh.nodes[current];
      HWY_ALIGN float entry[8];
      uint32_t mask = slabs.test(node, tnear, tfar, entry);
      if (mask == 0) {
        missed = true;
        break;
      }
      int nearest = __builtin_ctz(mask);
      mask &= mask - 1;
      if (mask == 0) {
        current = node.child[nearest];
        if constexpr (!C::kInstances) prefetch(bvh, current);
        continue;
      }
      int second = __builtin_ctz(mask);
      mask &= mask - 1;
      if (mask == 0) {
        if (entry[second] < entry[nearest]) std::swap(nearest, second);
        stack[top++] = {node.child[second], entry[second]};
        current = node.child[nearest];
        if constexpr (!C::kInstances) prefetch(bvh, current);
        continue;
      }
      // The nearest next, the rest in any order: a full sort costs more than it saves.
      if (entry[second] < entry[nearest]) std::swap(nearest, second);
      stack[top++] = {node.child[second], entry[second]};
      for (; mask != 0; mask &= mask - 1) {
        int lane = __builtin_ctz(mask);
        if (entry[lane] < entry[nearest]) std::swap(lane, nearest);
        stack[top++] = {node.child[lane], entry[lane]};
      }
      current = node.child[nearest];
      if constexpr (!C::kInstances) prefetch(bvh, current);
    }
    if (!missed) {
      if constexpr (C::kInstances) {
        const uint32_t id = current & ~kLeafBit;
        const TraceScene::Instance& instance = scene.instances[id];
        const float before = r.ray.tfar;
        using Inner = Config<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;
        closest_hit<Inner>(scene, *instance.bvh, id, local_point(instance, org), local_vector(instance, dir), r);
        if (r.ray.tfar < before) tfar = hn::Set(d8, r.ray.tfar);
      } else {
        const LeafBlock& block = bvh.leaves[current & ~kLeafBit];
        Lanes4 where;
        uint32_t hit = hit_block<C, true>(scene, block, lanes, tnear4, tfar4, r.ray.mask, where);
        if (hit != 0) {
          const float *t = where.t, *u = where.u, *v = where.v;
          bool nearer = false;
          for (; hit != 0; hit &= hit - 1) {
            const int lane = __builtin_ctz(hit);
            // The first of all may lie at tfar itself, where a division rounded up.
            if (!(t[lane] < r.ray.tfar) && !(t[lane] == r.ray.tfar && !nearer && r.hit.geom == kNoId)) continue;
            if constexpr (C::kFilters)
              if (scene.has_cutout[block.geom[lane]] != 0 &&
                  scene.filter->passes(block.geom[lane], block.prim[lane], u[lane], v[lane]))
                continue;
            nearer = true;
            r.ray.tfar = t[lane];
            r.hit.u = u[lane], r.hit.v = v[lane];
            r.hit.prim = block.prim[lane], r.hit.geom = block.geom[lane], r.hit.inst = instance_id;
            if constexpr (C::kBoxes) {
              r.hit.ng = {};
              for (int axis = 0; axis < 3; ++axis) {  // the side that is entered last faces the ray
                const float side = dir[axis] < 0.0f ? block.v[1][axis][lane] : block.v[0][axis][lane];
                const float at = (side - org[axis]) * reciprocal(dir[axis]);
                if (at == t[lane] && r.hit.ng == Vec3f{}) r.hit.ng[axis] = dir[axis] < 0.0f ? 1.0f : -1.0f;
              }
            } else {
              Vec3f corner[3];
              for (int k = 0; k < 3; ++k)
                for (int axis = 0; axis < 3; ++axis) corner[k][axis] = block.v[k][axis][lane];
              r.hit.ng = C::kRobust ? cross(corner[1] - corner[0], corner[2] - corner[0]) : cross(corner[1], corner[2]);
            }
          }
          if (nearer) tfar = hn::Set(d8, r.ray.tfar), tfar4 = hn::Set(d4, r.ray.tfar);
        }
      }
    }
    do {
      if (top == 0) return;
      --top;
    } while (stack[top].entry > r.ray.tfar);
    current = stack[top].child;
  }
}

// ---- Bundles: up to 64 rays with a common origin (points to a light) or a common direction (points to the sun) ----

using DN = hn::CappedTag<float, 16>;
using VN = hn::Vec<DN>;
constexpr size_t kBundle = 64;

struct Bundle {
  Vec3f common;                   // the origin, or with kSun the direction
  HWY_ALIGN float o[3][kBundle];  // kSun alone: origins
  HWY_ALIGN float d[3][kBundle];  // otherwise: directions
  HWY_ALIGN float r[3][kBundle];  // and their reciprocals
  float tfar;
  uint64_t active;
};

// Below this many rays a subtree is left to single rays.
constexpr int kFewRays = 3;

template <class C, bool kSun>
class BundleTracer {
 public:
  HWY_INLINE BundleTracer(const TraceScene& scene, const Bundle& bundle) : scene_(scene), b_(bundle) {
    // Intervals over the active rays, for culling.
    for (int axis = 0; axis < 3; ++axis) {
      const float* values = kSun ? b_.o[axis] : b_.r[axis];
      const auto [lo, hi] = interval(values);
      lo_[axis] = lo, hi_[axis] = hi;
      common_r_[axis] = reciprocal(b_.common[axis]);
      const float sign_lo = kSun ? common_r_[axis] : lo, sign_hi = kSun ? common_r_[axis] : hi;
      mixed_[axis] = sign_lo < 0.0f && sign_hi > 0.0f;
      negative_[axis] = sign_hi < 0.0f;
    }
    any_mixed_ = mixed_[0] || mixed_[1] || mixed_[2];
    if constexpr (!kSun && C::kRobust)
      for (int axis = 0; axis < 3; ++axis) {
        const auto [lo, hi] = interval(b_.d[axis]);
        reach_ = std::max(reach_, std::max(-lo, hi));
      }
  }

  // Rays that hit something.
  uint64_t run(const WideBvh& bvh) {
    struct Waiting {
      uint64_t rays;
      uint32_t child;
    };
    Waiting stack[kTraversalStack];
    int top = 0;
    uint64_t open = b_.active;  // rays that have hit nothing yet
    stack[top++] = {open, bvh.root};
    while (top > 0) {
      const Waiting next = stack[--top];
      const uint64_t rays = next.rays & open;
      if (rays == 0) continue;
      if ((next.child & kLeafBit) != 0) {
        open &= ~leaf(bvh, next.child & ~kLeafBit, rays);
        if (open == 0) break;
        continue;
      }
      if (__builtin_popcountll(rays) <= kFewRays) {
        for (uint64_t m = rays; m != 0; m &= m - 1) {
          const int i = __builtin_ctzll(m);
          if (any_hit<C>(scene_, bvh, next.child, ray(i))) open &= ~(uint64_t{1} << i);
        }
        if (open == 0) break;
        continue;
      }
      const WideNode& node = bvh.nodes[next.child];
      for (uint32_t mask = cull(node); mask != 0;) {
        const int child = 31 - __builtin_clz(mask);
        mask ^= 1u << child;
        const uint64_t inside = any_mixed_ ? test<true>(node, child, rays) : test<false>(node, child, rays);
        if (inside == 0) continue;
        stack[top++] = {inside, node.child[child]};
        if constexpr (!C::kInstances) prefetch(bvh, node.child[child]);
      }
    }
    return b_.active & ~open;
  }

 private:
  struct Interval {
    float lo, hi;
  };
  // Of the active rays' values. Vectors without any are not read: they may hold anything.
  HWY_INLINE Interval interval(const float* values) const {
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    VN lo = hn::Set(d, kInf), hi = hn::Set(d, -kInf);
    for (size_t i = 0; i < kBundle; i += kLanes) {
      const uint64_t bits = b_.active >> i & ((uint64_t{1} << kLanes) - 1);
      if (bits == 0) continue;
      const uint8_t bytes[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
      const auto active = hn::LoadMaskBits(d, bytes);
      const VN v = hn::Load(d, values + i);
      lo = hn::Min(lo, hn::IfThenElse(active, v, lo)), hi = hn::Max(hi, hn::IfThenElse(active, v, hi));
    }
    return {hn::GetLane(hn::MinOfLanes(d, lo)), hn::GetLane(hn::MaxOfLanes(d, hi))};
  }

  HWY_INLINE Ray ray(int i) const {
    Ray r;
    if constexpr (kSun)
      r.org = {b_.o[0][i], b_.o[1][i], b_.o[2][i]}, r.dir = b_.common;
    else
      r.org = b_.common, r.dir = {b_.d[0][i], b_.d[1][i], b_.d[2][i]};
    r.tfar = b_.tfar;
    return r;
  }

  static constexpr float kNear = C::kRobust ? 1.0f - 3.0f * kUlp : 1.0f, kFar = C::kRobust ? 1.0f + 3.0f * kUlp : 1.0f;

  // Children that some ray may meet: the earliest entry of all rays against the latest exit, axis by axis. Eight
  // children at once.
  HWY_INLINE uint32_t cull(const WideNode& node) const {
    const D8 d;
    uint32_t mask = 0;
    for (size_t i = 0; i < 8; i += hn::Lanes(d)) {
      V8 in = hn::Zero(d), out = hn::Set(d, b_.tfar);
      for (int axis = 0; axis < 3; ++axis) {
        if (mixed_[axis]) continue;
        const V8 near = hn::Load(d, node.planes[2 * axis + (negative_[axis] ? 1 : 0)] + i);
        const V8 far = hn::Load(d, node.planes[2 * axis + (negative_[axis] ? 0 : 1)] + i);
        V8 n0, n1, f0, f1;
        if constexpr (kSun) {
          const V8 lo = hn::Set(d, lo_[axis]), hi = hn::Set(d, hi_[axis]);
          const V8 rn = hn::Set(d, common_r_[axis] * kNear), rf = hn::Set(d, common_r_[axis] * kFar);
          n0 = hn::Mul(hn::Sub(near, lo), rn), n1 = hn::Mul(hn::Sub(near, hi), rn);
          f0 = hn::Mul(hn::Sub(far, lo), rf), f1 = hn::Mul(hn::Sub(far, hi), rf);
        } else {
          const V8 o = hn::Set(d, b_.common[axis]), near_o = hn::Sub(near, o), far_o = hn::Sub(far, o);
          n0 = hn::Mul(near_o, hn::Set(d, lo_[axis] * kNear)), n1 = hn::Mul(near_o, hn::Set(d, hi_[axis] * kNear));
          f0 = hn::Mul(far_o, hn::Set(d, lo_[axis] * kFar)), f1 = hn::Mul(far_o, hn::Set(d, hi_[axis] * kFar));
        }
        in = hn::Max(in, hn::Min(n0, n1)), out = hn::Min(out, hn::Max(f0, f1));
      }
      mask |= bits_of(d, hn::Le(in, out)) << i;
    }
    // With mixed signs an empty slot may seem to be met.
    if (any_mixed_)
      for (uint32_t m = mask; m != 0; m &= m - 1)
        if (node.child[__builtin_ctz(m)] == kEmptyChild) mask &= ~(m & (~m + 1));
    return mask;
  }

  // The rays that meet one child.
  template <bool kMixed>
  HWY_INLINE uint64_t test(const WideNode& node, int child, uint64_t rays) const {
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    const uint64_t lanes_mask = (uint64_t{1} << kLanes) - 1;
    VN near[3], far[3];
    for (int axis = 0; axis < 3; ++axis) {
      const float lo = node.planes[2 * axis][child], hi = node.planes[2 * axis + 1][child];
      const float a = negative_[axis] ? hi : lo, b = negative_[axis] ? lo : hi;
      near[axis] = hn::Set(d, kSun ? a : a - b_.common[axis]);
      far[axis] = hn::Set(d, kSun ? b : b - b_.common[axis]);
    }
    uint64_t inside = 0;
    for (size_t i = 0; i < kBundle; i += kLanes) {
      if (((rays >> i) & lanes_mask) == 0) continue;
      VN in = hn::Zero(d), out = hn::Set(d, b_.tfar);
      for (int axis = 0; axis < 3; ++axis) {
        VN t0, t1;
        if constexpr (kSun) {
          const VN o = hn::Load(d, b_.o[axis] + i);
          t0 = hn::Mul(hn::Sub(near[axis], o), hn::Set(d, common_r_[axis]));
          t1 = hn::Mul(hn::Sub(far[axis], o), hn::Set(d, common_r_[axis]));
        } else {
          const VN r = hn::Load(d, b_.r[axis] + i);
          t0 = hn::Mul(near[axis], r), t1 = hn::Mul(far[axis], r);
        }
        if constexpr (kMixed) {
          in = hn::Max(in, hn::Min(t0, t1)), out = hn::Min(out, hn::Max(t0, t1));
        } else {
          in = hn::Max(in, t0), out = hn::Min(out, t1);
        }
      }
      // Scaling after the reduction is the same: entries and exits that count are not below 0.
      if constexpr (C::kRobust) in = hn::Mul(in, hn::Set(d, kNear)), out = hn::Mul(out, hn::Set(d, kFar));
      inside |= static_cast<uint64_t>(bits_of(d, hn::Le(in, out))) << i;
    }
    return inside & rays;
  }

  // The rays that a leaf stops.
  HWY_INLINE uint64_t leaf(const WideBvh& bvh, uint32_t index, uint64_t rays) const {
    if constexpr (C::kInstances) return instance(index, rays);
    const LeafBlock& block = bvh.leaves[index];
    // Filters ask ray by ray, and few rays fill no lanes.
    if (C::kFilters || C::kBoxes || kSun || __builtin_popcountll(rays) <= 2) {
      uint64_t stopped = 0;
      for (uint64_t m = rays; m != 0; m &= m - 1) {
        const int i = __builtin_ctzll(m);
        if (stops(block, ray(i))) stopped |= uint64_t{1} << i;
      }
      return stopped;
    }
    return C::kRobust ? shared_origin_robust(block, rays) : shared_origin_fast(block, rays);
  }

  HWY_INLINE bool stops(const LeafBlock& block, const Ray& r) const {
    const D4 d4;
    Lanes4 where;
    uint32_t hit = hit_block<C, C::kFilters>(scene_, block, LaneRay(r.org, r.dir), hn::Zero(d4), hn::Set(d4, r.tfar),
                                             r.mask, where);
    if constexpr (C::kFilters) {
      for (; hit != 0; hit &= hit - 1) {
        const int lane = __builtin_ctz(hit);
        if (!(scene_.has_cutout[block.geom[lane]] != 0 &&
              scene_.filter->passes(block.geom[lane], block.prim[lane], where.u[lane], where.v[lane])))
          return true;
      }
      return false;
    }
    return hit != 0;
  }

  struct Rows {  // of four triangles: vectors whose dot product with a direction is wanted
    HWY_ALIGN float x[3][4], y[3][4], z[3][4], n[3][4], t[4], reach[4], norm[4];
  };
  HWY_INLINE static void store(const V4* from, float (*to)[4], size_t i) {
    for (int axis = 0; axis < 3; ++axis) hn::Store(from[axis], D4(), to[axis] + i);
  }
  HWY_INLINE VN dot_dir(const float (*row)[4], int lane, const VN* dir) const {
    const DN d;
    return hn::MulAdd(hn::Set(d, row[2][lane]), dir[2],
                      hn::MulAdd(hn::Set(d, row[0][lane]), dir[0], hn::Mul(hn::Set(d, row[1][lane]), dir[1])));
  }

  // With one origin o: det = d·(e2×e1), u = d·(e2×s), v = d·(s×e1), t = e2·(s×e1), where s = o - v0. All but d is
  // shared.
  HWY_INLINE uint64_t shared_origin_fast(const LeafBlock& block, uint64_t rays) const {
    const D4 d4;
    Rows rows;
    for (size_t i = 0; i < 4; i += hn::Lanes(d4)) {
      V4 e1[3], e2[3], s[3], p[3], q[3], n[3];
      for (int axis = 0; axis < 3; ++axis) {
        e1[axis] = hn::Load(d4, block.v[1][axis] + i), e2[axis] = hn::Load(d4, block.v[2][axis] + i);
        s[axis] = hn::Sub(hn::Set(d4, b_.common[axis]), hn::Load(d4, block.v[0][axis] + i));
      }
      cross4(e2, s, p), cross4(s, e1, q), cross4(e2, e1, n);
      store(p, rows.x, i), store(q, rows.y, i), store(n, rows.n, i);
      hn::Store(dot4(e2, q), d4, rows.t + i);
    }
    return sweep(rays, block, [&](int lane, const VN* dir) HWY_ATTR {
      const DN d;
      const VN det = dot_dir(rows.n, lane, dir), sign = hn::And(det, hn::SignBit(d)), abs_det = hn::Xor(det, sign),
               zero = hn::Zero(d);
      const VN u = hn::Xor(dot_dir(rows.x, lane, dir), sign), v = hn::Xor(dot_dir(rows.y, lane, dir), sign);
      const VN t = hn::Xor(hn::Set(d, rows.t[lane]), sign);
      const auto inside = hn::And(hn::And(hn::Ge(u, zero), hn::Ge(v, zero)), hn::Le(hn::Add(u, v), abs_det));
      return hn::And(inside, hn::And(hn::Gt(t, zero), hn::Lt(t, hn::Mul(hn::Set(d, b_.tfar), abs_det))));
    });
  }

  HWY_INLINE uint64_t shared_origin_robust(const LeafBlock& block, uint64_t rays) const {
    const D4 d4;
    Rows rows;
    for (size_t i = 0; i < 4; i += hn::Lanes(d4)) {
      V4 a[3], b[3], c[3], row[3], e1[3], e2[3];
      for (int axis = 0; axis < 3; ++axis) {
        const V4 o = hn::Set(d4, b_.common[axis]);
        a[axis] = hn::Sub(hn::Load(d4, block.v[0][axis] + i), o);
        b[axis] = hn::Sub(hn::Load(d4, block.v[1][axis] + i), o);
        c[axis] = hn::Sub(hn::Load(d4, block.v[2][axis] + i), o);
        e1[axis] = hn::Sub(b[axis], a[axis]), e2[axis] = hn::Sub(c[axis], a[axis]);
      }
      edge4(c, a, row), store(row, rows.x, i);
      edge4(a, b, row), store(row, rows.y, i);
      edge4(b, c, row), store(row, rows.z, i);
      cross4(e1, e2, row), store(row, rows.n, i);
      hn::Store(dot4(row, a), d4, rows.t + i);
      hn::Store(hn::Mul(edge_reach(block, i, a), hn::Set(d4, kEdgeSlack * reach_)), d4, rows.reach + i);
      hn::Store(hn::Mul(norm1(row), hn::Set(d4, kEdgeOn * reach_)), d4, rows.norm + i);
    }
    return sweep(rays, block, [&](int lane, const VN* dir) HWY_ATTR {
      const DN d;
      const VN u = dot_dir(rows.x, lane, dir), v = dot_dir(rows.y, lane, dir), w = dot_dir(rows.z, lane, dir);
      const VN slack = hn::Set(d, rows.reach[lane]);
      const auto inside =
          hn::Or(hn::Ge(hn::Min(u, hn::Min(v, w)), hn::Neg(slack)), hn::Le(hn::Max(u, hn::Max(v, w)), slack));
      const VN den = dot_dir(rows.n, lane, dir), sign = hn::And(den, hn::SignBit(d)), abs_den = hn::Xor(den, sign);
      const VN t = hn::Xor(hn::Set(d, rows.t[lane]), sign);
      const auto between = hn::And(hn::Gt(t, hn::Zero(d)), hn::Lt(t, hn::Mul(hn::Set(d, b_.tfar), abs_den)));
      return hn::And(inside, hn::And(between, hn::Gt(abs_den, hn::Set(d, rows.norm[lane]))));
    });
  }

  // test(lane, directions) for each triangle and each vector of rays that still goes on.
  template <class Test>
  HWY_INLINE uint64_t sweep(uint64_t rays, const LeafBlock& block, const Test& test_lane) const {
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    const uint64_t lanes_mask = (uint64_t{1} << kLanes) - 1;
    uint64_t stopped = 0;
    for (size_t i = 0; i < kBundle; i += kLanes) {
      uint64_t wanted = (rays >> i) & lanes_mask;
      if (wanted == 0) continue;
      const VN dir[3] = {hn::Load(d, b_.d[0] + i), hn::Load(d, b_.d[1] + i), hn::Load(d, b_.d[2] + i)};
      for (int lane = 0; lane < 4 && block.prim[lane] != kNoId; ++lane) {
        const uint64_t hit = static_cast<uint64_t>(bits_of(d, test_lane(lane, dir))) & wanted;
        stopped |= hit << i;
        wanted &= ~hit;
        if (wanted == 0) break;
      }
    }
    return stopped;
  }

  // The bundle in the space of an instance: what is common stays common.
  HWY_NOINLINE uint64_t instance(uint32_t index, uint64_t rays) const {
    const TraceScene::Instance& in = scene_.instances[index];
    Bundle local;
    local.common = kSun ? local_vector(in, b_.common) : local_point(in, b_.common);
    local.tfar = b_.tfar;
    local.active = rays;
    for (size_t i = 0; i < kBundle; ++i) {
      if constexpr (kSun) {
        const Vec3f o = local_point(in, {b_.o[0][i], b_.o[1][i], b_.o[2][i]});
        for (int axis = 0; axis < 3; ++axis) local.o[axis][i] = o[axis];
      } else {
        const Vec3f dir = local_vector(in, {b_.d[0][i], b_.d[1][i], b_.d[2][i]});
        for (int axis = 0; axis < 3; ++axis) local.d[axis][i] = dir[axis], local.r[axis][i] = reciprocal(dir[axis]);
      }
    }
    using Inner = Config<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;
    return BundleTracer<Inner, kSun>(scene_, local).run(*in.bvh);
  }

  const TraceScene& scene_;
  const Bundle& b_;
  float lo_[3], hi_[3], common_r_[3];
  float reach_ = 0.0f;  // the greatest component of a direction
  bool mixed_[3], negative_[3], any_mixed_;
};

template <class C, bool kSun>
HWY_NOINLINE void points_of(const TraceScene& scene, const Vec3f& light, const float* px, const float* py,
                            const float* pz, size_t n, uint8_t* occluded) {
  Bundle b;
  b.common = light;
  b.tfar = kSun ? kInf : 0x1.fffffep-1f;  // an open segment
  for (size_t begin = 0; begin < n; begin += kBundle) {
    const size_t count = std::min(kBundle, n - begin);
    b.active = 0;
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    const VN zero = hn::Zero(d), tiny = hn::Set(d, 1e-18f);
    const VN limit = hn::Set(d, kSun ? scene.limits.origin : scene.limits.direction);
    for (size_t i = 0; i < count; i += kLanes) {
      const size_t here = std::min(kLanes, count - i);
      const auto there = hn::FirstN(d, here);
      VN p[3];
      if (here == kLanes)
        p[0] = hn::LoadU(d, px + begin + i), p[1] = hn::LoadU(d, py + begin + i), p[2] = hn::LoadU(d, pz + begin + i);
      else
        p[0] = hn::MaskedLoad(there, d, px + begin + i), p[1] = hn::MaskedLoad(there, d, py + begin + i),
        p[2] = hn::MaskedLoad(there, d, pz + begin + i);
      if constexpr (!kSun) {
        for (int axis = 0; axis < 3; ++axis) {
          p[axis] = hn::Sub(p[axis], hn::Set(d, light[axis]));
          const VN safe =
              hn::IfThenElse(hn::Lt(hn::Abs(p[axis]), tiny), hn::Or(tiny, hn::And(p[axis], hn::SignBit(d))), p[axis]);
          hn::Store(p[axis], d, b.d[axis] + i);
          hn::Store(hn::Div(hn::Set(d, 1.0f), safe), d, b.r[axis] + i);
        }
      } else {
        for (int axis = 0; axis < 3; ++axis) hn::Store(p[axis], d, b.o[axis] + i);
      }
      // NaN passes no comparison; a segment without length meets nothing.
      auto sound = there;
      for (const VN& component : p) sound = hn::And(sound, hn::Le(hn::Abs(component), limit));
      if constexpr (!kSun) {
        const VN length = hn::Max(hn::Abs(p[0]), hn::Max(hn::Abs(p[1]), hn::Abs(p[2])));
        sound = hn::And(sound, hn::Gt(length, zero));
      }
      b.active |= static_cast<uint64_t>(bits_of(d, sound)) << i;
    }
    const uint64_t stopped = b.active == 0 ? 0 : BundleTracer<C, kSun>(scene, b).run(*scene.top);
    for (size_t i = 0; i < count; ++i) occluded[begin + i] = static_cast<uint8_t>((stopped >> i) & 1);
  }
}

// ---- Batches ----

template <class C>
void closest_of(const TraceScene& scene, RayHit* rays, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    RayHit& r = rays[i];
    r.hit = {};
    if (is_traceable(r.ray, scene.limits) && r.ray.mask != 0)
      closest_hit<C>(scene, *scene.top, kNoId, r.ray.org, r.ray.dir, r);
  }
}
template <class C>
void any_of(const TraceScene& scene, Ray* rays, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    Ray r = rays[i];
    if (!is_traceable(r, scene.limits) || r.mask == 0) continue;
    r.tnear = std::max(r.tnear, 0.0f);
    if (any_hit<C>(scene, *scene.top, scene.top->root, r)) rays[i].tfar = -kInf;
  }
}

// fn with the Config of the scene.
template <class Fn>
void with_config(const TraceScene& s, Fn&& fn) {
  const auto instances = [&](auto robust, auto boxes, auto masks, auto filters) {
    if (s.instanced)
      fn(Config<robust, boxes, masks, filters, true>());
    else
      fn(Config<robust, boxes, masks, filters, false>());
  };
  using Yes = std::true_type;
  using No = std::false_type;
  if (s.boxes) return fn(Config<true, true, false, false, false>());
  if (s.robust) {
    if (s.filter != nullptr) return instances(Yes(), No(), Yes(), Yes());
    if (s.masks) return instances(Yes(), No(), Yes(), No());
    return instances(Yes(), No(), No(), No());
  }
  if (s.filter != nullptr) return instances(No(), No(), Yes(), Yes());
  if (s.masks) return instances(No(), No(), Yes(), No());
  return instances(No(), No(), No(), No());
}

void closest(const TraceScene& scene, RayHit* rays, size_t n) {
  with_config(scene, [&](auto config) { closest_of<decltype(config)>(scene, rays, n); });
}
void any(const TraceScene& scene, Ray* rays, size_t n) {
  with_config(scene, [&](auto config) { any_of<decltype(config)>(scene, rays, n); });
}
void points(const TraceScene& scene, const Vec3f& light, bool directional, const float* px, const float* py,
            const float* pz, size_t n, uint8_t* occluded) {
  with_config(scene, [&](auto config) {
    if (directional)
      points_of<decltype(config), true>(scene, light, px, py, pz, n, occluded);
    else
      points_of<decltype(config), false>(scene, light, px, py, pz, n, occluded);
  });
}
const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {

HWY_EXPORT(closest);
HWY_EXPORT(any);
HWY_EXPORT(points);
HWY_EXPORT(target);

void trace_closest(const TraceScene& scene, std::span<RayHit> rays) {
  if (scene.top->root == kEmptyChild) {
    for (RayHit& r : rays) r.hit = {};
    return;
  }
  HWY_DYNAMIC_DISPATCH(closest)(scene, rays.data(), rays.size());
}

void trace_any(const TraceScene& scene, std::span<Ray> rays) {
  if (scene.top->root != kEmptyChild) HWY_DYNAMIC_DISPATCH(any)(scene, rays.data(), rays.size());
}

void trace_points(const TraceScene& scene, const Vec3f& light, bool directional, const float* px, const float* py,
                  const float* pz, size_t n, uint8_t* occluded) {
  const bool sound = within(light, directional ? scene.limits.direction : scene.limits.origin);
  if (scene.top->root == kEmptyChild || !sound || (directional && light == Vec3f{})) {
    std::fill_n(occluded, n, uint8_t{0});
    return;
  }
  HWY_DYNAMIC_DISPATCH(points)(scene, light, directional, px, py, pz, n, occluded);
}

const char* traversal_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace lumicut
#endif  // HWY_ONCE
