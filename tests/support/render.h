// Renders a frame below the C ABI, and measures images against each other.
#pragma once

#include "core/parallel.h"
#include "lights/trace_vpls.h"
#include "render/frame.h"
#include "tests/support/test_scenes.h"

namespace lumicut::test {

struct Frame {
  std::vector<Rgb> radiance;
  std::vector<float> cut_size;
  Counters counters;
};

using Settings = std::vector<std::pair<std::string, std::string>>;

inline VplSet lights_of(const Scene& scene, uint32_t count, uint64_t seed = 1, float sphere_scale = 0.0f) {
  Progress progress;
  return off_surfaces(trace_vpls(scene, {.count = count, .seed = seed, .sphere_scale = sphere_scale}, progress), scene);
}

inline Frame render(const Scene& scene, const std::string& id, const VplSet& vpls, const Settings& settings,
                    uint32_t width = 64, uint32_t height = 48, uint32_t samples = 1, int threads = 0,
                    float compensate = 0.0f, uint64_t seed = 1, bool spheres = false) {
  const IntegratorEntry* entry = find_integrator(id);
  if (entry == nullptr) fail_argument("no integrator " + id);
  Params params(all_params(*entry));
  for (const auto& [name, value] : settings) params.set(name, value);
  Progress progress;
  Stats stats;
  FrameOptions options;
  options.width = width, options.height = height, options.samples = samples, options.tile_size = 32;
  options.crop = {0, 0, width, height};
  options.compensate = compensate, options.seed = seed, options.spheres = spheres;
  Film film(options.crop);
  Arena arena(threads);
  arena.run([&] {
    const auto integrator = entry->create();
    integrator->prepare(scene, vpls, params, {progress, stats});
    render_frame(scene, *integrator, options, film, {progress, stats}, [](const Rect&) {});
  });
  Frame frame;
  frame.radiance.resize(size_t{width} * height);
  frame.cut_size.resize(frame.radiance.size());
  film.read(Channel::radiance, options.crop, &frame.radiance[0].x);
  film.read(Channel::cut_size, options.crop, frame.cut_size.data());
  frame.counters = stats.counters();
  return frame;
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
