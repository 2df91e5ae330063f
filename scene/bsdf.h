// The reflectance of a SurfacePoint as what it is to paths: a factor, and a distribution of directions.
#pragma once

#include <numbers>

#include "scene/shade_points.h"

namespace lumicut {

// BRDF towards `to_light` (unit), without the cosine. The vector twin is Reflectance in clusters/light_kernel-inl.h.
inline Rgb reflectance(const SurfacePoint& p, const Vec3f& to_light) {
  Rgb f = p.diffuse;
  const float beta = dot(p.mirror, to_light);
  if (beta > 0.0f) f += p.specular * std::pow(std::min(1.0f, beta), p.shininess);
  return f;
}

// Power heuristic for a sample drawn with density `a`, where `b` could have drawn it too. [Veach, Guibas 1995, sec. 4]
inline float mis_weight(double a, double b) {
  const double a2 = a * a, b2 = b * b;
  return a2 + b2 > 0.0 ? static_cast<float>(a2 / (a2 + b2)) : 0.0f;
}

struct BsdfSample {
  Vec3f direction;   // unit
  Rgb weight{};      // BRDF · cosine / density
  float pdf = 0.0f;  // per steradian; 0: nothing is reflected
};

// Mixture of the lobes by how much they reflect, each sampled by its shape. [Lafortune, Willems 1994]
class Bsdf {
 public:
  explicit Bsdf(const SurfacePoint& point) : point_(point) {
    const float diffuse = std::numbers::pi_v<float> * luminance(point.diffuse), sum = luminance(albedo());
    diffuse_share_ = sum > 0.0f ? diffuse / sum : 1.0f;
    black_ = !(sum > 0.0f);
  }

  bool black() const { return black_; }
  // Share of the light that the lobes send back, as if none fell below the horizon.
  Rgb albedo() const {
    return point_.diffuse * std::numbers::pi_v<float> +
           point_.specular * (2.0f * std::numbers::pi_v<float> / (point_.shininess + 1.0f));
  }

  float pdf(const Vec3f& direction) const {
    const float cosine = dot(point_.normal, direction);
    if (black_ || !(cosine > 0.0f)) return 0.0f;
    float p = diffuse_share_ * cosine * std::numbers::inv_pi_v<float>;
    const float beta = dot(point_.mirror, direction);
    if (diffuse_share_ < 1.0f && beta > 0.0f)
      p += (1.0f - diffuse_share_) * (point_.shininess + 1.0f) * 0.5f * std::numbers::inv_pi_v<float> *
           std::pow(std::min(1.0f, beta), point_.shininess);
    return p;
  }

  // `choice`, `u`, `v` in [0, 1).
  BsdfSample sample(float choice, float u, float v) const {
    BsdfSample s;
    if (black_) return s;
    const float phi = 2.0f * std::numbers::pi_v<float> * v;
    if (choice < diffuse_share_) {
      const float r = std::sqrt(u);
      s.direction =
          Frame(point_.normal).to_world({r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u))});
    } else {
      const float c = std::pow(u, 1.0f / (point_.shininess + 1.0f)), r = std::sqrt(std::max(0.0f, 1.0f - c * c));
      s.direction = Frame(point_.mirror).to_world({r * std::cos(phi), r * std::sin(phi), c});
    }
    const float cosine = dot(point_.normal, s.direction);
    s.pdf = pdf(s.direction);
    if (s.pdf > 0.0f) s.weight = reflectance(point_, s.direction) * (cosine / s.pdf);
    return s;
  }

 private:
  const SurfacePoint& point_;
  float diffuse_share_ = 1.0f;
  bool black_ = false;
};

}  // namespace lumicut
