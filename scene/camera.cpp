#include "scene/camera.h"

namespace lumicut {

// u from left to right, v from below to above, both in [0,1] without a shift. [the projections of Cycles, which follow Paul Bourke's]
Camera::Sample Camera::panoramic(float u, float v) const {
  Sample s{position, forward, near_clip, far_clip, 1.0f};
  if (panorama == Panorama::equirectangular) {
    const float phi = longitude[0] + (longitude[1] - longitude[0]) * u;
    const float theta = latitude[0] + (latitude[1] - latitude[0]) * v;
    s.direction = (forward * std::cos(phi) + right * std::sin(phi)) * std::cos(theta) + up * std::sin(theta);
    return s;
  }
  if (panorama == Panorama::equiangular_cube) {
    constexpr float kQuarterTurn = 1.57079633f;
    s.direction =
        normalize(forward + right * std::tan((u - 0.5f) * kQuarterTurn) + up * std::tan((v - 0.5f) * kQuarterTurn));
    return s;
  }
  if (panorama == Panorama::mirror_ball) {
    // forward mirrored at a ball's normal, turned round
    const float x = 2.0f * u - 1.0f, y = 2.0f * v - 1.0f, cosine2 = 1.0f - x * x - y * y;
    s.outside = cosine2 < 0.0f;
    const float cosine = std::sqrt(std::max(0.0f, cosine2));
    s.direction = (forward * cosine + right * x + up * y) * (2.0f * cosine) - forward;
    return s;
  }
  const bool equisolid = panorama == Panorama::fisheye_equisolid;
  const float x = (u - 0.5f) * (equisolid ? sensor_width : 2.0f), y = (v - 0.5f) * (equisolid ? sensor_height : 2.0f);
  const float r = std::sqrt(x * x + y * y),
              most = equisolid ? 2.0f * fisheye_lens * std::sin(0.25f * fisheye_fov) : 1.0f;
  if (r > most) {
    s.outside = true;
    return s;
  }
  if (!(r > 0.0f)) return s;
  const float theta = equisolid ? 2.0f * std::asin(std::min(1.0f, r / (2.0f * fisheye_lens))) : 0.5f * fisheye_fov * r;
  s.direction = forward * std::cos(theta) + (right * (x / r) + up * (y / r)) * std::sin(theta);
  return s;
}

Camera::Sample Camera::generate(float x, float y, float width, float height_px, float lens_u, float lens_v) const {
  if (panorama != Panorama::none) return panoramic(x / width + shift_x, 1.0f - y / height_px + shift_y);
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
