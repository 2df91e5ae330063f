// Rays that leave the points of a frame, and bring what virtual lights cannot: the light that the clamp takes away.
// [Kollig, Keller 2004: weight 1 − min(G, b)/G; here with the clamp's d²/c²] And the light that a glossy surface throws
// on another: virtual lights stand for what is reflected evenly, whatever the direction.
#pragma once

#include <memory>

#include "core/stats.h"
#include "lights/light_surfaces.h"
#include "render/nearby_lights.h"
#include "render/specular_chain.h"
#include "scene/scene.h"

namespace lumicut {

class ClampCompensation {
 public:
  // `distance`: that of the clamp, above 0. `spheres`: virtual lights on surfaces are, and lose nothing by it. Scene
  // outlives this. Throws Error(cancelled).
  ClampCompensation(const Scene& scene, float distance, bool spheres, uint64_t seed, const Progress& progress);

  // One ray from each point (unless it is cut short by chance, or the point is black), one sample of each near light,
  // and one of all emissive meshes. `level` counts the surfaces since the camera. Deterministic: numbers belong to the places of points.
  TracedPoints trace(const ShadePoints& points, uint32_t level, const Progress& progress, Counters& counters) const;

 private:
  void nearby_lights(const SurfacePoint& point, Rng& rng, std::vector<Ray>& shadows, TracedPoints& hits) const;

  void near_mesh(const SurfacePoint& point, Rng& rng, std::vector<Ray>& shadows, TracedPoints& hits) const;

  const Scene& scene_;
  const float distance_;
  const bool spheres_;
  const uint64_t seed_;
  LightSampler sampler_;
  NearbyLights lamps_;
  LightSurfaces light_surfaces_;
};

}  // namespace lumicut
