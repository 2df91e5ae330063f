#include "geometry/mesh_file.h"

#include <cstring>
#include <fstream>
#include <sstream>

#include "core/error.h"

namespace lumicut {

FaceMesh make_face_mesh(std::span<const float> positions, std::span<const uint32_t> indices) {
  FaceMesh mesh;
  for (size_t i = 0; i + 2 < positions.size(); i += 3)
    mesh.vertices.push_back({double{positions[i]}, double{positions[i + 1]}, double{positions[i + 2]}});
  for (size_t i = 0; i + 2 < indices.size(); i += 3) mesh.faces.push_back({indices[i], indices[i + 1], indices[i + 2]});
  return mesh;
}

std::string ply_of(const FaceMesh& mesh, std::span<const std::array<uint8_t, 3>> face_colours) {
  if (face_colours.size() != mesh.faces.size())
    fail_argument("mesh: " + std::to_string(face_colours.size()) + " colours for " + std::to_string(mesh.faces.size()) +
                  " faces");
  std::ostringstream out;
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << mesh.vertices.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << mesh.faces.size()
      << "\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar "
         "blue\nend_header\n";
  for (const Vec3d& v : mesh.vertices) {
    const float p[3] = {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
    out.write(reinterpret_cast<const char*>(p), sizeof p);
  }
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    char record[16];
    record[0] = 3;
    std::memcpy(record + 1, mesh.faces[f].data(), 12);
    std::memcpy(record + 13, face_colours[f].data(), 3);
    out.write(record, sizeof record);
  }
  return std::move(out).str();
}

}  // namespace lumicut
