// Light tracing: lights, emissive meshes and environment → VPLs. [Keller 1997; Walter et al. 2005 sec. 5; thesis ch. 1]
// Departs: emitters are chosen by power, and flux is divided by the number of light paths that were started (dividing
// by the number of VPLs, as some codes do, halves the indirect light of a closed room of albedo ½).
#include "lights/trace_vpls.h"

#include "lights/light_paths.h"
#include "lights/light_sampler.h"
#include "lights/sphere_radii.h"
#include "scene/scene.h"

namespace lumicut {

namespace {

// As many paths as should give the wanted number, by the mean of others whose lights are not kept. Ending at the path that
// fills the budget would favour long ones: by their spread over the number of paths, up to some percent of all light.
uint64_t paths_for(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                   const CameraImportance* importance, uint64_t wanted, Progress& progress) {
  constexpr uint64_t kFirstTrial = uint64_t{1} << 62;
  const uint64_t trials = std::clamp<uint64_t>(wanted / 16, 1024, 4096), most = std::max<uint64_t>(wanted * 16, 65536);
  const double found = importance != nullptr
                           ? importance->lights_of_path() * static_cast<double>(trials)
                           : static_cast<double>(trace_light_paths(scene, emitters, options, nullptr, kFirstTrial,
                                                                   kFirstTrial + trials, progress)
                                                     .lights.size());
  if (!(found > 0.0)) return most;
  const double paths = static_cast<double>(wanted * trials) / found;
  return std::clamp<uint64_t>(static_cast<uint64_t>(std::llround(std::min(paths, static_cast<double>(most)))), 1, most);
}

void trace_indirect(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                    const CameraImportance* importance, uint64_t wanted, Progress& progress, VplSet& set) {
  const uint64_t paths = paths_for(scene, emitters, options, importance, wanted, progress);
  const float normalise = 1.0f / static_cast<float>(paths);
  LightPaths traced = trace_light_paths(scene, emitters, options, importance, 0, paths, progress);
  set.glints = std::move(traced.glints);
  const bool lobed = scene.may_be_lobed();
  for (const PathVpl& v : traced.lights) {
    set.lights.push_back(v.vpl);
    set.lights.back().intensity *= normalise;
    if (lobed) set.lobes.push_back(v.lobe);
  }
  set.light_paths = paths;
}

std::vector<Vpl> kept_delta_lights(const LightSampler& emitters, const CameraImportance& importance, uint64_t seed) {
  std::vector<Vpl> kept;
  for (size_t i = 0; i < emitters.delta_lights().size(); ++i) {
    const float keep = importance.keep_delta()[i];
    if (!(Rng(seed, Stage::importance, i, 2).next_float() < keep)) continue;
    kept.push_back(emitters.delta_lights()[i]);
    kept.back().intensity *= 1.0f / keep;
  }
  return kept;
}

// Of the triangle just below a place.
float offset_on_surface(const Scene& scene, const Vec3f& position, const Vec3f& normal) {
  constexpr float kNear = 1e-3f;  // of the typical radius: a host's lights may lie a little off
  const float least = scene.offset_at(position), height = std::max(kNear * scene.extent().radius(), 8.0f * least);
  RayHit ray;
  ray.ray.org = position + normal * height, ray.ray.dir = -normal, ray.ray.tfar = 2.0f * height;
  scene.accel().intersect({&ray, 1});
  return ray.hit.geom == kNoId ? least : scene.surface(ray).offset;
}

void make_lobed(const DiffuseLobe& lobe, Vpl& light) {
  if (!lobe.any() || light.kind != VplKind::oriented) return;
  light.kind = VplKind::lobed, light.intensity *= 1.0f / lobe.mean;
  light.edge_or_radius = lobe.slope, light.again = lobe.again, light.retro = lobe.retro, light.dim = lobe.dim;
  light.falloff = lobe.falloff;
  light.blend_cosine = lobe.mirror.x, light.spot_cosine = lobe.mirror.y, light.spread_tan = lobe.mirror.z;
}

}  // namespace

VplSet trace_vpls(const Scene& scene, const VplOptions& options, Progress& progress) {
  return trace_vpls(scene, LightSampler(scene, &progress), options, nullptr, progress);
}

VplSet trace_vpls(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                  const CameraImportance* importance, Progress& progress) {
  progress.begin("light paths", options.count);
  VplSet set;
  set.profiles = scene.profiles();
  if (emitters.empty()) return set;
  if (importance == nullptr)
    set.lights = emitters.delta_lights();
  else
    set.lights = kept_delta_lights(emitters, *importance, options.seed);
  const uint64_t budget = options.count > set.lights.size() ? options.count - set.lights.size() : 0;
  if (emitters.has_extended() || emitters.has_environment()) {
    const double share = options.max_depth > 0 ? options.direct_share : 1.0;
    auto direct = std::max<uint64_t>(1, static_cast<uint64_t>(share * static_cast<double>(budget)));
    uint64_t environment = 0;
    if (emitters.has_environment()) {
      environment =
          options.environment_count > 0
              ? std::min<uint64_t>(options.environment_count, budget)
              : static_cast<uint64_t>(std::lround(emitters.environment_share() * static_cast<double>(direct)));
      environment = std::max<uint64_t>(1, environment);
      // Given their number, the rest share what is left; by power, they share with the environment.
      if (options.environment_count > 0)
        direct = static_cast<uint64_t>(share * static_cast<double>(budget - std::min(budget, environment)));
      else
        direct -= std::min(direct, environment);
      direct = emitters.has_extended() ? std::max<uint64_t>(1, direct) : 0;
    }
    set.first_of_sky = set.lights.size();
    for (uint64_t i = 0; i < environment; ++i) {
      if (i % 4096 == 0) progress.check();
      const Vpl v = emitters.environment_light(i, environment, options.seed);
      if (max_component(v.intensity) > 0.0f && is_finite(v.intensity)) set.lights.push_back(v);
    }
    set.of_sky = set.lights.size() - set.first_of_sky;
    for (uint64_t i = 0; i < direct; ++i) {
      if (i % 4096 == 0) progress.check();
      Rng rng(options.seed, Stage::light_path, i, 1);
      const Vpl v = emitters.sample_direct((static_cast<double>(i) + rng.next_float()) / static_cast<double>(direct),
                                           direct, rng, importance != nullptr ? &importance->direct() : nullptr);
      if (max_component(v.intensity) > 0.0f && is_finite(v.intensity)) set.lights.push_back(v);
    }
    set.extended = direct;
    progress.advance(direct + environment);
  }
  set.direct = set.lights.size();
  const uint64_t indirect = options.count > set.lights.size() ? options.count - set.lights.size() : 0;
  if (indirect > 0 && options.max_depth > 0 && !scene.bounds().empty()) {
    const size_t first = set.lights.size();
    trace_indirect(scene, emitters, options, importance, indirect, progress, set);
    if (options.sphere_scale > 0.0f)
      make_spheres(std::span(set.lights).subspan(first), options.sphere_scale, scene.extent().radius(), &progress);
    progress.check();
  }
  return set;
}

VplSet off_surfaces(const VplSet& set, const Scene& scene) {
  VplSet moved = set;
  moved.glints.clear(), moved.lobes.clear();
  const size_t direct = set.light_paths > 0 ? set.direct : set.lights.size();
  const uint32_t scattered = scene.scattered_ray_mask();
  parallel_chunks(moved.lights.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Vpl& v = moved.lights[i];
      if (i >= direct) v.ray_mask = scattered;
      if (v.kind != VplKind::oriented && v.kind != VplKind::sphere) continue;
      if (!(v.offset > 0.0f)) v.offset = offset_on_surface(scene, v.position, v.normal);
      v.position += v.normal * v.offset;
      if (i >= set.direct && i - set.direct < set.lobes.size()) make_lobed(set.lobes[i - set.direct], v);
    }
  });
  return moved;
}

}  // namespace lumicut
