// Scenes as JSON files with what they refer to beside them: what is read back renders the same image, bit for bit.
#pragma once

#include <string>

#include "io/scene_data.h"

namespace lumicut::io {

// Writes PATH (NAME.json) and, in the folder NAME_files beside it, meshes and textures, each under a name that holds a
// checksum of its content. The scene file is replaced last, at once; then files of an earlier conversion that nobody
// names any more are removed. Where anything fails, what stood there stays. Throws FileError.
void write_scene(const SceneData& scene, const std::string& path);

}  // namespace lumicut::io
