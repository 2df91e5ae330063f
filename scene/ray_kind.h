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
inline constexpr int kRayKinds = 5;
inline constexpr uint32_t kAllRays = kCameraRay | kDiffuseRay | kGlossyRay | kTransmissionRay | kShadowRay;

// Of the ray that leaves a surface by a sample with such BsdfFlags; `before`: of the one that came, which goes on
// straight.
inline uint32_t ray_kind(uint32_t flags, uint32_t before = kDiffuseRay) {
  if ((flags & kStraight) != 0) return before;
  if ((flags & kTransmitted) != 0) return kTransmissionRay;
  return (flags & (kSpecular | kGlossy)) != 0 ? kGlossyRay : kDiffuseRay;
}

// As a lamp tells lobes apart that it lights, of such a sample: what passes evenly is diffuse.
inline uint32_t lobe_kind(uint32_t flags) {
  const bool specular = (flags & kSpecular) != 0;
  if (specular && (flags & kTransmitted) != 0) return kTransmissionRay;
  return specular || (flags & kGlossy) != 0 ? kGlossyRay : kDiffuseRay;
}

// Light linking: emitters name a set of receivers and one of blockers by number, 0: all meshes; meshes have a bit for
// each set that they are not in. Blockers are told apart by the rays: a bit of Ray::mask for each set.
inline constexpr uint32_t kReceiverSets = 32, kBlockerSets = 32 - kRayKinds;
inline constexpr uint32_t blocker_ray(uint32_t set) { return uint32_t{kShadowRay} << set; }
inline constexpr bool in_set(uint32_t bits_of_others, uint32_t set) {
  return set == 0 || (bits_of_others >> (set - 1) & 1) == 0;
}

}  // namespace lumicut
