// A clear coat: a GGX lobe above a surface, and what it lets through to that. docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/bsdf_parameters.h"
#include "bsdf/ggx.h"
#include "bsdf/lobe_transmittance.h"
#include "bsdf/shade_points.h"

namespace lumicut {

// F0 and F90 are the coat's share of the surface times Schlick's.
struct ClearCoat {
  float f0, f90, alpha;
  LobeTransmittance transmittance;
};
inline ClearCoat clear_coat(const BsdfParameters& m) {
  const float r = (m.coat_ior - 1.0f) / (m.coat_ior + 1.0f), f0 = m.coat * r * r;
  const float f90 = m.coat * std::min(1.0f, 50.0f * r * r);
  return {f0, f90, m.coat_alpha, lobe_transmittance(f0, f90, m.coat_alpha)};
}

// Dims what lies beneath, seen at `cosine`. The diffuse part gets what the coat leaves of the light's directions on the
// average, the lobe what it leaves of the view's: that of the light too, where the lobe is a mirror's.
inline void dim_by_coat(const ClearCoat& coat, float cosine, SurfacePoint& beneath) {
  const float shown = coat.transmittance.at(cosine), before = beneath.falloff;
  beneath.falloff = combined_falloff(before, coat.transmittance.falloff);
  beneath.diffuse *= shown * mean_diffuse_falloff(before) / mean_diffuse_falloff(beneath.falloff);
  beneath.specular *= shown, beneath.grazing *= shown;
}

// Reflectance of a specular coat at the facet `cosine`.
inline float coat_reflectance(const ClearCoat& coat, float cosine) {
  const float p = schlick_share(cosine);
  return coat.f0 * (1.0f - p) + coat.f90 * p;
}

}  // namespace lumicut
