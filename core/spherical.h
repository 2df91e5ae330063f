// Directions drawn evenly from what a shape covers of the sphere around a point: next to a light all noise of its distance
// and its cosine is gone.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/vec.h"

namespace lumicut {

// The triangle that three directions span on the unit sphere. [Arvo 1995: Stratified Sampling of Spherical Triangles]
class SphericalTriangle {
 public:
  // Corners seen from `from`.
  SphericalTriangle(const Vec3f& from, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const Vec3d p = wide(from);
    a_ = normalize(wide(a) - p), b_ = normalize(wide(b) - p), c_ = normalize(wide(c) - p);
    // [Van Oosterom, Strackee 1983]
    const double volume = dot(a_, cross(b_, c_));
    solid_angle_ = 2.0 * std::atan2(std::abs(volume), 1.0 + dot(a_, b_) + dot(b_, c_) + dot(c_, a_));
    if (!(solid_angle_ > 0.0)) solid_angle_ = 0.0;
  }
  double solid_angle() const { return solid_angle_; }

  // Unit direction with density 1 / solid_angle(); u, v in [0, 1). The solid angle must be above 0.
  Vec3f sample(float u, float v) const {
    const Vec3d ab = cross(a_, b_), ca = cross(c_, a_);
    const double alpha = angle(ab, -ca);
    const double cos_c = dot(a_, b_);
    const double area = static_cast<double>(u) * solid_angle_;
    const double s = std::sin(area - alpha), t = std::cos(area - alpha);
    const double cos_alpha = std::cos(alpha), sin_alpha = std::sin(alpha);
    const double p = t - cos_alpha, q = s + sin_alpha * cos_c;
    const double top = (q * t - p * s) * cos_alpha - q, bottom = (q * s + p * t) * sin_alpha;
    const double cos_b = bottom != 0.0 ? std::clamp(top / bottom, -1.0, 1.0) : 1.0;
    const Vec3d beside = normalize(c_ - a_ * dot(c_, a_));
    const Vec3d corner = a_ * cos_b + beside * std::sqrt(std::max(0.0, 1.0 - cos_b * cos_b));
    const double z = 1.0 - static_cast<double>(v) * (1.0 - dot(corner, b_));
    const Vec3d across = normalize(corner - b_ * dot(corner, b_));
    const Vec3d d = b_ * z + across * std::sqrt(std::max(0.0, 1.0 - z * z));
    return normalize(Vec3f{static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)});
  }

 private:
  static Vec3d wide(const Vec3f& v) {
    return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
  }
  static double angle(const Vec3d& a, const Vec3d& b) { return std::atan2(length(cross(a, b)), dot(a, b)); }

  Vec3d a_, b_, c_;
  double solid_angle_ = 0.0;
};

}  // namespace lumicut
