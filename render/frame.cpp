#include "render/frame.h"

#include <numbers>
#include <optional>
#include <set>

#include "core/parallel.h"
#include "core/rng.h"
#include "lights/light_reach.h"
#include "render/camera_rays.h"
#include "render/clamp_compensation.h"
#include "render/denoising_features.h"
#include "render/traced_gloss.h"
#include "scene/rng_at_point.h"

namespace lumicut {

namespace {

// Bits of x at the even places of a 32-bit word, taken together.
uint32_t even_bits(uint32_t x) {
  x &= 0x55555555u;
  x = (x | x >> 1) & 0x33333333u;
  x = (x | x >> 2) & 0x0f0f0f0fu;
  x = (x | x >> 4) & 0x00ff00ffu;
  return (x | x >> 8) & 0x0000ffffu;
}

// Of radiation weighted by luminance, by convention: what 555 nm has. [docs/units.md]
constexpr float kLumenPerWatt = 683.0f;

struct PixelSums {
  std::vector<std::pair<uint32_t, Rgb>> seen;  // emitted towards the camera, by light group
  Vec3f normal{};
  Rgb albedo{};
  Vec3f position{};
  float depth = 0.0f, hits = 0.0f;
};

class Batch {
 public:
  // `surfaces`: where anything of the scene may be specular. `seen`: where the camera sees lamps.
  Batch(const Scene& scene, std::span<const GroupMethod> methods, const FrameOptions& options, const CameraRays& camera,
        const LightSurfaces* surfaces, const LightSurfaces* seen)
      : scene_(scene),
        methods_(methods),
        options_(options),
        camera_(camera),
        light_surfaces_(surfaces),
        seen_lamps_(seen) {}

  void add_tile(const Rect& tile) {
    tiles_.push_back(tile);
    const uint32_t side = std::max(tile.width(), tile.height());
    uint32_t bits = 1;
    while ((1u << bits) < side) ++bits;
    // Morton order within the tile: neighbours in the image lie together in memory, and share packets.
    for (uint32_t code = 0; code < 1u << (2 * bits); ++code) {
      const uint32_t x = tile.x0 + even_bits(code), y = tile.y0 + even_bits(code >> 1);
      if (x < tile.x1 && y < tile.y1) pixels_.push_back({x, y});
    }
  }

  // Camera rays → points.
  void collect(ShadeContext context) {
    const size_t samples = options_.samples;
    sums_.resize(pixels_.size());
    if (options_.denoise) features_.emplace(scene_, pixels_.size());
    std::vector<SurfacePoint> found(pixels_.size() * samples);
    std::vector<uint8_t> hit(found.size(), 0);
    const size_t most_further = scene_.most_layers() - 1;
    std::vector<SurfacePoint> further(most_further * found.size());  // layers after the first
    std::vector<uint8_t> further_count(most_further > 0 ? found.size() : 0, 0);
    const size_t chunk = std::max<size_t>(1, 1024 / samples);
    std::vector<std::vector<ChainRay>> chains(pixels_.size() / chunk + 1);  // of each chunk
    parallel_chunks(pixels_.size(), chunk, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      std::vector<RayHit> rays((end - begin) * samples);
      std::vector<float> cosines(rays.size());
      for (size_t p = begin; p < end; ++p)
        camera_.of_pixel(pixels_[p].x, pixels_[p].y, rays.data() + (p - begin) * samples,
                         cosines.data() + (p - begin) * samples);
      if (!scene_.bounds().empty()) scene_.accel().intersect(rays);
      std::vector<FeatureTracer::Way> ways;
      for (size_t i = 0; i < rays.size(); ++i) {
        const size_t p = begin + i / samples;
        const size_t at = begin * samples + i;
        if (rays[i].ray.mask == 0) continue;
        if (seen_lamps_ != nullptr) see_lamps(rays[i], p);
        if (rays[i].hit.geom == kNoId) {
          miss(rays[i], p);
          if (features_) features_->miss(static_cast<uint32_t>(p), rays[i].ray.dir);
          continue;
        }
        const SurfaceInteraction seen = scene_.interaction(rays[i], static_cast<uint32_t>(p));
        if (scene_.materials()[seen.material].holdout) continue;
        first_hit(seen, p, cosines[i]);
        if (features_) features_->hit(static_cast<uint32_t>(p), seen, cosines[i], ways);
        const auto layers = seen.bsdf.layers();
        hit[at] = 1, found[at] = layers[0];
        if (layers.size() > 1) {
          further_count[at] = static_cast<uint8_t>(layers.size() - 1);
          std::copy(layers.begin() + 1, layers.end(), further.begin() + static_cast<ptrdiff_t>(most_further * at));
        }
        if (seen.bsdf.is_specular()) start_chains_of(seen.bsdf, p, i % samples, chains[begin / chunk]);
        if (options_.lobes == 0) continue;
        limit(found[at], options_.lobes, 0);
        for (size_t k = 0; k < further_count_of(further_count, at); ++k)
          limit(further[most_further * at + k], options_.lobes, 0);
      }
      if (ways.empty()) return;
      Counters counters;
      features_->follow(std::move(ways), context.progress, counters);
      context.stats.add(counters);
    });
    context.progress.check();
    points_.reserve(found.size());
    for (size_t i = 0; i < found.size(); ++i) {
      if (i % 65536 == 0) context.progress.check();
      if (hit[i] == 0) continue;
      points_.push(found[i]);
      if (most_further == 0) continue;
      further_.push_back(false);
      for (size_t k = 0; k < further_count[i]; ++k)
        points_.push(further[most_further * i + k]), further_.push_back(true);
    }
    points_.finish();
    std::vector<ChainRay> rays;
    for (const auto& of_chunk : chains) rays.insert(rays.end(), of_chunk.begin(), of_chunk.end());
    if (rays.empty()) return;
    Counters counters;
    follow_chains(scene_, *light_surfaces_, std::move(rays), context.progress, seen_, counters, options_.direct);
    context.stats.add(counters);
  }

  // The points of the camera, and those that rays from them find.
  // `rays`: of compensation, from each point of a pixel of the crop.
  void shade(const NearbyLights* nearby, const ClampCompensation* compensation, std::span<const uint8_t> rays,
             ShadeContext context) {
    if (!rays.empty())
      for (const auto& [x, y] : pixels_)
        rays_.push_back(rays[size_t{y - options_.crop.y0} * options_.crop.width() + (x - options_.crop.x0)]);
    light_.assign(methods_.size(), std::vector<Rgb>(pixels_.size()));
    counts_.assign(pixels_.size(), {});
    if (options_.denoise) residual_.assign(pixels_.size(), {});
    if (options_.illuminance) illuminance_.assign(pixels_.size(), 0.0f);
    if (options_.occlusion > 0.0f) return occlude(context);
    shade_levels(points_, nearby, compensation, light_, context, options_.denoise);
    for (size_t i = 0; i < seen_.light.size(); ++i) {
      light_[slot(seen_.group[i])][seen_.pixel[i]] += seen_.light[i];
      if (options_.denoise && !seen_.seen_surely[i]) residual_[seen_.pixel[i]] += seen_.light[i];
    }
    if (!seen_.found.empty()) {
      const ShadePoints points = seen_.points();
      shade_levels(points, nearby, compensation, light_, context, options_.denoise, &seen_.found_surely);
    }
    if (!options_.illuminance) return;
    // White Lambert surfaces show the irradiance over π.
    ShadePoints white;
    white.reserve(points_.size());
    for (size_t i = 0; i < points_.size(); ++i) {
      if (!further_.empty() && further_[i]) continue;  // its place has a point of its own
      const SurfacePoint place = points_.get(i);
      SurfacePoint point;  // of its material it has nothing
      point.position = place.position, point.normal = place.normal, point.mirror = place.mirror;
      point.pixel = place.pixel, point.not_lit_by = place.not_lit_by;
      point.diffuse = Rgb{1, 1, 1} * std::numbers::inv_pi_v<float>;
      white.push(point);
    }
    white.finish();
    std::vector<std::vector<Rgb>> shown(methods_.size(), std::vector<Rgb>(pixels_.size()));
    shade_levels(white, nearby, compensation, shown, context, false);
    for (const auto& of_group : shown)
      for (size_t p = 0; p < pixels_.size(); ++p)
        illuminance_[p] += kLumenPerWatt * std::numbers::pi_v<float> * luminance(of_group[p]);
  }

  void write(Film& film) const {
    const float scale = 1.0f / static_cast<float>(options_.samples);
    for (size_t p = 0; p < pixels_.size(); ++p) {
      const auto [x, y] = pixels_[p];
      const PixelSums& s = sums_[p];
      Rgb all{};
      for (size_t g = 0; g < methods_.size(); ++g) all += light_[g][p];
      for (const auto& [group, radiance] : s.seen) all += radiance;
      film.set(Channel::radiance, x, y, all * scale);
      for (size_t g = 0; g < film.groups().size(); ++g) {
        Rgb of_group = light_[g][p];
        for (const auto& [group, radiance] : s.seen)
          if (group == methods_[g].group) of_group += radiance;
        std::copy_n(&(of_group *= scale).x, 3, film.group_pixel(g, x, y));
      }
      if (options_.illuminance) film.set(Channel::illuminance, x, y, s.hits > 0.0f ? illuminance_[p] / s.hits : 0.0f);
      if (options_.denoise) {
        const DenoisingFeatures& f = features_->sum(p);
        film.set(Channel::residual, x, y, residual_[p] * scale);
        film.set(Channel::denoising_albedo, x, y, f.albedo * scale);
        film.set(Channel::denoising_normal, x, y, f.normal * scale);
        film.set(Channel::denoising_depth, x, y, f.depth * scale);
        film.set(Channel::denoising_color, x, y, all * scale);
        film.set(Channel::denoised, x, y, all * scale);
      }
      film.set(Channel::alpha, x, y, s.hits * scale);
      film.set(Channel::depth, x, y, s.depth);
      film.set(Channel::normal, x, y, normalize(s.normal));
      film.set(Channel::albedo, x, y, s.albedo * scale);
      film.set(Channel::position, x, y, s.position);
      film.set(Channel::cut_size, x, y, counts_[p].x * scale);
      film.set(Channel::rays, x, y, counts_[p].y * scale);
      film.set(Channel::bounds, x, y, counts_[p].z * scale);
    }
  }

  const std::vector<Rect>& tiles() const { return tiles_; }
  size_t pixel_count() const { return pixels_.size(); }

 private:
  // Chance ends chains long before.
  static constexpr uint32_t kMaxLevels = 64;

  // `residual`: whether `residual_` is kept, the light whose noise neighbours do not share: all but what virtual lights
  // bring to the first points, unless the method chooses them anew at each. `surely`: of each first point, whether nothing
  // on the way to it was left to chance, else that is of the residual too; null: to none was.
  void shade_levels(const ShadePoints& first, const NearbyLights* nearby, const ClampCompensation* compensation,
                    std::vector<std::vector<Rgb>>& light, ShadeContext context, bool residual,
                    const std::vector<bool>* surely = nullptr) {
    const ShadePoints* points = &first;
    ShadePoints found;
    for (uint32_t level = 1; level <= kMaxLevels && points->size() > 0; ++level) {
      context.progress.check();
      add_light(*points, light, context, residual, level, level == 1 ? surely : nullptr);
      Counters counters;
      TracedPoints hits;
      if (nearby != nullptr)
        nearby->trace(*points, {level, compensation != nullptr, false}, context.progress, hits, counters);
      if (compensation != nullptr)
        compensation->trace(*points, level, level == 1 ? std::span<const uint8_t>(rays_) : std::span<const uint8_t>(),
                            context.progress, hits, counters);
      context.stats.add(counters);
      for (size_t i = 0; i < hits.light.size(); ++i) light[slot(hits.group[i])][hits.pixel[i]] += hits.light[i];
      if (residual)
        for (size_t i = 0; i < hits.light.size(); ++i) residual_[hits.pixel[i]] += hits.light[i];
      if (compensation == nullptr || options_.direct) return;
      found = hits.points();
      points = &found;
    }
  }

  size_t slot(uint32_t group) const {
    if (methods_.size() == 1) return 0;
    size_t g = 0;
    while (g + 1 < methods_.size() && methods_[g].group != group) ++g;
    return g;
  }

  void add_light(const ShadePoints& points, std::vector<std::vector<Rgb>>& light, ShadeContext context, bool residual,
                 uint32_t level, const std::vector<bool>* surely) {
    if (points.size() == 0) return;
    // Points some of whose gloss rays bring, and the others; where there are no such points, `points` are the others.
    std::vector<bool> has_gloss;
    if (std::any_of(methods_.begin(), methods_.end(), [](const GroupMethod& m) { return m.traces(); }))
      for (size_t i = 0; i < points.size(); ++i) has_gloss.push_back(traced_gloss(points.get(i)) > 0.0f);
    const bool apart = std::find(has_gloss.begin(), has_gloss.end(), true) != has_gloss.end();
    Part glossy, dimmed, others;
    for (size_t i = 0; apart && i < points.size(); ++i) {
      const SurfacePoint point = points.get(i);
      const bool sure = surely != nullptr && (*surely)[i];
      if (has_gloss[i])
        glossy.push(point, sure), dimmed.push(without_traced_gloss(point), sure);
      else
        others.push(point, sure);
    }
    for (Part* part : {&glossy, &dimmed, &others}) part->points.finish();
    const auto shade = [&](const Integrator* method, const ShadePoints& of, const std::vector<bool>* sure, size_t g) {
      if (method != nullptr) add_light(*method, of, light[g], context, residual, level, sure);
    };
    const auto shade_part = [&](const Integrator* method, const Part& part, size_t g) {
      if (part.points.size() > 0) shade(method, part.points, surely != nullptr ? &part.surely : nullptr, g);
    };
    for (size_t g = 0; g < methods_.size(); ++g) {
      const GroupMethod& m = methods_[g];
      if (!apart || !m.traces()) {
        shade(m.method, points, surely, g);
        continue;
      }
      shade_part(m.method, others, g);
      shade_part(m.others, glossy, g), shade_part(m.traced, dimmed, g);
    }
  }

  void add_light(const Integrator& method, const ShadePoints& points, std::vector<Rgb>& light, ShadeContext context,
                 bool residual, uint32_t level, const std::vector<bool>* surely) {
    std::vector<Rgb> radiance(points.size());
    std::vector<PointCounts> counts(points.size());
    method.shade(points, radiance, counts, context);
    if (residual) {
      const bool all = level > 1 || method.chooses_at_each_point();
      for (size_t i = 0; i < points.size(); ++i)
        if (all || (surely != nullptr && !(*surely)[i])) residual_[points.pixel[i]] += radiance[i];
    }
    for (size_t i = 0; i < points.size(); ++i) {
      const uint32_t p = points.pixel[i];
      light[p] += radiance[i];
      counts_[p] += Vec3f{static_cast<float>(counts[i].clusters), static_cast<float>(counts[i].rays),
                          static_cast<float>(counts[i].bounds)};
    }
  }

  static void see(PixelSums& sum, uint32_t group, const Rgb& radiance) {
    if (!(max_component(radiance) > 0.0f)) return;
    for (auto& [of, light] : sum.seen)
      if (of == group) {
        light += radiance;
        return;
      }
    sum.seen.emplace_back(group, radiance);
  }

  static size_t further_count_of(const std::vector<uint8_t>& counts, size_t at) {
    return counts.empty() ? 0 : counts[at];
  }
  // What is seen to emit is in the image.
  bool shows_emission() const { return options_.lobes == 0 && !(options_.occlusion > 0.0f); }

  // Of each first point the share of rays that meet nothing nearby.
  void occlude(ShadeContext context) {
    constexpr uint32_t kRays = 16;
    constexpr size_t kChunk = 1024;
    std::vector<float> open(points_.size());
    parallel_chunks(points_.size(), kChunk, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      std::vector<Ray> rays;
      for (size_t i = begin; i < end; ++i) {
        const SurfacePoint point = points_.get(i);
        Rng rng = rng_at_point(scene_, point, hash64(options_.seed, kRays), Stage::nearby_lights);
        const float shift_u = rng.next_float(), shift_v = rng.next_float();
        for (uint32_t k = 0; k < kRays; ++k) {
          // Even for any number of samples. [Roberts 2018: R2]
          const float u = shift_u + static_cast<float>(k) * 0.75487767f,
                      v = shift_v + static_cast<float>(k) * 0.5698403f;
          Ray ray;
          ray.org = point.position;
          ray.dir = sample_cosine_hemisphere(point.normal, u - std::floor(u), v - std::floor(v));
          ray.tfar = options_.occlusion, ray.mask = kShadowRay;
          rays.push_back(ray);
        }
      }
      scene_.accel().occluded(rays);
      for (size_t i = 0; i < rays.size(); ++i)
        if (!(rays[i].tfar < 0.0f)) open[begin + i / kRays] += 1.0f / kRays;
    });
    context.progress.check();
    for (size_t i = 0; i < points_.size(); ++i) {
      if (!further_.empty() && further_[i]) continue;
      const Rgb grey = Rgb{1, 1, 1} * open[i];
      light_[0][points_.pixel[i]] += grey;
      if (options_.denoise) residual_[points_.pixel[i]] += grey;
    }
    seen_ = {};
  }

  void see_lamps(const RayHit& ray, size_t p) {
    if (!shows_emission()) return;
    seen_lamps_->for_each_hit(ray.ray.org, ray.ray.dir, ray.ray.tfar, [&](const LightSurfaces::Hit& lamp) {
      see(sums_[p], scene_.lights()[lamp.light].group, lamp.radiance);
    });
  }

  void miss(const RayHit& ray, size_t p) {
    if (!scene_.environment().hidden && shows_emission())
      see(sums_[p], scene_.environment().group, scene_.environment_radiance(ray.ray.dir));
  }

  // Into the sums of pixel p.
  void first_hit(const SurfaceInteraction& at, size_t p, float cosine) {
    PixelSums& sum = sums_[p];
    if (shows_emission()) see(sum, scene_.meshes()[at.mesh].group, at.emitted);
    sum.normal += at.bsdf.normal();
    sum.albedo += options_.lobes == 0 ? at.bsdf.albedo() : albedo_of_lobes(at.bsdf);
    if (sum.hits == 0.0f) sum.position = at.position, sum.depth = at.t * cosine;
    sum.hits += 1.0f;
  }

  Rgb albedo_of_lobes(const Bsdf& bsdf) const {
    Rgb sum{};
    if ((options_.lobes & kDiffuseRay) != 0) sum += bsdf.even_color();
    if ((options_.lobes & kGlossyRay) != 0) sum += bsdf.reflected_color();
    if ((options_.lobes & kTransmissionRay) != 0) sum += bsdf.passed_color();
    return sum;
  }

  // What a mirror or glass goes on to show.
  void start_chains_of(const Bsdf& bsdf, size_t p, size_t sample, std::vector<ChainRay>& chains) const {
    const auto [x, y] = pixels_[p];
    ChainRay::State from_camera;
    from_camera.sure = true;
    const size_t before = chains.size();
    start_chains(bsdf, {1, 1, 1}, static_cast<uint32_t>(p),
                 Rng(hash64(options_.seed, sample), Stage::compensation, x, y), from_camera, chains);
    if (options_.lobes == 0) return;
    const auto other = [&](const ChainRay& ray) { return (ray.state.kind & options_.lobes) == 0; };
    chains.erase(std::remove_if(chains.begin() + static_cast<ptrdiff_t>(before), chains.end(), other), chains.end());
  }

  struct Pixel {
    uint32_t x, y;
  };
  struct Part {
    ShadePoints points;
    std::vector<bool> surely;
    void push(const SurfacePoint& point, bool sure) { points.push(point), surely.push_back(sure); }
  };
  const Scene& scene_;
  const std::span<const GroupMethod> methods_;
  const FrameOptions& options_;
  const CameraRays& camera_;
  const LightSurfaces* const light_surfaces_;
  const LightSurfaces* const seen_lamps_;
  std::vector<Rect> tiles_;
  std::vector<Pixel> pixels_;
  std::vector<PixelSums> sums_;
  ShadePoints points_;
  std::vector<bool> further_;            // of each point, where the scene has any: whether its place has one before it
  TracedPoints seen_;                    // by way of mirrors and glass
  std::vector<std::vector<Rgb>> light_;  // of each method: reflected, summed over a pixel's samples
  std::vector<float> illuminance_;       // summed over a pixel's samples
  std::vector<uint8_t> rays_;            // of compensation, from each point of a pixel; none: one
  std::vector<Rgb> residual_;            // of what is in light_, summed over a pixel's samples
  std::optional<FeatureTracer> features_;
  std::vector<Vec3f> counts_;  // clusters, rays, bounds
};

}  // namespace

std::vector<Rect> frame_tiles(const FrameOptions& options) {
  std::vector<Rect> tiles;
  const Rect& c = options.crop;
  for (uint32_t y = c.y0; y < c.y1; y += options.tile_size)
    for (uint32_t x = c.x0; x < c.x1; x += options.tile_size)
      tiles.push_back({x, y, std::min(c.x1, x + options.tile_size), std::min(c.y1, y + options.tile_size)});
  return tiles;
}

std::vector<uint32_t> light_groups(const Scene& scene) {
  std::set<uint32_t> groups;
  for (const Light& l : scene.lights()) groups.insert(l.group);
  if (!scene.environment().black()) groups.insert(scene.environment().group);
  for (const Mesh& m : scene.meshes()) {
    const auto emits = [&](uint32_t material) { return scene.materials()[material].emissive(); };
    if (m.triangle_materials.empty() ? m.triangle_count() > 0 && emits(m.material)
                                     : std::any_of(m.triangle_materials.begin(), m.triangle_materials.end(), emits))
      groups.insert(m.group);
  }
  return {groups.begin(), groups.end()};
}

void render_frame(const Scene& scene, std::span<const GroupMethod> methods, const FrameOptions& options,
                  const FrameLight& light, Film& film, ShadeContext context,
                  const std::function<void(const Rect&)>& tile_done) {
  const std::vector<Rect> tiles = frame_tiles(options);
  size_t batch_size = 1;
  for (const GroupMethod& m : methods)
    for (const Integrator* method : {m.method, m.traced, m.others})
      if (method != nullptr) batch_size = std::max(batch_size, method->batch_size());
  // Batches hold consecutive tiles, and depend on the integrator's wish alone: never on the number of threads.
  std::vector<std::pair<size_t, size_t>> batches;
  for (size_t first = 0; first < tiles.size();) {
    size_t last = first, points = 0;
    while (last < tiles.size() && (last == first || points < batch_size)) {
      points += size_t{tiles[last].width()} * tiles[last].height() * options.samples;
      ++last;
    }
    batches.emplace_back(first, last);
    first = last;
  }
  const CameraRays camera(scene.camera(), options);
  std::optional<LightSurfaces> light_surfaces;
  if (scene.may_be_specular()) light_surfaces.emplace(scene, LightSurfaces::RaysOf::mirrors);
  std::optional<LightSurfaces> seen_lamps;
  if (std::any_of(scene.lights().begin(), scene.lights().end(),
                  [](const Light& l) { return l.reach.lights(kCameraRay); }))
    seen_lamps.emplace(scene, LightSurfaces::RaysOf::camera);
  std::optional<ClampCompensation> compensation;
  if (light.compensated != nullptr)
    compensation.emplace(scene, *light.compensated, light.nearby, light.spheres, light.trace_gloss, light.sky,
                         light.glints, options.direct, options.seed);
  context.progress.begin("render", size_t{options.crop.width()} * options.crop.height());
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, batches.size(), 1),
      [&](const tbb::blocked_range<size_t>& range) {
        const CurrentWork current(&context.progress);
        for (size_t b = range.begin(); b < range.end(); ++b) {
          context.progress.check();
          Batch batch(scene, methods, options, camera, light_surfaces ? &*light_surfaces : nullptr,
                      seen_lamps ? &*seen_lamps : nullptr);
          for (size_t t = batches[b].first; t < batches[b].second; ++t) batch.add_tile(tiles[t]);
          batch.collect(context);
          batch.shade(light.nearby, compensation ? &*compensation : nullptr, light.rays, context);
          context.progress.check();
          batch.write(film);
          context.progress.advance(batch.pixel_count());
          for (const Rect& tile : batch.tiles()) tile_done(tile);
        }
      },
      tbb::simple_partitioner());
}

}  // namespace lumicut
