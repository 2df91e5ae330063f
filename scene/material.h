// A material's description, as the host gives it. Lambert and Blinn's or Phong's lobe, as the papers have them; or metal,
// glass and coated diffuse of GGX microfacets, under a clear coat. What they mean stands in bsdf/, a file a lobe.
#pragma once

#include <cstdint>

#include "bsdf/bsdf_parameters.h"
#include "bsdf/ggx.h"
#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

struct Material {
  Rgb diffuse{0.8f, 0.8f, 0.8f};
  Rgb specular{};
  Rgb translucency{};  // share of the light that leaves on the other side, evenly
  float shininess = 0.0f;
  LobeModel lobe = LobeModel::blinn;
  bool oren_nayar = false;   // not of GGX: bsdf/oren_nayar.h, of the slope `roughness`
  bool facets_once = false;  // of that, and of GGX's lobe: what facets reflect more than once is lost
  // GGX alone: `diffuse` is the base colour, `specular` multiplies the dielectric's reflectance at normal incidence.
  // Without `fresnel` it is the lobe's own reflectance at every angle, beside Lambert's `diffuse`: no metal, no glass.
  bool fresnel = true;
  bool bright_lobe = false;        // that makes the lobe brighter, instead of leaving evenly
  bool burley = false;             // the diffuse part; and the lobes above take nothing from it
  float diffuse_roughness = 0.0f;  // of the diffuse part, as of `oren_nayar`: the slope
  bool diffuse_once = false;       // of that
  Rgb specular_tint{1, 1, 1};      // of metal at 82 degrees, and of what glass reflects
  float roughness = 0.5f, metallic = 0.0f, ior = 1.5f, transmission = 0.0f;
  float coat = 0.0f, coat_roughness = 0.0f, coat_ior = 1.5f;  // a clear layer over all of this; `coat`: its share
  bool shadows_pass = false;  // light goes straight through the glass, though the camera sees it bent
  bool open_glass = false;    // which has no second border there: what lies behind the surface lies inside the glass
  Rgb absorption{};           // inside glass, for each unit of length
  bool bump_shadows = false;  // bsdf/bump_shadow.h, where normals are bent
  bool holdout = false;       // the camera sees nothing there, and nothing behind
  float opacity = 1.0f;
  Rgb emission{};  // radiance, W/(sr·m²), from the side the geometric normal points to
  bool emit_both_sides = false;
  float normal_strength = 1.0f;
  int32_t normal_texture = -1;
  float bump_strength = 1.0f, bump_distance = 1.0f;  // the distance in world units that a height of 1 stands out
  int32_t height_texture = -1;
  int32_t roughness_texture = -1, metallic_texture = -1;  // GGX alone; green and blue, as glTF packs them
  int32_t diffuse_roughness_texture = -1;                 // GGX alone; green
  int32_t diffuse_texture = -1, specular_texture = -1, opacity_texture = -1, emission_texture = -1;
  int32_t translucency_texture = -1;
  LUMICUT_FIELDS(Material, diffuse, specular, translucency, shininess, lobe, oren_nayar, facets_once, fresnel,
                 bright_lobe, burley, diffuse_roughness, diffuse_once, specular_tint, roughness, metallic, ior,
                 transmission, coat, coat_roughness, coat_ior, shadows_pass, open_glass, absorption, bump_shadows,
                 holdout, opacity, emission, emit_both_sides, normal_strength, normal_texture, bump_strength,
                 bump_distance, height_texture, roughness_texture, metallic_texture, diffuse_roughness_texture,
                 diffuse_texture, specular_texture, opacity_texture, emission_texture, translucency_texture)

  // Whether light that goes straight through its glass is absorbed there.
  bool absorbs_straight() const { return shadows_pass && max_component(absorption) > 0.0f; }
  bool translucent() const { return max_component(translucency) > 0.0f; }
  bool emissive() const { return max_component(emission) > 0.0f; }
  float coat_alpha() const { return coat_roughness * coat_roughness; }
  bool rough_coat() const { return lobe == LobeModel::ggx && coat > 0.0f && coat_alpha() >= kLeastAlpha; }
  // Whether it has a specular lobe somewhere (Bsdf::is_specular); where, a texture of roughness may decide.
  bool may_be_specular() const {
    return lobe == LobeModel::ggx && (roughness * roughness < kLeastAlpha || roughness_texture >= 0 ||
                                      transmission > 0.0f || smooth_coat(coat, coat_alpha()));
  }
  // Whether its diffuse part may not be Lambert's.
  bool may_be_lobed() const { return oren_nayar || lobe == LobeModel::ggx; }
  bool cutout() const { return opacity < 1.0f || opacity_texture >= 0; }
};

}  // namespace lumicut
