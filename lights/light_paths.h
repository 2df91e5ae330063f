// Light paths: from emitters through the scene, a virtual light wherever one meets what reflects evenly.
#pragma once

#include <vector>

#include "core/progress.h"
#include "lights/camera_importance.h"
#include "lights/light_sampler.h"
#include "lights/trace_vpls.h"

namespace lumicut {

// A virtual light with the light path it came from, to keep the order of paths whatever the order of work.
struct PathVpl {
  uint64_t path;
  uint32_t emitter;  // that the path starts at, as LightSampler counts all
  Vpl vpl;
  DiffuseLobe lobe;
};

struct LightPaths {
  std::vector<PathVpl> lights;
  std::vector<Glint> glints;  // all of them, whatever importance keeps
};

// Of paths [first, last), in their order, not divided by their number. `importance`: chooses where paths
// start and which lights are kept; null: by power alone, and all. Deterministic. Throws Error(cancelled).
LightPaths trace_light_paths(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                             const CameraImportance* importance, uint64_t first, uint64_t last, Progress& progress);

}  // namespace lumicut
