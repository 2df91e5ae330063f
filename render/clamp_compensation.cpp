#include "render/clamp_compensation.h"

#include <utility>

#include "bsdf/point_bsdf.h"
#include "bsdf/straight_glass.h"
#include "core/even_sequence.h"
#include "render/traced_gloss.h"
#include "scene/rng_at_point.h"

namespace lumicut {

struct ClampCompensation::Search {
  // What a ray carries from the point that it left; the ray itself may have come straight through glass.
  struct Carried {
    Rgb weight{};
    uint32_t pixel = 0;
    Rng rng;
    float pdf = 0.0f;
    Vec3f from{};
    float travelled = 0.0f;  // from there to the ray's origin
    Rgb absorption{};        // on the ray's way, for each unit of length
    uint32_t passages = 0;
    Rgb gloss{};          // the part of `weight` that virtual lights of bounced light and of the sky leave to it
    float share = 1.0f;   // of what it brings, that counts: its point has several
    float spared = 1.0f;  // by so much more chance keeps what it finds than by `weight`
  };
  std::vector<RayHit> rays;
  std::vector<Carried> carried;
  std::vector<RayHit> next_rays;  // straight on
  std::vector<Carried> next_carried;
  std::vector<ChainRay> chains;
  mutable BallQueryTree::Scratch scratch;
};

ClampCompensation::ClampCompensation(const Scene& scene, const Clamp& clamp, const NearbyLights* nearby, bool spheres,
                                     bool trace_gloss, const EvenSky* sky, const GlintGuide* glints, bool direct,
                                     uint64_t seed)
    : scene_(scene),
      clamp_(clamp),
      nearby_(nearby),
      spheres_(spheres),
      trace_gloss_(trace_gloss),
      sky_(sky),
      glints_(glints),
      direct_(direct),
      seed_(seed),
      light_surfaces_(scene, LightSurfaces::RaysOf::paths) {}

float ClampCompensation::lost_at(const Search& search, const Vec3f& position, float distance) const {
  const float clamp2 = clamp_.at2(position, search.scratch);
  return clamp2 > 0.0f ? std::max(0.0f, 1.0f - distance * distance / clamp2) : 0.0f;
}

void ClampCompensation::find_lights(const Search& search, size_t ray, TracedPoints& hits) const {
  const RayHit& r = search.rays[ray];
  const Search::Carried& c = search.carried[ray];
  light_surfaces_.for_each_panel(r.ray.org, r.ray.dir, r.ray.tfar, [&](const LightSurfaces::Hit& seen) {
    if (!seen.by_rays) return;
    const float distance = c.travelled + seen.t;
    const float share = nearby_ != nullptr ? nearby_->light_share(c.from, seen.light, distance, c.pdf)
                                           : lost_at(search, r.ray.org + r.ray.dir * seen.t, distance);
    if (share > 0.0f)
      hits.add(c.weight * seen.radiance * (share * c.share), c.pixel, scene_.lights()[seen.light].group);
  });
}

void ClampCompensation::find_sky(const Search& search, size_t ray, TracedPoints& hits) const {
  const Search::Carried& c = search.carried[ray];
  const Vec3f& direction = search.rays[ray].ray.dir;
  if (!(max_component(c.gloss) > 0.0f) || !sky_->has(direction)) return;
  hits.add(c.weight * c.gloss * scene_.environment_radiance(direction) * c.share, c.pixel, scene_.environment().group);
}

void ClampCompensation::find_surface(Search& search, size_t ray, TracedPoints& hits) const {
  const RayHit& r = search.rays[ray];
  Search::Carried& c = search.carried[ray];
  const SurfaceInteraction at = scene_.interaction(r, c.pixel);
  // A ray that meets its own surface at once left it below the horizon of the triangle.
  if (c.passages == 0 && at.t < 4.0f * at.offset) return;
  const Rgb weight = c.weight * at.bsdf.transmittance_to(at.t, c.absorption);
  const float distance = c.travelled + at.t;
  if (max_component(at.emitted) > 0.0f) {
    const float share = mesh_light(scene_.meshes()[at.mesh]) == MeshLight::by_rays ? 1.0f
                        : nearby_ != nullptr ? nearby_->triangle_share(c.from, r.hit, distance, c.pdf)
                                             : lost_at(search, at.position, distance);
    if (share > 0.0f) hits.add(at.emitted * weight * (share * c.share), c.pixel, scene_.meshes()[at.mesh].group);
  }
  // Mirrors and glass show it what is behind them: no virtual light shines by way of those, except straight on.
  if (auto next = start_chain(at.bsdf, weight, c.pixel, c.rng,
                              {c.passages, Passage::straight, r.ray.mask, c.absorption, 0, c.share})) {
    if (!next->straight) {
      if (!direct_) search.chains.push_back(*next);
    } else if (c.passages < kMostStraight) {
      RayHit& on = search.next_rays.emplace_back();
      on.ray.org = next->origin, on.ray.dir = next->direction, on.ray.mask = next->state.kind;
      search.next_carried.push_back({next->throughput, c.pixel, next->rng, c.pdf, c.from, distance,
                                     next->state.absorption, c.passages + 1, c.gloss, c.share, c.spared});
    }
  }
  if (direct_ || at.bsdf.layers().empty()) return;
  Rng& rng = c.rng;
  // Spheres stand for all that is reflected evenly.
  const float lost = spheres_ ? 0.0f : lost_at(search, at.position, distance);
  for (SurfacePoint point : at.bsdf.layers()) {
    const Rgb evenly = point.diffuse;
    point.diffuse = point.diffuse * lost;
    if (trace_gloss_) point.diffuse += (evenly - point.diffuse) * c.gloss;
    // Chance decides by what the surface still shows, so that few points cost a whole sum of lights; not by what a
    // direction lost that was favoured: many were sent there to find it.
    const float survive = std::min(1.0f, max_component(PointBsdf(point).albedo() * weight) * c.spared);
    if (!(rng.next_float() < survive)) continue;
    point.attenuate(weight / survive * c.share);
    hits.add(point);
  }
}

void ClampCompensation::trace(const ShadePoints& points, uint32_t level, std::span<const uint8_t> rays_of_pixel,
                              const Progress& progress, TracedPoints& hits, Counters& counters) const {
  Search search;
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % 4096 == 0) progress.check();
    const SurfacePoint point = points.get(i);
    const uint32_t rays = rays_of_pixel.empty() ? 1u : rays_of_pixel[point.pixel];
    GlintGuide::Directions glints;
    if (glints_ != nullptr && rays > 1) glints = glints_->at(point.position, point.normal, search.scratch);
    // The second, fourth, ... of its rays.
    const float guided = glints.empty() ? 0.0f : static_cast<float>(rays / 2) / static_cast<float>(rays);
    const PointBsdf bsdf(point);
    // A point that rays found reflects less for each to have been one of many; the chance of what it finds in turn falls
    // with the root of that alone, or the others would bring nothing where light comes by way of two surfaces.
    const float spared = level > 1 ? std::sqrt(std::max(1.0f, 1.0f / max_component(bsdf.albedo()))) : 1.0f;
    Rng rng = rng_at_point(scene_, point, hash64(seed_, level), Stage::compensation);
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    const uint64_t seed = rays > 1 ? Rng(rng).next_u32() : 0;
    for (uint32_t k = 0; k < rays; ++k) {
      const Vec3f at = even_in_cube(k, {choice, u, v});
      Rng own = k == 0 ? rng : Rng(hash64(seed, k), Stage::compensation);
      auto s = guided > 0.0f && k % 2 == 1 ? bsdf.towards(glints.sample(at.x, at.y, at.z), own.next_float())
                                           : bsdf.sample(at.x, at.y, at.z);
      if (!s) continue;
      // As drawn from both. [Veach, Guibas 1995: balance heuristic]
      const float favour = guided > 0.0f ? std::lerp(s->pdf, glints.pdf(s->direction), guided) / s->pdf : 1.0f;
      s->weight *= 1.0f / favour;
      if (!is_finite(s->weight)) continue;
      RayHit ray;
      ray.ray.org = point.position, ray.ray.dir = s->direction, ray.ray.mask = ray_kind(s->flags);
      search.rays.push_back(ray);
      search.carried.push_back({s->weight,
                                point.pixel,
                                own,
                                s->pdf,
                                point.position,
                                0.0f,
                                {},
                                0,
                                trace_gloss_ ? traced_part(point, s->direction) : Rgb{},
                                1.0f / static_cast<float>(rays),
                                std::max(1.0f, favour) * spared});
    }
  }
  while (!search.rays.empty()) {
    trace_in_parts(std::span(search.rays), progress, [&](std::span<RayHit> part) { scene_.accel().intersect(part); });
    counters.rays += search.rays.size();
    for (size_t i = 0; i < search.rays.size(); ++i) {
      if (i % 4096 == 0) progress.check();
      if (!light_surfaces_.empty()) find_lights(search, i, hits);
      if (search.rays[i].hit.geom != kNoId)
        find_surface(search, i, hits);
      else if (sky_ != nullptr)
        find_sky(search, i, hits);
    }
    search.rays = std::exchange(search.next_rays, {}), search.carried = std::exchange(search.next_carried, {});
  }
  follow_chains(scene_, light_surfaces_, std::move(search.chains), progress, hits, counters);
}

}  // namespace lumicut
