#include "lights/light_surfaces.h"

#include <numbers>

#include "lights/light_sampler.h"

namespace lumicut {

LightSurfaces::LightSurfaces(const Scene& scene) : scene_(scene) {
  bool disks = false;
  for (uint32_t i = 0; i < scene.lights().size(); ++i) {
    const Light& l = scene.lights()[i];
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
bool LightSurfaces::passes(uint32_t, uint32_t prim, float u, float v) const {
  if (scene_.lights()[lights_[prim / 2]].type != LightType::disk) return false;
  // From the corner (-1/2, -1/2) to its two followers.
  const float x = prim % 2 == 0 ? u + v : u, y = prim % 2 == 0 ? v : u + v;
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
  hit.cosine = -dot(normalize(cross(light.u, light.v)), direction);
  hit.radiance = hit.cosine > 0.0f ? light_radiance(light, hit.cosine) : Rgb{};
  return true;
}

}  // namespace lumicut
