#include "tools/mesh_shells.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <tuple>

namespace lumicut::tools {

namespace {

using Corner = std::array<float, 3>;

Corner raw_corner(const io::Mesh& mesh, size_t vertex) {
  const float* p = &mesh.positions[3 * vertex];
  return {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f};  // -0 is 0
}

// One number a place.
std::vector<uint32_t> weld(const io::Mesh& mesh) {
  const size_t n = mesh.positions.size() / 3;
  std::vector<uint32_t> order(n), id(n);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return raw_corner(mesh, a) < raw_corner(mesh, b); });
  uint32_t next = 0;
  for (size_t i = 0; i < n; ++i) {
    if (i > 0 && raw_corner(mesh, order[i]) != raw_corner(mesh, order[i - 1])) ++next;
    id[order[i]] = next;
  }
  return id;
}

// Disjoint sets, with halving of paths.
class Sets {
 public:
  explicit Sets(size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<uint32_t> parent_;
};

bool emits(const lumicut_material& m) { return m.emission[0] + m.emission[1] + m.emission[2] > 0; }

uint64_t mix(uint64_t h, uint64_t x) {
  h = (h ^ x) * 0x9e3779b97f4a7c15ull;
  return h ^ (h >> 29);
}

}  // namespace

void Box::extend(const Point& p) {
  for (size_t k = 0; k < 3; ++k) lo[k] = std::min(lo[k], p[k]), hi[k] = std::max(hi[k], p[k]);
}
bool Box::contains(const Point& p) const {
  for (size_t k = 0; k < 3; ++k)
    if (!(p[k] >= lo[k] && p[k] <= hi[k])) return false;
  return true;
}

size_t instance_count(const io::Mesh& mesh) { return std::max<size_t>(1, mesh.transforms.size() / 12); }

Point corner(const io::Mesh& mesh, size_t vertex, size_t instance) {
  const float* p = &mesh.positions[3 * vertex];
  if (mesh.transforms.empty()) return {p[0], p[1], p[2]};
  const float* m = &mesh.transforms[12 * instance];
  Point out{};
  for (size_t r = 0; r < 3; ++r)
    out[r] = double{m[4 * r]} * p[0] + double{m[4 * r + 1]} * p[1] + double{m[4 * r + 2]} * p[2] + m[4 * r + 3];
  return out;
}

MeshShells find_shells(const io::SceneData& scene, uint32_t mesh_id) {
  const io::Mesh& mesh = scene.meshes[mesh_id];
  const auto triangles = static_cast<uint32_t>(mesh.indices.size() / 3);
  const std::vector<uint32_t> id = weld(mesh);
  MeshShells out;

  struct Edge {
    uint32_t low, high;
    uint32_t triangle;
    bool forward;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * size_t{triangles});
  std::vector<bool> flat(triangles);
  for (uint32_t t = 0; t < triangles; ++t) {
    const uint32_t* v = &mesh.indices[3 * size_t{t}];
    const Point a = corner(mesh, v[0], 0), b = corner(mesh, v[1], 0), c = corner(mesh, v[2], 0);
    const double longest = std::max({length(b - a), length(c - b), length(a - c)});
    // A height of a ten-millionth of the longest edge is what is left of single precision.
    flat[t] = !(length(cross(b - a, c - a)) > 1e-7 * longest * longest);
    if (flat[t] && out.degenerate++ == 0) out.first_degenerate = t;
    for (int k = 0; k < 3; ++k) {
      const uint32_t from = id[v[k]], to = id[v[(k + 1) % 3]];
      if (from != to) edges.push_back({std::min(from, to), std::max(from, to), t, from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.triangle, a.forward) < std::tie(b.low, b.high, b.triangle, b.forward);
  });
  Sets sets(triangles);
  std::vector<bool> border(triangles), twisted(triangles);
  for (size_t first = 0, last; first < edges.size(); first = last) {
    int balance = 0;
    for (last = first;
         last < edges.size() && edges[last].low == edges[first].low && edges[last].high == edges[first].high; ++last) {
      balance += edges[last].forward ? 1 : -1;
      sets.join(edges[last].triangle, edges[first].triangle);
    }
    if ((last - first) % 2 != 0) border[edges[first].triangle] = true;
    if (balance != 0) twisted[edges[first].triangle] = true;
  }

  std::vector<uint32_t> shell_of_root(triangles, ~0u);
  out.shell_of.resize(triangles);
  std::vector<Point> origin;
  for (uint32_t t = 0; t < triangles; ++t) {
    uint32_t& shell = shell_of_root[sets.find(t)];
    const uint32_t* v = &mesh.indices[3 * size_t{t}];
    if (shell == ~0u) {
      shell = static_cast<uint32_t>(out.shells.size());
      Shell s;
      s.mesh = mesh_id, s.first_triangle = t, s.closed = s.oriented = true;
      out.shells.push_back(s);
      origin.push_back(corner(mesh, v[0], 0));
    }
    out.shell_of[t] = shell;
    Shell& s = out.shells[shell];
    ++s.triangles;
    if (border[t]) s.closed = false;
    if (border[t] || twisted[t]) s.oriented = false;
    const lumicut_material& m = scene.materials[mesh.materials[t]].values;
    if (m.opacity < 1.0f || m.opacity_texture != 0) s.opaque = false;
    if (emits(m) && (m.flags & LUMICUT_EMIT_BOTH_SIDES) == 0 && s.emissive++ == 0) s.emitter = t;
    const Point& o = origin[shell];
    s.volume += dot(corner(mesh, v[0], 0) - o, cross(corner(mesh, v[1], 0) - o, corner(mesh, v[2], 0) - o)) / 6;
  }
  return out;
}

std::vector<Duplicate> find_duplicates(const io::SceneData& scene) {
  struct Face {
    uint64_t hash;
    uint32_t mesh, triangle;
  };
  std::vector<Duplicate> found;
  std::vector<Face> faces;
  const auto add = [&](uint32_t mesh_id) {
    const io::Mesh& mesh = scene.meshes[mesh_id];
    for (uint32_t t = 0; 3 * size_t{t} < mesh.indices.size(); ++t) {
      std::array<Corner, 3> c;
      for (size_t k = 0; k < 3; ++k) c[k] = raw_corner(mesh, mesh.indices[3 * size_t{t} + k]);
      std::sort(c.begin(), c.end());
      if (c[0] == c[1] || c[1] == c[2]) continue;
      uint64_t h = 0;
      for (const Corner& p : c)
        for (const float x : p) h = mix(h, std::bit_cast<uint32_t>(x));
      faces.push_back({h, mesh_id, t});
    }
  };
  const auto report = [&] {
    std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
      return std::tie(a.hash, a.mesh, a.triangle) < std::tie(b.hash, b.mesh, b.triangle);
    });
    for (size_t i = 1, first = 0; i < faces.size(); ++i) {
      if (faces[i].hash != faces[first].hash) {
        first = i;
      } else {
        found.push_back({faces[i].mesh, faces[i].triangle, faces[first].mesh, faces[first].triangle});
      }
    }
    faces.clear();
  };
  // Meshes that stand in the world as they are together; each that is placed by transforms on its own.
  for (uint32_t m = 0; m < scene.meshes.size(); ++m)
    if (scene.meshes[m].transforms.empty()) add(m);
  report();
  for (uint32_t m = 0; m < scene.meshes.size(); ++m)
    if (!scene.meshes[m].transforms.empty()) add(m), report();
  return found;
}

}  // namespace lumicut::tools
