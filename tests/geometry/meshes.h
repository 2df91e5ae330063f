// Small meshes made in place: grid, torus, sphere.
#pragma once

#include <cmath>

#include "geometry/face_mesh.h"

namespace lumicut {

inline FaceMesh grid_mesh(uint32_t nx, uint32_t ny, bool wrap) {
  FaceMesh m;
  const uint32_t vx = wrap ? nx : nx + 1, vy = wrap ? ny : ny + 1;
  for (uint32_t y = 0; y < vy; ++y)
    for (uint32_t x = 0; x < vx; ++x) {
      if (wrap) {
        const double a = 6.283185307179586 * x / nx, b = 6.283185307179586 * y / ny;
        m.vertices.push_back({(2 + std::cos(b)) * std::cos(a), (2 + std::cos(b)) * std::sin(a), std::sin(b)});
      } else {
        m.vertices.push_back({x / static_cast<double>(nx), y / static_cast<double>(ny), 0});
      }
    }
  for (uint32_t y = 0; y < ny; ++y)
    for (uint32_t x = 0; x < nx; ++x) {
      const uint32_t a = y * vx + x, b = y * vx + (x + 1) % vx, c = (y + 1) % vy * vx + x,
                     d = (y + 1) % vy * vx + (x + 1) % vx;
      m.faces.push_back({a, b, d});
      m.faces.push_back({a, d, c});
    }
  return m;
}

inline FaceMesh torus_mesh(uint32_t nx, uint32_t ny) { return grid_mesh(nx, ny, true); }

inline FaceMesh sphere_mesh(uint32_t rings) {  // two poles
  FaceMesh m;
  const uint32_t around = 2 * rings;
  m.vertices.push_back({0, 0, 1});
  for (uint32_t r = 1; r < rings; ++r)
    for (uint32_t k = 0; k < around; ++k) {
      const double t = 3.141592653589793 * r / rings, p = 6.283185307179586 * k / around;
      m.vertices.push_back({std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)});
    }
  m.vertices.push_back({0, 0, -1});
  const auto south = static_cast<uint32_t>(m.vertices.size() - 1);
  const auto at = [&](uint32_t r, uint32_t k) { return 1 + (r - 1) * around + k % around; };
  for (uint32_t k = 0; k < around; ++k) {
    m.faces.push_back({0, at(1, k), at(1, k + 1)});
    for (uint32_t r = 1; r + 1 < rings; ++r) {
      m.faces.push_back({at(r, k), at(r + 1, k), at(r + 1, k + 1)});
      m.faces.push_back({at(r, k), at(r + 1, k + 1), at(r, k + 1)});
    }
    m.faces.push_back({at(rings - 1, k), south, at(rings - 1, k + 1)});
  }
  return m;
}

// One mesh after the other; no shared vertices.
inline FaceMesh both(FaceMesh a, const FaceMesh& b, double shift) {
  const auto base = static_cast<uint32_t>(a.vertices.size());
  for (const Vec3d& v : b.vertices) a.vertices.push_back({v.x + shift, v.y, v.z});
  for (const auto& f : b.faces) a.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  return a;
}

}  // namespace lumicut
