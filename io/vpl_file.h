// Files of virtual point lights: docs/vpl_format.md. Reads our own format and the bare records of the peer's.
#pragma once

#include <string>

#include "lumicut/lumicut.hpp"

namespace lumicut::io {

// Throws FileError naming the record and field: wrong length, unknown kind, numbers that are not finite, negative
// intensities, normals of length 0, origins that cannot be. Normals are brought to length 1. Files without origins
// (version 1, the peer's) give lights of which nothing is known.
api::VplSet read_vpls(const std::string& path);

// Atomic. Lights without origins are written as lights of which nothing is known. Throws FileError.
void write_vpls(const std::string& path, const api::VplSet& set);

}  // namespace lumicut::io
