// A GGX material's shares of metal, glass and coated diffuse, and the diffuse part that they leave.
// docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/bsdf_parameters.h"
#include "bsdf/dielectric.h"
#include "bsdf/ggx.h"
#include "bsdf/lobe_transmittance.h"
#include "bsdf/oren_nayar.h"

namespace lumicut {

struct GgxColors {
  Rgb base;
  float metal, opaque, clear;  // shares of metal, coated diffuse and glass; sum 1
  Rgb f0;                      // of the dielectric's border
  float f90;                   // of the same
  Rgb metal_edge;              // F90 of metal
  Rgb specular;                // F0 of metal and dielectric together
  Rgb grazing;                 // F90 of both
  float alpha, ior;            // of the lobe

  // Whether rays follow its lobe, without regard to a clear coat.
  bool is_specular() const { return alpha < kLeastAlpha || clear > 0.0f; }
};

// Metals go from their colour to white as glass of this index does, to 2 % of what is between: as Schlick's term.
inline constexpr float kMetalIndex = 1.5f;
inline constexpr float kMeanShare = 0.054f;  // of that way, over even light from all sides

// What is made to reflect hardly anything straight on has no bright edge either. `factor`: of a dielectric's F0.
inline float bright_edge(float factor) { return std::min(1.0f, 2.0f * factor); }

// F90 of metal. A tint darkens the colour at 82 degrees, as artists give it: the curve goes through that colour, and keeps
// the tint from there on, where Kutz et al. (2021) go back to white.
inline Rgb metal_edge(const Rgb& base, const Rgb& tint) {
  const float edge = bright_edge(25.0f * max_component(base));
  if (!(tint.x < 1.0f || tint.y < 1.0f || tint.z < 1.0f)) return Rgb{1, 1, 1} * edge;
  const float share = fresnel_share(1.0f / 7.0f, kMetalIndex);
  Rgb colour{};
  for (int k = 0; k < 3; ++k) {
    const float there = tint[k] * (base[k] + (edge - base[k]) * share);
    colour[k] = std::max(0.0f, base[k] + (there - base[k]) / share);
  }
  return colour;
}

inline GgxColors ggx_colors(const BsdfParameters& m) {
  GgxColors c{};
  c.base = m.diffuse;
  c.metal = m.metallic;
  c.clear = (1.0f - c.metal) * m.transmission;
  c.opaque = (1.0f - c.metal) * (1.0f - m.transmission);
  c.alpha = m.alpha;
  if (!m.fresnel) {
    c.metal = c.clear = 0.0f, c.opaque = 1.0f;
    c.specular = c.grazing = m.specular, c.ior = kMetalIndex;
    return c;
  }
  c.f0 = m.specular * normal_reflectance(m.ior);
  c.specular = c.base * c.metal + c.f0 * c.opaque;
  c.f90 = bright_edge(max_component(m.specular));
  c.metal_edge = metal_edge(c.base, m.specular_tint);
  c.grazing = c.metal_edge * c.metal + Rgb{1, 1, 1} * (c.f90 * c.opaque);
  c.ior = max_component(c.f0) * c.opaque > 0.0f ? m.ior : kMetalIndex;
  return c;
}

// The part of a GGX surface that scatters evenly: what its coat lets through to the diffuse base, and what the facets
// of rough metal reflect more than once.
struct GgxDiffuse {
  Rgb scale;           // with the view's factor, without the light's; over π: the BRDF
  float falloff;       // towards grazing light
  float burley;        // share that is Burley's
  float slope, again;  // of the base's facets (bsdf/oren_nayar.h)
};

// What gloss without Fresnel leaves of a white surface was mixed with the base: the base's own colour.
inline Rgb base_color(const GgxColors& c, bool fresnel) {
  return fresnel ? c.base : c.base / std::max(1e-3f, 1.0f - max_component(c.specular));
}

inline Rgb mean_reflectance(const Rgb& f0, const Rgb& f90) { return f0 + (f90 - f0) * kMeanShare; }

// Adds to a lobe, seen at `cosine`, what facets of rough metal reflect again of what single reflection loses, as if all of it
// kept to the lobe's directions: bright_lobe. [Kulla, Conty 2017; Turquin 2019]
inline void brighten_lobe(const GgxColors& c, bool fresnel, float cosine, Rgb& specular, Rgb& grazing) {
  const float lost = facet_loss(c.alpha, cosine), mean_lost = mean_facet_loss(c.alpha);
  const Rgb mean = fresnel ? mean_reflectance(c.base, c.metal_edge) : c.specular;
  const Rgb f0 = fresnel ? c.base * c.metal : c.specular, f90 = fresnel ? c.metal_edge * c.metal : c.specular;
  for (int k = 0; k < 3; ++k) {
    const float again = mean[k] * (1.0f - mean_lost) / (1.0f - mean[k] * mean_lost) * lost / (1.0f - lost);
    specular[k] += f0[k] * again, grazing[k] += f90[k] * again;
  }
}

// For a surface seen at `cosine`. The view has what the coat leaves, and what single reflection at rough metal loses, as
// they are; the light has falloffs that are near to that, with the same mean. [Kulla, Conty 2017]
inline GgxDiffuse ggx_diffuse(const GgxColors& c, const BsdfParameters& m, float cosine) {
  const float f0 = max_component(c.f0);
  const LobeTransmittance rest =
      m.additive ? LobeTransmittance{1.0f, 0.0f} : lobe_transmittance(f0, c.f90, c.ior, c.alpha, cosine);
  Rgb coat = c.base * (c.opaque * rest.to_viewer / mean_diffuse_falloff(rest.falloff));
  Grooves facets;
  if (m.slope > 0.0f) {
    facets = grooves(base_color(c, m.fresnel), m.slope, m.diffuse_once, cosine);
    coat *= facets.scale;
  }
  if (!(c.metal > 0.0f) || m.facets_once || m.bright_lobe)
    return {coat, rest.falloff, m.additive ? 1.0f : 0.0f, facets.slope, facets.again};
  const float mean_lost = mean_facet_loss(c.alpha), lost = facet_loss(c.alpha, cosine);
  const Rgb mean = mean_reflectance(c.base, c.metal_edge);
  Rgb metal{};
  for (int k = 0; k < 3; ++k)
    metal[k] = c.metal * mean[k] * mean[k] * (1.0f - mean_lost) / (1.0f - mean[k] * mean_lost) * lost /
               mean_diffuse_falloff(1.0f);
  const float whole = luminance(coat) + luminance(metal);
  const float of_coat = whole > 0.0f ? luminance(coat) / whole : 0.0f;
  const float falloff = whole > 0.0f ? (luminance(coat) * rest.falloff + luminance(metal)) / whole : rest.falloff;
  return {coat + metal, falloff, m.additive ? of_coat : 0.0f, facets.slope * of_coat, facets.again * of_coat};
}

}  // namespace lumicut
