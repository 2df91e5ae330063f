// Renders by the loop that hosts drive too, and measures images against each other.
#pragma once

#include <gtest/gtest.h>

#include "core/parallel.h"
#include "lights/trace_vpls.h"
#include "render/render_loop.h"
#include "tests/support/test_scenes.h"

namespace lumicut::test {

struct Image {
  std::vector<Rgb> radiance;
  std::vector<float> cut_size;
  Counters counters;
};

struct RenderOptions {
  uint32_t width = 64, height = 48, samples = 1, tile_size = 32;
  int threads = 0;  // 0: all
};

using Settings = std::vector<std::pair<std::string, std::string>>;

// As the library traces them, on their surfaces.
inline VplSet lights_of(const Scene& scene, uint32_t count, uint64_t seed = 1, float sphere_scale = 0.0f) {
  Progress progress;
  return trace_vpls(scene, {.count = count, .seed = seed, .sphere_scale = sphere_scale}, progress);
}

// The same in a scene that is so many times as large, and gives so many times the light to its square.
inline VplSet scaled(VplSet set, float scale) {
  for (Vpl& v : set.lights) {
    v.position = v.position * scale, v.intensity = v.intensity * (scale * scale);
    v.offset *= scale, v.cell *= scale * scale, v.clamp2 *= scale * scale;
  }
  return set;
}

// As lights_of, off their surfaces: for an integrator that is prepared by hand.
inline VplSet standing_lights_of(const Scene& scene, uint32_t count) {
  return off_surfaces(lights_of(scene, count), scene);
}

// Of the integrator `id`, with virtual lights of the test's own.
inline Preparation preparation_of(const std::string& id, const VplSet& vpls, const Settings& settings) {
  const IntegratorEntry* entry = find_integrator(id);
  if (entry == nullptr) fail_argument("no integrator " + id);
  Preparation preparation(*entry);
  for (const auto& [name, value] : settings) preparation.params.set(name, value);
  preparation.host_lights = std::make_shared<const VplSet>(vpls);
  preparation.host_lights_id = 1;
  return preparation;
}

inline FrameOptions frame_of(const RenderOptions& options) {
  FrameOptions frame;
  frame.width = options.width, frame.height = options.height, frame.samples = options.samples;
  frame.tile_size = options.tile_size;
  frame.crop = {0, 0, options.width, options.height};
  return frame;
}

inline Image render(const Scene& scene, const std::string& id, const VplSet& vpls, const Settings& settings,
                    const RenderOptions& options = {}) {
  Preparation preparation = preparation_of(id, vpls, settings);
  const FrameOptions frame = frame_of(options);
  RenderLoop loop(preparation, scene, nullptr, frame, {}, {});
  Progress progress;
  Stats stats;
  Arena(options.threads).run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  Image image;
  image.radiance.resize(size_t{options.width} * options.height);
  image.cut_size.resize(image.radiance.size());
  loop.read([&](const Film& film) {
    film.read(Channel::radiance, frame.crop, &image.radiance[0].x);
    film.read(Channel::cut_size, frame.crop, image.cut_size.data());
  });
  image.counters = stats.counters();
  return image;
}

// But spheres, which no point light stands for.
inline VplSet lights_of_every_kind(int count) {
  constexpr VplKind kKinds[] = {VplKind::omni, VplKind::oriented, VplKind::directional, VplKind::spot, VplKind::lobed};
  Rng rng(3, Stage::test);
  VplSet vpls;
  for (int i = 0; i < count; ++i) {
    Vpl v;
    v.kind = kKinds[i % 5];
    v.position = random_point(rng, 0.9f);
    v.normal = v.kind == VplKind::omni ? Vec3f{} : random_direction(rng);
    v.intensity = {rng.next_float(), rng.next_float(), rng.next_float()};
    if (v.kind == VplKind::spot) v.cos_outer() = 0.3f, v.blend_cosine = 0.2f;
    if (v.kind == VplKind::lobed) {
      const Vec3f mirror = normalize(v.normal * 0.3f + Frame(v.normal).t);
      v.blend_cosine = mirror.x, v.spot_cosine = mirror.y, v.spread_tan = mirror.z;
      v.edge_or_radius = 0.8f, v.again = 0.1f, v.falloff = 0.5f;
    }
    vpls.lights.push_back(v);
  }
  return vpls;
}

// Without points nothing is shaded, and with them a cancel is heard.
inline void expect_no_points_and_cancel(const std::string& id, const Scene& scene, const VplSet& vpls,
                                        uint32_t points_a_pixel) {
  const IntegratorEntry* entry = find_integrator(id);
  const Params params(all_params(*entry));
  Progress progress;
  Stats stats;
  const auto integrator = entry->create();
  integrator->prepare(scene, vpls, params, {progress, stats});
  ShadePoints points;
  points.finish();
  integrator->shade(points, {}, {}, {progress, stats});
  SurfacePoint p;
  p.position = {0, 0, 0.9f}, p.normal = p.mirror = {0, 0, -1};
  for (uint32_t i = 0; i < 500; ++i) p.pixel = i / points_a_pixel, points.push(p);
  points.finish();
  std::vector<Rgb> radiance(points.size());
  progress.cancel();
  EXPECT_THROW(integrator->shade(points, radiance, {}, {progress, stats}), Error);
}

// A light in the middle of a room, as `parts` at one place.
inline VplSet light_in_parts(uint32_t parts) {
  VplSet set;
  Vpl v;
  v.position = {0, -0.5f, 0.8f};
  v.intensity = Rgb{1, 1, 1} * (1 / static_cast<float>(parts));
  set.lights.assign(parts, v);
  return set;
}

inline double mean_luminance(const std::vector<Rgb>& image) {
  double sum = 0;
  for (const Rgb& c : image) sum += luminance(c);
  return sum / static_cast<double>(image.size());
}

// Over images of compensated virtual lights, and how far it is from what they converge to (one standard error).
struct MeanOfIterations {
  double mean, deviation;
};
inline MeanOfIterations mean_of_iterations(const Scene& scene, uint64_t iterations, const RenderOptions& options) {
  double sum = 0, sum2 = 0;
  for (uint64_t seed = 1; seed <= iterations; ++seed) {
    const double mean = mean_luminance(render(scene, "exhaustive", lights_of(scene, 200, seed),
                                              {{"compensate", "true"}, {"seed", std::to_string(seed)}}, options)
                                           .radiance);
    sum += mean, sum2 += mean * mean;
  }
  const auto n = static_cast<double>(iterations);
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, sum2 / n - mean * mean) / n)};
}

// Mean of |luminance − reference| over max(reference, a thousandth of its mean).
inline double mean_relative_error(const std::vector<Rgb>& image, const std::vector<Rgb>& reference) {
  double mean = 0, sum = 0;
  for (const Rgb& c : reference) mean += luminance(c) / static_cast<double>(reference.size());
  for (size_t i = 0; i < image.size(); ++i)
    sum += std::abs(luminance(image[i]) - luminance(reference[i])) /
           std::max<double>(luminance(reference[i]), 1e-3 * mean);
  return sum / static_cast<double>(image.size());
}

inline double rmse_over_mean(const std::vector<Rgb>& image, const std::vector<Rgb>& reference) {
  double mean = 0, sum = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    mean += luminance(reference[i]);
    sum += length2(image[i] - reference[i]) / 3.0;
  }
  return std::sqrt(sum / static_cast<double>(image.size())) / (mean / static_cast<double>(image.size()));
}

}  // namespace lumicut::test
