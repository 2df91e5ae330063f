// Traversal of bundles: the points that one light is tested against, 64 at a time.
// A child is first tested for the whole bundle by interval arithmetic [Boulos et al. 2006, Geometric and Arithmetic
// Culling Methods for Entire Ray Packets], then for each ray. Departs: all eight children are culled at once, and few
// remaining rays are traversed singly, so that unrelated points cost no more than single rays.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_BUNDLE_TRAVERSAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_BUNDLE_TRAVERSAL_INL_H_
#undef LUMICUT_ACCEL_BVH_BUNDLE_TRAVERSAL_INL_H_
#else
#define LUMICUT_ACCEL_BVH_BUNDLE_TRAVERSAL_INL_H_
#endif

#include <algorithm>

#include "accel/bvh/bundle_triangle-inl.h"
#include "accel/bvh/single_ray-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// At this many rays or fewer a subtree is traversed by single rays.
constexpr int kFewRays = 3;

template <class C, bool kDirectional>
class BundleTracer {
 public:
  HWY_INLINE BundleTracer(const TraceScene& scene, uint32_t instance_id, const Bundle& bundle)
      : scene_(scene), instance_id_(instance_id), bundle_(bundle) {
    for (int axis = 0; axis < 3; ++axis) {
      const float* values = kDirectional ? bundle_.origin[axis] : bundle_.rcp_dir[axis];
      const auto [lo, hi] = interval(values);
      lo_[axis] = lo, hi_[axis] = hi;
      common_rcp_[axis] = reciprocal(bundle_.common[axis]);
      const float sign_lo = kDirectional ? common_rcp_[axis] : lo, sign_hi = kDirectional ? common_rcp_[axis] : hi;
      mixed_[axis] = sign_lo < 0.0f && sign_hi > 0.0f;
      negative_[axis] = sign_hi < 0.0f;
    }
    any_mixed_ = mixed_[0] || mixed_[1] || mixed_[2];
    if constexpr (!kDirectional && C::kRobust)
      for (int axis = 0; axis < 3; ++axis) {
        const auto [lo, hi] = interval(bundle_.dir[axis]);
        max_dir_ = std::max(max_dir_, std::max(-lo, hi));
      }
  }

  // The active rays that hit something.
  uint64_t run(const WideBvh& bvh) {
    struct StackEntry {
      uint64_t rays;
      uint32_t child;
    };
    StackEntry stack[kTraversalStack];
    int top = 0;
    uint64_t open = bundle_.active;  // rays without a hit so far
    stack[top++] = {open, bvh.root};
    while (top > 0) {
      const StackEntry next = stack[--top];
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
          if (any_hit<C>(scene_, bvh, instance_id_, next.child, ray(i))) open &= ~(uint64_t{1} << i);
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
    return bundle_.active & ~open;
  }

 private:
  struct Interval {
    float lo, hi;
  };
  // Over the active rays. Vectors without an active ray are not read: they may be uninitialised.
  HWY_INLINE Interval interval(const float* values) const {
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    VN lo = hn::Set(d, kInf), hi = hn::Set(d, -kInf);
    for (size_t i = 0; i < kBundle; i += kLanes) {
      const uint64_t bits = bundle_.active >> i & ((uint64_t{1} << kLanes) - 1);
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
    if constexpr (kDirectional)
      r.org = {bundle_.origin[0][i], bundle_.origin[1][i], bundle_.origin[2][i]}, r.dir = bundle_.common;
    else
      r.org = bundle_.common, r.dir = {bundle_.dir[0][i], bundle_.dir[1][i], bundle_.dir[2][i]};
    r.tfar = bundle_.tfar, r.mask = bundle_.mask, r.flags = bundle_.flags;
    return r;
  }

  static constexpr float kNear = C::kRobust ? 1.0f - 3.0f * kUlp : 1.0f, kFar = C::kRobust ? 1.0f + 3.0f * kUlp : 1.0f;

  // Children that some active ray may meet: earliest entry and latest exit of all rays, by interval arithmetic per
  // axis.
  HWY_INLINE uint32_t cull(const WideNode& node) const {
    const D8 d;
    uint32_t mask = 0;
    for (size_t i = 0; i < 8; i += hn::Lanes(d)) {
      V8 in = hn::Zero(d), out = hn::Set(d, bundle_.tfar);
      for (int axis = 0; axis < 3; ++axis) {
        if (mixed_[axis]) continue;
        const V8 near = hn::Load(d, node.planes[2 * axis + (negative_[axis] ? 1 : 0)] + i);
        const V8 far = hn::Load(d, node.planes[2 * axis + (negative_[axis] ? 0 : 1)] + i);
        V8 n0, n1, f0, f1;
        if constexpr (kDirectional) {
          const V8 lo = hn::Set(d, lo_[axis]), hi = hn::Set(d, hi_[axis]);
          const V8 rn = hn::Set(d, common_rcp_[axis] * kNear), rf = hn::Set(d, common_rcp_[axis] * kFar);
          n0 = hn::Mul(hn::Sub(near, lo), rn), n1 = hn::Mul(hn::Sub(near, hi), rn);
          f0 = hn::Mul(hn::Sub(far, lo), rf), f1 = hn::Mul(hn::Sub(far, hi), rf);
        } else {
          const V8 o = hn::Set(d, bundle_.common[axis]), near_o = hn::Sub(near, o), far_o = hn::Sub(far, o);
          n0 = hn::Mul(near_o, hn::Set(d, lo_[axis] * kNear)), n1 = hn::Mul(near_o, hn::Set(d, hi_[axis] * kNear));
          f0 = hn::Mul(far_o, hn::Set(d, lo_[axis] * kFar)), f1 = hn::Mul(far_o, hn::Set(d, hi_[axis] * kFar));
        }
        in = hn::Max(in, hn::Min(n0, n1)), out = hn::Min(out, hn::Max(f0, f1));
      }
      mask |= bits_of(d, hn::Le(in, out)) << i;
    }
    // Empty slots are inverted boxes, which pass when all axes that would reject them are mixed.
    if (any_mixed_)
      for (uint32_t m = mask; m != 0; m &= m - 1)
        if (node.child[__builtin_ctz(m)] == kEmptyChild) mask &= ~(m & (~m + 1));
    return mask;
  }

  // The rays of `rays` that meet the box of one child.
  template <bool kMixed>
  HWY_INLINE uint64_t test(const WideNode& node, int child, uint64_t rays) const {
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    const uint64_t lanes_mask = (uint64_t{1} << kLanes) - 1;
    VN near[3], far[3];
    for (int axis = 0; axis < 3; ++axis) {
      const float lo = node.planes[2 * axis][child], hi = node.planes[2 * axis + 1][child];
      const float a = negative_[axis] ? hi : lo, b = negative_[axis] ? lo : hi;
      near[axis] = hn::Set(d, kDirectional ? a : a - bundle_.common[axis]);
      far[axis] = hn::Set(d, kDirectional ? b : b - bundle_.common[axis]);
    }
    uint64_t inside = 0;
    for (size_t i = 0; i < kBundle; i += kLanes) {
      if (((rays >> i) & lanes_mask) == 0) continue;
      VN in = hn::Zero(d), out = hn::Set(d, bundle_.tfar);
      for (int axis = 0; axis < 3; ++axis) {
        VN t0, t1;
        if constexpr (kDirectional) {
          const VN o = hn::Load(d, bundle_.origin[axis] + i);
          t0 = hn::Mul(hn::Sub(near[axis], o), hn::Set(d, common_rcp_[axis]));
          t1 = hn::Mul(hn::Sub(far[axis], o), hn::Set(d, common_rcp_[axis]));
        } else {
          const VN r = hn::Load(d, bundle_.rcp_dir[axis] + i);
          t0 = hn::Mul(near[axis], r), t1 = hn::Mul(far[axis], r);
        }
        if constexpr (kMixed) {
          in = hn::Max(in, hn::Min(t0, t1)), out = hn::Min(out, hn::Max(t0, t1));
        } else {
          in = hn::Max(in, t0), out = hn::Min(out, t1);
        }
      }
      // Widening after the minimum and maximum gives the same: entries and exits of interest are not negative.
      if constexpr (C::kRobust) in = hn::Mul(in, hn::Set(d, kNear)), out = hn::Mul(out, hn::Set(d, kFar));
      inside |= static_cast<uint64_t>(bits_of(d, hn::Le(in, out))) << i;
    }
    return inside & rays;
  }

  // The rays that the primitives of a leaf stop.
  HWY_INLINE uint64_t leaf(const WideBvh& bvh, uint32_t index, uint64_t rays) const {
    if constexpr (C::kInstances) return instance(index, rays);
    const LeafBlock& block = bvh.leaves[index];
    // Filters need single hits, and one or two rays leave most lanes idle.
    if (C::kFilters || C::kBoxes || kDirectional || __builtin_popcountll(rays) <= 2) {
      uint64_t stopped = 0;
      for (uint64_t m = rays; m != 0; m &= m - 1) {
        const int i = __builtin_ctzll(m);
        if (stops(block, ray(i))) stopped |= uint64_t{1} << i;
      }
      return stopped;
    }
    uint32_t unseen = 0;  // lanes
    if constexpr (C::kMasks)
      for (int lane = 0; lane < 4 && block.prim[lane] != kNoId; ++lane)
        if ((scene_.mesh_masks[block.geom[lane]] & bundle_.mask) == 0) unseen |= 1u << lane;
    return C::kRobust ? bundle_triangles_robust<C::kMasks>(block, bundle_, max_dir_, rays, unseen)
                      : bundle_triangles_fast<C::kMasks>(block, bundle_, rays, unseen);
  }
  // One ray against a block.
  HWY_INLINE bool stops(const LeafBlock& block, const Ray& r) const {
    const D4 d4;
    HitLanes hits;
    const uint32_t hit = intersect_block<C, C::kFilters>(scene_, block, LaneRay(r.org, r.dir), hn::Zero(d4),
                                                         hn::Set(d4, r.tfar), r.mask, hits);
    return any_lane_stops<C>(scene_, block, instance_id_, r, hit, hits);
  }

  // Traces the bundle in the space of an instance, where it has a common origin or direction again.
  HWY_NOINLINE uint64_t instance(uint32_t index, uint64_t rays) const {
    const TraceScene::Instance& in = scene_.instances[index];
    Bundle local;
    local.common = kDirectional ? local_vector(in, bundle_.common) : local_point(in, bundle_.common);
    local.tfar = bundle_.tfar, local.mask = bundle_.mask, local.flags = bundle_.flags;
    local.active = rays;
    for (size_t i = 0; i < kBundle; ++i) {
      if constexpr (kDirectional) {
        const Vec3f o = local_point(in, {bundle_.origin[0][i], bundle_.origin[1][i], bundle_.origin[2][i]});
        for (int axis = 0; axis < 3; ++axis) local.origin[axis][i] = o[axis];
      } else {
        const Vec3f dir = local_vector(in, {bundle_.dir[0][i], bundle_.dir[1][i], bundle_.dir[2][i]});
        for (int axis = 0; axis < 3; ++axis)
          local.dir[axis][i] = dir[axis], local.rcp_dir[axis][i] = reciprocal(dir[axis]);
      }
    }
    using Inner = SceneConfig<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;
    return BundleTracer<Inner, kDirectional>(scene_, index, local).run(*in.bvh);
  }

  const TraceScene& scene_;
  const uint32_t instance_id_;
  const Bundle& bundle_;
  float lo_[3], hi_[3];                      // over the active rays: 1/dir; kDirectional: origin
  float common_rcp_[3];                      // kDirectional: 1/direction
  float max_dir_ = 0.0f;                     // robust: the greatest absolute component of an active direction
  bool mixed_[3], negative_[3], any_mixed_;  // signs of the active directions, by axis
};

// See trace_points.
template <class C, bool kDirectional>
HWY_NOINLINE void trace_points_in_bundles(const TraceScene& scene, const BundleOrigin& origin, const float* px,
                                          const float* py, const float* pz, size_t n, uint8_t* occluded) {
  Bundle bundle;
  const Vec3f light = origin.light;
  bundle.common = light, bundle.mask = origin.mask, bundle.flags = origin.ray_flags();
  bundle.tfar = kDirectional ? kInf : 0x1.fffffep-1f;  // exclusive of the point itself
  for (size_t begin = 0; begin < n; begin += kBundle) {
    const size_t count = std::min(kBundle, n - begin);
    bundle.active = 0;
    const DN d;
    constexpr size_t kLanes = hn::MaxLanes(DN());
    const VN zero = hn::Zero(d), tiny = hn::Set(d, 1e-18f);
    const VN limit = hn::Set(d, kDirectional ? scene.limits.origin : scene.limits.direction);
    for (size_t i = 0; i < count; i += kLanes) {
      const size_t here = std::min(kLanes, count - i);
      const auto in_range = hn::FirstN(d, here);
      VN p[3];
      const float* points[3] = {px + begin + i, py + begin + i, pz + begin + i};
      for (int axis = 0; axis < 3; ++axis) {
        if (here == kLanes) {
          p[axis] = hn::LoadU(d, points[axis]);
          continue;
        }
#if HWY_TARGET <= HWY_AVX2
        p[axis] = hn::MaskedLoad(in_range, d, points[axis]);
#else  // there it loads a whole aligned vector
        HWY_ALIGN float part[kLanes] = {};
        std::copy_n(points[axis], here, part);
        p[axis] = hn::Load(d, part);
#endif
      }
      if constexpr (!kDirectional) {
        for (int axis = 0; axis < 3; ++axis) {
          p[axis] = hn::Sub(p[axis], hn::Set(d, light[axis]));
          const VN safe =
              hn::IfThenElse(hn::Lt(hn::Abs(p[axis]), tiny), hn::Or(tiny, hn::And(p[axis], hn::SignBit(d))), p[axis]);
          hn::Store(p[axis], d, bundle.dir[axis] + i);
          hn::Store(hn::Div(hn::Set(d, 1.0f), safe), d, bundle.rcp_dir[axis] + i);
        }
      } else {
        for (int axis = 0; axis < 3; ++axis) hn::Store(p[axis], d, bundle.origin[axis] + i);
      }
      // NaN fails the comparison. Segments of length 0 hit nothing.
      auto valid = in_range;
      for (const VN& component : p) valid = hn::And(valid, hn::Le(hn::Abs(component), limit));
      if constexpr (!kDirectional) {
        const VN length = hn::Max(hn::Abs(p[0]), hn::Max(hn::Abs(p[1]), hn::Abs(p[2])));
        valid = hn::And(valid, hn::Gt(length, zero));
      }
      bundle.active |= static_cast<uint64_t>(bits_of(d, valid)) << i;
    }
    const uint64_t stopped =
        bundle.active == 0 ? 0 : BundleTracer<C, kDirectional>(scene, kNoId, bundle).run(*scene.top);
    for (size_t i = 0; i < count; ++i) occluded[begin + i] = static_cast<uint8_t>((stopped >> i) & 1);
  }
}

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_BUNDLE_TRAVERSAL_INL_H_
