// Virtual point lights: the light's side of every many-lights method. [Keller 1997; thesis Eq. 1.1]
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/light_profile.h"
#include "scene/ray_kind.h"

namespace lumicut {

enum class VplKind : uint32_t { omni = 0, oriented = 1, directional = 2, spot = 3, sphere = 4, lobed = 5 };
inline constexpr int kVplKinds = 6;

// Whether it shines by the cosine to its normal.
inline constexpr bool faces_one_side(VplKind kind) {
  return kind == VplKind::oriented || kind == VplKind::sphere || kind == VplKind::lobed;
}

// A sphere is an oriented light spread over a ball. [Hašan et al. 2009: virtual spherical lights]
// A lobed light is an oriented one that shines by its surface's own diffuse lobe, which is not Lambert's: dimmer towards the
// horizon beneath gloss, brighter back to where its light comes from on rough surfaces. Made of oriented ones, within the
// library alone (off_surfaces).
struct Vpl {
  Vec3f position{};  // directional: unused
  VplKind kind = VplKind::omni;
  Vec3f normal{};  // unit; directional: the way light travels; spot: axis; omni: 0
  uint32_t group = 0;
  Rgb intensity{};              // W/sr along the normal; directional: irradiance W/m²; lobed: before its lobe
  float edge_or_radius = 0.0f;  // spot: cos_outer(); sphere: radius(); lobed: slope()
  float blend_cosine = 0.0f, spot_cosine = 0.0f;  // spot
  float spread_tan = 0.0f;  // spot: narrowed area lights fall off with max(0, 1 − spread_tan·tanθ)
  // Spot: id of a LightProfile [scene/light_profile.h] in place of the falloff above; then blend_cosine, spot_cosine and
  // spread_tan are the unit vector where its horizontal angle 0 lies, and intensity is that of its largest value.
  uint32_t profile = 0;
  // RayKind: of the rays that look for what stands before it. Bounced light comes with a ray that scattered at the point.
  uint32_t ray_mask = kShadowRay;
  // RayKind: lobes that it lights; and the set of meshes that do, 0: all. [scene/light.h: LightReach]
  uint32_t seen_by = kDiffuseRay | kGlossyRay, receivers = 0;
  // What a host may not know; found from where the light lies.
  float offset = 0.0f;  // how far shadow rays that start at it stand off its surface
  float cell = 0.0f;    // m² of surface that it stands for; 0: exactly its point, or distant
  float clamp2 = 0.0f;  // squared distance below which no point comes nearer
  // Spot: one place of a lamp with a radius. [lights/soft_lamp.h]
  Vec3f from_centre{};
  float lamp_radius = 0.0f;  // 0: a point
  // Lobed: its lobe, beside slope(). [bsdf/oren_nayar.h; bsdf/burley.h; bsdf/lambert.h]
  float again = 0.0f, retro = 0.0f, dim = 0.0f, falloff = 0.0f;
  uint32_t facing = 0;  // 1: its disk faces what it lights; else a sphere. (No bool: lights are compared by bytes.)
  LUMICUT_FIELDS(Vpl, position, kind, normal, group, intensity, edge_or_radius, blend_cosine, spot_cosine, spread_tan,
                 profile, ray_mask, seen_by, receivers, offset, cell, clamp2, from_centre, lamp_radius, again, retro,
                 dim, falloff, facing)

  // Spot: the cosine at which it has fallen to 0.
  float cos_outer() const { return edge_or_radius; }
  float& cos_outer() { return edge_or_radius; }
  // Sphere: above 0.
  float radius() const { return edge_or_radius; }
  float& radius() { return edge_or_radius; }
  Vec3f tangent() const { return {blend_cosine, spot_cosine, spread_tan}; }
  // Lobed: 0 to 1; and the unit direction that a mirror at its place would throw its light to.
  float slope() const { return edge_or_radius; }
  Vec3f mirror() const { return tangent(); }
  bool burley() const { return retro > 0.0f || dim > 0.0f; }
};

// What makes an oriented light a lobed one: its surface's diffuse lobe, for the light that comes to it.
struct DiffuseLobe {
  Vec3f mirror{};
  float slope = 0.0f, again = 0.0f, retro = 0.0f, dim = 0.0f, falloff = 0.0f;
  float mean = 1.0f;  // of the lobe over Lambert's: the oriented light has so many times the lobed one's intensity
  LUMICUT_FIELDS(DiffuseLobe, mirror, slope, again, retro, dim, falloff, mean)

  // Whether it is not Lambert's.
  bool any() const { return slope > 0.0f || retro > 0.0f || dim > 0.0f || falloff > 0.0f; }
};

// Where a light path met what reflects evenly, after gloss, a mirror or glass threw it there, and from where.
struct Glint {
  Vec3f position, from;
  float power;  // W, luminance
  LUMICUT_FIELDS(Glint, position, from, power)
};

struct VplSet {
  std::vector<Vpl> lights;
  uint64_t light_paths = 0;               // that were started; 0 where nothing is known of the lights
  uint64_t direct = 0;                    // the first so many shine by themselves; likewise 0
  uint64_t first_of_sky = 0, of_sky = 0;  // those of them that stand for the environment
  uint64_t extended = 0;                  // samples drawn on emitters with extent for those; some give no light
  LightProfiles profiles;                 // those that lights name
  std::vector<DiffuseLobe> lobes;         // of each light behind the direct ones, if any surface may have one
  std::vector<Glint> glints;              // of light paths, not divided by their number
  LUMICUT_FIELDS(VplSet, lights, light_paths, direct, first_of_sky, of_sky, extended, profiles, lobes, glints)
};

}  // namespace lumicut
