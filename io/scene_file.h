// Scenes of whatever format the ending of their name tells.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

// glTF (scene_gltf.h), models (scene_model.h), else JSON (scene_json.h). Throws FileError.
SceneData read_scene_file(const std::string& path);

}  // namespace lumicut::io
