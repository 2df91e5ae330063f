// What every integrator accepts, so that a host may set it whatever the method.
#pragma once

#include <cstdint>

#include "lights/trace_vpls.h"
#include "scene/scene.h"

namespace lumicut {

enum class VirtualLights { points, spheres };

struct CommonParams {
  uint32_t vpls = 60000;
  uint64_t seed = 1;
  uint32_t max_depth = 32;
  float direct_share = 0.25f;
  uint32_t environment_vpls = 0;  // 0: by power
  double clamp_lights = 40.0;     // that lie within the clamp
  double clamp_relative = 0.0;    // of the scene's radius; 0: by the lights
  double clamp_distance = 0.0;    // scene units; 0: by the others
  VirtualLights virtual_lights = VirtualLights::points;
  float sphere_scale = 1.0f;  // of the distance to the tenth nearest
  bool compensate = false;
  bool importance = false;
  bool trace_gloss = false;  // where compensated
  bool operator==(const CommonParams&) const = default;
};

// Distance below which no light comes nearer, in scene units: clamp_distance, or clamp_relative of the scene's radius.
// 0: it follows how densely they lie [render/clamp.h].
float clamp_distance(const CommonParams& params, const Scene& scene);

// sphere_scale where virtual lights are spheres, 0 where they are points.
float sphere_scale(const CommonParams& params);

// All that light tracing gets of the parameters, and so all that its lights depend on.
VplOptions vpl_options(const CommonParams& params);

}  // namespace lumicut
