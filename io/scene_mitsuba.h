// Scenes of Mitsuba 3 (.xml) as docs/pbrt_mitsuba.md has them.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

bool is_mitsuba(const std::string& path);  // by its ending

// Throws FileError, which names the file, the element and the value.
SceneData read_mitsuba(const std::string& path);

}  // namespace lumicut::io
