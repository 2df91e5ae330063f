// Files of virtual point lights: docs/vpl_format.md. Reads our own format and the bare records of the peer's.
#pragma once

#include <string>
#include <vector>

#include "lumicut/lumicut.h"

namespace lumicut::io {

struct VplFile {
  std::vector<lumicut_vpl> lights;
  // The peer's lights lie on their surfaces; the library's, and so ours, stand off them by the scene's epsilon, so that
  // no shadow ray meets the surface it leaves.
  bool on_surfaces = false;
};

// Throws FileError naming the record and field: wrong length, unknown kind, numbers that are not finite, negative
// intensities, normals of length 0. Normals are brought to length 1.
VplFile read_vpls(const std::string& path);

// Moves oriented lights along their normals.
void move_off_surfaces(std::vector<lumicut_vpl>& lights, double distance);

// Atomic. Throws FileError.
void write_vpls(const std::string& path, const lumicut_vpl* lights, uint64_t count);

}  // namespace lumicut::io
