// Lambert and a glossy lobe about the mirror direction, as the papers have them. [thesis sec. 1, below Eq. 1.1]
// With β between the mirrored view direction and the light, times cosθ:
//   Lambert kd/π · Blinn ks (n+2)/(2π) cosⁿβ · Phong ks/(2π) cosⁿβ
// Or metal, glass and coated diffuse of GGX microfacets, under a clear coat. docs/decisions/ggx.md
#pragma once

#include <algorithm>
#include <cstdint>
#include <numbers>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/facet_albedo.h"

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
  // Without `fresnel` it is the lobe's own reflectance at every angle, beside Lambert's `diffuse`: no metal, no glass.
  bool fresnel = true;
  float roughness = 0.5f, metallic = 0.0f, ior = 1.5f, transmission = 0.0f;
  float coat = 0.0f, coat_roughness = 0.0f, coat_ior = 1.5f;  // a clear layer over all of this; `coat`: its share
  float opacity = 1.0f;
  Rgb emission{};  // radiance, W/(sr·m²), from the side the geometric normal points to
  bool emit_both_sides = false;
  float normal_strength = 1.0f;
  int32_t normal_texture = -1;
  float bump_strength = 1.0f, bump_distance = 1.0f;  // the distance in world units that a height of 1 stands out
  int32_t height_texture = -1;
  int32_t roughness_texture = -1, metallic_texture = -1;  // GGX alone; green and blue, as glTF packs them
  int32_t diffuse_texture = -1, specular_texture = -1, opacity_texture = -1, emission_texture = -1;
  LUMICUT_FIELDS(Material, diffuse, specular, shininess, lobe, fresnel, roughness, metallic, ior, transmission, coat,
                 coat_roughness, coat_ior, opacity, emission, emit_both_sides, normal_strength, normal_texture,
                 bump_strength, bump_distance, height_texture, roughness_texture, metallic_texture, diffuse_texture,
                 specular_texture, opacity_texture, emission_texture)

  bool emissive() const { return max_component(emission) > 0.0f; }
  float coat_alpha() const { return coat_roughness * coat_roughness; }
  bool smooth_coat() const { return coat > 0.0f && coat_alpha() < kLeastAlpha; }
  bool rough_coat() const { return lobe == LobeModel::ggx && coat > 0.0f && coat_alpha() >= kLeastAlpha; }
  // Whether paths follow a lobe of it somewhere; where, a texture of roughness may decide.
  bool followed() const {
    return lobe == LobeModel::ggx &&
           (roughness * roughness < kLeastAlpha || roughness_texture >= 0 || transmission > 0.0f || smooth_coat());
  }
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
  Rgb f0;                      // of the dielectric's border
  Rgb specular;                // F0 of metal and dielectric together
  Rgb grazing;                 // F90 of both
  float alpha;                 // roughness²

  // A lobe that paths follow, without regard to a clear coat.
  bool followed() const { return alpha < kLeastAlpha || clear > 0.0f; }
};

// The part of a GGX surface that scatters evenly: what its coat lets through to the diffuse base, and what the facets
// of rough metal reflect more than once. It falls with the light's cosine c as 1 − fade·(1 − c)⁴.
struct GgxBase {
  Rgb scale;  // with the view's factor, without the light's; over π: the BRDF
  float fade;
};

// 2 ∫ (1 − fade·(1 − c)⁴) c dc
inline float mean_of_fading(float fade) { return 1.0f - fade * (1.0f / 15.0f); }
// 1 − fade·(1 − c)⁴
inline float fading(float fade, float cosine) {
  const float m = 1.0f - std::min(1.0f, std::max(0.0f, cosine));
  return 1.0f - fade * (m * m) * (m * m);
}

// What a lobe of reflectances f0 and f90 leaves of the light from a direction: left·(1 − fade·(1 − c)⁴).
// Fitted to the lobe's directional albedo by numerical integration. docs/decisions/ggx.md
struct LobeRest {
  float left;  // steeply down
  float fade;
  float at(float cosine) const { return left * fading(fade, cosine); }
};
inline LobeRest lobe_rest(float f0, float f90, float alpha) {
  const float a2 = alpha * alpha, left = 1.0f - f0 * (1.0f - 1.643f * a2 / (1.0f + 2.248f * a2));
  return {left, std::min(1.0f, (f90 / (1.0f + 8.0f * alpha + 5.0f * a2) + 0.4f * f0 * a2) / left)};
}

// What cosine the surface is seen at: coats leave the view as much as the light of that cosine; of rough metals the
// view has what single reflection loses, the light a fit to that with fade 1. [Kulla, Conty 2017]
inline GgxBase ggx_base(const GgxColors& c, float cosine) {
  const float f0 = max_component(c.f0);
  const LobeRest rest = lobe_rest(f0, std::min(1.0f, 50.0f * f0), c.alpha);
  const Rgb coat = c.base * (c.opaque * rest.at(cosine) / mean_of_fading(rest.fade));
  if (!(c.metal > 0.0f)) return {coat, rest.fade};
  const float mean_lost = mean_facet_loss(c.alpha), lost = facet_loss(c.alpha, cosine);
  Rgb metal{};
  for (int k = 0; k < 3; ++k) {
    const float mean = c.base[k] + (1.0f - c.base[k]) * (1.0f / 21.0f);
    metal[k] = c.metal * mean * mean * (1.0f - mean_lost) / (1.0f - mean * mean_lost) * lost / mean_of_fading(1.0f);
  }
  const float whole = luminance(coat) + luminance(metal);
  const float fade = whole > 0.0f ? (luminance(coat) * rest.fade + luminance(metal)) / whole : rest.fade;
  return {coat + metal, fade};
}

// A clear coat: its share of the surface times Schlick's F0 and F90, and what it lets through to what is beneath.
struct ClearCoat {
  float f0, f90;
  LobeRest rest;
};
inline ClearCoat clear_coat(const Material& m) {
  const float r = (m.coat_ior - 1.0f) / (m.coat_ior + 1.0f), f0 = m.coat * r * r;
  const float f90 = m.coat * std::min(1.0f, 50.0f * r * r);
  return {f0, f90, lobe_rest(f0, f90, m.coat_alpha())};
}

// The fading of a product of two: the same mean. 2 ∫ (1 − c)⁸ c dc = 1/45
inline float product_fade(float a, float b) { return std::min(1.0f, a + b - a * b * (1.0f / 3.0f)); }

}  // namespace lumicut
