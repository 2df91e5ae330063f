#include "render/nearby_lights.h"

#include "bsdf/point_bsdf.h"
#include "clustering/light_kernel.h"
#include "core/sampling.h"
#include "lights/light_reach.h"
#include "scene/rng_at_point.h"

namespace lumicut {

// Shadow rays that wait to be traced, and what they bring.
struct NearbyLights::Waiting {
  std::vector<Ray> shadows;
  std::vector<Rgb> light;
  std::vector<uint32_t> pixel, group;
};

// What the samples of one point bring of a group is one entry.
void NearbyLights::trace_shadows(Waiting& waiting, TracedPoints& hits, Counters& counters) const {
  scene_.accel().occluded(waiting.shadows);
  counters.rays += waiting.shadows.size();
  for (size_t i = 0; i < waiting.shadows.size(); ++i) {
    if (waiting.shadows[i].tfar < 0.0f) continue;
    if (!hits.light.empty() && hits.pixel.back() == waiting.pixel[i] && hits.group.back() == waiting.group[i])
      hits.light.back() += waiting.light[i];
    else
      hits.add(waiting.light[i], waiting.pixel[i], waiting.group[i]);
  }
  waiting.shadows.clear(), waiting.light.clear(), waiting.pixel.clear(), waiting.group.clear();
}

void NearbyLights::trace(const ShadePoints& points, const Options& options, const Progress& progress,
                         TracedPoints& hits, Counters& counters) const {
  constexpr size_t kPart = 4096;  // rays
  Waiting waiting;
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    if (!near_.near(points.position_at(i))) continue;
    const SurfacePoint point = points.get(i);
    const PointBsdf bsdf(point);
    if (bsdf.black()) continue;
    Rng rng = rng_at_point(scene_, point, hash64(seed_, options.level), Stage::nearby_lights);
    const float shift_u = rng.next_float(), shift_v = rng.next_float();
    for (uint32_t k = 0; k < kSamples; ++k) {
      const float choice = (static_cast<float>(k) + rng.next_float()) / kSamples;
      // Even for any number of samples. [Roberts 2018: R2]
      const float u = shift_u + static_cast<float>(k) * 0.75487767f, v = shift_v + static_cast<float>(k) * 0.5698403f;
      const auto s =
          near_.sample(point.position, std::min(choice, 0x1.fffffep-1f), u - std::floor(u), v - std::floor(v));
      if (!s) continue;
      Rgb light = light_point_limited(s->vpl, s->vpl.intensity * (1.0f / kSamples), {}, point);
      if (!(max_component(light) > 0.0f) || !is_finite(light)) continue;
      const Vec3f to_light = s->vpl.position - point.position;
      if (options.rays && s->found_by_rays)
        light *= power_heuristic(kSamples * s->density, bsdf.pdf(normalize(to_light)));
      Ray ray;  // ends before a mesh, which blocks
      ray.org = point.position, ray.dir = to_light + s->vpl.normal * s->offset;
      ray.tnear = 0.0f, ray.tfar = 1.0f, ray.mask = s->vpl.ray_mask;
      waiting.shadows.push_back(ray), waiting.light.push_back(light);
      waiting.pixel.push_back(options.by_point ? static_cast<uint32_t>(i) : point.pixel);
      waiting.group.push_back(s->vpl.group);
    }
    if (waiting.shadows.size() >= kPart) {
      progress.check();
      trace_shadows(waiting, hits, counters);
    }
  }
  trace_shadows(waiting, hits, counters);
}

float NearbyLights::light_share(const Vec3f& origin, uint32_t light, float distance, float pdf) const {
  const NearLights::Found f = near_.find_light(origin, light, distance);
  return f.lost > 0.0f ? f.lost * power_heuristic(pdf, kSamples * f.density) : 0.0f;
}

float NearbyLights::triangle_share(const Vec3f& origin, const Hit& hit, float distance, float pdf) const {
  if (mesh_light(scene_.meshes()[hit.geom]) == MeshLight::by_samples) return 0.0f;
  const NearLights::Found f = near_.find_triangle(origin, hit.geom, hit.prim, scene_.instance_of(hit), distance);
  return f.lost > 0.0f ? f.lost * power_heuristic(pdf, kSamples * f.density) : 0.0f;
}

}  // namespace lumicut
