// What a ray finds.
#pragma once

#include "bsdf/bsdf.h"

namespace lumicut {

// Geometry of a hit, in world space.
struct SurfaceHit {
  Vec3f position;          // on the surface
  Vec3f geometric_normal;  // unit, the mesh's front side
  Vec3f normal;            // unit shading normal, on the geometric normal's side
  Vec3f smooth{};          // what it was before a texture bent it, where that dims; else 0
  Vec2f uv;
  uint32_t material = 0, mesh = 0, triangle = 0, instance = 0;  // `instance`: of its mesh
  float u = 0.0f, v = 0.0f;                                     // barycentric, as Hit has them
  float t = 0.0f;
  float offset = 0.0f;  // how far rays start from the surface: follows the size of its triangle and coordinates
};

// A hit as it is seen from one side: made once, by Scene::interaction.
struct SurfaceInteraction : SurfaceHit {
  SurfaceInteraction(const SurfaceHit& hit, const Rgb& radiance, const BsdfParameters& parameters,
                     const SurfaceView& view)
      : SurfaceHit(hit), to_viewer(view.to_viewer), emitted(radiance), bsdf(parameters, view) {}
  // The geometric normal on the viewer's side.
  Vec3f side() const { return dot(geometric_normal, to_viewer) < 0.0f ? -geometric_normal : geometric_normal; }
  Vec3f to_viewer;  // unit, away from the surface
  Rgb emitted;      // radiance towards the viewer
  Bsdf bsdf;
};

}  // namespace lumicut
