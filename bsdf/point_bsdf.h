// The reflectance of a SurfacePoint, which virtual lights shade: a Lambert part and one glossy lobe. Scalar forms; the
// SIMD counterpart is bsdf/reflectance-inl.h.
#pragma once

#include <optional>

#include "bsdf/bump_shadow.h"
#include "bsdf/burley.h"
#include "bsdf/lambert.h"
#include "bsdf/lobes.h"
#include "bsdf/oren_nayar.h"

namespace lumicut {

// Share of the light that the glossy lobe sends back, roughly.
inline Rgb specular_albedo(const SurfacePoint& p) {
  return with_lobe(p, [&](auto lobe) { return lobe.albedo(p); });
}

// BRDF towards `to_light` (unit), without the cosine.
inline Rgb reflectance(const SurfacePoint& p, const Vec3f& to_light) {
  const float cosine = dot(p.normal, to_light);
  float even = diffuse_falloff(p.falloff, cosine);
  if (p.bent() && cosine > 0.0f) even *= bump_shadow(p, cosine, to_light);
  if (p.burley()) even *= burley_factor(p, cosine, dot(p.mirror, to_light));
  if (p.grooved()) even *= oren_nayar_factor(p, cosine, dot(p.mirror, to_light));
  Rgb f = p.diffuse * even;
  f += with_lobe(p, [&](auto lobe) { return lobe.value(p, to_light); });
  return f;
}

// Mean over the light's projected solid angle of what the diffuse lobe is over Lambert's.
inline float mean_diffuse_factor(const SurfacePoint& p) {
  const float view = dot(p.normal, p.mirror);
  return mean_diffuse_falloff(p.falloff) * (p.burley() ? mean_burley_factor(p.retro, p.dim, view) : 1.0f) *
         (p.grooved() ? mean_oren_nayar_factor(p.slope, p.again, view) : 1.0f);
}

// About the largest luminance of the glossy lobe over directions of at most `cosine` to the normal and `beta` to the
// mirror direction; above 0 wherever the lobe is.
inline float lobe_importance(const SurfacePoint& p, float cosine, float beta) {
  return with_lobe(p, [&](auto lobe) { return lobe.importance(p, cosine, beta); });
}

// kStraight: through glass as if it were not there; what lies behind is lit and found by shadow rays too.
// kGlossy: by a lobe that virtual lights shade.
// kSharp: by a specular lobe that is narrower than about a pixel.
enum BsdfFlags : uint32_t { kReflected = 1, kTransmitted = 2, kSpecular = 4, kStraight = 8, kGlossy = 16, kSharp = 32 };

struct BsdfSample {
  Vec3f direction;     // unit
  Rgb weight{};        // BSDF · cosine / density
  float pdf = 0.0f;    // per steradian; 0 of specular lobes, which nothing but their own samples finds
  uint32_t flags = 0;  // BsdfFlags
};

// Mixture of the lobes by how much they reflect, each sampled by its shape. [Lafortune, Willems 1994]
class PointBsdf {
 public:
  explicit PointBsdf(const SurfacePoint& point) : point_(point) {
    const float diffuse = std::numbers::pi_v<float> * luminance(point.diffuse), sum = luminance(albedo());
    diffuse_share_ = sum > 0.0f ? diffuse / sum : 1.0f;
    black_ = !(sum > 0.0f);
  }

  bool black() const { return black_; }
  // Chance that a sample follows the glossy lobe.
  float glossy_share() const { return 1.0f - diffuse_share_; }
  // Share of the light that the lobes send back, as if none fell below the horizon.
  Rgb albedo() const { return point_.diffuse * std::numbers::pi_v<float> + specular_albedo(point_); }

  float pdf(const Vec3f& direction) const {
    const float cosine = dot(point_.normal, direction);
    if (black_ || !(cosine > 0.0f)) return 0.0f;
    const float p = diffuse_share_ * cosine * std::numbers::inv_pi_v<float>;
    if (!(diffuse_share_ < 1.0f)) return p;
    const float share = 1.0f - diffuse_share_;
    return p + with_lobe(point_, [&](auto lobe) { return lobe.pdf(share, point_, direction); });
  }

  // `choice`, `u`, `v` in [0, 1). Empty where nothing is reflected that way.
  std::optional<BsdfSample> sample(float choice, float u, float v) const {
    if (black_) return {};
    BsdfSample s;
    const bool diffuse = choice < diffuse_share_;
    s.direction = diffuse ? sample_cosine_hemisphere(point_.normal, u, v)
                          : with_lobe(point_, [&](auto lobe) { return lobe.sample(point_, u, v); });
    s.pdf = pdf(s.direction);
    if (!(s.pdf > 0.0f)) return {};
    s.weight = reflectance(point_, s.direction) * (dot(point_.normal, s.direction) / s.pdf);
    s.flags = diffuse ? kReflected : kReflected | kGlossy;
    return s;
  }

  // The same for a direction that something else chose; `choice` decides which lobe it is said to be of.
  std::optional<BsdfSample> towards(const Vec3f& direction, float choice) const {
    BsdfSample s;
    s.direction = direction;
    s.pdf = pdf(direction);
    if (!(s.pdf > 0.0f)) return {};
    const float cosine = dot(point_.normal, direction);
    s.weight = reflectance(point_, direction) * (cosine / s.pdf);
    const bool diffuse = choice * s.pdf < diffuse_share_ * cosine * std::numbers::inv_pi_v<float>;
    s.flags = diffuse ? kReflected : kReflected | kGlossy;
    return s;
  }

 private:
  const SurfacePoint& point_;
  float diffuse_share_ = 1.0f;
  bool black_ = false;
};

}  // namespace lumicut
