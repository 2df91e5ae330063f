// Vector types, masks as bits and other small parts that all traversal loops share.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_BVH_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_BVH_LANES_INL_H_
#undef LUMICUT_ACCEL_BVH_LANES_INL_H_
#else
#define LUMICUT_ACCEL_BVH_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "accel/bvh/traverse.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace {  // one includer, traverse.cpp: functions with one caller are inlined

namespace hn = hwy::HWY_NAMESPACE;

// Eight children of a node; four primitives of a block.
using D8 = hn::CappedTag<float, 8>;
using V8 = hn::Vec<D8>;
using D4 = hn::CappedTag<float, 4>;
using V4 = hn::Vec<D4>;
using D4u = hn::CappedTag<uint32_t, 4>;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kUlp = 1.1920929e-7f;  // of 1

// The features of a scene that traversal depends on, as constants.
template <bool robust, bool boxes, bool masks, bool filters, bool instances>
struct SceneConfig {
  static constexpr bool kRobust = robust, kBoxes = boxes, kMasks = masks, kFilters = filters, kInstances = instances;
};

// One bit per lane.
template <class D>
HWY_INLINE uint32_t bits_of(D d, hn::Mask<D> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  uint32_t bits = bytes[0];
  if constexpr (hn::MaxLanes(D()) > 8) bits |= static_cast<uint32_t>(bytes[1]) << 8;
  return bits;
}

// 1/d. Components below 1e-18 count as ±1e-18, so that slab tests never compute 0·inf.
HWY_INLINE float reciprocal(float d) { return 1.0f / (std::abs(d) < 1e-18f ? std::copysign(1e-18f, d) : d); }

// A node or block is three to four cache lines.
HWY_INLINE void prefetch(const WideBvh& bvh, uint32_t child) {
  const char* at = (child & kLeafBit) != 0 ? reinterpret_cast<const char*>(bvh.leaves.data() + (child & ~kLeafBit))
                                           : reinterpret_cast<const char*>(bvh.nodes.data() + child);
  __builtin_prefetch(at);
  __builtin_prefetch(at + 64);
  __builtin_prefetch(at + 128);
}

// World space to the space of an instance.
HWY_INLINE Vec3f local_point(const TraceScene::Instance& instance, const Vec3f& p) { return instance.inverse.point(p); }
HWY_INLINE Vec3f local_vector(const TraceScene::Instance& instance, const Vec3f& v) {
  return instance.inverse.vector(v);
}

}  // namespace
}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_BVH_LANES_INL_H_
