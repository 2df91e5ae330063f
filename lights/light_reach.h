// What of a point a virtual light lights: by kinds of lobes, and by sets of meshes. [scene/light.h: LightReach]
#pragma once

#include "bsdf/shade_points.h"
#include "lights/light_vpls.h"

namespace lumicut {

inline bool lights_all(const Vpl& v) { return v.seen_by == kShadedLobes && v.receivers == 0; }

// Leaves the point what such a light makes it show.
inline void limit(SurfacePoint& point, uint32_t seen_by, uint32_t receivers) {
  const bool lit = in_set(point.not_lit_by, receivers);
  if (!lit || (seen_by & kDiffuseRay) == 0) point.diffuse = {};
  if (!lit || (seen_by & kGlossyRay) == 0) point.specular = {}, point.grazing = {};
}

}  // namespace lumicut
