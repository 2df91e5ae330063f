// Files of virtual point lights: docs/vpl_format.md. Reads our own format and the bare records of the peer's.
#pragma once

#include <string>

#include "lumicut/lumicut.hpp"

namespace lumicut::io {

// Throws FileError for wrong lengths and versions. Normals are brought to length 1; all other values are for the library
// to check, by upload_vpls. Files without origins (version 1, the peer's) give lights of which nothing is known.
api::VplSet read_vpls(const std::string& path);

// Gives an integrator the lights of file `path`. Throws FileError with the library's words where it refuses a value.
void upload_vpls(const api::Functions& library, lumicut_integrator integrator, const api::VplSet& set,
                 const std::string& path);

// Atomic. Lights without origins are written as lights of which nothing is known. Throws FileError.
void write_vpls(const std::string& path, const api::VplSet& set);

}  // namespace lumicut::io
