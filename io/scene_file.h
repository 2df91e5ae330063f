// Scenes of whatever format the ending of their name tells.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

// glTF, models (FBX ...), pbrt, Mitsuba, else JSON. Throws FileError.
SceneData read_scene_file(const std::string& path);

}  // namespace lumicut::io
