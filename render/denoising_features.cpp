#include "render/denoising_features.h"

#include "render/traced_points.h"

namespace lumicut {

namespace {
constexpr uint32_t kMostSurfaces = 16;  // panes of glass have two each
constexpr float kShown = 0.25f;         // a surface of less even or rough reflectance is a mirror with dust on it
constexpr float kFaint = 0.02f;         // what carries less is not followed

Rgb at_most_one(const Rgb& c) { return min(c, Rgb{1, 1, 1}); }
}  // namespace

void FeatureTracer::miss(uint32_t pixel, const Vec3f& direction) {
  if (!scene_.environment().hidden) sums_[pixel].albedo += at_most_one(scene_.environment_radiance(direction));
}

bool FeatureTracer::add(const SurfaceInteraction& at, Way& way) const {
  way.throughput *= at.bsdf.transmittance_to(at.t, way.absorption);
  way.travelled += at.t;
  Rgb shown{};
  for (const SurfacePoint& layer : at.bsdf.layers()) shown += PointBsdf(layer).albedo();
  shown = at_most_one(shown + at.emitted);
  way.seen.albedo += way.throughput * shown;
  // Half of all choices fall below 1/2: what holds that number shows most, or nearly.
  const auto next = at.bsdf.sample_specular(0.5f, 0.5f, 0.5f);
  const auto end_here = [&] {
    if (way.found) return;
    way.seen.normal = at.bsdf.normal(), way.seen.depth = way.travelled * way.cosine, way.found = true;
  };
  if (!next) {
    end_here();
    return false;
  }
  if (max_component(shown) >= kShown) end_here();
  way.throughput *= next->weight;
  if (!(max_component(way.throughput) >= kFaint)) {
    end_here();
    return false;
  }
  way.absorption = at.bsdf.absorption_after(next->flags, way.absorption);
  const uint32_t kind = ray_kind(next->flags, way.ray.ray.mask);
  way.ray = {};
  way.ray.ray.org = at.bsdf.origin(next->flags), way.ray.ray.dir = next->direction, way.ray.ray.mask = kind;
  return true;
}

void FeatureTracer::hit(uint32_t pixel, const SurfaceInteraction& at, float cosine, std::vector<Way>& ways) {
  Way way{pixel, {}, {1, 1, 1}, {}, cosine, 0.0f, {}, false};
  way.ray.ray.mask = kCameraRay;
  if (add(at, way))
    ways.push_back(way);
  else
    sums_[pixel] += way.seen;
}

void FeatureTracer::follow(std::vector<Way> ways, const Progress& progress, Counters& counters) {
  for (uint32_t depth = 1; !ways.empty(); ++depth) {
    std::vector<RayHit> rays;
    rays.reserve(ways.size());
    for (const Way& way : ways) rays.push_back(way.ray);
    trace_in_parts(std::span(rays), progress, [&](std::span<RayHit> part) { scene_.accel().intersect(part); });
    counters.rays += rays.size();
    std::vector<Way> next;
    for (size_t i = 0; i < ways.size(); ++i) {
      Way& way = ways[i];
      bool goes_on = false;
      if (rays[i].hit.geom == kNoId && scene_.environment().reach.lights(rays[i].ray.mask))
        way.seen.albedo += way.throughput * at_most_one(scene_.environment_radiance(rays[i].ray.dir));
      else if (rays[i].hit.geom != kNoId)
        goes_on = add(scene_.interaction(rays[i], way.pixel), way) && depth < kMostSurfaces;
      if (goes_on)
        next.push_back(way);
      else
        sums_[way.pixel] += way.seen;
    }
    ways = std::move(next);
  }
}

}  // namespace lumicut
