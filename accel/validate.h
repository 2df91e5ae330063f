// Checks of geometry and rays that all ray-tracing backends share.
#pragma once

#include <cmath>
#include <optional>

#include "accel/accel.h"

namespace lumicut {

// Triangles with a coordinate past this are left out by every backend, as in Embree: products of three coordinates
// overflow.
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

// False past the limit, and for NaN.
inline bool within(const Vec3f& v, float limit) {
  return std::abs(v.x) <= limit && std::abs(v.y) <= limit && std::abs(v.z) <= limit;
}
inline bool in_range(const Triangle& t) {
  return within(t.v0, kHugeCoordinate) && within(t.v1, kHugeCoordinate) && within(t.v2, kHugeCoordinate);
}

// Bounds of all meshes or instances, without those out of range.
Aabb bounds_of(const AccelGeometry& geometry);

// Limits of the coordinates of rays' origins and directions: kHugeCoordinate, in the space of each instance too. An
// Embree built with assertions ends the process on rays past them.
struct RayLimits {
  float origin = kHugeCoordinate, direction = kHugeCoordinate;
};

// World to mesh of each instance, computed in double precision. Empty where the transform is singular to single
// precision, so that points in the scene's bounds are out of range in the mesh's space: nothing of it can be hit.
struct Inverses {
  std::vector<std::optional<Transform>> of;
  RayLimits limits;
};
Inverses invert_instances(const AccelGeometry& geometry);

// False for rays with NaN or past the limits, and for empty ranges: they hit nothing.
inline bool is_traceable(const Ray& r, const RayLimits& limits) {
  return within(r.org, limits.origin) && within(r.dir, limits.direction) && r.tnear <= r.tfar && r.tfar >= 0.0f;
}

}  // namespace lumicut
