#include "lights/light_surfaces.h"

#include <cmath>
#include <numbers>

#include "lights/light_sampler.h"
#include "lights/light_vpls.h"

namespace lumicut {

namespace {
// By what rounding may take from it.
void widen(Aabb& box) {
  for (int k = 0; k < 3; ++k) {
    const float slack = 1e-6f * std::max(std::abs(box.lo[k]), std::abs(box.hi[k]));
    box.lo[k] -= slack, box.hi[k] += slack;
  }
}
}  // namespace

LightSurfaces::LightSurfaces(const Scene& scene, RaysOf rays) : scene_(scene), of_paths_(rays == RaysOf::paths) {
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
    if (has(l) && max_component(l.value) > 0.0f && area(l) > 0.0f) panels_.push_back(i);
  }
  panel_boxes_ = LightBoxes(boxes_of_panels()), lamp_boxes_ = LightBoxes(boxes_of_lamps());
}

std::vector<Aabb> LightSurfaces::boxes_of_panels() const {
  std::vector<Aabb> boxes;
  for (const uint32_t panel : panels_) {
    const Light& l = scene_.lights()[panel];
    Aabb& box = boxes.emplace_back();
    for (const auto& [a, b] : {Vec2f{-0.5f, -0.5f}, Vec2f{0.5f, -0.5f}, Vec2f{0.5f, 0.5f}, Vec2f{-0.5f, 0.5f}})
      box.extend(l.position + l.u * a + l.v * b);
    widen(box);
  }
  return boxes;
}

std::vector<Aabb> LightSurfaces::boxes_of_lamps() const {
  std::vector<Aabb> boxes;
  for (const uint32_t lamp : lamps_) {
    const Light& l = scene_.lights()[lamp];
    const Vec3f reach{l.radius, l.radius, l.radius};
    Aabb& box = boxes.emplace_back();
    box.extend(l.position - reach), box.extend(l.position + reach);
    widen(box);
  }
  return boxes;
}

float LightSurfaces::area(const Light& light) {
  return length(cross(light.u, light.v)) * (light.type == LightType::disk ? 0.25f * std::numbers::pi_v<float> : 1.0f);
}

bool LightSurfaces::meet_panel(uint32_t panel, const Vec3f& origin, const Vec3f& direction, float far, Hit& hit) const {
  const Light& l = scene_.lights()[panel];
  const float width = length(l.u), height = length(l.v);
  const Vec3f u = l.u * (1.0f / width), v = l.v * (1.0f / height), across = cross(u, v);
  const float skew = length(across);
  const Vec3f normal = across * (1.0f / skew);
  hit.cosine = -dot(normal, direction);
  if (!(hit.cosine > 0.0f)) return false;
  const Vec3f from_middle = origin - l.position;
  hit.t = dot(normal, from_middle) / hit.cosine;
  if (!(hit.t > 0.0f && hit.t < far)) return false;
  const Vec3f at = from_middle + direction * hit.t;
  const float x = dot(cross(at, v), normal) / (skew * width), y = dot(cross(u, at), normal) / (skew * height);
  if (l.type == LightType::disk ? x * x + y * y > 0.25f : std::max(std::abs(x), std::abs(y)) > 0.5f) return false;
  hit.light = panel, hit.by_rays = !l.reach.limited();
  hit.radiance = light_radiance(l, scene_.light_value(l, origin + direction * hit.t), hit.cosine);
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
