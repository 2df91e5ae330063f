// Points that camera rays and rays of compensation found, with what they show already multiplied in: their radiance
// adds to their pixels.
#pragma once

#include <algorithm>
#include <numeric>
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
  // Of each entry, whether nothing on the way to it was left to chance.
  std::vector<bool> found_surely, seen_surely;

  void add(const SurfacePoint& point, bool surely = false) { found.push_back(point), found_surely.push_back(surely); }
  void add(const Rgb& radiance, uint32_t at, uint32_t of_group, bool surely = false) {
    light.push_back(radiance), pixel.push_back(at), group.push_back(of_group), seen_surely.push_back(surely);
  }
  // `found`, brought in the order of its pixels.
  ShadePoints points() {
    std::vector<uint32_t> order(found.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return found[a].pixel < found[b].pixel; });
    std::vector<SurfacePoint> sorted;
    std::vector<bool> sorted_surely;
    ShadePoints all;
    sorted.reserve(order.size()), all.reserve(order.size());
    for (uint32_t i : order) {
      sorted.push_back(found[i]), sorted_surely.push_back(found_surely[i]);
      all.push(found[i]);
    }
    all.finish();
    found = std::move(sorted), found_surely = std::move(sorted_surely);
    return all;
  }
};

}  // namespace lumicut
