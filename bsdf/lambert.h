// Lambert's lobe: kd/π, dimmed towards grazing light where a lobe above it, or rough metal, takes its share:
//   f = kd/π · (1 − falloff·(1 − c)⁴),  c: cosine of the light
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_LAMBERT_H_
#define LUMICUT_BSDF_LAMBERT_H_

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/vec.h"

namespace lumicut {

// 1 − falloff·(1 − c)⁴
inline float diffuse_falloff(float falloff, float cosine) {
  const float m = 1.0f - std::min(1.0f, std::max(0.0f, cosine));
  return 1.0f - falloff * (m * m) * (m * m);
}
// Its mean over the light's projected solid angle: 2 ∫ (1 − falloff·(1 − c)⁴) c dc
inline float mean_diffuse_falloff(float falloff) { return 1.0f - falloff * (1.0f / 15.0f); }
// One falloff for a product of two: of the same mean. 2 ∫ (1 − c)⁸ c dc = 1/45
inline float combined_falloff(float a, float b) { return std::min(1.0f, a + b - a * b * (1.0f / 3.0f)); }

// A direction about `normal`, by its cosine.
inline Vec3f sample_cosine_hemisphere(const Vec3f& normal, float u, float v) {
  const float phi = 2.0f * std::numbers::pi_v<float> * v, r = std::sqrt(u);
  return Frame(normal).to_world({r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u))});
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_LAMBERT_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_LAMBERT_SIMD_
#undef LUMICUT_BSDF_LAMBERT_SIMD_
#else
#define LUMICUT_BSDF_LAMBERT_SIMD_
#endif

#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// SIMD counterpart of diffuse_falloff, for cosines of at most 1.
HWY_INLINE V DiffuseFalloff(D d, V falloff, V cosine) {
  const V m = hn::Sub(hn::Set(d, 1.0f), hn::Max(hn::Zero(d), cosine)), m2 = hn::Mul(m, m);
  return hn::NegMulAdd(falloff, hn::Mul(m2, m2), hn::Set(d, 1.0f));
}

// Its largest value over cosines of at most `cosine`: it grows with the cosine.
HWY_INLINE V BoundOfDiffuseFalloff(D d, V falloff, V cosine) {
  const V one = hn::Set(d, 1.0f);
  const V m = hn::Sub(one, hn::Min(one, hn::Max(hn::Zero(d), cosine))), m2 = hn::Mul(m, m);
  return hn::NegMulAdd(falloff, hn::Mul(m2, m2), one);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
