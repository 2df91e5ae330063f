// Kinds of rays, as bits of Ray::mask and Mesh::mask: a mesh is there for the rays that it has a bit in common with.
// They are what Cycles calls the ray visibility of an object.
#pragma once

#include <cstdint>

#include "bsdf/point_bsdf.h"

namespace lumicut {

enum RayKind : uint32_t {
  kCameraRay = 1,
  kDiffuseRay = 2,  // light paths too: what they meet is seen by what it lights
  kGlossyRay = 4,
  kTransmissionRay = 8,
  kShadowRay = 16
};
inline constexpr uint32_t kAllRays = kCameraRay | kDiffuseRay | kGlossyRay | kTransmissionRay | kShadowRay;

// Of the ray that leaves a surface by a sample with such BsdfFlags; `before`: of the one that came, which goes on
// straight.
inline uint32_t ray_kind(uint32_t flags, uint32_t before = kDiffuseRay) {
  if ((flags & kStraight) != 0) return before;
  if ((flags & kTransmitted) != 0) return kTransmissionRay;
  return (flags & (kSpecular | kGlossy)) != 0 ? kGlossyRay : kDiffuseRay;
}

}  // namespace lumicut
