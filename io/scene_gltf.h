// glTF 2.0 scenes (.gltf, .glb) as docs/gltf.md has them.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

bool is_gltf(const std::string& path);  // by its ending

// With a camera that frames the scene and a clear sky where the file has none. Throws FileError, which names the file, the
// part of it and the value.
SceneData read_gltf(const std::string& path);

}  // namespace lumicut::io
