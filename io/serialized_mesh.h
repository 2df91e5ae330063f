// Mitsuba's own meshes: .serialized, several in a file, each packed.
#pragma once

#include <string>

#include "io/scene_builder.h"

namespace lumicut::io {

// The mesh number `index`. Throws FileError.
Geometry read_serialized_mesh(const std::string& path, size_t index);

}  // namespace lumicut::io
