// What a GGX lobe leaves of the light to what lies beneath it: a diffuse base, a coated surface.
// Fitted to the lobe's directional albedo by numerical integration. docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/lambert.h"

namespace lumicut {

// Share that passes the lobe from a direction: normal·(1 − falloff·(1 − c)⁴).
struct LobeTransmittance {
  float normal;  // at normal incidence
  float falloff;
  float at(float cosine) const { return normal * diffuse_falloff(falloff, cosine); }
};

// Of a lobe with the reflectances f0 and f90.
inline LobeTransmittance lobe_transmittance(float f0, float f90, float alpha) {
  const float a2 = alpha * alpha, left = 1.0f - f0 * (1.0f - 1.643f * a2 / (1.0f + 2.248f * a2));
  return {left, std::min(1.0f, (f90 / (1.0f + 8.0f * alpha + 5.0f * a2) + 0.4f * f0 * a2) / left)};
}

}  // namespace lumicut
