// Small generated meshes and rays for tests.
#pragma once

#include <cmath>
#include <vector>

#include "accel/accel.h"
#include "core/rng.h"

namespace lumicut::test {

struct Mesh {
  std::vector<Vec3f> positions;
  std::vector<uint32_t> indices;
  MeshView view() const {
    MeshView v;
    v.positions = positions.data(), v.position_count = positions.size();
    v.indices = indices.data(), v.triangle_count = indices.size() / 3;
    return v;
  }
  void add(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const auto n = static_cast<uint32_t>(positions.size());
    positions.insert(positions.end(), {a, b, c});
    indices.insert(indices.end(), {n, n + 1, n + 2});
  }
};

// The box of each triangle.
inline std::vector<Aabb> boxes_of(const Mesh& mesh) {
  std::vector<Aabb> boxes(mesh.indices.size() / 3);
  for (size_t i = 0; i < mesh.indices.size(); ++i) boxes[i / 3].extend(mesh.positions[mesh.indices[i]]);
  return boxes;
}

inline Vec3f random_point(Rng& rng) { return {rng.next_float(), rng.next_float(), rng.next_float()}; }
inline Vec3f random_direction(Rng& rng) {
  for (;;) {
    const Vec3f d = random_point(rng) * 2.0f - Vec3f{1, 1, 1};
    if (length2(d) <= 1.0f && length2(d) > 1e-4f) return normalize(d);
  }
}

// Triangles of edge about `size` in the unit cube.
inline Mesh random_soup(size_t n, float size, uint64_t seed) {
  Rng rng(seed, Stage::test);
  Mesh mesh;
  for (size_t i = 0; i < n; ++i) {
    const Vec3f c = random_point(rng);
    const Vec3f a = random_direction(rng) * size, b = random_direction(rng) * size;
    mesh.add(c + a, c + b, c + random_direction(rng) * size);
  }
  return mesh;
}

// A closed unit sphere around the origin, of 2·stacks·slices - 2·slices triangles that share their corners.
inline Mesh sphere(uint32_t stacks, uint32_t slices) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 1});
  for (uint32_t i = 1; i < stacks; ++i)
    for (uint32_t j = 0; j < slices; ++j) {
      const float theta = 3.14159265f * static_cast<float>(i) / static_cast<float>(stacks);
      const float phi = 6.2831853f * static_cast<float>(j) / static_cast<float>(slices);
      mesh.positions.push_back({std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)});
    }
  mesh.positions.push_back({0, 0, -1});
  const auto at = [&](uint32_t i, uint32_t j) { return 1 + (i - 1) * slices + j % slices; };
  const auto last = static_cast<uint32_t>(mesh.positions.size() - 1);
  for (uint32_t j = 0; j < slices; ++j) {
    mesh.indices.insert(mesh.indices.end(), {0, at(1, j), at(1, j + 1)});
    for (uint32_t i = 1; i + 1 < stacks; ++i)
      mesh.indices.insert(mesh.indices.end(),
                          {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    mesh.indices.insert(mesh.indices.end(), {at(stacks - 1, j), last, at(stacks - 1, j + 1)});
  }
  return mesh;
}

inline RayHit ray_of(const Vec3f& org, const Vec3f& dir, float tnear = 0.0f,
                     float tfar = std::numeric_limits<float>::infinity()) {
  RayHit r;
  r.ray.org = org, r.ray.dir = dir, r.ray.tnear = tnear, r.ray.tfar = tfar;
  return r;
}

// From a cube thrice as wide as the unit cube, in any direction. One draw after another: the order in which arguments
// are evaluated is the compiler's.
inline RayHit random_ray(Rng& rng, float tfar = std::numeric_limits<float>::infinity()) {
  const Vec3f org = random_point(rng) * 3.0f - Vec3f{1, 1, 1};
  return ray_of(org, random_direction(rng), 0.0f, tfar);
}

}  // namespace lumicut::test
