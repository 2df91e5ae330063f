// Light tracing: lights, emissive meshes and environment → VPLs. [Keller 1997; Walter et al. 2005 sec. 5; thesis ch. 1]
// Departs: emitters are chosen by power, and flux is divided by the number of light paths that were started (dividing
// by the number of VPLs, as some codes do, halves the indirect light of a closed room of albedo ½).
#include "lights/trace_vpls.h"

#include "bsdf/straight_glass.h"
#include "lights/light_sampler.h"
#include "lights/sphere_radii.h"
#include "scene/scene.h"

namespace lumicut {

namespace {

constexpr size_t kPathsPerChunk = 1024;

struct LightPath {
  Vec3f origin, direction;
  Rgb flux{};
  uint32_t group = 0;
  Rng rng;
  uint32_t met = 0;  // surfaces
  Rgb absorption{};  // on its way, for each unit of length
  // RayKind: the first ray meets what stops samples of its light, and what is seen.
  uint32_t kind = kDiffuseRay | kShadowRay;
};

// A VPL with the light path it came from, to keep the order of paths whatever the order of work.
struct PathVpl {
  uint64_t path;
  Vpl vpl;
};

// Follows paths [first, last) in step, so that rays are traced in batches.
std::vector<PathVpl> trace_paths(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                                 uint64_t first, uint64_t last) {
  std::vector<PathVpl> vpls;
  std::vector<LightPath> paths;
  std::vector<uint64_t> ids;
  for (uint64_t i = first; i < last; ++i) {
    Rng rng(options.seed, Stage::light_path, i);
    const EmittedRay e = emitters.sample_ray(rng);
    if (!(max_component(e.flux) > 0.0f)) continue;
    paths.push_back({e.origin, e.direction, e.flux, e.group, rng});
    ids.push_back(i);
  }
  std::vector<RayHit> rays;
  for (uint32_t step = 0; step < options.max_depth + kMostStraight && !paths.empty(); ++step) {
    rays.assign(paths.size(), {});
    for (size_t i = 0; i < paths.size(); ++i)
      rays[i].ray.org = paths[i].origin, rays[i].ray.dir = paths[i].direction, rays[i].ray.mask = paths[i].kind;
    scene.accel().intersect(rays);
    size_t alive = 0;
    for (size_t i = 0; i < paths.size(); ++i) {
      if (rays[i].hit.geom == kNoId) continue;
      LightPath path = paths[i];
      const uint32_t seen_by = scene.meshes()[rays[i].hit.geom].mask;
      if ((seen_by & kDiffuseRay) == 0) continue;  // it stops the light, and nobody sees it
      const SurfaceInteraction at = scene.interaction(rays[i]);
      path.flux *= at.bsdf.transmittance_to(at.t, path.absorption);
      if ((path.kind & ~seen_by & kShadowRay) != 0) {
        // Lit, and no shadow behind it: half of the paths stay, half go on.
        path.flux = path.flux * 2.0f;
        if (path.rng.next_float() < 0.5f) {
          path.origin = at.bsdf.origin(kTransmitted);
          paths[alive] = path, ids[alive++] = ids[i];
          continue;
        }
      }
      Vpl light;
      light.position = at.position, light.kind = VplKind::oriented, light.normal = at.bsdf.normal();
      light.offset = at.offset;
      light.group = path.group;
      light.intensity = at.bsdf.lambertian_intensity(path.flux);
      if (max_component(light.intensity) > 0.0f && is_finite(light.intensity)) vpls.push_back({ids[i], light});
      light.intensity = at.bsdf.passed_intensity(path.flux), light.normal = -light.normal;
      if (max_component(light.intensity) > 0.0f && is_finite(light.intensity)) vpls.push_back({ids[i], light});
      const auto next = at.bsdf.scatter(path.rng);
      if (!next) continue;
      if ((next->flags & kStraight) == 0 && ++path.met >= options.max_depth) continue;
      if ((next->flags & kStraight) == 0) path.kind = kDiffuseRay;
      path.absorption = at.bsdf.absorption_after(next->flags, path.absorption);
      path.origin = at.bsdf.origin(next->flags), path.direction = next->direction;
      path.flux = path.flux * next->weight * next->factor;
      if (!(max_component(path.flux) > 0.0f) || !is_finite(path.flux)) continue;
      paths[alive] = path;
      ids[alive++] = ids[i];
    }
    paths.erase(paths.begin() + static_cast<ptrdiff_t>(alive), paths.end());
    ids.resize(alive);
  }
  std::stable_sort(vpls.begin(), vpls.end(), [](const PathVpl& a, const PathVpl& b) { return a.path < b.path; });
  return vpls;
}

// Lights of paths [first, last), in the order of paths.
std::vector<PathVpl> trace_in_chunks(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                                     uint64_t first, uint64_t last, Progress& progress) {
  const size_t chunks = (last - first + kPathsPerChunk - 1) / kPathsPerChunk;
  std::vector<std::vector<PathVpl>> parts(chunks);
  tbb::parallel_for(size_t{0}, chunks, [&](size_t c) {
    if (progress.cancelled()) return;
    parts[c] = trace_paths(scene, emitters, options, first + c * kPathsPerChunk,
                           std::min(last, first + (c + 1) * kPathsPerChunk));
    progress.advance(parts[c].size());
  });
  progress.check();
  std::vector<PathVpl> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// As many paths as should give the wanted number, by the mean of others whose lights are not kept. Ending at the path that
// fills the budget would favour long ones: by their spread over the number of paths, up to some percent of all light.
uint64_t paths_for(const Scene& scene, const LightSampler& emitters, const VplOptions& options, uint64_t wanted,
                   Progress& progress) {
  constexpr uint64_t kFirstTrial = uint64_t{1} << 62;
  const uint64_t trials = std::clamp<uint64_t>(wanted / 16, 1024, 4096), most = std::max<uint64_t>(wanted * 16, 65536);
  const size_t found = trace_in_chunks(scene, emitters, options, kFirstTrial, kFirstTrial + trials, progress).size();
  if (found == 0) return most;
  return std::clamp<uint64_t>(
      static_cast<uint64_t>(std::llround(static_cast<double>(wanted * trials) / static_cast<double>(found))), 1, most);
}

void trace_indirect(const Scene& scene, const LightSampler& emitters, const VplOptions& options, uint64_t wanted,
                    Progress& progress, VplSet& set) {
  const uint64_t paths = paths_for(scene, emitters, options, wanted, progress);
  const float normalise = 1.0f / static_cast<float>(paths);
  for (const PathVpl& v : trace_in_chunks(scene, emitters, options, 0, paths, progress)) {
    set.lights.push_back(v.vpl);
    set.lights.back().intensity *= normalise;
  }
  set.light_paths = paths;
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

}  // namespace

VplSet trace_vpls(const Scene& scene, const VplOptions& options, Progress& progress) {
  return trace_vpls(scene, LightSampler(scene, &progress), options, progress);
}

VplSet trace_vpls(const Scene& scene, const LightSampler& emitters, const VplOptions& options, Progress& progress) {
  progress.begin("light paths", options.count);
  VplSet set;
  set.profiles = scene.profiles();
  if (emitters.empty()) return set;
  set.lights = emitters.delta_lights();
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
    for (uint64_t i = 0; i < environment; ++i) {
      if (i % 4096 == 0) progress.check();
      const Vpl v = emitters.environment_light(i, environment, options.seed);
      if (max_component(v.intensity) > 0.0f && is_finite(v.intensity)) set.lights.push_back(v);
    }
    for (uint64_t i = 0; i < direct; ++i) {
      if (i % 4096 == 0) progress.check();
      Rng rng(options.seed, Stage::light_path, i, 1);
      const Vpl v = emitters.sample_direct((static_cast<double>(i) + rng.next_float()) / static_cast<double>(direct),
                                           direct, rng);
      if (max_component(v.intensity) > 0.0f && is_finite(v.intensity)) set.lights.push_back(v);
    }
    set.extended = direct;
    progress.advance(direct + environment);
  }
  set.direct = set.lights.size();
  const uint64_t indirect = options.count > set.lights.size() ? options.count - set.lights.size() : 0;
  if (indirect > 0 && options.max_depth > 0 && !scene.bounds().empty()) {
    const size_t first = set.lights.size();
    trace_indirect(scene, emitters, options, indirect, progress, set);
    if (options.sphere_scale > 0.0f)
      make_spheres(std::span(set.lights).subspan(first), options.sphere_scale, scene.extent().radius(), &progress);
    progress.check();
  }
  return set;
}

VplSet off_surfaces(const VplSet& set, const Scene& scene) {
  VplSet moved = set;
  const size_t direct = set.light_paths > 0 ? set.direct : set.lights.size();
  const uint32_t scattered = scene.scattered_ray_mask();
  parallel_chunks(moved.lights.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Vpl& v = moved.lights[i];
      if (i >= direct) v.ray_mask = scattered;
      if (v.kind != VplKind::oriented && v.kind != VplKind::sphere) continue;
      if (!(v.offset > 0.0f)) v.offset = offset_on_surface(scene, v.position, v.normal);
      v.position += v.normal * v.offset;
    }
  });
  return moved;
}

}  // namespace lumicut
