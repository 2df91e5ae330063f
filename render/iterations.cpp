#include "render/iterations.h"

#include <cmath>

#include "core/rng.h"
#include "film/denoise.h"
#include "film/iteration_mean.h"

namespace lumicut {

Params params_of_iteration(const Params& params, uint32_t iteration, const Scene& scene) {
  if (iteration == 0) return params;
  CommonParams of = params.common();
  of.seed = hash64(of.seed, iteration) & 0xffffffffu;
  const double shrink = std::pow(iteration + 1.0, -0.25);
  if (const double scale = sphere_scale(of) * shrink; scale > 0.0)
    of.sphere_scale = static_cast<float>(std::max(scale, 0.001));
  if (!of.compensate) {
    if (const double clamp = clamp_distance(of, scene) * shrink; clamp > 0.0) of.clamp_distance = clamp;
    of.clamp_lights *= shrink * shrink;  // within an area
  }
  return params.with(of);
}

bool enough_iterations(const IterationOptions& options, uint32_t done, double seconds, double last_seconds,
                       double error) {
  if (options.count > 0 && done >= options.count) return true;
  if (options.max_seconds > 0.0 && seconds + 0.5 * last_seconds > options.max_seconds) return true;
  return options.target_error > 0.0 && done >= kLeastIterationsForError && error <= options.target_error;
}

uint64_t render_bytes(const Rect& crop, const IterationOptions& options, size_t groups, bool denoise) {
  const uint64_t film = film_pixel_bytes(groups, denoise), mean = IterationMean::pixel_bytes(denoise),
                 state = film + mean;
  uint64_t bytes = film;
  // The iteration beside the mean; a list in which the image's error is looked up; how many rays compensate a pixel.
  if (options.progressive()) bytes += film + mean + sizeof(double) + sizeof(uint8_t);
  // One is made, one is the last, one is what a host looks at. Or the one that the render goes on from.
  bytes += state * (options.checkpoints ? 3 : options.resume.empty() ? 0 : 1);
  // At the end, when no checkpoint is being made and the last iteration's film is gone.
  if (options.progressive() && denoise) {
    const uint64_t free = film + sizeof(double) + (options.checkpoints ? state : 0), at_end = denoising_pixel_bytes();
    bytes += at_end > free ? at_end - free : 0;
  }
  return bytes * crop.width() * crop.height();
}

}  // namespace lumicut
