// Shadow catchers of a scene file: what the camera sees of them is how much darker all other objects make them. Three
// frames of the same camera samples: the whole scene; the same with the catchers as holes to the camera; the catchers as
// the camera sees them, but lit as if they were alone. A fourth, empty one has the world behind them, where the camera
// sees it. [export_scripts/lumicut_blender/shadow_catcher.py does the same in Blender]
#pragma once

#include <span>
#include <vector>

#include "io/scene_data.h"

namespace lumicut::tools {

bool has_catchers(const io::SceneData& data);

// Scenes beside the whole one are made one after the other: each changes `data`, so that nothing big is copied.
void leave_objects(io::SceneData& data);   // of the whole
void leave_catchers(io::SceneData& data);  // of that
void leave_world(io::SceneData& data);     // of any

// Pixels of a frame: three numbers of radiance each, one of alpha.
struct Caught {
  std::vector<float> radiance, alpha, denoised;  // denoised: empty, or as radiance
};
// Of the image with the catchers' shadows, in place of what `whole` has. `beside`: objects, catchers, and the world where
// it is seen.
void lay_shadows(std::span<const Caught> beside, Caught& whole);

}  // namespace lumicut::tools
