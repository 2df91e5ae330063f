// The connected pieces of a scene's meshes: which are closed, which way they face, and what lies twice. For preflight.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "io/affine.h"
#include "io/scene_data.h"

namespace lumicut::tools {

using Point = io::Vec;
using io::operator+;
using io::operator-;
using io::operator*;
using io::cross;
using io::dot;
using io::length;

struct Box {
  Point lo{1e300, 1e300, 1e300}, hi{-1e300, -1e300, -1e300};
  void extend(const Point& p);
  bool empty() const { return lo[0] > hi[0]; }
  double diagonal() const { return empty() ? 0.0 : length(hi - lo); }
  bool contains(const Point& p) const;
};

// Triangles that hang together by edges, corners at one place being one corner.
struct Shell {
  uint32_t mesh = 0, first_triangle = 0;
  uint64_t triangles = 0;
  uint64_t emissive = 0;  // triangles that emit from their front alone
  uint32_t emitter = 0;   // the first of them
  bool closed = false;    // no edge is a border
  bool oriented = false;  // closed, and neighbours are wound alike
  bool opaque = true;     // no hole, no mask
  double volume = 0;      // oriented: positive where fronts look outwards
};

struct MeshShells {
  std::vector<Shell> shells;
  std::vector<uint32_t> shell_of;  // a triangle
  uint64_t degenerate = 0;         // triangles without area
  uint32_t first_degenerate = 0;
};

MeshShells find_shells(const io::SceneData& scene, uint32_t mesh);

// Triangles whose three corners are those of an earlier one, in whatever order.
struct Duplicate {
  uint32_t mesh, triangle, other_mesh, other_triangle;
};
std::vector<Duplicate> find_duplicates(const io::SceneData& scene);

size_t instance_count(const io::Mesh& mesh);
// In the world, of an instance.
Point corner(const io::Mesh& mesh, size_t vertex, size_t instance);

}  // namespace lumicut::tools
