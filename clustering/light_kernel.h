// One light against many points: the inner loop of every method. SIMD over points, picked at run time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "accel/accel.h"
#include "bsdf/shade_points.h"
#include "core/stats.h"
#include "lights/falloff.h"
#include "lights/soft_lamp.h"
#include "lights/vpl.h"

namespace lumicut {

// Most points that one call takes.
inline constexpr size_t kMaxLit = 256;

// Points that a light reaches if nothing stands between: contribution in radiance, and where the shadow ray ends.
struct LitPoints {
  alignas(64) float x[kMaxLit + kLanes], y[kMaxLit + kLanes], z[kMaxLit + kLanes];
  alignas(64) float r[kMaxLit + kLanes], g[kMaxLit + kLanes], b[kMaxLit + kLanes];
  alignas(64) uint32_t index[kMaxLit + kLanes];  // counted from the first point of the call
  uint8_t occluded[kMaxLit + kLanes];
  size_t count = 0;
};

// How the directions of a cluster of oriented lights scatter about their mean: 2/π times their covariance.
struct DirectionScatter {
  float xx = 0.0f, yy = 0.0f, zz = 0.0f, xy = 0.0f, xz = 0.0f, yz = 0.0f;
};

// Mean of the lights' cosines, each cut off at 90 degrees: (c + √(c² + s)) / 2, c the cosine of their mean direction
// (as short as such a mean is) and s the scatter along `to_light`. Exact where nothing scatters, and about a mean of 0
// where cosines are normally distributed; in between within a few hundredths.
inline float mean_cosine(const Vec3f& direction, const DirectionScatter& s, const Vec3f& to_light) {
  const Vec3f& t = to_light;
  const float c = -dot(direction, t);
  const float along = t.x * t.x * s.xx + t.y * t.y * s.yy + t.z * t.z * s.zz +
                      2.0f * (t.x * t.y * s.xy + t.x * t.z * s.xz + t.y * t.z * s.yz);
  return 0.5f * (c + std::sqrt(c * c + std::max(0.0f, along)));
}

// Unshadowed radiance of `light`, with the summed intensity `intensity` in place of its own, at points
// [first, first + count) of `points`; first a multiple of kLanes, count <= kMaxLit. Only points that get any are kept,
// in order. [thesis Eq. 1.1 without V]
// `lanes`, where given, holds a bit for each point (kLanes points a word, as many words as points need): only points
// whose bit is set are kept.
// `scatter`, for oriented lights and spheres: `light` is the mean of a cluster, its normal their mean direction.
void light_points(const Vpl& light, const Rgb& intensity, Falloff falloff, const ShadePoints& points, size_t first,
                  size_t count, LitPoints& lit, const uint16_t* lanes = nullptr,
                  const DirectionScatter* scatter = nullptr);

// Where its shadow rays begin, to points about `middle`. A lamp with a radius has its place on the disk that faces them: else
// half of a lamp at a ceiling stood above it.
inline BundleOrigin shadow_origin(const Vpl& light, const Vec3f& middle) {
  const bool directional = light.kind == VplKind::directional;
  if (light.lamp_radius > 0.0f) return {place_facing(light, middle), false, light.ray_mask};
  return {directional ? -light.normal : light.position, directional, light.ray_mask};
}

// Shadow rays from the light to n points; fills `occluded`. To a lamp with a radius each goes on its own: what a point
// sees must not depend on its neighbours, or borders of images showed.
inline void trace_shadows(const Accel& accel, const Vpl& light, const float* x, const float* y, const float* z,
                          size_t n, uint8_t* occluded) {
  if (!(light.lamp_radius > 0.0f)) return accel.occluded_from_point(shadow_origin(light, {}), x, y, z, n, occluded);
  constexpr size_t kMost = 64;
  for (size_t begin = 0; begin < n; begin += kMost) {
    Ray rays[kMost];
    const size_t count = std::min(kMost, n - begin);
    for (size_t i = 0; i < count; ++i) {
      const Vec3f point{x[begin + i], y[begin + i], z[begin + i]};
      rays[i].org = place_facing(light, point), rays[i].dir = point - rays[i].org;
      rays[i].tfar = 0x1.fffffep-1f, rays[i].mask = light.ray_mask, rays[i].flags = kFromLight;
    }
    accel.occluded({rays, count});
    for (size_t i = 0; i < count; ++i) occluded[begin + i] = rays[i].tfar < 0.0f;
  }
}

// Shadow rays from the light to the lit points; fills `occluded`.
inline void trace_lit(const Accel& accel, const Vpl& light, LitPoints& lit) {
  if (lit.count > 0) trace_shadows(accel, light, lit.x, lit.y, lit.z, lit.count, lit.occluded);
}

// The same for one point, in plain arithmetic: what the kernel is tested against, and for code that is not hot.
// Spheres: one lane of the kernel.
Rgb light_point(const Vpl& light, const Rgb& intensity, Falloff falloff, const SurfacePoint& point);
// The same of the lobes that the light lights.
Rgb light_point_limited(const Vpl& light, const Rgb& intensity, Falloff falloff, const SurfacePoint& point);

}  // namespace lumicut
