// Traversal of single rays: any hit and closest hit.
// Eight-wide nodes as in Embree's BVH8. Departs: any-hit rays take the children in a fixed order, see wide_bvh.h.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_SINGLE_RAY_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_SINGLE_RAY_INL_H_
#undef LUMICUT_ACCEL_BVH_SINGLE_RAY_INL_H_
#else
#define LUMICUT_ACCEL_BVH_SINGLE_RAY_INL_H_
#endif

#include <algorithm>

#include "accel/bvh/leaf-inl.h"
#include "accel/bvh/slabs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

// A leaf that stopped a ray; no tree: none did.
struct Stopper {
  const WideBvh* bvh = nullptr;
  uint32_t instance_id = kNoId, leaf = 0;  // a child word
};

template <class C>
using WithoutInstances = SceneConfig<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;

inline Ray local_ray(const TraceScene::Instance& instance, const Ray& r) {
  Ray local = r;
  local.org = local_point(instance, r.org), local.dir = local_vector(instance, r.dir);
  return local;
}

// True when something that stops light lies in (r.tnear, r.tfar) below child word `start`. Children are visited in the
// order stored by collapse(). `stopper`, where given, is set to what it was.
template <class C>
HWY_NOINLINE bool any_hit(const TraceScene& scene, const WideBvh& bvh, uint32_t instance_id, uint32_t start,
                          const Ray& r, Stopper* stopper = nullptr) {
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
      const uint32_t id = current & ~kLeafBit;
      const TraceScene::Instance& instance = scene.instances[id];
      const Ray local = local_ray(instance, r);
      if (any_hit<WithoutInstances<C>>(scene, *instance.bvh, id, instance.bvh->root, local, stopper)) return true;
    } else {
      const LeafBlock& block = bvh.leaves[current & ~kLeafBit];
      HitLanes hits;
      const uint32_t hit = intersect_block<C, C::kFilters>(scene, block, lanes, tnear4, tfar4, r.mask, hits);
      if (any_lane_stops<C>(scene, block, instance_id, r, hit, hits)) {
        if (stopper != nullptr) *stopper = {&bvh, instance_id, current};
        return true;
      }
    }
    if (top == 0) return false;
    current = stack[--top];
  }
}

// Whether it stops this ray too.
template <class C>
HWY_INLINE bool stops_again(const TraceScene& scene, const Stopper& stopper, const Ray& r) {
  const uint32_t id = stopper.instance_id;
  return any_hit<WithoutInstances<C>>(scene, *stopper.bvh, id, stopper.leaf,
                                      id == kNoId ? r : local_ray(scene.instances[id], r));
}

// Shortens r.ray.tfar to the closest hit and fills r.hit. The nearest child is visited first. `org` and `dir`: the ray
// in the space of `bvh`; distances are the same in every space, since `dir` is not normalised.
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
  struct StackEntry {
    uint32_t child;
    float entry;
  };
  StackEntry stack[kTraversalStack];
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
      // Only the nearest is selected: sorting the rest costs more than it saves.
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
        using Inner = SceneConfig<C::kRobust, C::kBoxes, C::kMasks, C::kFilters, false>;
        closest_hit<Inner>(scene, *instance.bvh, id, local_point(instance, org), local_vector(instance, dir), r);
        if (r.ray.tfar < before) tfar = hn::Set(d8, r.ray.tfar);
      } else {
        const LeafBlock& block = bvh.leaves[current & ~kLeafBit];
        HitLanes hits;
        uint32_t hit = intersect_block<C, true>(scene, block, lanes, tnear4, tfar4, r.ray.mask, hits);
        if (hit != 0) {
          const float *t = hits.t, *u = hits.u, *v = hits.v;
          bool nearer = false;
          for (; hit != 0; hit &= hit - 1) {
            const int lane = __builtin_ctz(hit);
            // A first hit may equal tfar where the division rounded up.
            if (!(t[lane] < r.ray.tfar) && !(t[lane] == r.ray.tfar && !nearer && r.hit.geom == kNoId)) continue;
            if constexpr (C::kFilters)
              if ((scene.filtered[block.geom[lane]] & kFilterAll) != 0 &&
                  scene.filter->passes(
                      {block.geom[lane], instance_id, block.prim[lane], u[lane], v[lane], r.ray.turned_to_light(dir)}))
                continue;
            nearer = true;
            r.ray.tfar = t[lane];
            r.hit.u = u[lane], r.hit.v = v[lane];
            r.hit.prim = block.prim[lane], r.hit.geom = block.geom[lane], r.hit.inst = instance_id;
            if constexpr (C::kBoxes) {
              r.hit.ng = {};
              for (int axis = 0; axis < 3; ++axis) {  // normal of the side entered last
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

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_SINGLE_RAY_INL_H_
