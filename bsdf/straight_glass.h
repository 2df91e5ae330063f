// Glass that light passes straight: what a material's `shadows_pass` makes of it for shadow rays and for the rays that
// carry light. docs/decisions/0019-shadows-through-glass.md
#pragma once

#include <cmath>
#include <cstdint>

#include "bsdf/coat.h"

namespace lumicut {

inline constexpr uint32_t kMostStraight = 64;  // passages of one path: they count as no surface, and must end
inline constexpr float kSmoothAlpha = 1e-4f;   // facets below turn directions by less than single precision tells
inline constexpr float kSharpAlpha = 1e-3f;    // facets below turn directions by less than a pixel or two are wide

// Share that goes straight on through one border, for the cosine to the geometric normal. Either side counts as the outer
// one: in a slab light that was not bent meets the second border as it met the first, and is not totally reflected there.
// `from_inside`: whether what is lit lies behind the surface. In glass that is open there it has the light of the other side in
// a narrower cone; radiance keeps its value through borders here, so that so much less arrives.
inline Rgb straight_transmittance(const BsdfParameters& m, float cosine, bool from_inside) {
  const float clear = m.fresnel ? (1.0f - m.metallic) * m.transmission : 0.0f;
  if (!(clear > 0.0f)) return {};
  cosine = std::min(1.0f, std::abs(cosine));
  const bool rough = !(m.alpha < kSmoothAlpha) && m.glass != nullptr;
  float refracted = 0.0f;
  float share =
      clear * (rough ? m.glass->passed(m.alpha, cosine) : 1.0f - fresnel_reflectance(cosine, m.ior, refracted));
  if (rough && m.facets_once) share *= m.glass->at(false, m.alpha, cosine);
  if (m.coat > 0.0f && !m.additive) share *= clear_coat(m, cosine).transmittance.to_viewer;
  if (m.open_glass && from_inside) share = std::min(1.0f, share / (m.ior * m.ior));
  Rgb passed{};
  for (int k = 0; k < 3; ++k) passed[k] = share * std::sqrt(std::max(0.0f, m.diffuse[k]));
  return passed;
}

}  // namespace lumicut
