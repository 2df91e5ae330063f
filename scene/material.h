// Lambert and a glossy lobe about the mirror direction, as the papers have them. [thesis sec. 1, below Eq. 1.1]
// With β between the mirrored view direction and the light, times cosθ:
//   Lambert kd/π · Blinn ks (n+2)/(2π) cosⁿβ · Phong ks/(2π) cosⁿβ
// Or metal, glass and coated diffuse of GGX microfacets. docs/decisions/ggx.md
#pragma once

#include <cstdint>
#include <numbers>

#include "core/vec.h"

namespace lumicut {

enum class LobeModel { blinn, phong, ggx };

// α = roughness². Lobes that are sharper are followed by paths (scene/followed.h): point lights cannot shade them.
inline constexpr float kLeastAlpha = 0.01f;

struct Material {
  Rgb diffuse{0.8f, 0.8f, 0.8f};
  Rgb specular{};
  float shininess = 0.0f;
  LobeModel lobe = LobeModel::blinn;
  // GGX alone: `diffuse` is the base colour, `specular` multiplies the dielectric's reflectance at normal incidence.
  float roughness = 0.5f, metallic = 0.0f, ior = 1.5f, transmission = 0.0f;
  float opacity = 1.0f;
  Rgb emission{};  // radiance, W/(sr·m²), from the side the geometric normal points to
  bool emit_both_sides = false;
  float normal_strength = 1.0f;
  int32_t normal_texture = -1;
  int32_t diffuse_texture = -1, specular_texture = -1, opacity_texture = -1, emission_texture = -1;

  bool emissive() const { return max_component(emission) > 0.0f; }
  float alpha() const { return roughness * roughness; }
  // A lobe that paths follow.
  bool followed() const { return lobe == LobeModel::ggx && (alpha() < kLeastAlpha || transmission > 0.0f); }
  bool cutout() const { return opacity < 1.0f || opacity_texture >= 0; }
};

// The lobe's factor before ks cosⁿβ.
inline float lobe_scale(bool phong, float shininess) {
  constexpr float kInvTwoPi = 0.15915494309f;
  return phong ? kInvTwoPi : (shininess + 2.0f) * kInvTwoPi;
}

// A GGX material's colours at one place.
struct GgxColors {
  Rgb base;
  float metal, opaque, clear;  // shares of metal, coated diffuse and glass; sum 1
  Rgb f0;                      // of the coat
  Rgb specular;                // F0 of metal and coat together
  float grazing;               // F90 of both
};

// The part of a GGX surface that scatters evenly: what its coat lets through to the diffuse base, and what the facets
// of rough metal reflect more than once. Towards cosine c, of view and of light alike: 1 − fade·(1 − c)⁴.
struct GgxBase {
  Rgb scale;  // without both cosines' factors
  float fade;
};

// 2 ∫ (1 − fade·(1 − c)⁴) c dc
inline float mean_of_fading(float fade) { return 1.0f - fade * (1.0f / 15.0f); }

// Fitted to the lobe's directional albedo by numerical integration. docs/decisions/ggx.md
inline GgxBase ggx_base(const GgxColors& c, float alpha) {
  const float a2 = alpha * alpha, f0 = max_component(c.f0), f90 = std::min(1.0f, 50.0f * f0);
  const float left = 1.0f - f0 * (1.0f - 1.643f * a2 / (1.0f + 2.248f * a2));  // steeply down
  const float coat_fade = std::min(1.0f, (f90 / (1.0f + 8.0f * alpha + 5.0f * a2) + 0.4f * f0 * a2) / left);
  const Rgb coat = c.base * (c.opaque * left / mean_of_fading(coat_fade));
  // Rough metal: what one reflection leaves, reflected again. [Kulla, Conty 2017]
  const float lost = 1.6f * a2 / (1.0f + 1.76f * a2), mean_lost = lost * mean_of_fading(1.0f);
  Rgb metal{};
  for (int k = 0; k < 3; ++k) {
    const float mean = c.base[k] + (1.0f - c.base[k]) * (1.0f / 21.0f);
    metal[k] = c.metal * mean * mean * (1.0f - mean_lost) / (1.0f - mean * mean_lost) * lost / mean_of_fading(1.0f);
  }
  const float whole = luminance(coat) + luminance(metal);
  const float fade = whole > 0.0f ? (luminance(coat) * coat_fade + luminance(metal)) / whole : coat_fade;
  return {coat + metal, fade};
}

}  // namespace lumicut
