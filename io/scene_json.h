// JSON scenes: docs/scene_format.md. Reads the file and all it refers to (OBJ, MTL, textures).
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

// Throws FileError, which names the file, the path of the key and the value (or the line of the OBJ or MTL).
SceneData read_scene(const std::string& path);

}  // namespace lumicut::io
