// Scenes of pbrt-v4 (.pbrt) as docs/pbrt_mitsuba.md has them.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

bool is_pbrt(const std::string& path);  // by its ending

// Throws FileError, which names the file, the line and the value.
SceneData read_pbrt(const std::string& path);

}  // namespace lumicut::io
