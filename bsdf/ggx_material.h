// A GGX material's shares of metal, glass and coated diffuse, and the diffuse part that they leave.
// docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/bsdf_parameters.h"
#include "bsdf/ggx.h"
#include "bsdf/lobe_transmittance.h"

namespace lumicut {

struct GgxColors {
  Rgb base;
  float metal, opaque, clear;  // shares of metal, coated diffuse and glass; sum 1
  Rgb f0;                      // of the dielectric's border
  Rgb specular;                // F0 of metal and dielectric together
  Rgb grazing;                 // F90 of both
  float alpha;

  // Whether rays follow its lobe, without regard to a clear coat.
  bool is_specular() const { return alpha < kLeastAlpha || clear > 0.0f; }
};

inline GgxColors ggx_colors(const BsdfParameters& m) {
  GgxColors c{};
  c.base = m.diffuse;
  c.metal = m.metallic;
  c.clear = (1.0f - c.metal) * m.transmission;
  c.opaque = (1.0f - c.metal) * (1.0f - m.transmission);
  c.alpha = m.alpha;
  if (!m.fresnel) {
    c.metal = c.clear = 0.0f, c.opaque = 1.0f;
    c.specular = c.grazing = m.specular;
    return c;
  }
  const float r = (m.ior - 1.0f) / (m.ior + 1.0f);
  c.f0 = m.specular * (r * r);
  c.specular = c.base * c.metal + c.f0 * c.opaque;
  // What hardly reflects has no bright edge either.
  const auto edge = [](const Rgb& f0) { return std::min(1.0f, 50.0f * max_component(f0)); };
  c.grazing = Rgb{1, 1, 1} * (edge(c.base) * c.metal + edge(c.f0) * c.opaque);
  return c;
}

// The part of a GGX surface that scatters evenly: what its coat lets through to the diffuse base, and what the facets
// of rough metal reflect more than once.
struct GgxDiffuse {
  Rgb scale;      // with the view's factor, without the light's; over π: the BRDF
  float falloff;  // towards grazing light
};

// For a surface seen at `cosine`: coats leave the view as much as the light of that cosine; of rough metals the view has
// what single reflection loses, the light a fit to that with falloff 1. [Kulla, Conty 2017]
inline GgxDiffuse ggx_diffuse(const GgxColors& c, float cosine) {
  const float f0 = max_component(c.f0);
  const LobeTransmittance rest = lobe_transmittance(f0, std::min(1.0f, 50.0f * f0), c.alpha);
  const Rgb coat = c.base * (c.opaque * rest.at(cosine) / mean_diffuse_falloff(rest.falloff));
  if (!(c.metal > 0.0f)) return {coat, rest.falloff};
  const float mean_lost = mean_facet_loss(c.alpha), lost = facet_loss(c.alpha, cosine);
  Rgb metal{};
  for (int k = 0; k < 3; ++k) {
    const float mean = c.base[k] + (1.0f - c.base[k]) * (1.0f / 21.0f);
    metal[k] =
        c.metal * mean * mean * (1.0f - mean_lost) / (1.0f - mean * mean_lost) * lost / mean_diffuse_falloff(1.0f);
  }
  const float whole = luminance(coat) + luminance(metal);
  const float falloff = whole > 0.0f ? (luminance(coat) * rest.falloff + luminance(metal)) / whole : rest.falloff;
  return {coat + metal, falloff};
}

}  // namespace lumicut
