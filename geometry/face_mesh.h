// Triangles and their dual graph, for the face-cluster methods.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace lumicut {

struct FaceMesh {
  std::vector<Vec3d> vertices;
  std::vector<std::array<uint32_t, 3>> faces;
};

// Who shares an edge with whom. Edges are undirected pairs of vertex indices; an edge with more than two faces links
// each of them with the next. Degenerate faces (a repeated corner) keep their id and have fewer edges.
struct DualGraph {
  std::vector<uint32_t> offset, neighbour;  // by face
  std::vector<uint32_t> edge_offset, edge;  // by face: ids of its edges
  std::vector<std::array<uint32_t, 2>> edge_vertices;
  size_t boundary_edges = 0, non_manifold_edges = 0;
  size_t components = 0;

  std::span<const uint32_t> of(uint32_t f) const { return {neighbour.data() + offset[f], offset[f + 1] - offset[f]}; }
  std::span<const uint32_t> edges_of(uint32_t f) const {
    return {edge.data() + edge_offset[f], edge_offset[f + 1] - edge_offset[f]};
  }
};

// Throws invalid_argument on an index out of range and on coordinates that are not finite.
void validate_mesh(const FaceMesh& mesh);
DualGraph dual_graph(const FaceMesh& mesh);

Vec3d face_centre(const FaceMesh& mesh, uint32_t f);
Vec3d face_normal_area(const FaceMesh& mesh, uint32_t f);  // length: twice the area

}  // namespace lumicut
