// Blinn's and Phong's lobes as the many-lights papers have them: with β between the mirrored view direction and the
// light, ks (n+2)/(2π) cosⁿβ (Blinn) or ks/(2π) cosⁿβ (Phong). [thesis sec. 1, below Eq. 1.1]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_COSINE_LOBE_H_
#define LUMICUT_BSDF_COSINE_LOBE_H_

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/vec.h"

namespace lumicut {

// The lobe's factor before ks cosⁿβ.
inline float cosine_lobe_scale(bool phong, float exponent) {
  constexpr float kInvTwoPi = 0.15915494309f;
  return phong ? kInvTwoPi : (exponent + 2.0f) * kInvTwoPi;
}

// A direction about `mirror` with the density (n+1)/(2π) cosⁿβ; and that density times `share`.
inline Vec3f sample_cosine_lobe(const Vec3f& mirror, float exponent, float u, float v) {
  const float phi = 2.0f * std::numbers::pi_v<float> * v;
  const float c = std::pow(u, 1.0f / (exponent + 1.0f)), r = std::sqrt(std::max(0.0f, 1.0f - c * c));
  return Frame(mirror).to_world({r * std::cos(phi), r * std::sin(phi), c});
}
inline float cosine_lobe_pdf(float share, float exponent, float beta) {
  return beta > 0.0f ? share * (exponent + 1.0f) * 0.5f * std::numbers::inv_pi_v<float> *
                           std::pow(std::min(1.0f, beta), exponent)
                     : 0.0f;
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_COSINE_LOBE_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_COSINE_LOBE_SIMD_
#undef LUMICUT_BSDF_COSINE_LOBE_SIMD_
#else
#define LUMICUT_BSDF_COSINE_LOBE_SIMD_
#endif

#include "bsdf/lanes-inl.h"

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// cosine^exponent, 0 from the horizon on.
HWY_INLINE V CosineLobe(D d, V cosine, V exponent) {
  const V base = hn::Min(hn::Max(cosine, hn::Set(d, 1e-20f)), hn::Set(d, 1.0f));
  const V lobe = hn::Exp(d, hn::Max(hn::Mul(exponent, hn::Log(d, base)), hn::Set(d, -80.0f)));
  return hn::IfThenElseZero(hn::Gt(cosine, hn::Zero(d)), lobe);
}

// Its largest value over cosines of at most `beta` to the mirror direction.
HWY_INLINE V BoundOfCosineLobe(D d, V beta, V exponent) {
  // Rounding of the cosine is magnified by the exponent: a part in 10^6 of slack before it.
  beta = hn::Min(hn::Set(d, 1.0f), hn::MulAdd(beta, hn::Set(d, 1.000001f), hn::Set(d, 1e-6f)));
  const V base = hn::Max(beta, hn::Set(d, 1e-20f));
  const V lobe = hn::Exp(d, hn::Max(hn::Mul(exponent, hn::Log(d, base)), hn::Set(d, -80.0f)));
  return hn::IfThenElseZero(hn::Gt(beta, hn::Zero(d)), lobe);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
