// Scenes of FBX, COLLADA (.dae), PLY and OBJ files, as docs/formats.md has them, with a camera that frames the scene and a
// clear sky where the file has none.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

bool is_model(const std::string& path);  // by its ending

// Throws FileError, which names the file.
SceneData read_model(const std::string& path);

}  // namespace lumicut::io
