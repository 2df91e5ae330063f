// Light that the clamp takes from virtual lights on emitters near a point, brought back by samples of those emitters:
// direct light is never clamped away. [lights/near_lights.h]
#pragma once

#include "core/stats.h"
#include "lights/near_lights.h"
#include "render/traced_points.h"

namespace lumicut {

class NearbyLights {
 public:
  // Samples of each point that lights are near to: few beside the shadow rays of a cut, and then it is hardly noisy.
  static constexpr uint32_t kSamples = 16;

  // All outlive this.
  NearbyLights(const Scene& scene, const NearLights& near, uint64_t seed) : scene_(scene), near_(near), seed_(seed) {}

  struct Options {
    uint32_t level = 0;     // surfaces since the camera
    bool rays = false;      // rays by the points' reflectance find the same lights, and are weighted for that
    bool by_point = false;  // TracedPoints::pixel numbers points, not their pixels
  };
  // Appends what samples bring to `hits`. Deterministic: numbers belong to the places of points. Throws
  // Error(cancelled).
  void trace(const ShadePoints& points, const Options& options, const Progress& progress, TracedPoints& hits,
             Counters& counters) const;

  // Of a ray from `origin` by a reflectance of density `pdf` that finds a rectangle or disk, or a triangle, at `distance`:
  // the share of what it finds that counts, the rest being that of virtual lights and samples.
  float light_share(const Vec3f& origin, uint32_t light, float distance, float pdf) const;
  float triangle_share(const Vec3f& origin, const Hit& hit, float distance, float pdf) const;

 private:
  struct Waiting;
  void trace_shadows(Waiting& waiting, TracedPoints& hits, Counters& counters) const;

  const Scene& scene_;
  const NearLights& near_;
  const uint64_t seed_;
};

}  // namespace lumicut
