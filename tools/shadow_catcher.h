// Shadow catchers of a scene file: what the camera sees of them is how much darker all other objects make them. Three
// frames of the same camera samples: the whole scene; the same with the catchers as holes to the camera; the catchers as
// the camera sees them, but lit as if they were alone. A fourth, empty one has the world behind them, where the camera
// sees it. [export_scripts/lumicut_blender/shadow_catcher.py does the same in Blender]
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "io/scene_data.h"

namespace lumicut::tools {

bool has_catchers(const io::SceneData& data);

bool shows_world(const io::SceneData& data);
// Calls `use` for each scene beside the whole one, `data`: objects, catchers, and where it is seen the world.
void for_each_beside(io::SceneData data, const std::function<void(const io::SceneData&)>& use);

// Pixels of a frame: three numbers of radiance each, one of alpha.
struct Caught {
  std::vector<float> radiance, alpha, denoised;  // denoised: empty, or as radiance
};
// Of the image with the catchers' shadows, in place of what `whole` has. `beside`: objects, catchers, and the world where
// it is seen.
void lay_shadows(std::span<const Caught> beside, Caught& whole);

}  // namespace lumicut::tools
