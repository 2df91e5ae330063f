// Dispatch of traversal: the instruction set at run time, the features of the scene at compile time.
#include "accel/bvh/traverse.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "accel/bvh/traverse.cpp"
#include <hwy/foreach_target.h>
// foreach_target comes first.
#include <hwy/highway.h>

#include "accel/bvh/bundle_traversal-inl.h"
#include "accel/bvh/single_ray-inl.h"
#include "accel/validate.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {

template <class C>
void trace_closest_singly(const TraceScene& scene, RayHit* rays, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    RayHit& r = rays[i];
    r.hit = {};
    if (is_traceable(r.ray, scene.limits) && r.ray.mask != 0)
      closest_hit<C>(scene, *scene.top, kNoId, r.ray.org, r.ray.dir, r);
  }
}
template <class C>
void trace_any_singly(const TraceScene& scene, Ray* rays, size_t n) {
  Stopper last;  // rays that follow each other, such as those of a lamp to neighbours, often meet the same
  for (size_t i = 0; i < n; ++i) {
    Ray r = rays[i];
    if (!is_traceable(r, scene.limits) || r.mask == 0) continue;
    r.tnear = std::max(r.tnear, 0.0f);
    if (last.bvh != nullptr && !stops_again<C>(scene, last, r)) last = {};
    if (last.bvh != nullptr || any_hit<C>(scene, *scene.top, kNoId, scene.top->root, r, &last)) rays[i].tfar = -kInf;
  }
}

// fn(SceneConfig) with the features of the scene. For fewer variants, filters come with masks and boxes are robust.
template <class Fn>
void with_config(const TraceScene& s, Fn&& fn) {
  const auto instances = [&](auto robust, auto boxes, auto masks, auto filters) {
    if (s.instanced)
      fn(SceneConfig<robust, boxes, masks, filters, true>());
    else
      fn(SceneConfig<robust, boxes, masks, filters, false>());
  };
  using Yes = std::true_type;
  using No = std::false_type;
  if (s.boxes) return fn(SceneConfig<true, true, false, false, false>());
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
  with_config(scene, [&](auto config) { trace_closest_singly<decltype(config)>(scene, rays, n); });
}
void any(const TraceScene& scene, Ray* rays, size_t n) {
  with_config(scene, [&](auto config) { trace_any_singly<decltype(config)>(scene, rays, n); });
}
void points(const TraceScene& scene, const BundleOrigin& origin, const float* px, const float* py, const float* pz,
            size_t n, uint8_t* occluded) {
  with_config(scene, [&](auto config) {
    if (origin.directional)
      trace_points_in_bundles<decltype(config), true>(scene, origin, px, py, pz, n, occluded);
    else
      trace_points_in_bundles<decltype(config), false>(scene, origin, px, py, pz, n, occluded);
  });
}
const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
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

void trace_points(const TraceScene& scene, const BundleOrigin& origin, const float* px, const float* py,
                  const float* pz, size_t n, uint8_t* occluded) {
  const bool valid = within(origin.light, origin.directional ? scene.limits.direction : scene.limits.origin);
  if (scene.top->root == kEmptyChild || origin.mask == 0 || !valid || (origin.directional && origin.light == Vec3f{})) {
    std::fill_n(occluded, n, uint8_t{0});
    return;
  }
  HWY_DYNAMIC_DISPATCH(points)(scene, origin, px, py, pz, n, occluded);
}

const char* traversal_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace lumicut
#endif  // HWY_ONCE
