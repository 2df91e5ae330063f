// Perspective and orthographic cameras with lens shift and a thin lens, and panoramas.
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
  float shift_x = 0.0f, shift_y = 0.0f;                              // in heights; of panoramas in widths and heights
  float near_clip = 0.0f, far_clip = std::numeric_limits<float>::infinity();
  float pixel_aspect = 1.0f;
  float lens_radius = 0.0f, focus_distance = 1.0f;
  enum class Panorama : uint32_t {
    none = 0,
    equirectangular = 1,
    fisheye_equidistant = 2,
    fisheye_equisolid = 3,
    mirror_ball = 4,
    equiangular_cube = 5  // a face of it
  };
  Panorama panorama = Panorama::none;
  float fisheye_fov = 3.14159265f, fisheye_lens = 1.0f;  // radians; in units of the sensor
  float sensor_width = 1.0f, sensor_height = 1.0f;
  float longitude[2] = {-3.14159265f, 3.14159265f};  // equirectangular: from left to right
  float latitude[2] = {-1.57079633f, 1.57079633f};   // from below to above
  LUMICUT_FIELDS(Camera, orthographic, position, right, up, forward, tan_half_fov_y, height, shift_x, shift_y,
                 near_clip, far_clip, pixel_aspect, lens_radius, focus_distance, panorama, fisheye_fov, fisheye_lens,
                 sensor_width, sensor_height, longitude, latitude)

  struct Sample {
    Vec3f origin, direction;  // unit direction
    float tnear, tfar;
    float forward_cosine;  // depth along the axis = t · forward_cosine; of panoramas the distance, 1
    bool outside = false;  // of what a fisheye shows: no ray
  };
  // Ray through (x, y) in pixels, row 0 on top, of an image of width × height; (lens_u, lens_v) in [0,1)².
  Sample generate(float x, float y, float width, float height_px, float lens_u, float lens_v) const;

 private:
  Sample panoramic(float u, float v) const;
};

}  // namespace lumicut
