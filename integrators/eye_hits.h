// Points that eye rays found, with what they show already multiplied in: their radiance adds to their pixels.
#pragma once

#include <algorithm>
#include <vector>

#include "scene/shade_points.h"

namespace lumicut {

struct EyeHits {
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
