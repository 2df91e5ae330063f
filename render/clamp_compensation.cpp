#include "render/clamp_compensation.h"

#include "clustering/light_kernel.h"
#include "core/sampling.h"
#include "scene/rng_at_point.h"

namespace lumicut {

ClampCompensation::ClampCompensation(const Scene& scene, float distance, bool spheres, uint64_t seed,
                                     const Progress& progress)
    : scene_(scene),
      distance_(distance),
      spheres_(spheres),
      seed_(seed),
      sampler_(scene, &progress),
      lamps_(scene, sampler_, distance, progress),
      light_surfaces_(scene) {}

void ClampCompensation::nearby_lights(const SurfacePoint& point, Rng& rng, std::vector<Ray>& shadows,
                                      TracedPoints& hits) const {
  lamps_.for_each_share(point, rng, [&](const Vpl& vpl, const Rgb& lost) {
    Ray ray;
    ray.org = point.position, ray.dir = vpl.position - point.position;
    ray.tnear = 0.0f, ray.tfar = 1.0f;
    shadows.push_back(ray), hits.add(lost, point.pixel, vpl.group);
  });
}

// By power over all meshes: where few emit, most samples hit a near one; where many do, the rays find them.
void ClampCompensation::near_mesh(const SurfacePoint& point, Rng& rng, std::vector<Ray>& shadows,
                                  TracedPoints& hits) const {
  const DirectSample s = sampler_.sample_light(rng);
  if (!s.on_mesh) return;
  const Vec3f v = s.vpl.position - point.position;
  const float d2 = length2(v), c2 = distance_ * distance_;
  if (!(d2 < c2)) return;
  const Rgb lost = light_point(s.vpl, s.vpl.intensity, {0.0f, scene_.profiles()}, point) * (1.0f - d2 / c2);
  if (!(max_component(lost) > 0.0f) || !is_finite(lost)) return;
  const Vec3f to_light = normalize(v);
  const double cosine = std::max(1e-9f, -dot(s.vpl.normal, to_light));
  Ray ray;  // ends before the mesh, which blocks
  ray.org = point.position, ray.dir = v + s.vpl.normal * scene_.epsilon();
  ray.tnear = 0.0f, ray.tfar = 1.0f;
  shadows.push_back(ray);
  hits.add(lost * power_heuristic(s.density * d2 / cosine, PointBsdf(point).pdf(to_light)), point.pixel, s.vpl.group);
}

TracedPoints ClampCompensation::trace(const ShadePoints& points, uint32_t level, const Progress& progress,
                                      Counters& counters) const {
  TracedPoints hits;
  std::vector<RayHit> rays;
  std::vector<Rgb> weights;
  std::vector<uint32_t> pixels;
  std::vector<Rng> rngs;
  std::vector<float> pdfs;
  std::vector<Ray> shadows;
  std::vector<ChainRay> chains;
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    const SurfacePoint point = points.get(i);
    Rng rng = rng_at_point(scene_, point, hash64(seed_, level), Stage::eye_ray);
    if (!lamps_.empty()) nearby_lights(point, rng, shadows, hits);
    if (sampler_.has_meshes()) near_mesh(point, rng, shadows, hits);
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    const auto s = PointBsdf(point).sample(choice, u, v);
    if (!s || !is_finite(s->weight)) continue;
    RayHit ray;
    ray.ray.org = point.position, ray.ray.dir = s->direction;
    rays.push_back(ray), weights.push_back(s->weight), pixels.push_back(point.pixel), rngs.push_back(rng),
        pdfs.push_back(s->pdf);
  }
  if (!shadows.empty()) {
    trace_in_parts(std::span(shadows), progress, [&](std::span<Ray> part) { scene_.accel().occluded(part); });
    for (size_t i = 0; i < shadows.size(); ++i)
      if (shadows[i].tfar < 0.0f) hits.light[i] = {};
  }
  trace_in_parts(std::span(rays), progress, [&](std::span<RayHit> part) { scene_.accel().intersect(part); });
  counters.rays += shadows.size() + rays.size();
  for (size_t i = 0; i < rays.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    if (!light_surfaces_.empty())
      light_surfaces_.for_each_hit(
          rays[i].ray.org, rays[i].ray.dir, std::min(rays[i].ray.tfar, distance_), [&](const LightSurfaces::Hit& lamp) {
            const float share = lamp.t / distance_;
            const double density = double{lamp.t} * lamp.t / (double{lamp.cosine} * lamp.area);
            hits.add(weights[i] * lamp.radiance * ((1.0f - share * share) * power_heuristic(pdfs[i], density)),
                     pixels[i], scene_.lights()[lamp.lamp].group);
          });
    // A ray that meets its own surface at once left it below the horizon of the triangle.
    if (rays[i].hit.geom == kNoId || rays[i].ray.tfar < 4.0f * scene_.epsilon()) continue;
    const SurfaceInteraction at = scene_.interaction(rays[i], pixels[i]);
    const float share = rays[i].ray.tfar / distance_, lost = std::max(0.0f, 1.0f - share * share);
    if (lost > 0.0f) {
      if (max_component(at.emitted) > 0.0f) {
        const double cosine = std::max(1e-9f, std::abs(dot(at.geometric_normal, at.to_viewer)));
        const double density = sampler_.mesh_density(at) * double{at.t} * at.t / cosine;
        hits.add(at.emitted * weights[i] * (lost * power_heuristic(pdfs[i], density)), pixels[i],
                 scene_.meshes()[at.mesh].group);
      }
    }
    // Mirrors and glass show it what is behind them: no virtual light shines by way of those.
    if (auto ray = start_chain(at.bsdf, weights[i], pixels[i], rngs[i])) chains.push_back(*ray);
    for (SurfacePoint point : at.bsdf.layers()) {
      // Spheres stand for all that is reflected evenly.
      point.diffuse = point.diffuse * (spheres_ ? 0.0f : lost);
      // Chance decides by what the surface still shows, so that few points cost a whole sum of lights.
      const Rgb shown = PointBsdf(point).albedo() * weights[i];
      const float survive = std::min(1.0f, max_component(shown));
      if (!(rngs[i].next_float() < survive)) continue;
      point.attenuate(weights[i] / survive);
      hits.found.push_back(point);
    }
  }
  follow_chains(scene_, light_surfaces_, std::move(chains), progress, hits, counters);
  return hits;
}

}  // namespace lumicut
