// Lambert and a glossy lobe about the mirror direction, as the papers have them. [thesis sec. 1, below Eq. 1.1]
// With β between the mirrored view direction and the light, times cosθ:
//   Lambert kd/π · Blinn ks (n+2)/(2π) cosⁿβ · Phong ks/(2π) cosⁿβ
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace lumicut {

struct Material {
  Rgb diffuse{0.8f, 0.8f, 0.8f};
  Rgb specular{};
  float shininess = 0.0f;
  bool phong = false;
  float opacity = 1.0f;
  Rgb emission{};  // radiance, W/(sr·m²), from the side the geometric normal points to
  bool emit_both_sides = false;
  int32_t diffuse_texture = -1, specular_texture = -1, opacity_texture = -1, emission_texture = -1;

  bool emissive() const { return max_component(emission) > 0.0f; }
  bool cutout() const { return opacity < 1.0f || opacity_texture >= 0; }
};

// The lobe's factor before ks cosⁿβ.
inline float lobe_scale(bool phong, float shininess) {
  constexpr float kInvTwoPi = 0.15915494309f;
  return phong ? kInvTwoPi : (shininess + 2.0f) * kInvTwoPi;
}

}  // namespace lumicut
