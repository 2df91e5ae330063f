// Programs and attributes of hosts.
#pragma once

#include "plugin/include/lumicut/lumicut_programs.h"
#include "scene/mesh.h"
#include "scene/texture_program.h"

namespace lumicut {

// `texture`: index of the texture whose program it is, for texts.
TextureProgram to_program(const lumicut_program* in, uint64_t texture);
std::vector<MeshAttribute> to_attributes(const lumicut_mesh& in);

}  // namespace lumicut
