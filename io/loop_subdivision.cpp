#include "io/loop_subdivision.h"

#include <algorithm>
#include <unordered_map>

namespace lumicut::io {

namespace {

struct Edge {
  uint32_t a, b, middle = 0;  // its ends, and the vertex that splits it
  Vec opposite{0, 0, 0};      // sum of the corners across
  uint32_t faces = 0;
};

class Surface {
 public:
  explicit Surface(const Geometry& g) : faces_(g.indices) {
    for (size_t i = 0; i + 2 < g.positions.size(); i += 3)
      places_.push_back({g.positions[i], g.positions[i + 1], g.positions[i + 2]});
  }

  void split() {
    const std::vector<Edge> edges = find_edges();
    std::vector<Vec> places = moved(edges, false);
    std::vector<uint32_t> faces;
    faces.reserve(4 * faces_.size());
    for (const Edge& e : edges) {
      const Vec ends = places_[e.a] + places_[e.b];
      places.push_back(e.faces == 2 ? ends * (3.0 / 8) + e.opposite * (1.0 / 8) : ends * 0.5);
    }
    for (size_t i = 0; i + 2 < faces_.size(); i += 3) {
      const uint32_t v[3] = {faces_[i], faces_[i + 1], faces_[i + 2]};
      const auto middle = [&](size_t k) {  // of the edge from corner k
        return static_cast<uint32_t>(places_.size()) + edge_of_.at(key(v[k], v[(k + 1) % 3]));
      };
      const uint32_t m[3] = {middle(0), middle(1), middle(2)};
      faces.insert(faces.end(), {v[0], m[0], m[2], m[0], v[1], m[1], m[2], m[1], v[2], m[0], m[1], m[2]});
    }
    places_ = std::move(places), faces_ = std::move(faces);
  }

  Geometry limit() {
    places_ = moved(find_edges(), true);
    std::vector<Vec> normals(places_.size(), Vec{0, 0, 0});
    for (size_t i = 0; i + 2 < faces_.size(); i += 3) {
      const Vec &a = places_[faces_[i]], &b = places_[faces_[i + 1]], &c = places_[faces_[i + 2]];
      for (size_t k = 0; k < 3; ++k) normals[faces_[i + k]] = normals[faces_[i + k]] + cross(b - a, c - a);
    }
    Geometry out;
    out.indices = faces_;
    for (size_t i = 0; i < places_.size(); ++i) {
      const Vec n = unit(normals[i]);
      for (size_t k = 0; k < 3; ++k) {
        out.positions.push_back(static_cast<float>(places_[i][k]));
        out.normals.push_back(static_cast<float>(n[k]));
      }
    }
    return out;
  }

 private:
  static uint64_t key(uint32_t a, uint32_t b) { return uint64_t{std::min(a, b)} << 32 | std::max(a, b); }

  std::vector<Edge> find_edges() {
    std::vector<Edge> edges;
    edge_of_.clear();
    for (size_t i = 0; i + 2 < faces_.size(); i += 3)
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t a = faces_[i + k], b = faces_[i + (k + 1) % 3];
        const auto [known, is_new] = edge_of_.emplace(key(a, b), static_cast<uint32_t>(edges.size()));
        if (is_new) edges.push_back({a, b});
        Edge& e = edges[known->second];
        e.opposite = e.opposite + places_[faces_[i + (k + 2) % 3]];
        ++e.faces;
      }
    return edges;
  }

  // The vertices one level further, or at the limit.
  std::vector<Vec> moved(const std::vector<Edge>& edges, bool to_limit) const {
    struct Around {
      Vec all{0, 0, 0}, creases{0, 0, 0};
      uint32_t count = 0, on_creases = 0;
    };
    std::vector<Around> around(places_.size());
    for (const Edge& e : edges)
      for (const auto& [v, other] : {std::pair(e.a, e.b), std::pair(e.b, e.a)}) {
        Around& at = around[v];
        at.all = at.all + places_[other], ++at.count;
        if (e.faces != 2) at.creases = at.creases + places_[other], ++at.on_creases;
      }
    std::vector<Vec> out(places_.size());
    for (size_t i = 0; i < out.size(); ++i) {
      const Around& at = around[i];
      const double n = at.count, beta = at.count == 3 ? 3.0 / 16 : 3 / (8 * n);
      if (at.on_creases == 2) {
        const double weight = to_limit ? 1.0 / 6 : 1.0 / 8;  // a cubic spline's
        out[i] = places_[i] * (1 - 2 * weight) + at.creases * weight;
      } else if (at.on_creases != 0 || at.count == 0) {
        out[i] = places_[i];
      } else {
        const double weight = to_limit ? 1 / (n + 3 / (8 * beta)) : beta;
        out[i] = places_[i] * (1 - n * weight) + at.all * weight;
      }
    }
    return out;
  }

  std::vector<Vec> places_;
  std::vector<uint32_t> faces_;
  std::unordered_map<uint64_t, uint32_t> edge_of_;
};

}  // namespace

Geometry loop_subdivided(const Geometry& control, int levels) {
  Surface surface(control);
  for (int i = 0; i < levels; ++i) surface.split();
  return surface.limit();
}

}  // namespace lumicut::io
