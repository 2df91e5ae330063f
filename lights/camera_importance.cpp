#include "lights/camera_importance.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <span>

#include "bsdf/straight_glass.h"
#include "core/even_sequence.h"
#include "core/parallel.h"
#include "geometry/places.h"
#include "lights/falloff.h"
#include "lights/light_paths.h"

namespace lumicut {

namespace {

constexpr size_t kCameraPaths = 2048, kChunk = 256;
constexpr uint32_t kRaysOfPoint = 4, kMostSpecular = 16;
constexpr uint64_t kLightPaths = 4096, kFirstLightPath = uint64_t{3} << 60;
constexpr size_t kEmitterGroups = 1024, kShadowRays = 32;
constexpr double kPi = std::numbers::pi;

size_t side_of(const Vec3f& n) {
  const Vec3f a{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
  const int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  return static_cast<size_t>(2 * axis + (n[axis] < 0.0f ? 1 : 0));
}

// Emitters that are treated alike: one each, or so many near each other that no group has more than its share of power.
class EmitterGroups {
 public:
  EmitterGroups(const LightSampler& emitters, const Progress& progress) : emitters_(emitters), progress_(progress) {
    const size_t all = emitters.emitter_count(), without_extent = all - emitters.extended_count();
    places_.resize(all);
    add(0, without_extent), add(without_extent, all);
  }
  std::vector<std::vector<uint32_t>> take() { return std::move(groups_); }

 private:
  void add(size_t first, size_t last) {
    std::vector<uint32_t> here;
    double power = 0.0;
    for (size_t e = first; e < last; ++e) {
      check_now_and_then(&progress_, e);
      if (const auto place = emitters_.place_of(e))
        places_[e] = *place, here.push_back(static_cast<uint32_t>(e)), power += emitters_.power_of(e);
      else
        groups_.push_back({static_cast<uint32_t>(e)});
    }
    if (!here.empty()) divide(here, here.size() <= kEmitterGroups ? 0.0 : power / kEmitterGroups);
  }

  void divide(std::span<uint32_t> members, double most) {
    progress_.check();
    double power = 0.0;
    Aabb box;
    for (const uint32_t e : members) power += emitters_.power_of(e), box.extend(places_[e]);
    if (members.size() == 1 || power <= most) {
      groups_.emplace_back(members.begin(), members.end());
      return;
    }
    const int axis = box.longest_axis();
    const size_t half = members.size() / 2;
    std::nth_element(
        members.begin(), members.begin() + static_cast<std::ptrdiff_t>(half), members.end(),
        [&](uint32_t a, uint32_t b) { return std::pair(places_[a][axis], a) < std::pair(places_[b][axis], b); });
    divide(members.first(half), most), divide(members.subspan(half), most);
  }

  const LightSampler& emitters_;
  const Progress& progress_;
  std::vector<Vec3f> places_;
  std::vector<std::vector<uint32_t>> groups_;
};

// Chances by `learned` and by power, of emitters from `first` on.
DiscreteDistribution mixed(const LightSampler& emitters, size_t first, const std::vector<double>& learned) {
  constexpr double kByPower = CameraImportance::kByPower;
  double sum = 0.0, power = 0.0;
  std::vector<double> chances(learned.size());
  for (size_t i = 0; i < learned.size(); ++i) sum += learned[i], power += emitters.power_of(first + i);
  for (size_t i = 0; i < learned.size(); ++i) {
    chances[i] = emitters.power_of(first + i) / power;
    if (sum > 0.0) chances[i] = kByPower * chances[i] + (1.0 - kByPower) * learned[i] / sum;
  }
  return DiscreteDistribution(chances);
}

// Empty where the camera shows nothing, beside the circle of a fisheye.
std::optional<RayHit> camera_ray(const Scene& scene, FrameSize frame, Vec2f at, Rng& rng) {
  const float lens_u = rng.next_float(), lens_v = rng.next_float();
  const auto width = static_cast<float>(frame.width), height = static_cast<float>(frame.height);
  const Camera::Sample c = scene.camera().generate(at.x * width, at.y * height, width, height, lens_u, lens_v);
  if (c.outside) return {};
  RayHit ray;
  ray.ray.org = c.origin, ray.ray.dir = c.direction, ray.ray.tnear = c.tnear, ray.ray.tfar = c.tfar;
  ray.ray.mask = kCameraRay;
  return ray;
}

// The first surface that virtual lights shade, by way of mirrors and glass; `weight` is multiplied by what those show.
std::optional<SurfaceInteraction> what_camera_sees(const Scene& scene, RayHit ray, Rng& rng, float& weight) {
  for (uint32_t depth = 0; depth < kMostSpecular; ++depth) {
    scene.accel().intersect({&ray, 1});
    if (ray.hit.geom == kNoId) return {};
    const SurfaceInteraction seen = scene.interaction(ray);
    if (scene.materials()[seen.material].holdout) return {};
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    const auto next = seen.bsdf.sample_specular(choice, u, v);
    if (!next) return seen;
    // Half of what is both a mirror and rough goes either way.
    const bool both = seen.bsdf.layers().size() > 1 || !PointBsdf(seen.bsdf.layers()[0]).black();
    if (both) weight *= 2.0f;
    if (both && rng.next_float() < 0.5f) return seen;
    weight *= max_component(next->weight);
    const uint32_t kind = ray_kind(next->flags, ray.ray.mask);
    ray = {};
    ray.ray.org = seen.bsdf.origin(next->flags), ray.ray.dir = next->direction, ray.ray.mask = kind;
  }
  return {};
}

// Where a virtual light would lie that shines along the sample; light goes straight through glass that lets shadows pass.
std::optional<SurfaceInteraction> what_light_comes_from(const Scene& scene, const Vec3f& from, const BsdfSample& s) {
  RayHit ray;
  ray.ray.org = from, ray.ray.dir = s.direction, ray.ray.mask = ray_kind(s.flags);
  for (uint32_t passage = 0; passage <= kMostStraight; ++passage) {
    const uint32_t kind = ray.ray.mask;
    scene.accel().intersect({&ray, 1});
    if (ray.hit.geom == kNoId) return {};
    const SurfaceInteraction there = scene.interaction(ray);
    if (!there.bsdf.passes_straight()) return there;
    ray = {};
    ray.ray.org = there.bsdf.origin(kTransmitted), ray.ray.dir = s.direction, ray.ray.mask = kind;
  }
  return {};
}

}  // namespace

CameraImportance::CameraImportance(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                                   FrameSize frame, Progress& progress) {
  progress.begin("importance", kCameraPaths + kLightPaths);
  const std::vector<CameraPoint> points = trace_camera_paths(scene, frame, options.seed, progress);
  const auto groups = EmitterGroups(emitters, progress).take();
  weigh_path_starts(scene, emitters, options, groups, progress);
  weigh_direct(emitters, root_mean_squares(scene, emitters, options.seed, points, groups, progress));
}

std::vector<CameraImportance::CameraPoint> CameraImportance::trace_camera_paths(const Scene& scene, FrameSize frame,
                                                                                uint64_t seed, Progress& progress) {
  struct Found {
    std::vector<CameraPoint> points;
    std::array<std::vector<std::pair<Vec3f, float>>, 6> importons;
  };
  if (scene.bounds().empty()) return {};
  std::vector<Found> parts(kCameraPaths / kChunk);
  parallel_chunks(kCameraPaths, kChunk, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    Found& found = parts[begin / kChunk];
    for (size_t i = begin; i < end; ++i) {
      Rng rng(seed, Stage::importance, i);
      float weight = 1.0f;
      const auto ray = camera_ray(scene, frame, even_point(i), rng);
      if (!ray) continue;
      const auto seen = what_camera_sees(scene, *ray, rng, weight);
      if (!seen || !(weight > 0.0f)) continue;
      for (const SurfacePoint& point : seen->bsdf.layers()) {
        const PointBsdf bsdf(point);
        if (bsdf.black()) continue;
        found.points.push_back({point, weight});
        for (uint32_t k = 0; k < kRaysOfPoint; ++k) {
          const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
          const auto s = bsdf.sample(choice, u, v);
          if (!s) continue;
          if (const auto there = what_light_comes_from(scene, point.position, *s))
            found.importons[side_of(there->bsdf.normal())].emplace_back(there->position,
                                                                        weight * luminance(s->weight) / kRaysOfPoint);
        }
      }
    }
    progress.advance(end - begin);
  });
  progress.check();
  std::vector<CameraPoint> points;
  for (const Found& part : parts) points.insert(points.end(), part.points.begin(), part.points.end());
  for (size_t side = 0; side < importons_.size(); ++side) {
    Importons& all = importons_[side];
    std::vector<Vec3f> places;
    for (const Found& part : parts)
      for (const auto& [place, weight] : part.importons[side]) places.push_back(place), all.weights.push_back(weight);
    if (!places.empty())
      all.tree = std::make_unique<const BallQueryTree>(rows_of(places, std::identity{}), 3, &progress);
  }
  return points;
}

float CameraImportance::density(const Vec3f& position, const Vec3f& normal, BallQueryTree::Scratch& scratch) const {
  const Importons& here = importons_[side_of(normal)];
  if (here.tree == nullptr) return 0.0f;
  std::array<uint32_t, kNeighbours> index;
  std::array<double, kNeighbours> dist2;
  const size_t found = here.tree->nearest(row_of(position).data(), kNeighbours, index.data(), dist2.data(), scratch);
  float sum = 0.0f;
  for (size_t k = 0; k < found; ++k) sum += here.weights[index[k]];
  return static_cast<float>(static_cast<double>(sum) / (kPi * std::max(dist2[found - 1], 1e-30)));
}

float CameraImportance::keep(const Vec3f& position, const Vec3f& normal, BallQueryTree::Scratch& scratch) const {
  if (!(typical_ > 0.0f)) return 1.0f;
  // The root: what few pixels see, but as brightly, is a smaller part of the picture and as large a part of its error.
  return std::clamp(std::sqrt(density(position, normal, scratch) / typical_), kLeastChance, 1.0f);
}

void CameraImportance::weigh_path_starts(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                                         const std::vector<std::vector<uint32_t>>& groups, Progress& progress) {
  const std::vector<PathVpl> lights =
      trace_light_paths(scene, emitters, options, nullptr, kFirstLightPath, kFirstLightPath + kLightPaths, progress)
          .lights;
  std::vector<float> densities(lights.size());
  parallel_chunks(lights.size(), 1024, [&](size_t begin, size_t end) {
    BallQueryTree::Scratch scratch;
    for (size_t i = begin; i < end; ++i) densities[i] = density(lights[i].vpl.position, lights[i].vpl.normal, scratch);
  });
  // The mean over what they give.
  double sum = 0.0, square = 0.0;
  for (size_t i = 0; i < lights.size(); ++i) {
    const double intensity = static_cast<double>(luminance(lights[i].vpl.intensity)), d = densities[i];
    sum += intensity * d, square += intensity * d * d;
  }
  typical_ = sum > 0.0 ? static_cast<float>(square / sum) : 0.0f;
  // Root of the mean square of what paths of a group give.
  std::vector<double> of_group(groups.size()), learned(emitters.emitter_count());
  std::vector<uint32_t> group_of(emitters.emitter_count());
  std::vector<double> power(groups.size());
  for (uint32_t g = 0; g < groups.size(); ++g)
    for (const uint32_t e : groups[g]) group_of[e] = g, power[g] += emitters.power_of(e);
  BallQueryTree::Scratch scratch;
  for (size_t i = 0; i < lights.size();) {
    double given = 0.0;
    const size_t first = i;
    for (; i < lights.size() && lights[i].path == lights[first].path; ++i)
      given += static_cast<double>(luminance(lights[i].vpl.intensity) *
                                   keep(lights[i].vpl.position, lights[i].vpl.normal, scratch));
    of_group[group_of[lights[first].emitter]] += given * given;
  }
  // By power about kLightPaths · power/all paths started in the group, each with the flux of all.
  for (uint32_t g = 0; g < groups.size(); ++g)
    for (const uint32_t e : groups[g])
      learned[e] =
          std::sqrt(of_group[g] / std::max(1.0, static_cast<double>(kLightPaths) * power[g] / emitters.power())) *
          emitters.power_of(e);
  if (!(typical_ > 0.0f)) std::fill(learned.begin(), learned.end(), 0.0);
  path_starts_ = mixed(emitters, 0, learned);
  // Of paths that start by those chances.
  for (const PathVpl& light : lights)
    lights_of_path_ += static_cast<double>(keep(light.vpl.position, light.vpl.normal, scratch)) *
                       path_starts_.pmf(light.emitter) * emitters.power() / emitters.power_of(light.emitter) /
                       static_cast<double>(kLightPaths);
}

namespace {

// What a virtual light gives to a point of the camera, shadow aside, and the ray that looks for that.
double given_to(const SurfacePoint& point, const DirectSample& s, const Falloff& profiles, Ray& shadow) {
  shadow.org = point.position, shadow.tnear = 0.0f, shadow.mask = s.vpl.ray_mask;
  Vec3f towards = -s.vpl.normal;
  float falloff = 1.0f;
  shadow.dir = towards;
  if (s.vpl.kind != VplKind::directional) {
    shadow.dir = s.vpl.position + s.vpl.normal * s.offset - point.position, shadow.tfar = 1.0f;
    const Vec3f to = s.vpl.position - point.position;
    const float d2 = length2(to);
    if (!(d2 > 0.0f)) return 0.0;
    towards = to / std::sqrt(d2);
    // As if it were no nearer than it is wide: what is nearer is sampled otherwise [near_lights.h].
    falloff = 1.0f / (d2 + (s.density > 0.0 ? static_cast<float>(1.0 / s.density) : 0.0f));
    if (s.vpl.kind == VplKind::spot) falloff *= profiles.of_spot(s.vpl, -towards);
    if (s.vpl.kind == VplKind::oriented) falloff *= std::max(0.0f, -dot(s.vpl.normal, towards));
  }
  const float cosine = dot(point.normal, towards);
  if (!(cosine > 0.0f) || !(falloff > 0.0f)) return 0.0;
  const auto given = static_cast<double>(luminance(reflectance(point, towards) * s.vpl.intensity) * cosine * falloff);
  return std::isfinite(given) ? given : 0.0;
}

}  // namespace

// Root of the mean square over points of the camera, shadows included: lights by that make the least error in all.
std::vector<double> CameraImportance::root_mean_squares(const Scene& scene, const LightSampler& emitters, uint64_t seed,
                                                        const std::vector<CameraPoint>& points,
                                                        const std::vector<std::vector<uint32_t>>& groups,
                                                        Progress& progress) {
  const size_t first = emitters.emitter_count() - emitters.extended_count();
  std::vector<double> learned(emitters.emitter_count());
  std::vector<uint32_t> delta(first, kNoId);
  for (uint32_t d = 0; d < emitters.delta_emitters().size(); ++d)
    if (const uint32_t e = emitters.delta_emitters()[d]; e != kNoId) delta[e] = d;
  const Falloff profiles(scene.profiles());
  const size_t tried = std::clamp<size_t>((size_t{1} << 18) / std::max<size_t>(1, groups.size()), 64, 1024);
  parallel_chunks(groups.size(), 4, [&](size_t begin, size_t end) {
    if (progress.cancelled() || points.empty()) return;
    for (size_t g = begin; g < end; ++g) {
      if (groups[g][0] < first && delta[groups[g][0]] == kNoId) continue;  // the environment
      Rng rng(seed, Stage::importance, g, 1);
      std::vector<double> weights;
      for (const uint32_t e : groups[g]) weights.push_back(emitters.power_of(e));
      const DiscreteDistribution choice(weights);
      std::vector<double> squares(tried);
      std::vector<Ray> shadows(tried);
      for (size_t k = 0; k < tried; ++k) {
        const auto& [point, weight] = points[rng.next_below(static_cast<uint32_t>(points.size()))];
        const size_t member = choice.sample(static_cast<double>(rng.next_float()));
        const uint32_t e = groups[g][member];
        const DirectSample s =
            e < first ? DirectSample{emitters.delta_lights()[delta[e]]} : emitters.sample_extended(e - first, rng);
        const double given =
            static_cast<double>(weight) * given_to(point, s, profiles, shadows[k]) / choice.pmf(member);
        squares[k] = given * given;
      }
      const DiscreteDistribution likely(squares);
      if (likely.empty()) continue;
      std::vector<Ray> traced;
      for (size_t k = 0; k < kShadowRays; ++k)
        traced.push_back(shadows[likely.sample((static_cast<double>(k) + static_cast<double>(rng.next_float())) /
                                               static_cast<double>(kShadowRays))]);
      scene.accel().occluded(traced);
      const auto open = static_cast<double>(
          std::count_if(traced.begin(), traced.end(), [](const Ray& r) { return !(r.tfar < 0.0f); }));
      const double rms =
          std::sqrt(likely.total() / static_cast<double>(tried) * open / static_cast<double>(kShadowRays));
      for (size_t k = 0; k < groups[g].size(); ++k) learned[groups[g][k]] = rms * choice.pmf(k);
    }
  });
  progress.check();
  return learned;
}

void CameraImportance::weigh_direct(const LightSampler& emitters, const std::vector<double>& learned) {
  const size_t first = emitters.emitter_count() - emitters.extended_count();
  if (emitters.has_extended())
    direct_ = mixed(emitters, first, {learned.begin() + static_cast<std::ptrdiff_t>(first), learned.end()});
  // A light that gives r, kept by r over a share of the sum of all, adds that share · sum · r of variance at most.
  const std::vector<uint32_t>& deltas = emitters.delta_emitters();
  keep_delta_.assign(deltas.size(), 1.0f);
  double sum = 0.0;
  for (const uint32_t e : deltas) sum += e != kNoId ? learned[e] : 0.0;
  if (static_cast<double>(deltas.size()) * kDeltaVariance <= 1.0 || !(sum > 0.0)) return;
  for (size_t d = 0; d < deltas.size(); ++d)
    if (deltas[d] != kNoId)
      keep_delta_[d] = std::clamp(static_cast<float>(learned[deltas[d]] / (kDeltaVariance * sum)), kLeastChance, 1.0f);
}

}  // namespace lumicut
