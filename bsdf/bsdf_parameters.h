// A material's description at one place, its textures looked up: all that a Bsdf is made from.
#pragma once

#include <algorithm>

#include "bsdf/facet_albedo.h"
#include "core/vec.h"

namespace lumicut {

enum class LobeModel { blinn, phong, ggx };

struct BsdfParameters {
  LobeModel model = LobeModel::blinn;
  Rgb diffuse{},
      specular{};      // kd and ks; GGX: base colour, and factor of the dielectric's F0 (or F0 without `fresnel`)
  Rgb translucency{};  // what is passed on evenly to the other side
  float slope = 0.0f;  // Oren and Nayar's diffuse (bsdf/oren_nayar.h); 0: Lambert's
  bool diffuse_once = false;  // of that: what facets reflect more than once is lost
  float exponent = 0.0f;      // Blinn, Phong
  // GGX alone.
  bool fresnel = true;
  bool facets_once = false;    // of metal and rough glass: what facets reflect more than once is lost
  bool bright_lobe = false;    // it makes the lobe brighter, instead of leaving evenly
  Rgb specular_tint{1, 1, 1};  // of metal at 82 degrees, and of what glass reflects
  bool additive = false;       // Burley's diffuse, from which the lobes above take nothing
  float alpha = 0.25f;         // roughness²
  float metallic = 0.0f, ior = 1.5f, transmission = 0.0f;
  float coat = 0.0f, coat_alpha = 0.0f, coat_ior = 1.5f;  // a clear layer over all of this; `coat`: its share
  const GlassAlbedo* glass = nullptr;                     // of that ior, for rough glass
  bool shadows_pass = false;                              // light goes straight through its glass
  bool open_glass = false;                                // which has no second border
  Rgb absorption{};                                       // inside that, for each unit of length
};

}  // namespace lumicut
