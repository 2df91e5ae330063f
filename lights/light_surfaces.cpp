#include "lights/light_surfaces.h"

#include <cmath>
#include <numbers>

#include "lights/light_sampler.h"
#include "lights/light_vpls.h"

namespace lumicut {

LightSurfaces::LightSurfaces(const Scene& scene, RaysOf rays) : scene_(scene), of_paths_(rays == RaysOf::paths) {
  bool disks = false;
  for (uint32_t i = 0; i < scene.lights().size(); ++i) {
    const Light& l = scene.lights()[i];
    const bool seen = l.reach.lights(kCameraRay);
    if (rays == RaysOf::camera && !seen) continue;
    if (l.radius > 0.0f && max_component(l.value) > 0.0f) {
      const bool shown = rays != RaysOf::camera && l.reach.lights(kGlossyRay | kTransmissionRay);
      if ((seen || shown) && (l.type == LightType::point || l.type == LightType::spot) && l.profile == 0)
        lamps_.push_back(i);
      if (shown && l.type == LightType::sun) suns_.push_back(i);
    }
    if (!has(l) || !(max_component(l.value) > 0.0f) || !(area(l) > 0.0f)) continue;
    const auto base = static_cast<uint32_t>(positions_.size());
    lights_.push_back(i);
    disks = disks || l.type == LightType::disk;
    for (const auto& [a, b] : {Vec2f{-0.5f, -0.5f}, Vec2f{0.5f, -0.5f}, Vec2f{0.5f, 0.5f}, Vec2f{-0.5f, 0.5f}})
      positions_.push_back(l.position + l.u * a + l.v * b);
    indices_.insert(indices_.end(), {base, base + 1, base + 2, base, base + 2, base + 3});
  }
  if (lights_.empty()) return;
  AccelGeometry geometry;
  geometry.filter = this;
  geometry.meshes.push_back(
      {positions_.data(), positions_.size(), indices_.data(), indices_.size() / 3, 0xffffffffu, disks});
  accel_ = make_accel(kDefaultAccel, geometry, {true, ""});
}

float LightSurfaces::area(const Light& light) {
  return length(cross(light.u, light.v)) * (light.type == LightType::disk ? 0.25f * std::numbers::pi_v<float> : 1.0f);
}

// The corners of a disk's parallelogram let rays through.
bool LightSurfaces::passes(const CandidateHit& hit) const {
  if (scene_.lights()[lights_[hit.prim / 2]].type != LightType::disk) return false;
  // From the corner (-1/2, -1/2) to its two followers.
  const float across = hit.u + hit.v;
  const float x = hit.prim % 2 == 0 ? across : hit.u, y = hit.prim % 2 == 0 ? hit.v : across;
  return (x - 0.5f) * (x - 0.5f) + (y - 0.5f) * (y - 0.5f) > 0.25f;
}

bool LightSurfaces::next(const Vec3f& origin, const Vec3f& direction, float& near, float far, Hit& hit) const {
  RayHit ray;
  ray.ray.org = origin, ray.ray.dir = direction, ray.ray.tnear = near, ray.ray.tfar = far;
  accel_->intersect({&ray, 1});
  if (ray.hit.geom == kNoId) return false;
  hit.light = lights_[ray.hit.prim / 2];
  hit.t = ray.ray.tfar;
  near = hit.t * (1.0f + 1e-5f) + 1e-12f;
  const Light& light = scene_.lights()[hit.light];
  hit.by_rays = !light.reach.limited();
  hit.cosine = -dot(normalize(cross(light.u, light.v)), direction);
  hit.radiance = hit.cosine > 0.0f
                     ? light_radiance(light, scene_.light_value(light, origin + direction * hit.t), hit.cosine)
                     : Rgb{};
  return true;
}

// A sphere, or a disk that faces the ray's origin; even over its projected area, as what it lights has it.
bool LightSurfaces::meet_lamp(uint32_t lamp, const Vec3f& origin, const Vec3f& direction, float far, Hit& hit) const {
  const Light& l = scene_.lights()[lamp];
  const Vec3f to_centre = l.position - origin;
  const float along = dot(to_centre, direction), d2 = length2(to_centre), r2 = l.radius * l.radius;
  if (!(along > 0.0f) || !(d2 > r2)) return false;
  if (l.facing) {
    hit.t = d2 / along;
    if (!(length2(direction * hit.t - to_centre) < r2)) return false;
  } else {
    const float away2 = length2(to_centre - direction * along);
    if (!(away2 < r2)) return false;
    hit.t = along - std::sqrt(r2 - away2);
  }
  if (!(hit.t < far)) return false;
  const Vpl emits = soft_lamp(l, {});
  const float falloff = l.type == LightType::spot ? spot_falloff(emits, -dot(l.direction, direction)) : 1.0f;
  hit.light = lamp, hit.cosine = 1.0f, hit.by_rays = false;
  hit.radiance = l.value * (falloff * share_of(r2 / d2) * std::numbers::inv_pi_v<float> / r2);
  return true;
}

// Even over the cone that it is sampled in.
bool LightSurfaces::meet_sun(uint32_t sun, const Vec3f& direction, Hit& hit) const {
  const Light& l = scene_.lights()[sun];
  if (!(dot(direction, -l.direction) > std::cos(l.radius))) return false;
  const float half = std::sin(0.5f * l.radius);
  hit.light = sun, hit.t = std::numeric_limits<float>::infinity(), hit.cosine = 1.0f, hit.by_rays = false;
  hit.radiance = l.value * (share_of(4.0f * half * half) / (4.0f * std::numbers::pi_v<float> * half * half));
  return true;
}

}  // namespace lumicut
