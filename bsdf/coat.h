// A clear coat: a GGX lobe above a surface, and what it lets through to that. docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/bsdf_parameters.h"
#include "bsdf/dielectric.h"
#include "bsdf/ggx.h"
#include "bsdf/lobe_transmittance.h"
#include "bsdf/shade_points.h"

namespace lumicut {

// F0 and F90 are the coat's share of the surface times the border's.
struct ClearCoat {
  float f0, f90, ior, alpha;
  LobeTransmittance transmittance;
};
// Seen at `cosine` to the normal.
inline ClearCoat clear_coat(const BsdfParameters& m, float cosine) {
  const float f0 = m.coat * normal_reflectance(m.coat_ior), f90 = m.coat;
  return {f0, f90, m.coat_ior, m.coat_alpha, lobe_transmittance(f0, f90, m.coat_ior, m.coat_alpha, cosine)};
}

// Dims what lies beneath. The diffuse part gets what the coat leaves of the light's directions on the
// average, the lobe what it leaves of the view's: that of the light too, where the lobe is a mirror's.
inline void dim_by_coat(const ClearCoat& coat, SurfacePoint& beneath) {
  const float shown = coat.transmittance.to_viewer, before = beneath.falloff;
  beneath.falloff = combined_falloff(before, coat.transmittance.falloff);
  beneath.diffuse *= shown * mean_diffuse_falloff(before) / mean_diffuse_falloff(beneath.falloff);
  beneath.specular *= shown, beneath.grazing *= shown;
}

// Reflectance of a specular coat at the facet `cosine`.
inline float coat_reflectance(const ClearCoat& coat, float cosine) {
  const float p = fresnel_share(cosine, coat.ior);
  return coat.f0 * (1.0f - p) + coat.f90 * p;
}

}  // namespace lumicut
