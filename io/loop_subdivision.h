// Smooth surfaces of a triangle mesh. [Loop 1987; limits by Hoppe et al. 1994]
#pragma once

#include "io/scene_builder.h"

namespace lumicut::io {

// `levels` times each triangle becomes four; then the vertices move to where infinitely many would take them, with normals of
// the areas around them. Edges of one triangle, or of more than two, are creases.
Geometry loop_subdivided(const Geometry& control, int levels);

}  // namespace lumicut::io
