// The rays of the benchmark: where a many-lights renderer sends them.
#pragma once

#include <vector>

#include "accel/accel.h"
#include "bench/bvh/meshes.h"

namespace lumicut::bench {

inline constexpr size_t kPointsPerLight = 64;

// Segments from `light` to 64 points near each other.
struct PointBundle {
  Vec3f light;
  float x[kPointsPerLight], y[kPointsPerLight], z[kPointsPerLight];
};

struct RaySet {
  std::vector<RayHit> primary;         // a camera inside, in tiles
  std::vector<RayHit> diffuse;         // one bounce from random surface points, cosine-weighted
  std::vector<Ray> shadow;             // random surface points to random lights: incoherent
  std::vector<PointBundle> coherent;   // lights to 64 nearby points, as Lightcuts and its kin shade
  std::vector<PointBundle> scattered;  // the same call with 64 unrelated points
};

// `accel` finds the surfaces; about n rays of each kind. All ends are off their surfaces by 1e-4 of the diagonal.
RaySet make_rays(const Accel& accel, size_t n, uint64_t seed);

}  // namespace lumicut::bench
