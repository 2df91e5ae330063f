// Lobes too sharp for point lights to shade: mirrors and glass. Eye paths and light paths follow them alike.
#pragma once

#include <optional>

#include "scene/scene.h"

namespace lumicut {

struct Followed {
  Vec3f origin;     // off the surface, on the side that the path goes on
  Vec3f direction;  // unit
  Rgb weight{};     // of what comes along `direction`, for what goes to the viewer: factor · cosine / density
  bool transmitted = false;
};

// One direction out of the surface's followed lobes: metal, dielectric and clear coats of α below kLeastAlpha, and
// glass, which reflects or refracts by chance of its Fresnel reflectance. `choice`, `u`, `v` in [0, 1). Empty where the
// material has no such lobe, or where the light is lost in it. What Scene::shade_point makes of the same hit leaves
// these lobes out: light to the viewer is the sum of both. The mean weight is at most 1 (of one direction through rough
// glass it may be more: what others lose is given back); solid angles that refraction narrows are not in it, since a
// closed body widens them again.
std::optional<Followed> follow(const Scene& scene, const SurfaceHit& hit, const Vec3f& to_viewer, float choice, float u,
                               float v);

}  // namespace lumicut
