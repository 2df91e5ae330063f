// Backend: the host's own ray tracing.
#pragma once

#include "accel/accel.h"

namespace lumicut {

// Both return void and write into the rays, which are preset to 'no hit'.
// Called concurrently, with batches as large as the caller's: a callback into Python costs tens of microseconds.
struct HostCallbacks {
  // Closest hits: fills `hit` (geom and prim are indices into the AccelGeometry) and shortens `ray.tfar` to it.
  // `hit.ng` is computed here from the mesh, which overwrites the host's.
  void (*intersect)(void* user, RayHit* rays, size_t n) = nullptr;
  // Any hit: sets tfar to -inf where something lies between tnear and tfar.
  void (*occluded)(void* user, Ray* rays, size_t n) = nullptr;
  void* user = nullptr;
};

// Queries throw Error(invalid_argument) when the host reports a mesh, primitive or instance that does not exist, u and
// v outside of the triangle, or a distance outside of the ray's range. `geometry`'s arrays must outlive the
// Accel. Throws Error on missing callbacks, and as make_accel does on bad geometry.
std::unique_ptr<Accel> make_host_accel(const HostCallbacks& callbacks, const AccelGeometry& geometry);

}  // namespace lumicut
