// Lights. They are not seen by the camera and block nothing; an emissive mesh is and does.
#pragma once

#include <cstdint>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/ray_kind.h"

namespace lumicut {

enum class LightType : uint32_t { point = 0, spot = 1, rectangle = 2, disk = 3, sun = 4 };

// What an emitter lights, and what stands before it.
struct LightReach {
  uint32_t seen_by = kDiffuseRay | kGlossyRay | kTransmissionRay;  // RayKind: lobes that it lights, rays that see it
  uint32_t receivers = 0, blockers = 0;                            // sets [scene/ray_kind.h]; 0: all
  LUMICUT_FIELDS(LightReach, seen_by, receivers, blockers)
  bool lights(uint32_t kind) const { return (seen_by & kind) != 0; }
  // Not all lobes and surfaces see it alike: samples alone stand for it, and no ray from a point that they are drawn at.
  bool limited() const {
    constexpr uint32_t kAny = kDiffuseRay | kGlossyRay | kTransmissionRay;
    return (seen_by & kAny) != kAny || receivers != 0 || blockers != 0;
  }
};

// Radiometric values inside: what the host gave in watt is converted once. [docs/units.md]
struct Light {
  LightType type = LightType::point;
  uint32_t group = 0;
  Rgb value{};  // intensity W/sr (point, spot: on the axis), radiance W/(sr·m²) (rectangle, disk), irradiance W/m²
                // (sun)
  Vec3f position{};
  float radius = 0.0f;        // point, spot: emitting sphere or disk; sun: angular radius, radians
  Vec3f direction{0, 0, -1};  // unit; spot: axis; sun: the way light travels
  float cos_outer = 0.0f;     // spot: cosine of half the opening angle
  float blend_cosine = 0.0f;  // spot: smoothstep over this much of cosine; 0: sharp
  bool spot_cosine = false;
  Vec3f u{}, v{};              // rectangle: whole edges; disk: whole axes; emits towards u×v
  float spread = 3.14159265f;  // rectangle, disk: opening angle; π: Lambertian
  uint32_t profile = 0;  // point: id of a LightProfile [scene/light_profile.h] about `direction`, `value` its largest
  Vec3f tangent{};       // profile: unit, where its horizontal angle 0 lies; orthogonal to `direction`
  bool facing = false;   // point, spot: its disk faces what it lights; else a sphere
  bool shadows = true;   // false: nothing stands before it
  LightReach reach;
  int32_t texture = -1;  // rectangle, disk: an image over it, which multiplies value
  LUMICUT_FIELDS(Light, type, group, value, position, radius, direction, cos_outer, blend_cosine, spot_cosine, u, v,
                 spread, profile, tangent, facing, shadows, reach, texture)
};

struct Environment {
  Rgb color{};
  int32_t texture = -1;
  uint32_t group = 0;
  float world_to_map[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  bool hidden = false;  // from camera rays alone
  LightReach reach;     // its seen_by alone
  LUMICUT_FIELDS(Environment, color, texture, group, world_to_map, hidden, reach)
  bool black() const { return !(max_component(color) > 0.0f); }
};

}  // namespace lumicut
