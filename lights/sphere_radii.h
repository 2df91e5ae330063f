// Radii of virtual spherical lights from how densely they lie. [Hašan et al. 2009, sec. 4: the tenth nearest light]
// Departs: held between shares of the scene's radius, so that lights in one place keep a size and lonely ones do not
// shine through the whole scene.
#pragma once

#include <span>

#include "core/progress.h"
#include "lights/vpl.h"

namespace lumicut {

inline constexpr size_t kSphereNeighbour = 10;
inline constexpr float kLeastSphere = 1e-3f, kLargestSphere = 0.1f;  // of the scene's radius, before `scale`

// Oriented lights become spheres of `scale` times the distance to their tenth neighbour among `lights`; where there are
// not so many, of the largest radius.
void make_spheres(std::span<Vpl> lights, float scale, float scene_radius, const Progress* progress = nullptr);

}  // namespace lumicut
