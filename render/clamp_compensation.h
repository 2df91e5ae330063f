// Rays that leave the points of a frame, and bring what virtual lights cannot: the light that the clamp takes away.
// [Kollig, Keller 2004: weight 1 − min(G, b)/G; here with the clamp's d²/c²] And the light that a glossy surface throws
// on another: virtual lights stand for what is reflected evenly, whatever the direction.
#pragma once

#include <span>

#include "core/stats.h"
#include "lights/light_surfaces.h"
#include "render/clamp.h"
#include "render/glint_guide.h"
#include "render/nearby_lights.h"
#include "render/specular_chain.h"
#include "render/traced_gloss.h"
#include "scene/scene.h"

namespace lumicut {

class ClampCompensation {
 public:
  // `nearby`: samples what the clamp takes from emitters with extent; null: rays alone bring it. `spheres`: virtual lights
  // on surfaces are, and lose nothing by it. `trace_gloss`: rays bring a part of the gloss of bounced light, and of what
  // `sky` has of the environment; null: nothing. `glints`: where half of a point's rays go, if it has several; null: by its
  // lobes all. `direct`: of what rays find, what shines alone. All outlive this.
  ClampCompensation(const Scene& scene, const Clamp& clamp, const NearbyLights* nearby, bool spheres, bool trace_gloss,
                    const EvenSky* sky, const GlintGuide* glints, bool direct, uint64_t seed);

  // Rays from each point (unless they are cut short by chance, or the point is black): as many as `rays` has for its pixel,
  // or one where it is empty. `level` counts the surfaces since the camera. Appends to `hits`. Deterministic: numbers belong to the places of points. Throws Error(cancelled).
  void trace(const ShadePoints& points, uint32_t level, std::span<const uint8_t> rays, const Progress& progress,
             TracedPoints& hits, Counters& counters) const;

 private:
  struct Search;  // of one call
  void find_lights(const Search& search, size_t ray, TracedPoints& hits) const;
  void find_sky(const Search& search, size_t ray, TracedPoints& hits) const;
  void find_surface(Search& search, size_t ray, TracedPoints& hits) const;
  // Share of what a ray finds at `position` that a virtual light there would lose.
  float lost_at(const Search& search, const Vec3f& position, float distance) const;

  const Scene& scene_;
  const Clamp& clamp_;
  const NearbyLights* const nearby_;
  const bool spheres_, trace_gloss_;
  const EvenSky* const sky_;
  const GlintGuide* const glints_;
  const bool direct_;
  const uint64_t seed_;
  LightSurfaces light_surfaces_;
};

}  // namespace lumicut
