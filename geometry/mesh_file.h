// Meshes of the geometry tools: from a reader's arrays, and into coloured PLY.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "geometry/face_mesh.h"

namespace lumicut {

// Of xyz a vertex and three indices a triangle, as readers give them (io::read_obj_positions).
FaceMesh make_face_mesh(std::span<const float> positions, std::span<const uint32_t> indices);

// The bytes of a binary PLY with a colour a face (0 to 255).
std::string ply_of(const FaceMesh& mesh, std::span<const std::array<uint8_t, 3>> face_colours);

}  // namespace lumicut
