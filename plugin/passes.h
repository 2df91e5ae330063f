// Progressive rendering: which virtual lights and clamp a pass has, when to stop, and the state that a render goes on
// from. [Davidovič et al. 2012]
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "film/film.h"
#include "film/pass_mean.h"
#include "integrators/frame.h"
#include "integrators/integrator.h"

namespace lumicut {

struct PassOptions {
  uint32_t passes = 1;  // 0: until stopped
  double max_seconds = 0.0, target_error = 0.0, confidence = 0.95;
  bool checkpoints = false, groups = false;
  std::vector<uint8_t> resume;
  bool progressive() const { return passes != 1 || checkpoints || !resume.empty(); }
};

// Fewest passes before an interval is believed enough to stop by it.
inline constexpr uint32_t kMinPassesForError = 8;

// Parameters of pass `pass` (0 is the first, which has them unchanged): lights of its own, and where nothing
// compensates the clamp, one that shrinks with the fourth root of the passes, so that its loss and the noise it hides
// vanish together. Spheres shrink in the same way.
Params params_of_pass(const Params& params, uint32_t pass, const Scene& scene);

// True after `done` passes of which the last took `last_seconds`.
bool enough_passes(const PassOptions& options, uint32_t done, double seconds, double last_seconds, double error);

// The state after `done` whole passes, as bytes, and back. `key`: what it was made for; another one, and bytes that are
// damaged, throw Error(invalid_argument).
std::vector<uint8_t> save_passes(const std::string& key, uint32_t done, const PassMean& mean, const Film& film);
uint32_t load_passes(const std::vector<uint8_t>& bytes, const std::string& key, PassMean& mean, Film& film);

// Memory that a render takes at its peak, in bytes: films, what averages them, checkpoints. Not what grows with the scene
// or the tile.
uint64_t render_bytes(const Rect& crop, const PassOptions& options, size_t groups);

// Of all that decides the image beside the number of passes [plugin/identity.h]. `host_lights`: null where they are
// traced.
std::string passes_key(const Scene& scene, const std::string& integrator, const Params& params,
                       const VplSet* host_lights, const FrameOptions& frame, const PassOptions& options);

}  // namespace lumicut
