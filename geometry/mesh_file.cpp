#include "geometry/mesh_file.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

#include "core/error.h"

namespace lumicut {

FaceMesh read_obj_mesh(const std::string& path) {
  std::ifstream in(path);
  if (!in) fail_argument("mesh: cannot open " + path);
  FaceMesh mesh;
  std::string line;
  size_t number = 0;
  const auto bad = [&](const char* what) {
    fail_argument("mesh: " + path + ", line " + std::to_string(number) + ": " + what);
  };
  std::vector<uint32_t> corners;
  while (std::getline(in, line)) {
    ++number;
    const char* at = line.c_str();
    const char* end = at + line.size();
    const auto skip = [&] {
      while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    };
    skip();
    if (end - at < 2 || (at[1] != ' ' && at[1] != '\t')) continue;
    if (*at == 'v') {
      ++at;
      Vec3d p;
      for (int k = 0; k < 3; ++k) {
        skip();
        const auto r = std::from_chars(at, end, p[k]);
        if (r.ec != std::errc() || !std::isfinite(p[k])) bad("three finite coordinates expected");
        at = r.ptr;
      }
      mesh.vertices.push_back(p);
    } else if (*at == 'f') {
      ++at;
      corners.clear();
      for (skip(); at < end; skip()) {
        long long index = 0;
        const auto r = std::from_chars(at, end, index);
        if (r.ec != std::errc()) bad("a vertex index expected");
        const auto count = static_cast<long long>(mesh.vertices.size());
        if (index < 0) index += count + 1;
        if (index < 1 || index > count) bad("a vertex index out of range");
        corners.push_back(static_cast<uint32_t>(index - 1));
        at = r.ptr;
        while (at < end && *at != ' ' && *at != '\t' && *at != '\r') ++at;  // texture and normal indices
      }
      if (corners.size() < 3) bad("a face of fewer than three corners");
      for (size_t k = 2; k < corners.size(); ++k) mesh.faces.push_back({corners[0], corners[k - 1], corners[k]});
    }
  }
  return mesh;
}

void write_ply_mesh(const std::string& path, const FaceMesh& mesh,
                    std::span<const std::array<uint8_t, 3>> face_colours) {
  if (face_colours.size() != mesh.faces.size())
    fail_argument("mesh: " + std::to_string(face_colours.size()) + " colours for " + std::to_string(mesh.faces.size()) +
                  " faces");
  std::ofstream out(path, std::ios::binary);
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
  if (!out.flush()) fail_argument("mesh: cannot write " + path);
}

}  // namespace lumicut
