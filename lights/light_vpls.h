// Lights as virtual lights: how each kind emits. Shared by the files of LightSampler.
#pragma once

#include <cmath>
#include <numbers>

#include "lights/falloff.h"
#include "lights/vpl.h"
#include "scene/light.h"
#include "scene/mesh.h"

namespace lumicut {

// Area lights of spread s emit Lambert times N·max(0, 1 − tanθ·tan a), a = (π−s)/2, whose flux stays that of Lambert.
// [Cycles; docs/units.md]
inline Vpl spread_profile(const Light& light) {
  Vpl v;
  v.kind = VplKind::spot, v.spot_cosine = 1.0f;
  const float a = 0.5f * (std::numbers::pi_v<float> - light.spread);
  v.spread_tan = std::tan(a);
  v.intensity = Rgb{1, 1, 1} * (2.0f / (2.0f + (2.0f * a - std::numbers::pi_v<float>)*v.spread_tan));
  return v;
}
inline bool narrowed(const Light& light) {
  return (light.type == LightType::rectangle || light.type == LightType::disk) &&
         light.spread < std::numbers::pi_v<float> - 1e-4f;
}

inline constexpr uint32_t kShadedLobes = kDiffuseRay | kGlossyRay;  // that virtual lights light
inline void set_reach(Vpl& v, const Light& l) {
  v.ray_mask = l.shadows ? blocker_ray(l.reach.blockers) : 0u;
  v.seen_by = l.reach.seen_by & kShadedLobes, v.receivers = l.reach.receivers;
}
inline void set_reach(Vpl& v, const Mesh& m) { v.ray_mask = blocker_ray(m.blockers), v.receivers = m.receivers; }
inline void set_reach(Vpl& v, const Environment& e) { v.seen_by = e.reach.seen_by & kShadedLobes; }

inline Vpl spot_of(const Light& l) {
  Vpl v;
  set_reach(v, l);
  v.kind = VplKind::spot, v.position = l.position, v.normal = l.direction, v.intensity = l.value, v.group = l.group;
  v.cos_outer() = l.cos_outer, v.blend_cosine = l.blend_cosine, v.spot_cosine = l.spot_cosine ? 1.0f : 0.0f;
  return v;
}

// A place, in units of its radius, of a lamp that has one. A point lamp is a spot that is open all around.
inline Vpl soft_lamp(const Light& l, const Vec3f& place) {
  Vpl v = spot_of(l);
  if (l.type == LightType::point) v.cos_outer() = -1.0f, v.blend_cosine = v.spot_cosine = 0.0f;
  v.from_centre = place * l.radius, v.position += v.from_centre;
  v.lamp_radius = l.radius, v.facing = l.facing;
  return v;
}

// A point light with a measured profile.
inline Vpl profiled(const Light& l, const LightProfile& profile) {
  Vpl v;
  set_reach(v, l);
  v.kind = VplKind::spot, v.position = l.position, v.normal = l.direction, v.intensity = l.value, v.group = l.group;
  v.profile = l.profile, v.cos_outer() = profile.cos_outer();
  v.blend_cosine = l.tangent.x, v.spot_cosine = l.tangent.y, v.spread_tan = l.tangent.z;
  return v;
}

}  // namespace lumicut
