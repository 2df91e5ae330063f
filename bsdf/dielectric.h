// The smooth border of a dielectric. [Fresnel]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_DIELECTRIC_H_
#define LUMICUT_BSDF_DIELECTRIC_H_

#include <algorithm>
#include <cmath>

namespace lumicut {

// Reflectance straight on, for the ratio of the index beyond to the index before.
inline float normal_reflectance(float ratio) {
  const float r = (ratio - 1.0f) / (ratio + 1.0f);
  return r * r;
}

// Reflectance for a cosine of incidence; `ratio`: index beyond over index before; `refracted`: the cosine beyond, 0 in
// total reflection.
inline float fresnel_reflectance(float cosine, float ratio, float& refracted) {
  refracted = 0.0f;
  const float sine2 = (1.0f - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1.0f) return 1.0f;
  refracted = std::sqrt(1.0f - sine2);
  const float s = (cosine - ratio * refracted) / (cosine + ratio * refracted),
              p = (ratio * cosine - refracted) / (ratio * cosine + refracted);
  return 0.5f * (s * s + p * p);
}

// How far the reflectance is between that straight on, F0, and 1: (F − F0)/(1 − F0), so that F = F0 + (1 − F0)·share;
// tinted lobes go from one colour to another by it. 1 at grazing incidence. Never below 0: that F dips below F0 near
// Brewster's angle, for ratios above 3.7 and by 3 % of F0 at 5, is left out. With g = √(ratio² − 1 + c²):
//   F = ½ ((g − c)/(g + c))² (1 + ((c(g + c) − 1)/(c(g − c) + 1))²)   [Cook, Torrance 1982]
inline float fresnel_share(float cosine, float ratio) {
  const float c = std::min(1.0f, std::max(1e-6f, cosine));
  const float g = std::sqrt(std::max(0.0f, ratio * ratio - 1.0f + c * c));
  const float a = g - c, b = g + c, n = c * b - 1.0f, m = c * a + 1.0f;
  const float below = b * b * (m * m), sum = ratio + 1.0f, difference = ratio - 1.0f;
  return std::max(0.0f, (0.5f * (sum * sum) * (a * a) * (m * m + n * n) - difference * difference * below) /
                            (4.0f * ratio * below));
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_DIELECTRIC_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_DIELECTRIC_SIMD_
#undef LUMICUT_BSDF_DIELECTRIC_SIMD_
#else
#define LUMICUT_BSDF_DIELECTRIC_SIMD_
#endif

#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// SIMD counterpart of fresnel_share, for cosines above 0 and at most 1.
HWY_INLINE V FresnelShare(D d, V c, V ratio) {
  const V one = hn::Set(d, 1.0f);
  const V g = hn::Sqrt(hn::Max(hn::Zero(d), hn::MulAdd(c, c, hn::MulSub(ratio, ratio, one))));
  const V a = hn::Sub(g, c), b = hn::Add(g, c), n = hn::MulSub(c, b, one), m = hn::MulAdd(c, a, one);
  const V m2 = hn::Mul(m, m), below = hn::Mul(hn::Mul(b, b), m2);
  const V sum = hn::Add(ratio, one), difference = hn::Sub(ratio, one);
  const V above = hn::Mul(hn::Mul(hn::Mul(hn::Set(d, 0.5f), hn::Mul(sum, sum)), hn::Mul(a, a)), hn::MulAdd(n, n, m2));
  return hn::Max(hn::Zero(d), hn::Div(hn::NegMulAdd(hn::Mul(difference, difference), below, above),
                                      hn::Mul(hn::Mul(hn::Set(d, 4.0f), ratio), below)));
}

// Its largest value over cosines of at least `c` and ratios from `low` to `high`. It falls with the cosine;
// over ratios above 1 it has one maximum, at about 1.588 + 0.412 c (to 1e-4 of 1 by value).
HWY_INLINE V BoundOfFresnelShare(D d, V c, V low, V high) {
  const V one = hn::Set(d, 1.0f);
  c = hn::Min(one, hn::Max(hn::Set(d, 1e-6f), c));
  const V best = hn::MulAdd(c, hn::Set(d, 0.412f), hn::Set(d, 1.588f));
  const V share = FresnelShare(d, c, hn::Min(high, hn::Max(low, best)));
  // Below 1 there is total reflection.
  return hn::IfThenElse(hn::Lt(low, one), one, hn::Add(share, hn::Set(d, 1.5e-4f)));
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
