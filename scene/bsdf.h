// The reflectance of a SurfacePoint as what it is to paths: a factor, and a distribution of directions.
#pragma once

#include <numbers>

#include "scene/shade_points.h"

namespace lumicut {

// ---- GGX with Smith's height-correlated masking and Schlick's Fresnel. [Walter et al. 2007; Heitz 2014]
// The vector twins are in clusters/light_kernel-inl.h and clusters/bounds-inl.h.

// √(c²(1 − α²) + α²): cosine times √(1 + tan²·α²), of Smith's masking.
inline float ggx_root(float alpha2, float cosine) { return std::sqrt(cosine * cosine * (1.0f - alpha2) + alpha2); }

inline float schlick_share(float cosine) {
  const float m = std::min(1.0f, std::max(0.0f, 1.0f - cosine));
  return (m * m) * (m * m) * m;
}

// Reflectance of a smooth border for a cosine of incidence; `ratio`: index beyond over index before; `refracted`: the
// cosine beyond, 0 in total reflection. [Fresnel]
inline float fresnel_reflectance(float cosine, float ratio, float& refracted) {
  refracted = 0.0f;
  const float sine2 = (1.0f - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1.0f) return 1.0f;
  refracted = std::sqrt(1.0f - sine2);
  const float s = (cosine - ratio * refracted) / (cosine + ratio * refracted),
              p = (ratio * cosine - refracted) / (ratio * cosine + refracted);
  return 0.5f * (s * s + p * p);
}

// Of what is seen along visible half vectors, the share that facets towards the light do not mask: reflected, where
// heights are correlated, and through the surface. Cosines to the normal.
inline float masking_reflected(float alpha2, float nv, float nl) {
  const float root_v = ggx_root(alpha2, nv), root_l = ggx_root(alpha2, nl);
  return nl * (nv + root_v) / (nl * root_v + nv * root_l);
}
inline float masking_transmitted(float alpha2, float nl) { return 2.0f * nl / (nl + ggx_root(alpha2, nl)); }

struct GgxTerms {
  float distribution;  // D(h)
  float visibility;    // masking over 4 (n·v)(n·l)
  float fresnel;       // (1 − v·h)⁵
};

// Between the view direction, given by its mirror image `mirror` about `normal`, and `to_light`. The half vector's
// sine comes from the difference of mirror and light direction: nothing cancels where lobes are sharp.
inline GgxTerms ggx_terms(float alpha, const Vec3f& normal, const Vec3f& mirror, const Vec3f& to_light) {
  const float a2 = alpha * alpha;
  const Vec3f w = to_light - mirror;
  const float nv = std::max(1e-4f, dot(normal, mirror)), nl = std::max(0.0f, dot(normal, to_light)),
              nw = dot(normal, w);
  const float sum = nv + nl, sum2 = sum * sum;
  const float side2 = std::max(0.0f, dot(w, w) - nw * nw);  // of v + l, along the surface
  const float q = sum2 + side2;                             // |v + l|²
  const float e = a2 * sum2 + side2;
  GgxTerms t;
  t.distribution = a2 * q * q * std::numbers::inv_pi_v<float> / (e * e);
  t.visibility = 0.5f / (nl * ggx_root(a2, nv) + nv * ggx_root(a2, nl));
  t.fresnel = schlick_share(0.5f * std::sqrt(q));
  return t;
}

// Largest D·V·(n·l)/cosine over lights of at most `cosine` to the normal and `beta` to the mirror direction: the half
// vector is turned from the normal by at least half as much as the light from the mirror direction.
inline float ggx_lobe_bound(float alpha, float nv, float cosine, float beta) {
  const float a2 = alpha * alpha, far = 0.5f * (1.0f - std::min(1.0f, beta));  // sin² of the half vector's turn
  const float e = a2 * (1.0f - far) + far;
  nv = std::max(1e-4f, nv);
  return a2 * std::numbers::inv_pi_v<float> / (e * e) * 0.5f / (cosine * ggx_root(a2, nv) + nv * ggx_root(a2, cosine));
}

// Share of the light that the lobe sends back, roughly.
inline Rgb specular_albedo(const SurfacePoint& p) {
  if (!p.ggx()) return p.specular * (2.0f * std::numbers::pi_v<float> / (p.shininess + 1.0f));
  return p.specular + max(p.grazing - p.specular, Rgb{}) * schlick_share(dot(p.normal, p.mirror));
}

// BRDF towards `to_light` (unit), without the cosine. The vector twin is Reflectance in clusters/light_kernel-inl.h.
inline Rgb reflectance(const SurfacePoint& p, const Vec3f& to_light) {
  Rgb f = p.diffuse;
  if (p.ggx()) {
    const float m = 1.0f - std::max(0.0f, dot(p.normal, to_light));
    f *= 1.0f - p.fade * (m * m) * (m * m);
    const GgxTerms t = ggx_terms(-p.shininess, p.normal, p.mirror, to_light);
    f += (p.specular * (1.0f - t.fresnel) + p.grazing * t.fresnel) * (t.distribution * t.visibility);
    return f;
  }
  const float beta = dot(p.mirror, to_light);
  if (beta > 0.0f) f += p.specular * std::pow(std::min(1.0f, beta), p.shininess);
  return f;
}

// A half vector about +z as seen from `view` (unit, z > 0): by the area it shows. [Heitz 2018]
inline Vec3f sample_visible_normal(const Vec3f& view, float alpha, float u, float v) {
  const Vec3f h = normalize(Vec3f{alpha * view.x, alpha * view.y, view.z});
  const float flat2 = h.x * h.x + h.y * h.y;
  const Vec3f t = flat2 > 1e-12f ? Vec3f{-h.y, h.x, 0.0f} / std::sqrt(flat2) : Vec3f{1.0f, 0.0f, 0.0f};
  const Vec3f b = cross(h, t);
  const float r = std::sqrt(u), phi = 2.0f * std::numbers::pi_v<float> * v;
  const float x = r * std::cos(phi), s = 0.5f * (1.0f + h.z);
  const float y = (1.0f - s) * std::sqrt(std::max(0.0f, 1.0f - x * x)) + s * r * std::sin(phi);
  const Vec3f n = t * x + b * y + h * std::sqrt(std::max(0.0f, 1.0f - x * x - y * y));
  return normalize(Vec3f{alpha * n.x, alpha * n.y, std::max(1e-6f, n.z)});
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
  Rgb albedo() const { return point_.diffuse * std::numbers::pi_v<float> + specular_albedo(point_); }

  float pdf(const Vec3f& direction) const {
    const float cosine = dot(point_.normal, direction);
    if (black_ || !(cosine > 0.0f)) return 0.0f;
    float p = diffuse_share_ * cosine * std::numbers::inv_pi_v<float>;
    if (!(diffuse_share_ < 1.0f)) return p;
    if (point_.ggx()) {
      const float alpha = -point_.shininess, nv = std::max(1e-4f, dot(point_.normal, point_.mirror));
      const float d = ggx_terms(alpha, point_.normal, point_.mirror, direction).distribution;
      return p + (1.0f - diffuse_share_) * d * 0.5f / (nv + ggx_root(alpha * alpha, nv));
    }
    const float beta = dot(point_.mirror, direction);
    if (beta > 0.0f)
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
    } else if (point_.ggx()) {
      const Frame frame(point_.normal);
      const Vec3f view = frame.to_local(reflect(point_.mirror, point_.normal));
      const Vec3f h = sample_visible_normal({view.x, view.y, std::max(1e-4f, view.z)}, -point_.shininess, u, v);
      s.direction = frame.to_world(normalize(reflect(view, h)));
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
