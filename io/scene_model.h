// Scenes of FBX, COLLADA (.dae), PLY and OBJ files, as docs/formats.md has them, with a camera that frames the scene and a
// clear sky where the file has none.
#pragma once

#include <string>
#include <vector>

#include "io/scene_data.h"

namespace lumicut::io {

bool is_model(const std::string& path);  // by its ending

// Throws FileError, which names the file.
SceneData read_model(const std::string& path);

// Its meshes alone, for scene files that name it; their materials mean nothing. A PLY may be packed by gzip (.ply.gz).
// Throws FileError.
bool has_meshes(const std::string& path);  // by its ending
std::vector<Mesh> read_model_meshes(const std::string& path, Warnings& warnings);

}  // namespace lumicut::io
