#include "scene/camera.h"

namespace lumicut {

Camera::Sample Camera::generate(float x, float y, float width, float height_px, float lens_u, float lens_v) const {
  // Image plane in units of the image's height, centre 0, y up.
  const float sx = (x - 0.5f * width) * pixel_aspect / height_px + shift_x;
  const float sy = 0.5f - y / height_px + shift_y;
  Vec3f origin = position, d;  // d has a forward component of 1
  if (orthographic) {
    origin += (right * sx + up * sy) * height;
    d = forward;
  } else {
    const float scale = 2.0f * tan_half_fov_y;
    d = forward + (right * sx + up * sy) * scale;
  }
  if (lens_radius > 0.0f) {
    const Vec3f focus = origin + d * focus_distance;
    const float r = lens_radius * std::sqrt(lens_u), phi = 6.28318530718f * lens_v;
    origin += right * (r * std::cos(phi)) + up * (r * std::sin(phi));
    d = (focus - origin) / focus_distance;
  }
  const float len = length(d);
  return {origin, d / len, near_clip * len, far_clip * len, 1.0f / len};
}

}  // namespace lumicut
