#include "render/nearby_lights.h"

#include "bsdf/point_bsdf.h"
#include "clustering/light_kernel.h"
#include "core/rng.h"
#include "core/sampling.h"
#include "lights/light_surfaces.h"

namespace lumicut {

namespace {

constexpr int64_t kMaxCells = 4096;  // of one light: larger ones are tried at every point

// Box of what emits.
Aabb bounds_of(const Light& l) {
  Aabb box;
  if (l.type == LightType::rectangle || l.type == LightType::disk) {
    for (int k = 0; k < 4; ++k)
      box.extend(l.position + l.u * (k % 2 == 0 ? -0.5f : 0.5f) + l.v * (k / 2 == 0 ? -0.5f : 0.5f));
  } else {
    const float r = l.type == LightType::point ? l.radius : 0.0f;
    box.extend(l.position - Vec3f{r, r, r});
    box.extend(l.position + Vec3f{r, r, r});
  }
  return box;
}

}  // namespace

NearbyLights::NearbyLights(const Scene& scene, const LightSampler& emitters, float distance, const Progress& progress)
    : scene_(scene), sampler_(emitters), distance_(distance) {
  for (uint32_t i = 0; i < scene.lights().size(); ++i) {
    if (i % 64 == 0) progress.check();  // thousands of cells each
    const Light& light = scene.lights()[i];
    if (light.type == LightType::sun || !(max_component(light.value) > 0.0f)) continue;
    const auto index = static_cast<uint32_t>(lamps_.size());
    lamps_.push_back(i);
    const Aabb box = bounds_of(light);
    const Vec3f reach{distance, distance, distance};
    const Vec3f cells = (box.hi - box.lo + reach * 2.0f) / distance;
    if (!((double{cells.x} + 1) * (double{cells.y} + 1) * (double{cells.z} + 1) <= static_cast<double>(kMaxCells))) {
      large_.push_back(index);
      continue;
    }
    const Cell lo = cell(box.lo - reach), hi = cell(box.hi + reach);
    for (int64_t z = lo.z; z <= hi.z; ++z)
      for (int64_t y = lo.y; y <= hi.y; ++y)
        for (int64_t x = lo.x; x <= hi.x; ++x) cells_[key({x, y, z})].push_back(index);
  }
}

NearbyLights::Cell NearbyLights::cell(const Vec3f& p) const {
  const Vec3f at = (p - (scene_.bounds().empty() ? Vec3f{} : scene_.bounds().lo)) / distance_;
  const auto floor = [](float v) { return static_cast<int64_t>(std::floor(std::clamp(v, -1e9f, 1e9f))); };
  return {floor(at.x), floor(at.y), floor(at.z)};
}

// Cells that share a key only cost time: every light is measured again at the point.
uint64_t NearbyLights::key(const Cell& c) {
  return hash64(hash64(static_cast<uint64_t>(c.x), static_cast<uint64_t>(c.y)), static_cast<uint64_t>(c.z));
}

Rgb NearbyLights::lost_light(uint32_t lamp, const Vpl& vpl, const SurfacePoint& point) const {
  const float d2 = length2(vpl.position - point.position), c2 = distance_ * distance_;
  if (!(d2 < c2)) return {};
  Rgb lost = light_point(vpl, vpl.intensity, {0.0f, scene_.profiles()}, point) * (1.0f - d2 / c2);
  const Light& light = scene_.lights()[lamp];
  if (LightSurfaces::has(light) && max_component(lost) > 0.0f) {
    const Vec3f to_light = normalize(vpl.position - point.position);
    const double cosine = std::max(1e-9f, -dot(vpl.normal, to_light));
    lost = lost * power_heuristic(d2 / (cosine * LightSurfaces::area(light)), PointBsdf(point).pdf(to_light));
  }
  return lost;
}

}  // namespace lumicut
