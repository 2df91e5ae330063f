#include "render/clamp_compensation.h"

#include "bsdf/point_bsdf.h"
#include "scene/rng_at_point.h"

namespace lumicut {

struct ClampCompensation::Search {
  std::vector<RayHit> rays;
  std::vector<Rgb> weights;
  std::vector<uint32_t> pixels;
  std::vector<Rng> rngs;
  std::vector<float> pdfs;
  std::vector<ChainRay> chains;
  mutable BallQueryTree::Scratch scratch;
};

ClampCompensation::ClampCompensation(const Scene& scene, const Clamp& clamp, const NearbyLights* nearby, bool spheres,
                                     uint64_t seed)
    : scene_(scene), clamp_(clamp), nearby_(nearby), spheres_(spheres), seed_(seed), light_surfaces_(scene) {}

float ClampCompensation::lost_at(const Search& search, const Vec3f& position, float distance) const {
  const float clamp2 = clamp_.at2(position, search.scratch);
  return clamp2 > 0.0f ? std::max(0.0f, 1.0f - distance * distance / clamp2) : 0.0f;
}

void ClampCompensation::find_lights(const Search& search, size_t ray, TracedPoints& hits) const {
  const RayHit& r = search.rays[ray];
  light_surfaces_.for_each_hit(r.ray.org, r.ray.dir, r.ray.tfar, [&](const LightSurfaces::Hit& seen) {
    const float share = nearby_ != nullptr ? nearby_->light_share(r.ray.org, seen.light, seen.t, search.pdfs[ray])
                                           : lost_at(search, r.ray.org + r.ray.dir * seen.t, seen.t);
    if (share > 0.0f)
      hits.add(search.weights[ray] * seen.radiance * share, search.pixels[ray], scene_.lights()[seen.light].group);
  });
}

void ClampCompensation::find_surface(Search& search, size_t ray, TracedPoints& hits) const {
  const RayHit& r = search.rays[ray];
  const SurfaceInteraction at = scene_.interaction(r, search.pixels[ray]);
  // A ray that meets its own surface at once left it below the horizon of the triangle.
  if (at.t < 4.0f * at.offset) return;
  const Rgb& weight = search.weights[ray];
  if (max_component(at.emitted) > 0.0f) {
    const float share = nearby_ != nullptr ? nearby_->triangle_share(r.ray.org, r, search.pdfs[ray])
                                           : lost_at(search, at.position, at.t);
    if (share > 0.0f) hits.add(at.emitted * weight * share, search.pixels[ray], scene_.meshes()[at.mesh].group);
  }
  // Mirrors and glass show it what is behind them: no virtual light shines by way of those.
  Rng& rng = search.rngs[ray];
  if (auto next = start_chain(at.bsdf, weight, search.pixels[ray], rng)) search.chains.push_back(*next);
  if (at.bsdf.layers().empty()) return;
  // Spheres stand for all that is reflected evenly.
  const float lost = spheres_ ? 0.0f : lost_at(search, at.position, at.t);
  for (SurfacePoint point : at.bsdf.layers()) {
    point.diffuse = point.diffuse * lost;
    // Chance decides by what the surface still shows, so that few points cost a whole sum of lights.
    const float survive = std::min(1.0f, max_component(PointBsdf(point).albedo() * weight));
    if (!(rng.next_float() < survive)) continue;
    point.attenuate(weight / survive);
    hits.found.push_back(point);
  }
}

void ClampCompensation::trace(const ShadePoints& points, uint32_t level, const Progress& progress, TracedPoints& hits,
                              Counters& counters) const {
  Search search;
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    const SurfacePoint point = points.get(i);
    Rng rng = rng_at_point(scene_, point, hash64(seed_, level), Stage::eye_ray);
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    const auto s = PointBsdf(point).sample(choice, u, v);
    if (!s || !is_finite(s->weight)) continue;
    RayHit ray;
    ray.ray.org = point.position, ray.ray.dir = s->direction;
    search.rays.push_back(ray), search.weights.push_back(s->weight), search.pixels.push_back(point.pixel);
    search.rngs.push_back(rng), search.pdfs.push_back(s->pdf);
  }
  trace_in_parts(std::span(search.rays), progress, [&](std::span<RayHit> part) { scene_.accel().intersect(part); });
  counters.rays += search.rays.size();
  for (size_t i = 0; i < search.rays.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    if (!light_surfaces_.empty()) find_lights(search, i, hits);
    if (search.rays[i].hit.geom != kNoId) find_surface(search, i, hits);
  }
  follow_chains(scene_, light_surfaces_, std::move(search.chains), progress, hits, counters);
}

}  // namespace lumicut
