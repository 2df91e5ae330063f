// Bundles of up to 64 rays with one end in common.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_BUNDLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_BUNDLE_INL_H_
#undef LUMICUT_ACCEL_BVH_BUNDLE_INL_H_
#else
#define LUMICUT_ACCEL_BVH_BUNDLE_INL_H_
#endif

#include "accel/bvh/lanes-inl.h"

// No function here: no HWY_BEFORE_NAMESPACE, which clang refuses where nothing uses it.
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

using DN = hn::CappedTag<float, 16>;
using VN = hn::Vec<DN>;
constexpr size_t kBundle = 64;

// Rays that share their origin (points to one light), or with kDirectional their direction (points to a distant light).
struct Bundle {
  Vec3f common;                         // the shared origin or direction
  HWY_ALIGN float origin[3][kBundle];   // kDirectional only
  HWY_ALIGN float dir[3][kBundle];      // otherwise
  HWY_ALIGN float rcp_dir[3][kBundle];  // 1/dir
  float tfar;
  uint32_t mask, flags;  // of the rays
  uint64_t active;       // one bit per ray; the others may hold any value
};

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE

#endif  // LUMICUT_ACCEL_BVH_BUNDLE_INL_H_
