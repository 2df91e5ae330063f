// Meshes of the geometry tools: reads the positions and faces of an OBJ file, writes coloured PLY.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "geometry/face_mesh.h"

namespace lumicut {

// `v` and `f` lines; polygons become fans; indices may be negative (from the end). Throws invalid_argument naming the
// file and the line on what cannot be read.
FaceMesh read_obj_mesh(const std::string& path);

// Binary PLY with a colour a face (0 to 255).
void write_ply_mesh(const std::string& path, const FaceMesh& mesh,
                    std::span<const std::array<uint8_t, 3>> face_colours);

}  // namespace lumicut
