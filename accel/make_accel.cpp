#include <cmath>
#include <string>

#include "accel/accel.h"
#include "accel/bvh.h"
#include "accel/embree_accel.h"
#include "accel/validate.h"
#include "core/error.h"

namespace lumicut {

void validate(const AccelGeometry& geometry, Progress* progress) {
  for (size_t m = 0; m < geometry.meshes.size(); ++m) {
    const MeshView& mesh = geometry.meshes[m];
    const std::string name = "mesh " + std::to_string(m);
    if (mesh.triangle_count > 0 && (mesh.positions == nullptr || mesh.indices == nullptr))
      fail_argument(name + ": has " + std::to_string(mesh.triangle_count) + " triangles and no positions or indices");
    if (mesh.triangle_count > 0x1fffffffull || mesh.position_count > 0xffffffffull)
      fail_argument(name + ": triangle_count " + std::to_string(mesh.triangle_count) + " is more than 2^29-1");
    for (size_t i = 0; i < mesh.position_count; ++i) {
      if ((i & 0xffff) == 0 && progress != nullptr) progress->check();
      if (is_finite(mesh.positions[i])) continue;
      const Vec3f& p = mesh.positions[i];
      fail_argument(name + ": position " + std::to_string(i) + " is not finite: (" + std::to_string(p.x) + ", " +
                    std::to_string(p.y) + ", " + std::to_string(p.z) + ")");
    }
    for (size_t i = 0; i < 3 * mesh.triangle_count; ++i) {
      if ((i & 0xffff) == 0 && progress != nullptr) progress->check();
      if (mesh.indices[i] < mesh.position_count) continue;
      fail_argument(name + ": index " + std::to_string(i) + " is " + std::to_string(mesh.indices[i]) +
                    ", but there are " + std::to_string(mesh.position_count) + " positions");
    }
  }
  for (size_t i = 0; i < geometry.instances.size(); ++i) {
    const InstanceView& instance = geometry.instances[i];
    const std::string name = "instance " + std::to_string(i);
    if (instance.mesh >= geometry.meshes.size())
      fail_argument(name + ": mesh is " + std::to_string(instance.mesh) + ", but there are " +
                    std::to_string(geometry.meshes.size()) + " meshes");
    for (int k = 0; k < 12; ++k)
      if (!std::isfinite(instance.to_world.m[k]))
        fail_argument(name + ": to_world[" + std::to_string(k) +
                      "] is not finite: " + std::to_string(instance.to_world.m[k]));
  }
}

Aabb bounds_of(const AccelGeometry& geometry) {
  std::vector<Aabb> boxes(geometry.meshes.size());
  for (size_t m = 0; m < boxes.size(); ++m)
    for (size_t i = 0; i < geometry.meshes[m].triangle_count; ++i)
      if (const Triangle t = triangle_of(geometry.meshes[m], i); in_range(t))
        boxes[m].extend(t.v0), boxes[m].extend(t.v1), boxes[m].extend(t.v2);
  Aabb all;
  if (geometry.instances.empty())
    for (const Aabb& box : boxes) all.extend(box);
  for (const InstanceView& instance : geometry.instances) {
    const Aabb& box = boxes[instance.mesh];
    if (box.empty()) continue;
    Aabb moved;
    for (int corner = 0; corner < 8; ++corner)
      moved.extend(instance.to_world.point(
          {corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y, corner & 4 ? box.hi.z : box.lo.z}));
    if (within(moved.lo, kHugeCoordinate) && within(moved.hi, kHugeCoordinate)) all.extend(moved);
  }
  return all;
}

Inverses invert_instances(const AccelGeometry& geometry) {
  Inverses out;
  const Aabb bounds = bounds_of(geometry);
  const double reach = bounds.empty() ? 0.0 : double{max_component(max(bounds.hi, -bounds.lo))};
  double origin = kHugeCoordinate, direction = kHugeCoordinate;
  for (const InstanceView& instance : geometry.instances) {
    out.of.emplace_back();
    const float* m = instance.to_world.m;
    const Vec3d a{m[0], m[1], m[2]}, b{m[4], m[5], m[6]}, c{m[8], m[9], m[10]}, t{m[3], m[7], m[11]};
    const Vec3d bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
    const double det = dot(a, bc);
    if (!(std::abs(det) > 0.0)) continue;
    Transform inverse;
    double stretch = 0.0, moved = 0.0;  // a coordinate grows to at most stretch * coordinate + moved
    for (int row = 0; row < 3; ++row) {
      const Vec3d r = Vec3d{bc[row], ca[row], ab[row]} / det;
      for (int k = 0; k < 3; ++k) inverse.m[4 * row + k] = static_cast<float>(r[k]);
      inverse.m[4 * row + 3] = static_cast<float>(-dot(r, t));
      stretch = std::max(stretch, std::abs(r.x) + std::abs(r.y) + std::abs(r.z));
      moved = std::max(moved, std::abs(dot(r, t)));
    }
    // Slightly less than the limit, for rounding to single precision.
    constexpr double kLimit = 0.999999 * kHugeCoordinate;
    if (!(stretch * reach + moved < kLimit)) continue;
    out.of.back() = inverse;
    origin = std::min(origin, (kLimit - moved) / stretch);
    direction = std::min(direction, kLimit / stretch);
  }
  out.limits = {static_cast<float>(origin), static_cast<float>(direction)};
  return out;
}

std::string accel_kind_of(const std::string& name) {
  if (name == "bvh" || name == "agglomerative") return "bvh";
  if (name == "embree") {
    if (!has_embree())
      throw Error(ErrorCode::unsupported, "accel 'embree' is not in this library, which was built without it");
    return name;
  }
  fail_argument("accel '" + name + "' is neither 'bvh' nor 'embree'");
}

std::unique_ptr<Accel> make_accel(const std::string& name, const AccelGeometry& geometry, const AccelOptions& options,
                                  Progress* progress) {
  if (accel_kind_of(name) == "bvh") return Bvh::from_geometry(geometry, options, progress);
  validate(geometry, progress);
  return make_embree_accel(geometry, options, progress);
}

}  // namespace lumicut
