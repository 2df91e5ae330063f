// Virtual point lights: the light's side of every many-lights method. [Keller 1997; thesis Eq. 1.1]
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

enum class VplKind : uint32_t { omni = 0, oriented = 1, directional = 2, spot = 3, sphere = 4 };
inline constexpr int kVplKinds = 5;

// Layout of lumicut_vpl in lumicut.h (64 bytes). A sphere is an oriented light spread over a ball. [Hašan et al. 2009:
// virtual spherical lights]
struct Vpl {
  Vec3f position{};  // directional: unused
  VplKind kind = VplKind::omni;
  Vec3f normal{};  // unit; directional: the way light travels; spot: axis; omni: 0
  uint32_t group = 0;
  Rgb intensity{};                                // W/sr along the normal; directional: irradiance W/m²
  float edge_or_radius = 0.0f;                    // spot: cos_outer(); sphere: radius()
  float blend_cosine = 0.0f, spot_cosine = 0.0f;  // spot
  float spread_tan = 0.0f;  // spot: narrowed area lamps fall off with max(0, 1 − spread_tan·tanθ)
  // Spot: id of a LightProfile [lights/light_profile.h] in place of the falloff above; then blend_cosine, spot_cosine and
  // spread_tan are the unit vector where its horizontal angle 0 lies, and intensity is that of its largest value.
  uint32_t profile = 0;
  LUMICUT_FIELDS(Vpl, position, kind, normal, group, intensity, edge_or_radius, blend_cosine, spot_cosine, spread_tan,
                 profile)

  // Spot: the cosine at which it has fallen to 0.
  float cos_outer() const { return edge_or_radius; }
  float& cos_outer() { return edge_or_radius; }
  // Sphere: above 0.
  float radius() const { return edge_or_radius; }
  float& radius() { return edge_or_radius; }
  Vec3f tangent() const { return {blend_cosine, spot_cosine, spread_tan}; }
};
static_assert(sizeof(Vpl) == 64);

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

// The same of a spot with a profile, towards a unit direction.
float profile_share(const Vpl& v, const Vec3f& direction);

inline float spot_profile(const Vpl& v, const Vec3f& direction) {
  return v.profile != 0 ? profile_share(v, direction) : spot_falloff(v, dot(v.normal, direction));
}

struct VplSet {
  std::vector<Vpl> lights;
  uint64_t light_paths = 0;  // that were started; 0 for a host's own lights
  LUMICUT_FIELDS(VplSet, lights, light_paths)
};

}  // namespace lumicut
