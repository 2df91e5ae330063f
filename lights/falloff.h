// How a virtual light's intensity falls with direction and distance. [docs/units.md]
#pragma once

#include <algorithm>
#include <cmath>

#include "lights/vpl.h"
#include "scene/light_profile.h"

namespace lumicut {

// Share of a spot's intensity at cosine `c` to its axis. The SIMD counterpart is in clustering/light_kernel-inl.h.
inline float spot_falloff(const Vpl& v, float c) {
  float x = v.blend_cosine > 0.0f ? (c - v.cos_outer()) / v.blend_cosine : (c > v.cos_outer() ? 1.0f : 0.0f);
  x = std::min(1.0f, std::max(0.0f, x));
  x = x * x * (3.0f - 2.0f * x);
  if (v.spot_cosine > 0.0f) x *= std::max(0.0f, c);
  if (v.spread_tan > 0.0f && x > 0.0f) {
    const float sine = std::sqrt(std::max(0.0f, 1.0f - c * c));
    x *= std::max(0.0f, 1.0f - v.spread_tan * sine / std::max(c, 1e-6f));
  }
  return x;
}

// The same of a spot with a profile, towards a unit direction; 0 where the profile is null.
float profile_share(const Vpl& v, const LightProfile* profile, const Vec3f& direction);

// What a light's falloff needs beside the light.
struct Falloff {
  // Of the lights' set; null: none of the lights has one.
  const LightProfiles* profiles = nullptr;

  Falloff() = default;
  explicit Falloff(const LightProfiles& p) : profiles(&p) {}
  const LightProfile* profile(const Vpl& v) const { return profiles != nullptr ? profiles->find(v.profile) : nullptr; }

  // Share of a spot's intensity towards a unit direction.
  float of_spot(const Vpl& v, const Vec3f& direction) const {
    return v.profile != 0 ? profile_share(v, profile(v), direction) : spot_falloff(v, dot(v.normal, direction));
  }
};

}  // namespace lumicut
