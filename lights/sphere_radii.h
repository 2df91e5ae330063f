// Radii of virtual spherical lights from how densely they lie. [Hašan et al. 2009, sec. 4: the tenth nearest light]
// Departs: not below a share of the scene's typical radius, so that lights in one place keep a size.
#pragma once

#include <span>

#include "core/progress.h"
#include "lights/vpl.h"

namespace lumicut {

inline constexpr float kLeastSphere = 1e-3f, kLonelySphere = 0.1f;  // of SceneExtent::radius, before `scale`

// Oriented lights become spheres of `scale` times the distance to their tenth neighbour among `lights`
// [lights/light_spacing.h]; a lone one that of lonely ones.
void make_spheres(std::span<Vpl> lights, float scale, float typical_radius, const Progress* progress = nullptr);

}  // namespace lumicut
