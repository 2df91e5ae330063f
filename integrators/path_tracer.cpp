// Paths from the eye, with a light sampled at every surface: the reference that virtual lights are measured against.
// [Kajiya 1986; multiple importance sampling: Veach, Guibas 1995]
#include <numbers>

#include "bsdf/straight_glass.h"
#include "clustering/light_kernel.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "integrators/integrator.h"
#include "lights/light_reach.h"
#include "lights/light_sampler.h"
#include "lights/light_surfaces.h"
#include "scene/rng_at_point.h"
#include "scene/scene.h"

namespace lumicut {

namespace {

constexpr size_t kChunk = 1024;       // points
constexpr uint32_t kSureBounces = 3;  // before chance may end a path

struct PathTracerParams {
  uint32_t samples = 16;
};

class PathTracer final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet&, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    sampler_ = std::make_unique<LightSampler>(scene, &context.progress);
    light_surfaces_ = std::make_unique<LightSurfaces>(scene, LightSurfaces::RaysOf::paths);
    samples_ = params.own<PathTracerParams>().samples;
    max_depth_ = params.common().max_depth;
    seed_ = params.common().seed;
    std::vector<double> power;
    for (const Vpl& v : sampler_->delta_lights()) power.push_back(luminance(v.intensity));
    delta_ = DiscreteDistribution(power);
  }

  bool chooses_at_each_point() const override { return true; }
  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    parallel_chunks(points.size(), kChunk, [&](size_t begin, size_t end) {
      Counters total;
      total.points = end - begin;
      std::vector<Path> paths;
      std::vector<uint32_t> rays(end - begin, 0);
      std::fill(radiance.begin() + static_cast<ptrdiff_t>(begin), radiance.begin() + static_cast<ptrdiff_t>(end),
                Rgb{});
      for (uint32_t s = 0; s < samples_; ++s) {
        if (context.progress.cancelled()) return;
        paths.clear();
        for (size_t i = begin; i < end; ++i)
          paths.push_back({points.get(i), rng_at_point(*scene_, points.get(i), hash64(seed_, s), Stage::path),
                           static_cast<uint32_t>(i - begin)});
        follow(paths, radiance.subspan(begin, end - begin), rays, context);
      }
      for (size_t i = begin; i < end; ++i) {
        radiance[i] = radiance[i] / static_cast<float>(samples_);
        if (!counts.empty()) counts[i] = {0, rays[i - begin], 0};
        total.rays += rays[i - begin];
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  struct Path {
    SurfacePoint point;  // with all that the path has lost and gained in its reflectance
    Rng rng;
    uint32_t index;
    Vec3f direction{};
    Rgb weight{};
    float pdf = 0.0f;
    bool specular = false;  // along a specular lobe, from `origin`: nothing else finds what it finds
    Vec3f origin{};
    uint32_t depth = 0;           // surfaces met
    bool straight = false;        // has come so through glass to `origin`
    float travelled = 0.0f;       // on that way, since `point`
    uint32_t kind = kDiffuseRay;  // of its ray
    Rgb absorption{};             // on its way, for each unit of length
  };
  struct Shadow {
    Rgb light;
    uint32_t index;
  };

  // All paths of a chunk go on in step, so that rays are traced in batches.
  void follow(std::vector<Path>& paths, std::span<Rgb> radiance, std::vector<uint32_t>& counts,
              ShadeContext context) const {
    std::vector<Ray> shadow_rays;
    std::vector<Shadow> shadows;
    std::vector<RayHit> rays;
    for (uint32_t step = 0; step <= max_depth_ + kMostStraight && !paths.empty(); ++step) {
      if (context.progress.cancelled()) return;
      shadow_rays.clear(), shadows.clear(), rays.clear();
      size_t alive = 0;
      for (size_t i = 0; i < paths.size(); ++i) {
        Path path = paths[i];
        if (path.specular || path.straight) {
          RayHit ray;
          ray.ray.org = path.origin, ray.ray.dir = path.direction, ray.ray.mask = path.kind;
          rays.push_back(ray);
          paths[alive++] = path;
          continue;
        }
        sample_lights(path, shadow_rays, shadows);
        const float choice = path.rng.next_float(), u = path.rng.next_float(), v = path.rng.next_float();
        const auto s = PointBsdf(path.point).sample(choice, u, v);
        if (!s || !is_finite(s->weight)) continue;
        path.direction = s->direction, path.weight = s->weight, path.pdf = s->pdf, path.kind = ray_kind(s->flags);
        RayHit ray;
        ray.ray.org = path.point.position, ray.ray.dir = s->direction, ray.ray.mask = path.kind;
        rays.push_back(ray);
        paths[alive++] = path;
      }
      paths.erase(paths.begin() + static_cast<ptrdiff_t>(alive), paths.end());
      scene_->accel().occluded(shadow_rays);
      for (size_t i = 0; i < shadows.size(); ++i) {
        ++counts[shadows[i].index];
        if (!(shadow_rays[i].tfar < 0.0f)) radiance[shadows[i].index] += shadows[i].light;
      }
      scene_->accel().intersect(rays);
      alive = 0;
      for (size_t i = 0; i < paths.size(); ++i) {
        ++counts[paths[i].index];
        if (arrive(paths[i], rays[i], radiance)) paths[alive++] = paths[i];
      }
      paths.erase(paths.begin() + static_cast<ptrdiff_t>(alive), paths.end());
    }
  }

  // One light without extent and one sample of what has some, each by power.
  void sample_lights(Path& path, std::vector<Ray>& rays, std::vector<Shadow>& shadows) const {
    if (!delta_.empty()) {
      const size_t i = delta_.sample(path.rng.next_float());
      const Vpl& light = sampler_->delta_lights()[i];
      add_shadow(path, light, 0.0f,
                 light_point_limited(light, light.intensity / static_cast<float>(delta_.pmf(i)),
                                     Falloff(scene_->profiles()), path.point),
                 rays, shadows);
    }
    if (!sampler_->has_extended() && !sampler_->has_environment()) return;
    const DirectSample s = sampler_->sample_light(path.rng);
    Rgb light = light_point_limited(s.vpl, s.vpl.intensity, Falloff(scene_->profiles()), path.point);
    if (!(max_component(light) > 0.0f)) return;
    if (s.seen_by_rays) {
      const bool far = s.vpl.kind == VplKind::directional;
      const Vec3f v = far ? -s.vpl.normal : s.vpl.position - path.point.position;
      const Vec3f to_light = normalize(v);
      const double cosine = far ? 1.0 : std::max(1e-9f, -dot(s.vpl.normal, to_light));
      const double density = far ? s.density : s.density * length2(v) / cosine;
      light = light * power_heuristic(density, PointBsdf(path.point).pdf(to_light));
    }
    add_shadow(path, s.vpl, s.offset, light, rays, shadows);
  }

  [[gnu::always_inline]] void add_shadow(const Path& path, const Vpl& light, float offset, const Rgb& value,
                                         std::vector<Ray>& rays, std::vector<Shadow>& shadows) const {
    if (!(max_component(value) > 0.0f) || !is_finite(value)) return;
    Ray ray;
    ray.org = path.point.position, ray.mask = light.ray_mask;
    if (light.kind == VplKind::directional) {
      ray.dir = -light.normal;
    } else {
      // Emissive meshes block: the ray ends before them.
      const Vec3f end = light.kind == VplKind::oriented ? light.position + light.normal * offset
                                                        : shadow_origin(light, path.point.position).light;
      ray.dir = end - ray.org, ray.tfar = 1.0f;
    }
    rays.push_back(ray);
    shadows.push_back({value, path.index});
  }

  // What the path's ray found: adds what it emits; true where the path goes on from there.
  bool arrive(Path& path, const RayHit& hit, std::span<Rgb> radiance) const {
    Rgb& sum = radiance[path.index];
    const auto shine = [&](const LightSurfaces::Hit& seen) {
      const LightReach& reach = scene_->lights()[seen.light].reach;
      const bool shown = reach.lights(path.kind) && in_set(path.point.not_lit_by, reach.receivers);
      if (path.specular ? !shown : !seen.by_rays) return;
      const double distance = double{path.travelled} + seen.t;
      const double density = sampler_->light_density(seen.light) * distance * distance / seen.cosine;
      sum += path.weight * seen.radiance * (path.specular ? 1.0f : power_heuristic(path.pdf, density));
    };
    if (path.specular)
      light_surfaces_->for_each_hit(hit.ray.org, path.direction, hit.ray.tfar, shine);
    else
      light_surfaces_->for_each_panel(hit.ray.org, path.direction, hit.ray.tfar, shine);
    if (hit.hit.geom == kNoId) {
      const LightReach& reach = scene_->environment().reach;
      if (path.specular ? !reach.lights(path.kind) : reach.limited()) return false;
      const Rgb light = scene_->environment_radiance(path.direction);
      if (max_component(light) > 0.0f)
        sum += path.weight * light *
               (path.specular ? 1.0f : power_heuristic(path.pdf, sampler_->environment_density(path.direction)));
      return false;
    }
    const SurfaceInteraction at = scene_->interaction(hit, path.point.pixel);
    path.weight *= at.bsdf.transmittance_to(at.t, path.absorption);
    // A ray that meets its own surface at once left it below the horizon of the triangle.
    if (!path.specular && !path.straight && at.t < 4.0f * at.offset) return false;
    if (max_component(at.emitted) > 0.0f) {
      const double cosine = std::max(1e-9f, std::abs(dot(at.geometric_normal, at.to_viewer)));
      const double distance = double{path.travelled} + at.t;
      const double density = sampler_->mesh_density(at) * distance * distance / cosine;
      const bool sampled_alone = !path.specular && mesh_light(scene_->meshes()[at.mesh]) == MeshLight::by_samples;
      if (!sampled_alone) sum += path.weight * at.emitted * (path.specular ? 1.0f : power_heuristic(path.pdf, density));
    }
    const bool last = path.depth >= max_depth_;
    if (last && !at.bsdf.passes_straight()) return false;
    const PathChoice choice = at.bsdf.choose(path.rng);
    // Light samples find what lies straight behind glass: the path is still that of its last point.
    path.straight = choice.specular && (choice.specular->flags & kStraight) != 0;
    if (last && !path.straight) return false;
    const uint32_t depth = path.depth;
    if (path.straight) {
      path.travelled += at.t;
    } else {
      ++path.depth;
      path.specular = choice.specular.has_value(), path.travelled = 0.0f;
    }
    if (choice.specular) {
      path.origin = at.bsdf.origin(choice.specular->flags), path.direction = choice.specular->direction;
      path.kind = ray_kind(choice.specular->flags, path.kind);
      // Of the surface that it leaves; nothing else is asked of the point again.
      if (!path.straight) path.point.not_lit_by = at.bsdf.not_lit_by();
      path.absorption = at.bsdf.absorption_after(choice.specular->flags, path.absorption);
      path.weight = path.weight * choice.specular->weight / choice.probability;
      return survives(path, depth, path.weight, path.weight);
    }
    if (choice.layer == nullptr) return false;
    path.point = *choice.layer;
    Rgb factor = path.weight / choice.probability;
    if (!survives(path, depth, PointBsdf(path.point).albedo() * factor, factor)) return false;
    path.point.attenuate(factor);
    return true;
  }

  // Chance ends paths that carry little; `factor` of the others grows.
  static bool survives(Path& path, uint32_t depth, const Rgb& carried, Rgb& factor) {
    if (depth < kSureBounces) return true;
    const float survive = std::min(0.95f, max_component(carried));
    if (!(path.rng.next_float() < survive)) return false;
    factor = factor / survive;
    return true;
  }

  const Scene* scene_ = nullptr;
  std::unique_ptr<LightSampler> sampler_;
  std::unique_ptr<LightSurfaces> light_surfaces_;
  DiscreteDistribution delta_;
  uint32_t samples_ = 1, max_depth_ = 32;
  uint64_t seed_ = 1;
};

}  // namespace

extern const IntegratorEntry path_tracer_integrator;
const IntegratorEntry path_tracer_integrator = {
    "path_tracer",
    "Path tracer",
    "Traces paths from the eye: noise in place of bias, no virtual lights and no clamp; the reference of all methods",
    "Kajiya 1986; Veach, Guibas 1995",
    [] {
      return describe(number<&PathTracerParams::samples>("samples", "Paths", "Paths from each shaded point",
                                                         "paths a point", 1, 1e6));
    },
    []() -> std::unique_ptr<Integrator> { return std::make_unique<PathTracer>(); },
    LightSource::emitters};

}  // namespace lumicut
