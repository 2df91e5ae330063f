// From what was read to what the library renders.
#pragma once

#include <cstdint>

#include "io/library.h"
#include "io/scene_data.h"

namespace lumicut::io {

// Hands everything to `scene` (textures, materials, meshes, lights, environment, camera). Does not commit.
// Throws FileError in the scene file's terms where the library refuses a value of it, LibraryError naming the
// part otherwise.
void upload_scene(const Api& api, lumicut_scene scene, const SceneData& data);

}  // namespace lumicut::io
