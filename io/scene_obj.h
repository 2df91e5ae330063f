// OBJ and MTL files, through tinyobjloader, checked line by line: what would make a wrong picture is an error that
// names the line, what is merely untidy a warning. See docs/scene_format.md for what is read and how it is
// approximated.
#pragma once

#include <string>
#include <vector>

#include "io/scene_data.h"
#include "io/texture_store.h"
#include "io/warnings.h"

namespace lumicut::io {

struct ObjModel {
  struct NamedMaterial {
    std::string name;
    lumicut_material values;
  };
  std::vector<NamedMaterial> materials;
  // Those with and those without vertex normals; `materials` of a mesh index into `materials` above.
  std::vector<Mesh> meshes;
};

struct ObjOptions {
  bool read_materials = true;   // false: no MTL is read, and all triangles have material 0 (of the caller's)
  bool positions_only = false;  // one mesh without uvs and normals, whose faces share the file's vertices
};

// Throws FileError: missing file, number that is none, index out of range, no face at all, unreadable texture. Warns of
// what is missing (MTL, material, texture: grey stands in) or passed over.
ObjModel read_obj(const std::string& path, const ObjOptions& options, TextureStore& textures, Warnings& warnings);

// Positions and indices alone: for geometry that needs to know which faces meet.
Mesh read_obj_positions(const std::string& path, Warnings& warnings);

// Triangles of a polygon in space, as indices of its corners; concave ones by clipping ears. `points` holds xyz a
// corner.
std::vector<uint32_t> triangulate_polygon(const std::vector<float>& points);

}  // namespace lumicut::io
