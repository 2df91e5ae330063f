// Light tracing: lights, emissive meshes and environment → VPLs. [Keller 1997; Walter et al. 2005 sec. 5]
#pragma once

#include "core/fields.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

class CameraImportance;
class LightSampler;

struct VplOptions {
  // Wanted lights in all; what comes is within some percent.
  uint32_t count = 60000;
  // Of them on extended emitters, for their direct light (point, spot and sun lights take one each).
  float direct_share = 0.25f;
  // Of them for the environment, not above `count`; 0: a part of the direct ones by power.
  uint32_t environment_count = 0;
  // Surfaces a light path may meet.
  uint32_t max_depth = 32;
  uint64_t seed = 1;
  // Above 0: traced lights are spheres, with radii of so many times the distance to their tenth neighbour
  // [lights/sphere_radii.h].
  float sphere_scale = 0.0f;
  LUMICUT_FIELDS(VplOptions, count, direct_share, environment_count, max_depth, seed, sphere_scale)
};

// Energy is normalised by the number of light paths. Deterministic. A scene without emitters gives no lights.
VplSet trace_vpls(const Scene& scene, const VplOptions& options, Progress& progress);
// `importance`: lights are where the camera feels them, by chance and weighted for it; null: by power alone.
VplSet trace_vpls(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                  const CameraImportance* importance, Progress& progress);

// The same lights with oriented ones and spheres moved off their surface by their offset, so that shadow rays can start
// there, and oriented ones of surfaces that are not Lambert's made lobed. Traced lights and a host's own lie on their surfaces;
// those whose offset is not known have the one of the triangle that they lie on. Lights of light paths ask for what stops
// bounced light (Vpl::ray_mask), where any path is known. Without glints and lobes. Throws Error(cancelled).
VplSet off_surfaces(const VplSet& set, const Scene& scene);

}  // namespace lumicut
