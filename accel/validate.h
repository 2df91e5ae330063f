// What every room behind make_accel checks before it builds, and before it traces.
#pragma once

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

// Inverse of an affine map, computed in double. False when it flattens space: such an instance has nothing to hit.
bool invert(const Transform& transform, Transform& inverse);

// Bounds of all meshes, each through its instances.
Aabb bounds_of(const AccelGeometry& geometry);

// Rays with NaN anywhere, or an origin or direction at infinity, hit nothing; so do rays without a range.
inline bool is_traceable(const Ray& r) {
  const float sum = (r.org.x + r.org.y + r.org.z) * 0.0f + (r.dir.x + r.dir.y + r.dir.z) * 0.0f;
  return sum == 0.0f && r.tnear <= r.tfar && r.tfar >= 0.0f;
}

}  // namespace lumicut
