// Progressive rendering: which virtual lights and clamp an iteration has, when to stop, what memory it takes.
// [Davidovič et al. 2012]
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "film/film.h"
#include "integrators/integrator.h"

namespace lumicut {

struct IterationOptions {
  uint32_t count = 1;  // 0: until stopped
  double max_seconds = 0.0, target_error = 0.0, confidence = 0.95;
  bool checkpoints = false, groups = false, keep_fireflies = false;
  std::vector<uint8_t> resume;
  bool progressive() const { return count != 1 || checkpoints || !resume.empty(); }
};

// Fewest iterations before an interval is believed enough to stop by it.
inline constexpr uint32_t kLeastIterationsForError = 8;

// Parameters of an iteration (0 is the first, which has them unchanged): lights of its own, and where nothing
// compensates the clamp, one that shrinks with the fourth root of the iterations, so that its loss and the noise it hides
// vanish together. Spheres shrink in the same way.
Params params_of_iteration(const Params& params, uint32_t iteration, const Scene& scene);

// True after `done` iterations of which the last took `last_seconds`.
bool enough_iterations(const IterationOptions& options, uint32_t done, double seconds, double last_seconds,
                       double error);

// Memory that a render takes at its peak, in bytes: films, what averages them, checkpoints. Not what grows with the scene
// or the tile.
uint64_t render_bytes(const Rect& crop, const IterationOptions& options, size_t groups, bool denoise);

}  // namespace lumicut
