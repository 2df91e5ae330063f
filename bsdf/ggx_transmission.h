// Refraction by GGX facets. [Walter et al. 2007]
#pragma once

#include "bsdf/dielectric.h"
#include "bsdf/ggx.h"

namespace lumicut {

// Of what is seen along visible half vectors, the share through the surface that facets do not mask.
inline float masking_transmitted(float alpha2, float nl) { return 2.0f * nl / (nl + ggx_root(alpha2, nl)); }

// Where light through the facet `half` goes on, for a unit view direction at `cosine` to it; `ratio`, `refracted`: of
// fresnel_reflectance. All in one frame. [Snell]
inline Vec3f refract(const Vec3f& view, const Vec3f& half, float cosine, float ratio, float refracted) {
  return half * (cosine / ratio - refracted) - view * (1.0f / ratio);
}

}  // namespace lumicut
