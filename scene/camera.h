// Perspective and orthographic cameras with lens shift and a thin lens.
#pragma once

#include <limits>

#include "core/fields.h"
#include "core/rng.h"
#include "core/vec.h"

namespace lumicut {

struct Camera {
  bool orthographic = false;
  Vec3f position{}, right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};  // orthonormal
  float tan_half_fov_y = 0.5f;                                       // perspective
  float height = 2.0f;                                               // orthographic: world height of the image
  float shift_x = 0.0f, shift_y = 0.0f;
  float near_clip = 0.0f, far_clip = std::numeric_limits<float>::infinity();
  float pixel_aspect = 1.0f;
  float lens_radius = 0.0f, focus_distance = 1.0f;
  LUMICUT_FIELDS(Camera, orthographic, position, right, up, forward, tan_half_fov_y, height, shift_x, shift_y,
                 near_clip, far_clip, pixel_aspect, lens_radius, focus_distance)

  struct Sample {
    Vec3f origin, direction;  // unit direction
    float tnear, tfar;
    float forward_cosine;  // depth along the axis = t · forward_cosine
  };
  // Ray through (x, y) in pixels, row 0 on top, of an image of width × height; (lens_u, lens_v) in [0,1)².
  Sample generate(float x, float y, float width, float height_px, float lens_u, float lens_v) const;
};

}  // namespace lumicut
