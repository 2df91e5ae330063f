// Virtual point lights: the light's side of every many-lights method. [Keller 1997; thesis Eq. 1.1]
#pragma once

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace lumicut {

enum class VplKind : uint32_t { omni = 0, oriented = 1, directional = 2, spot = 3 };
inline constexpr int kVplKinds = 4;

// Layout of lumicut_vpl in lumicut.h (64 bytes).
struct Vpl {
  Vec3f position{};  // oriented: off its surface by the scene's epsilon. directional: unused
  VplKind kind = VplKind::omni;
  Vec3f normal{};     // unit; directional: the way light travels; spot: axis; omni: 0
  uint32_t group = 0;
  Rgb intensity{};    // W/sr along the normal; directional: irradiance W/m²
  float cos_outer = 0.0f, blend_cosine = 0.0f, spot_cosine = 0.0f;  // spot alone
  float reserved[2] = {};
};
static_assert(sizeof(Vpl) == 64);

// Share of a spot's intensity at cosine `c` to its axis: a smoothstep, then the cosine where asked.
inline float spot_profile(float c, float cos_outer, float blend_cosine, float spot_cosine) {
  float x = blend_cosine > 0.0f ? (c - cos_outer) / blend_cosine : (c > cos_outer ? 1.0f : 0.0f);
  x = std::min(1.0f, std::max(0.0f, x));
  x = x * x * (3.0f - 2.0f * x);
  return spot_cosine > 0.0f ? x * std::max(0.0f, c) : x;
}

struct VplSet {
  std::vector<Vpl> lights;
  uint64_t light_paths = 0;  // that were started; 0 for a host's own lights
};

}  // namespace lumicut
