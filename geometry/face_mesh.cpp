#include "geometry/face_mesh.h"

#include <algorithm>
#include <string>

#include "core/error.h"

namespace lumicut {

void validate_mesh(const FaceMesh& mesh) {
  for (size_t v = 0; v < mesh.vertices.size(); ++v)
    for (int k = 0; k < 3; ++k)
      if (!(std::fabs(mesh.vertices[v][k]) <= 1e15))
        fail_argument("mesh: vertex " + std::to_string(v) + " has a coordinate that is not finite or beyond 1e15");
  for (size_t f = 0; f < mesh.faces.size(); ++f)
    for (const uint32_t v : mesh.faces[f])
      if (v >= mesh.vertices.size())
        fail_argument("mesh: face " + std::to_string(f) + " names vertex " + std::to_string(v) + " of " +
                      std::to_string(mesh.vertices.size()));
}

DualGraph dual_graph(const FaceMesh& mesh) {
  validate_mesh(mesh);
  DualGraph g;
  const auto n = static_cast<uint32_t>(mesh.faces.size());
  struct Side {
    uint32_t a, b, face;
  };
  std::vector<Side> sides;
  sides.reserve(3 * static_cast<size_t>(n));
  for (uint32_t f = 0; f < n; ++f)
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = mesh.faces[f][static_cast<size_t>(k)], b = mesh.faces[f][static_cast<size_t>((k + 1) % 3)];
      if (a != b) sides.push_back({std::min(a, b), std::max(a, b), f});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.a != y.a ? x.a < y.a : x.b != y.b ? x.b < y.b : x.face < y.face;
  });
  std::vector<std::array<uint32_t, 2>> links, face_edges;
  for (size_t i = 0; i < sides.size();) {
    size_t j = i, sharing = 0;
    const auto id = static_cast<uint32_t>(g.edge_vertices.size());
    g.edge_vertices.push_back({sides[i].a, sides[i].b});
    for (; j < sides.size() && sides[j].a == sides[i].a && sides[j].b == sides[i].b; ++j) {
      if (j > i && sides[j].face == sides[j - 1].face) continue;  // a folded face has its edge twice
      ++sharing;
      face_edges.push_back({sides[j].face, id});
      if (j > i) links.push_back({sides[j - 1].face, sides[j].face});
    }
    if (sharing == 1) ++g.boundary_edges;
    if (sharing > 2) ++g.non_manifold_edges;
    i = j;
  }
  const auto fill = [n](std::vector<std::array<uint32_t, 2>>& pairs, std::vector<uint32_t>& offset,
                        std::vector<uint32_t>& list) {
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    offset.assign(n + 1, 0);
    for (const auto& p : pairs) ++offset[p[0] + 1], list.push_back(p[1]);
    for (uint32_t f = 0; f < n; ++f) offset[f + 1] += offset[f];
    if (list.empty()) list.reserve(1);
  };
  for (size_t i = 0, m = links.size(); i < m; ++i) links.push_back({links[i][1], links[i][0]});
  fill(links, g.offset, g.neighbour);
  fill(face_edges, g.edge_offset, g.edge);
  std::vector<uint8_t> seen(n, 0);
  std::vector<uint32_t> stack;
  for (uint32_t f = 0; f < n; ++f) {
    if (seen[f]) continue;
    ++g.components;
    seen[f] = 1;
    stack.push_back(f);
    while (!stack.empty()) {
      const uint32_t u = stack.back();
      stack.pop_back();
      for (const uint32_t v : g.of(u))
        if (!seen[v]) seen[v] = 1, stack.push_back(v);
    }
  }
  return g;
}

Vec3d face_centre(const FaceMesh& mesh, uint32_t f) {
  const auto& t = mesh.faces[f];
  return (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0;
}

Vec3d face_normal_area(const FaceMesh& mesh, uint32_t f) {
  const auto& t = mesh.faces[f];
  return cross(mesh.vertices[t[1]] - mesh.vertices[t[0]], mesh.vertices[t[2]] - mesh.vertices[t[0]]);
}

}  // namespace lumicut
