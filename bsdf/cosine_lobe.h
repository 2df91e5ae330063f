// Blinn's and Phong's lobes as the many-lights papers have them: with β between the mirrored view direction and the
// light, ks (n+2)/(2π) cosⁿβ (Blinn) or ks/(2π) cosⁿβ (Phong). [thesis sec. 1, below Eq. 1.1]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_COSINE_LOBE_H_
#define LUMICUT_BSDF_COSINE_LOBE_H_

#include <algorithm>
#include <cmath>
#include <numbers>

#include "bsdf/shade_points.h"

namespace lumicut {

// The lobe's factor before ks cosⁿβ.
inline float cosine_lobe_scale(bool phong, float exponent) {
  constexpr float kInvTwoPi = 0.15915494309f;
  return phong ? kInvTwoPi : (exponent + 2.0f) * kInvTwoPi;
}

// The lobe of a SurfacePoint: shape is n, specular ks times that factor. [requirements: bsdf/lobes.h]
struct CosineLobe {
  static Rgb value(const SurfacePoint& p, const Vec3f& to_light) {
    const float beta = dot(p.mirror, to_light);
    return beta > 0.0f ? p.specular * std::pow(std::min(1.0f, beta), p.shape) : Rgb{};
  }
  // Density (n+1)/(2π) cosⁿβ.
  static Vec3f sample(const SurfacePoint& p, float u, float v) {
    const float phi = 2.0f * std::numbers::pi_v<float> * v;
    const float c = std::pow(u, 1.0f / (p.shape + 1.0f)), r = std::sqrt(std::max(0.0f, 1.0f - c * c));
    return Frame(p.mirror).to_world({r * std::cos(phi), r * std::sin(phi), c});
  }
  static float pdf(float share, const SurfacePoint& p, const Vec3f& direction) {
    const float beta = dot(p.mirror, direction);
    return beta > 0.0f ? share * (p.shape + 1.0f) * 0.5f * std::numbers::inv_pi_v<float> *
                             std::pow(std::min(1.0f, beta), p.shape)
                       : 0.0f;
  }
  static Rgb albedo(const SurfacePoint& p) {
    return p.specular * (2.0f * std::numbers::pi_v<float> / (p.shape + 1.0f));
  }
  static float importance(const SurfacePoint& p, float /*cosine*/, float beta) {
    const float specular = luminance(p.specular);
    return specular > 0.0f && beta > 0.0f ? specular * std::pow(beta, p.shape) : 0.0f;
  }
};

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

// SIMD counterpart of lumicut::CosineLobe.
struct CosineLobe {
  static constexpr bool kFresnel = false, kBoundOverCosine = false, kAroundMirror = true;

  // cosⁿβ, 0 from 90 degrees on.
  static HWY_INLINE LobeValue Value(D d, const LobeNumbers& of, const LobeDirections& at) {
    const V base = hn::Min(hn::Max(at.beta, hn::Set(d, 1e-20f)), hn::Set(d, 1.0f));
    const V lobe = hn::Exp(d, hn::Max(hn::Mul(of.shape, hn::Log(d, base)), hn::Set(d, -80.0f)));
    return {hn::IfThenElseZero(hn::Gt(at.beta, hn::Zero(d)), lobe), hn::Zero(d)};
  }
  static HWY_INLINE LobeValue Bound(D d, const LobeCone& cone) {
    // Rounding of the cosine is magnified by the exponent: a part in 10^6 of slack before it.
    const V beta = hn::Min(hn::Set(d, 1.0f), hn::MulAdd(cone.beta, hn::Set(d, 1.000001f), hn::Set(d, 1e-6f)));
    const V base = hn::Max(beta, hn::Set(d, 1e-20f));
    const V lobe = hn::Exp(d, hn::Max(hn::Mul(cone.low, hn::Log(d, base)), hn::Set(d, -80.0f)));
    return {hn::IfThenElseZero(hn::Gt(beta, hn::Zero(d)), lobe), hn::Zero(d)};
  }
  static HWY_INLINE V Width(D d, V exponent) { return hn::Div(hn::Set(d, 2.0f), hn::Add(hn::Set(d, 1.0f), exponent)); }
};

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
