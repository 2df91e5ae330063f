// What a scene file need not say: a camera that frames the scene, and a sky where nothing shines.
#pragma once

#include "io/affine.h"
#include "io/scene_data.h"

namespace lumicut::io {

// Looks from `eye` against `back`. The lens is the caller's.
void set_camera(SceneData& scene, const Vec& eye, const Vec& back, const Vec& up);

// From the front and above, at a distance at which the ball around all meshes fits; y is up.
void frame_scene(SceneData& scene);

// Whether there is a lamp, an environment or a mesh that emits.
bool is_lit(const SceneData& scene);

// Clear, with the sun 50 degrees high; y is up.
void add_sky(SceneData& scene);

}  // namespace lumicut::io
