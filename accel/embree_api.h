// Differences between Embree 3 and 4; no other file depends on the version. LUMICUT_EMBREE_MAJOR comes from CMake.
#pragma once

#include <cstddef>

#if LUMICUT_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace lumicut::embree {

#if LUMICUT_EMBREE_MAJOR >= 4

inline constexpr bool kHasStreams = false;

// Flags of queries; cheap to construct, one per batch.
class Context {
 public:
  explicit Context(bool coherent) {
    rtcInitRayQueryContext(&context_);
    rtcInitIntersectArguments(&intersect_);
    rtcInitOccludedArguments(&occluded_);
    const RTCRayQueryFlags flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    intersect_.flags = occluded_.flags = flags;
    intersect_.context = occluded_.context = &context_;
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  void intersect(RTCScene scene, RTCRayHit* ray) { rtcIntersect1(scene, ray, &intersect_); }
  void occluded(RTCScene scene, RTCRay* ray) { rtcOccluded1(scene, ray, &occluded_); }
  void occluded16(const int* valid, RTCScene scene, RTCRay16* ray) { rtcOccluded16(valid, scene, ray, &occluded_); }
  // Embree 4 has no streams.
  void occluded_stream(RTCScene, RTCRayN*, unsigned, size_t) {}
  void occluded_stream_aos(RTCScene, RTCRay*, unsigned) {}

 private:
  RTCRayQueryContext context_;
  RTCIntersectArguments intersect_;
  RTCOccludedArguments occluded_;
};

#else

inline constexpr bool kHasStreams = true;

class Context {
 public:
  explicit Context(bool coherent) {
    rtcInitIntersectContext(&context_);
    context_.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  void intersect(RTCScene scene, RTCRayHit* ray) { rtcIntersect1(scene, &context_, ray); }
  void occluded(RTCScene scene, RTCRay* ray) { rtcOccluded1(scene, &context_, ray); }
  void occluded16(const int* valid, RTCScene scene, RTCRay16* ray) { rtcOccluded16(valid, scene, &context_, ray); }
  // One packet of `n` rays in structure of arrays, `bytes` long.
  void occluded_stream(RTCScene scene, RTCRayN* rays, unsigned n, size_t bytes) {
    rtcOccludedNM(scene, &context_, rays, n, 1, bytes);
  }
  // `n` rays one after the other.
  void occluded_stream_aos(RTCScene scene, RTCRay* rays, unsigned n) {
    rtcOccluded1M(scene, &context_, rays, n, sizeof(RTCRay));
  }

 private:
  RTCIntersectContext context_;
};

#endif

}  // namespace lumicut::embree
