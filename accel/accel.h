// Ray tracing behind one interface. Backends: our BVH, Embree, and the host's own callbacks.
// Every call is a batch, so that no virtual call is paid per ray. All queries are [shared]: concurrent after build.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"

namespace lumicut {

inline constexpr uint32_t kNoId = 0xffffffffu;

// Limit of a scene's coordinates: the difference of two is a valid direction in every backend.
inline constexpr float kLargestCoordinate = 9e17f;

// A flag of rays: they run from a light to what it lights. Without it, the other way.
inline constexpr uint32_t kFromLight = 1;

// Fields in Embree's order (RTCRay). `dir` need not be a unit vector; distances are in units of its length.
struct Ray {
  Vec3f org;
  float tnear = 0.0f;  // below 0 is taken as 0
  Vec3f dir;
  float time = 0.0f;
  float tfar = std::numeric_limits<float>::infinity();  // shortened to the hit; -inf when found occluded
  uint32_t mask = 0xffffffffu;                          // a mesh is seen when (mesh.mask & ray.mask) != 0
  uint32_t id = 0;
  uint32_t flags = 0;  // kFromLight; others are ignored

  Vec3f towards_light() const { return turned_to_light(dir); }
  // `along`: its direction in another space.
  Vec3f turned_to_light(const Vec3f& along) const { return (flags & kFromLight) != 0 ? -along : along; }
};

// Fields in Embree's order (RTCHit). `ng` is not normalised and is in the mesh's own space: an instance's transform has
// not been applied to it.
struct Hit {
  Vec3f ng;
  float u = 0.0f, v = 0.0f;  // hit = (1-u-v)·v0 + u·v1 + v·v2
  uint32_t prim = kNoId;
  uint32_t geom = kNoId;  // index into AccelGeometry::meshes; kNoId: nothing hit
  uint32_t inst = kNoId;  // index into AccelGeometry::instances; kNoId when the geometry has no instances
};

struct RayHit {
  Ray ray;
  Hit hit;
};

// Where a ray meets a surface. `dir`, of any length, is in the mesh's own space, and leads towards the light.
struct CandidateHit {
  uint32_t mesh, inst, prim;  // as in Hit
  float u, v;
  Vec3f dir;
};

// Cut-outs, partial transparency, and glass that light passes straight. Called for each candidate hit on a mesh that is
// marked for it, concurrently. Must always return the same for the same place (and direction).
class HitFilter {
 public:
  virtual ~HitFilter() = default;
  // True where any ray passes through the surface: meshes with `has_cutout`.
  virtual bool passes(const CandidateHit& hit) const = 0;
  // The same for rays of occlusion queries, of meshes with `has_cutout` or `passes_light`.
  virtual bool passes_light(const CandidateHit& hit) const { return passes(hit); }
};

// Views of the caller's memory, which must outlive the Accel.
struct MeshView {
  const Vec3f* positions = nullptr;
  size_t position_count = 0;
  const uint32_t* indices = nullptr;  // three per triangle
  size_t triangle_count = 0;
  uint32_t mask = 0xffffffffu;
  bool has_cutout = false;
  bool passes_light = false;  // occlusion queries may pass where closest hits do not
};

struct InstanceView {
  uint32_t mesh = 0;
  Transform to_world;
};

struct AccelGeometry {
  std::vector<MeshView> meshes;
  std::vector<InstanceView> instances;  // empty: each mesh once, as it is
  const HitFilter* filter = nullptr;
};

struct AccelOptions {
  bool robust = true;        // watertight on shared edges
  std::string builder = "";  // "bvh" only: see build_options_of in accel/bvh_build.h; empty: its default
};

// Statistics of a build. Costs as in [Walter et al. 2008, Fig. 6]; 0 where the backend does not compute them.
struct AccelInfo {
  uint64_t triangles = 0, nodes = 0, bytes = 0;
  double build_seconds = 0, expected_boxes = 0, expected_tris = 0, expected_cost = 0;
  Aabb bounds;
};

// Where all rays of a bundle begin: a light's point, or the unit direction towards a light at infinity. With `to_lights`
// they begin at a point that lights of other places light.
struct BundleOrigin {
  Vec3f light;
  bool directional = false;
  uint32_t mask = 0xffffffffu;  // as Ray::mask
  bool to_lights = false;

  uint32_t ray_flags() const { return directional || to_lights ? 0 : kFromLight; }
};

class Accel {
 public:
  virtual ~Accel() = default;
  virtual AccelInfo info() const = 0;

  // Closest hits. Rays with NaN fields, or an origin or direction past 1.844e18, hit nothing.
  virtual void intersect(std::span<RayHit> rays) const = 0;

  // Any hit: sets tfar to -inf where something that stops light lies in (tnear, tfar).
  virtual void occluded(std::span<Ray> rays) const = 0;

  // The hot call of the renderer: one light, many nearby points (structure of arrays). Tests the open segments
  // light→point; with `directional` the ray runs from the point to infinity. Both ends should be offset from their surfaces already. occluded[i] = 1 where blocked, else 0. Fastest
  // where `n` is a multiple of 16.
  virtual void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz,
                                   size_t n, uint8_t* occluded) const = 0;
};

inline constexpr const char* kDefaultAccel = "bvh";
// "bvh" or "embree" for the name of a backend; "agglomerative" is an earlier name of "bvh". Throws Error on others,
// Error(unsupported) on "embree" where it is not built in.
std::string accel_kind_of(const std::string& name);

// Builds the backend of that name, on the caller's arena. Throws Error on an unknown name, an index out of range, or a
// position that is not finite (naming mesh, index and value), and Error(cancelled).
std::unique_ptr<Accel> make_accel(const std::string& name, const AccelGeometry& geometry, const AccelOptions& options,
                                  Progress* progress = nullptr);

}  // namespace lumicut
