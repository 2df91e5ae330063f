// Refraction by GGX facets, and the border of a dielectric. [Walter et al. 2007; Fresnel]
#pragma once

#include "bsdf/ggx.h"

namespace lumicut {

// Reflectance of a smooth border for a cosine of incidence; `ratio`: index beyond over index before; `refracted`: the
// cosine beyond, 0 in total reflection. [Fresnel]
inline float fresnel_reflectance(float cosine, float ratio, float& refracted) {
  refracted = 0.0f;
  const float sine2 = (1.0f - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1.0f) return 1.0f;
  refracted = std::sqrt(1.0f - sine2);
  const float s = (cosine - ratio * refracted) / (cosine + ratio * refracted),
              p = (ratio * cosine - refracted) / (ratio * cosine + refracted);
  return 0.5f * (s * s + p * p);
}

// Of what is seen along visible half vectors, the share through the surface that facets do not mask.
inline float masking_transmitted(float alpha2, float nl) { return 2.0f * nl / (nl + ggx_root(alpha2, nl)); }

// Where light through the facet `half` goes on, for a unit view direction at `cosine` to it; `ratio`, `refracted`: of
// fresnel_reflectance. All in one frame. [Snell]
inline Vec3f refract(const Vec3f& view, const Vec3f& half, float cosine, float ratio, float refracted) {
  return half * (cosine / ratio - refracted) - view * (1.0f / ratio);
}

}  // namespace lumicut
