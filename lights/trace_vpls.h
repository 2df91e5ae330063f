// Light tracing: lamps, emissive meshes and environment → VPLs. [Keller 1997; Walter et al. 2005 sec. 5]
#pragma once

#include "core/parallel.h"
#include "core/progress.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

struct VplOptions {
  uint32_t count = 60000;  // wanted lights in all; what comes is within a few percent
  float direct_share =
      0.25f;  // of them on extended emitters, for their direct light (point, spot and sun lamps take one each)
  uint32_t environment_count =
      0;                    // of them for the environment, not above `count`; 0: a part of the direct ones by power
  uint32_t max_depth = 32;  // surfaces a light path may meet
  uint64_t seed = 1;
  float sphere_scale = 0.0f;  // above 0: traced lights are spheres, with radii of so many times the distance to their
                              // tenth neighbour [lights/sphere_radii.h]
};

// Energy is normalised by the number of light paths. Deterministic. A scene without emitters gives no lights.
VplSet trace_vpls(const Scene& scene, const VplOptions& options, Progress& progress);

// The same lights with oriented ones and spheres moved off their surface by the scene's epsilon, so that shadow rays
// can start there. Traced lights and a host's own lie on their surfaces.
VplSet off_surfaces(const VplSet& set, const Scene& scene);

}  // namespace lumicut
