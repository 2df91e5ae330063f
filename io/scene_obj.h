// OBJ and MTL files, through tinyobjloader, checked line by line: what tinyobjloader would pass over or take for 0 is
// an error that names the line. See docs/scene_format.md for what is read and how it is approximated.
#pragma once

#include <string>
#include <vector>

#include "io/scene_data.h"
#include "io/texture_store.h"

namespace lumicut::io {

struct ObjModel {
  struct NamedMaterial {
    std::string name;
    lumicut_material values;
    int line;  // of the MTL's newmtl
  };
  std::vector<NamedMaterial> materials;
  // Those with and those without vertex normals; `materials` of a mesh index into `materials` above.
  std::vector<Mesh> meshes;
  std::vector<std::string> warnings;
};

struct ObjOptions {
  bool read_materials = true;  // false: no MTL is read, and all triangles have material 0 (of the caller's)
};

// Throws FileError: missing file or MTL, number that is none, index out of range, polygon of less than three corners,
// unknown material, missing texture.
ObjModel read_obj(const std::string& path, const ObjOptions& options, TextureStore& textures);

// Triangles of a polygon in space, as indices of its corners; concave ones by clipping ears. `points` holds xyz a
// corner.
std::vector<uint32_t> triangulate_polygon(const std::vector<float>& points);

}  // namespace lumicut::io
