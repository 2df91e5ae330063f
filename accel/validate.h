// What every room behind make_accel checks before it builds, and before it traces.
#pragma once

#include <cmath>
#include <optional>

#include "accel/accel.h"

namespace lumicut {

// Triangles that reach past this are left out by every room, as Embree does: products of three coordinates overflow.
inline constexpr float kHugeCoordinate = 1.844e18f;

// Throws Error naming mesh, index and value: indices out of range, positions or transforms that are not finite.
void validate(const AccelGeometry& geometry, Progress* progress);

// The three corners of a triangle.
struct Triangle {
  Vec3f v0, v1, v2;
};
inline Triangle triangle_of(const MeshView& mesh, size_t prim) {
  const uint32_t* i = mesh.indices + 3 * prim;
  return {mesh.positions[i[0]], mesh.positions[i[1]], mesh.positions[i[2]]};
}

// False past kHugeCoordinate, and of NaN.
inline bool within(const Vec3f& v, float limit) {
  return std::abs(v.x) <= limit && std::abs(v.y) <= limit && std::abs(v.z) <= limit;
}
inline bool in_range(const Triangle& t) {
  return within(t.v0, kHugeCoordinate) && within(t.v1, kHugeCoordinate) && within(t.v2, kHugeCoordinate);
}

// Bounds of all meshes, each through its instances, without what lies out of range.
Aabb bounds_of(const AccelGeometry& geometry);

// How far the origins and directions of rays may reach: kHugeCoordinate, in the space of each instance too. Embree ends
// the process on rays past it where it is built with its assertions.
struct RayLimits {
  float origin = kHugeCoordinate, direction = kHugeCoordinate;
};

// World to mesh of each instance, computed in double; nothing where it flattens space, in so far as single precision
// tells: what lies in the scene's bounds has no place in the mesh's space. Such an instance has nothing to hit.
struct Inverses {
  std::vector<std::optional<Transform>> of;
  RayLimits limits;
};
Inverses invert_instances(const AccelGeometry& geometry);

// Rays with NaN anywhere, or past the limits, hit nothing; so do rays without a range.
inline bool is_traceable(const Ray& r, const RayLimits& limits) {
  return within(r.org, limits.origin) && within(r.dir, limits.direction) && r.tnear <= r.tfar && r.tfar >= 0.0f;
}

}  // namespace lumicut
