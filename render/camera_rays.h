// The rays that a frame's pixels begin with.
#pragma once

#include "accel/accel.h"
#include "film/pixel_filter.h"
#include "render/frame.h"
#include "scene/camera.h"

namespace lumicut {

class CameraRays {
 public:
  CameraRays(const Camera& camera, const FrameOptions& options);
  // options.samples rays of one pixel, and their cosines to the camera's axis. The mask is 0 where the camera shows nothing.
  void of_pixel(uint32_t x, uint32_t y, RayHit* rays, float* cosines) const;

 private:
  const Camera& camera_;
  const FrameOptions& options_;
  const FilterSampler filter_;
};

// What the samples of a rectangle's pixels meet first: options.samples hits a pixel, row after row, of kNoId where there is
// nothing. Throws Error(cancelled).
struct FirstHit {
  uint32_t mesh, instance, triangle, material;
  float u, v;  // barycentric, of the triangle's second and third corners
};
void first_hits(const Scene& scene, const FrameOptions& options, const Rect& rect, std::span<FirstHit> hits,
                const Progress& progress);

}  // namespace lumicut
