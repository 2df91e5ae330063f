#include "lights/light_paths.h"

#include "bsdf/straight_glass.h"
#include "core/parallel.h"
#include "scene/scene.h"

namespace lumicut {

namespace {

constexpr size_t kPathsPerChunk = 1024;

struct LightPath {
  Vec3f origin, direction;
  Rgb flux{};
  uint32_t group = 0;
  uint32_t emitter = 0;
  Rng rng;
  uint32_t met = 0;  // surfaces
  Rgb absorption{};  // on its way, for each unit of length
  // RayKind: the first ray meets what stops samples of its light, and what is seen.
  uint32_t kind = kDiffuseRay | kShadowRay;
  Vec3f disk_centre{};  // as EmittedRay has it
  float disk_radius = 0.0f;
  bool shadows = true;
  bool thrown = false;  // by gloss, a mirror or glass
  LightReach reach{};
  // It has met nothing yet that scatters: what its lamp does not reach, it does not light, nor is stopped by.
  bool first() const { return (kind & kShadowRay) != 0; }
  bool stopped_by(const Mesh& mesh) const {
    return !first() || (shadows && (mesh.mask & kShadowRay) != 0 && in_set(mesh.not_blocking, reach.blockers));
  }
};

// Camera paths meet a surface by its geometric normal and have it lit by the shading one; light paths do the reverse. With
// these factors both see one image. [Veach 1997, 5.3] Of grazing light, where few paths arrive, what is above is lost.
constexpr float kMostTilted = 32.0f;

// Of what leaves evenly, by the geometric normal: virtual lights, and paths that go on.
float lit_by_shading_normal(const SurfaceInteraction& at) {
  const float geometric = std::abs(dot(at.geometric_normal, at.to_viewer));
  const float shading = std::max(0.0f, dot(at.bsdf.normal(), at.to_viewer));
  return shading < kMostTilted * geometric ? shading / geometric : kMostTilted;
}

// Of a path that goes on: a sharper lobe's direction was drawn by the shading normal.
float scattered_by_shading_normal(const SurfaceInteraction& at, const ScatterSample& next) {
  if ((next.flags & kStraight) != 0) return 1.0f;
  if ((next.flags & (kSpecular | kGlossy)) == 0) return lit_by_shading_normal(at);
  const auto cosines = [&](const Vec3f& direction) {
    return std::pair{std::abs(dot(at.geometric_normal, direction)), std::abs(dot(at.bsdf.normal(), direction))};
  };
  const auto [geometric_in, shading_in] = cosines(at.to_viewer);
  const auto [geometric_out, shading_out] = cosines(next.direction);
  const float up = shading_in * geometric_out, down = geometric_in * shading_out;
  return up < kMostTilted * down ? up / down : kMostTilted;
}

// Of the surface beneath. Its virtual light leaves by the geometric normal: so the lobe is turned from the shading one to that
// as a whole, and keeps the mean that it has by the shading normal.
DiffuseLobe diffuse_lobe_of(const SurfaceInteraction& at, const Vec3f& direction) {
  const SurfacePoint& p = at.bsdf.layers()[0];
  if (!p.lobed()) return {};
  const Vec3f side = at.side();
  const float leans = 1.0f + dot(p.normal, side);
  Vec3f mirror = reflect(-direction, side);
  if (p.normal != side && leans > 0.1f) {
    const Vec3f both = p.normal + side;
    mirror = normalize(p.mirror - both * (dot(both, p.mirror) / leans) + side * (2.0f * dot(p.normal, p.mirror)));
  }
  // Burley's edges are of the shading normal, and turn with nothing: even where that leans by 10 degrees or more.
  constexpr float kEven = 0.985f;
  SurfacePoint lobed = p;
  const float kept = std::clamp((dot(p.normal, side) - kEven) / (1.0f - kEven), 0.0f, 1.0f);
  lobed.retro *= kept, lobed.dim *= kept;
  return {mirror, p.slope, p.again, lobed.retro, lobed.dim, p.falloff, mean_diffuse_factor(lobed)};
}

// Follows paths [first, last) in step, so that rays are traced in batches.
LightPaths trace_paths(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                       const CameraImportance* importance, uint64_t first, uint64_t last) {
  const DiscreteDistribution* starts = importance != nullptr ? &importance->path_starts() : nullptr;
  BallQueryTree::Scratch scratch;
  LightPaths found;
  std::vector<PathVpl>& vpls = found.lights;
  std::vector<LightPath> paths;
  std::vector<uint64_t> ids;
  for (uint64_t i = first; i < last; ++i) {
    Rng rng(options.seed, Stage::light_path, i);
    const EmittedRay e = emitters.sample_ray(rng, starts);
    if (!(max_component(e.flux) > 0.0f)) continue;
    paths.push_back({e.origin, e.direction, e.flux, e.group, e.emitter, rng});
    paths.back().disk_centre = e.disk_centre, paths.back().disk_radius = e.disk_radius;
    paths.back().shadows = e.shadows, paths.back().reach = e.reach;
    ids.push_back(i);
  }
  std::vector<RayHit> rays;
  for (uint32_t step = 0; step < options.max_depth + kMostStraight && !paths.empty(); ++step) {
    rays.assign(paths.size(), {});
    for (size_t i = 0; i < paths.size(); ++i)
      rays[i].ray.org = paths[i].origin, rays[i].ray.dir = paths[i].direction, rays[i].ray.mask = paths[i].kind,
      rays[i].ray.flags = kFromLight;
    scene.accel().intersect(rays);
    size_t alive = 0;
    for (size_t i = 0; i < paths.size(); ++i) {
      if (rays[i].hit.geom == kNoId) continue;
      LightPath path = paths[i];
      const Mesh& mesh = scene.meshes()[rays[i].hit.geom];
      const bool stopped = path.stopped_by(mesh);
      const bool lights =
          (mesh.mask & kDiffuseRay) != 0 && (!path.first() || in_set(mesh.not_lit_by, path.reach.receivers));
      const SurfaceInteraction at = scene.interaction(rays[i]);
      if (stopped && !lights && !at.bsdf.passes_straight()) continue;  // nobody sees it
      path.flux *= at.bsdf.transmittance_to(at.t, path.absorption) * scene.stopped_share(rays[i]);
      if (!stopped) {
        // Lit, and no shadow behind it: half of the paths stay, half go on.
        if (lights) path.flux = path.flux * 2.0f;
        if (!lights || path.rng.next_float() < 0.5f) {
          path.origin = at.bsdf.origin(kTransmitted);
          paths[alive] = path, ids[alive++] = ids[i];
          continue;
        }
      }
      float lit = 1.0f;  // share of the light that a facing disk gives at this distance
      if (path.disk_radius > 0.0f) {
        const float d2 = length2(at.position - path.disk_centre);
        lit = d2 / (d2 + path.disk_radius * path.disk_radius);
      }
      Vpl light;
      light.position = at.position, light.kind = VplKind::oriented, light.normal = at.side();
      light.offset = at.offset;
      light.group = path.group;
      const auto leave = [&](const Rgb& intensity, const DiffuseLobe& lobe) {
        if (!(max_component(intensity) > 0.0f) || !is_finite(intensity)) return;
        light.intensity = intensity;
        if (importance != nullptr) {
          const float keep = importance->keep(light.position, light.normal, scratch);
          if (!(path.rng.next_float() < keep)) return;
          light.intensity *= 1.0f / keep;
        }
        vpls.push_back({ids[i], path.emitter, light, lobe});
      };
      if (lights && (!path.first() || path.reach.lights(kDiffuseRay))) {
        const Rgb received = path.flux * (lit * lit_by_shading_normal(at));
        if (path.thrown && max_component(at.bsdf.even_color()) > 0.0f)
          found.glints.push_back({at.position, path.origin, luminance(received)});
        leave(at.bsdf.lambertian_intensity(received), diffuse_lobe_of(at, path.direction));
        light.normal = -light.normal;
        leave(at.bsdf.passed_intensity(received), {});
      }
      const auto next = at.bsdf.scatter(path.rng);
      if (!next) continue;
      const bool straight = (next->flags & kStraight) != 0;
      if (straight ? !stopped : !lights) continue;  // the half that goes on has passed; what is not lit throws nothing
      if (path.first() && !straight && !path.reach.lights(lobe_kind(next->flags))) continue;
      if (!straight && ++path.met >= options.max_depth) continue;
      if (!straight) {
        path.kind = kDiffuseRay, path.flux *= lit, path.disk_radius = 0.0f;
        path.thrown = (next->flags & (kSpecular | kGlossy)) != 0;
      }
      path.absorption = at.bsdf.absorption_after(next->flags, path.absorption);
      path.origin = at.bsdf.origin(next->flags), path.direction = next->direction;
      path.flux = path.flux * next->weight * (next->factor * scattered_by_shading_normal(at, *next));
      if (!(max_component(path.flux) > 0.0f) || !is_finite(path.flux)) continue;
      paths[alive] = path;
      ids[alive++] = ids[i];
    }
    paths.erase(paths.begin() + static_cast<ptrdiff_t>(alive), paths.end());
    ids.resize(alive);
  }
  std::stable_sort(vpls.begin(), vpls.end(), [](const PathVpl& a, const PathVpl& b) { return a.path < b.path; });
  return found;
}

}  // namespace

LightPaths trace_light_paths(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                             const CameraImportance* importance, uint64_t first, uint64_t last, Progress& progress) {
  std::vector<LightPaths> parts((last - first + kPathsPerChunk - 1) / kPathsPerChunk);
  parallel_chunks(last - first, kPathsPerChunk, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    LightPaths& part = parts[begin / kPathsPerChunk];
    part = trace_paths(scene, emitters, options, importance, first + begin, first + end);
    progress.advance(part.lights.size());
  });
  progress.check();
  LightPaths all;
  for (const LightPaths& part : parts) {
    all.lights.insert(all.lights.end(), part.lights.begin(), part.lights.end());
    all.glints.insert(all.glints.end(), part.glints.begin(), part.glints.end());
  }
  return all;
}

}  // namespace lumicut
