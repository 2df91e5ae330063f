// Traversal of wide BVHs: single rays, and bundles of up to 64 rays with one end in common. Selects AVX-512, AVX2, SSE4
// or a portable fallback at run time.
#pragma once

#include <span>

#include "accel/accel.h"
#include "accel/bvh/wide_bvh.h"
#include "accel/validate.h"

namespace lumicut {

// Which rays the filter is asked for at a mesh.
enum FilteredRays : uint8_t { kFilterAll = 1, kFilterLight = 2 };

// Input of traversal. Features that a scene does not use are compiled out of its loops.
struct TraceScene {
  struct Instance {
    Transform inverse;  // world to mesh
    const WideBvh* bvh = nullptr;
  };
  const WideBvh* top = nullptr;  // over primitives, or over instances
  std::span<const Instance> instances;
  const HitFilter* filter = nullptr;
  const uint8_t* filtered = nullptr;     // by mesh: FilteredRays
  const uint32_t* mesh_masks = nullptr;  // by mesh
  bool robust = true;
  bool boxes = false;  // leaves hold boxes, not triangles
  bool masks = false;  // some mesh mask is not all ones
  bool instanced = false;
  RayLimits limits;
};

void trace_closest(const TraceScene& scene, std::span<RayHit> rays);
void trace_any(const TraceScene& scene, std::span<Ray> rays);
// See Accel::occluded_from_point.
void trace_points(const TraceScene& scene, const BundleOrigin& origin, const float* px, const float* py,
                  const float* pz, size_t n, uint8_t* occluded);

// The instruction set in use: "AVX3", "AVX2", "SSE4", or a portable one ("SCALAR", "EMU128").
const char* traversal_target();

}  // namespace lumicut
