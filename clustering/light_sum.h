// Sums a list of lights at points that lie together: how methods that share one list among many points render.
#pragma once

#include <span>

#include "accel/accel.h"
#include "clustering/light_kernel.h"
#include "core/progress.h"
#include "lights/vpl.h"

namespace lumicut {

struct ScaledLight {
  const Vpl* light;
  Rgb intensity;  // in place of the light's own
};

// What the lights give to points [first, first + count) of `points`, shadows included: first a multiple of kLanes,
// count <= kMaxLit. Sets radiance[i] and rays[i] (shadow rays) of point first + i, i < count. Returns the number of
// (light, point) pairs that are not in shadow. Stops early once cancelled: the caller throws.
uint64_t sum_lights(const Accel& accel, std::span<const ScaledLight> lights, Falloff falloff, const ShadePoints& points,
                    size_t first, size_t count, const Progress& progress, LitPoints& lit, Rgb* radiance,
                    uint32_t* rays);

}  // namespace lumicut
