// Lights that are near a point: what the clamp takes from them is given back by sampling them. They are invisible, so no
// ray finds them.
#pragma once

#include <unordered_map>
#include <vector>

#include "bsdf/shade_points.h"
#include "core/progress.h"
#include "lights/light_sampler.h"

namespace lumicut {

class NearbyLights {
 public:
  // `distance`: that of the clamp, above 0. Throws Error(cancelled).
  NearbyLights(const Scene& scene, const LightSampler& emitters, float distance, const Progress& progress);
  bool empty() const { return lamps_.empty(); }

  // What one sample of each near light gives the point beyond its clamped light, before visibility: fn(vpl, radiance).
  // Weighted for rays of the point's reflectance that find the same lights [lights/light_surfaces.h].
  template <typename Fn>
  void for_each_share(const SurfacePoint& point, Rng& rng, Fn&& fn) const {
    for (uint32_t i : large_) share(i, point, rng, fn);
    if (cells_.empty()) return;
    const auto found = cells_.find(key(cell(point.position)));
    if (found == cells_.end()) return;
    for (uint32_t i : found->second) share(i, point, rng, fn);
  }

 private:
  struct Cell {
    int64_t x, y, z;
  };
  Cell cell(const Vec3f& p) const;
  static uint64_t key(const Cell& c);
  template <typename Fn>
  void share(uint32_t lamp, const SurfacePoint& point, Rng& rng, Fn&& fn) const {
    const Vpl vpl = sampler_.sample_lamp(lamps_[lamp], rng);
    const Rgb lost = lost_light(lamps_[lamp], vpl, point);
    if (max_component(lost) > 0.0f) fn(vpl, lost);
  }
  Rgb lost_light(uint32_t lamp, const Vpl& vpl, const SurfacePoint& point) const;

  const Scene& scene_;
  const LightSampler& sampler_;
  float distance_;
  std::vector<uint32_t> lamps_;  // of the scene
  std::vector<uint32_t> large_;  // of lamps_: near everywhere
  std::unordered_map<uint64_t, std::vector<uint32_t>> cells_;
};

}  // namespace lumicut
