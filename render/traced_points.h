// Points that camera rays and rays of compensation found, with what they show already multiplied in: their radiance
// adds to their pixels.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "accel/accel.h"
#include "bsdf/shade_points.h"

namespace lumicut {

// trace(part) of all the rays, part after part, between which it looks at cancel.
template <typename T, typename Fn>
void trace_in_parts(std::span<T> rays, const Progress& progress, const Fn& trace) {
  constexpr size_t kPart = 16384;
  for (size_t first = 0; first < rays.size(); first += kPart) {
    progress.check();
    trace(rays.subspan(first, std::min(kPart, rays.size() - first)));
  }
}

struct TracedPoints {
  std::vector<SurfacePoint> found;
  std::vector<Rgb> light;              // emitted towards the ray
  std::vector<uint32_t> pixel, group;  // of each entry of `light`

  void add(const Rgb& radiance, uint32_t at, uint32_t of_group) {
    light.push_back(radiance), pixel.push_back(at), group.push_back(of_group);
  }
  // Those of one pixel together.
  ShadePoints points() const {
    std::vector<SurfacePoint> sorted = found;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const SurfacePoint& a, const SurfacePoint& b) { return a.pixel < b.pixel; });
    ShadePoints all;
    all.reserve(sorted.size());
    for (const SurfacePoint& p : sorted) all.push(p);
    all.finish();
    return all;
  }
};

}  // namespace lumicut
