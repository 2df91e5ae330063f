// Files of virtual point lights: docs/vpl_format.md. Reads our own format and the bare records of the peer's.
#pragma once

#include <string>
#include <vector>

#include "lumicut/lumicut.h"

namespace lumicut::io {

// Throws FileError naming the record and field: wrong length, unknown kind, numbers that are not finite, negative
// intensities, normals of length 0. Normals are brought to length 1.
std::vector<lumicut_vpl> read_vpls(const std::string& path);

// Atomic. Throws FileError.
void write_vpls(const std::string& path, const lumicut_vpl* lights, uint64_t count);

}  // namespace lumicut::io
