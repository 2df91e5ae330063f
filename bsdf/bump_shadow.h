// Bent normals (of normal maps and bumps) light the diffuse part as if the surface stood towards a light that it lies flat
// to. Dims that: g + g² − g³ below 1, g = (s·l)/((n·l)(s·n)), s the smooth normal, n the bent one; 0 from behind.
// [Chiang, Li, Burley 2019: Taming the Shadow Terminator; as Cycles has it]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_BUMP_SHADOW_H_
#define LUMICUT_BSDF_BUMP_SHADOW_H_

#include "bsdf/shade_points.h"

namespace lumicut {

// `cosine`: n·l, above 0. Out of line, so that `reflectance` stays small enough to be inlined.
[[gnu::noinline]] inline float bump_shadow(const SurfacePoint& p, float cosine, const Vec3f& to_light) {
  const float over = cosine * dot(p.smooth, p.normal);
  if (over == 0.0f) return 1.0f;
  const float g = std::min(1.0f, std::max(0.0f, dot(p.smooth, to_light) / over));
  return g + g * g - g * g * g;
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_BUMP_SHADOW_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_BUMP_SHADOW_SIMD_
#undef LUMICUT_BSDF_BUMP_SHADOW_SIMD_
#else
#define LUMICUT_BSDF_BUMP_SHADOW_SIMD_
#endif

#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// SIMD counterpart of bump_shadow, by the cosines n·l, s·n and s·l; the last two are 0 in lanes whose normal is not bent.
HWY_INLINE V BumpShadow(D d, V cosine, V smooth_normal, V smooth_light) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V over = hn::Mul(cosine, smooth_normal);
  const V g = hn::Min(one, hn::Max(zero, hn::Div(smooth_light, over)));
  return hn::IfThenElse(hn::Eq(over, zero), one, hn::Mul(g, hn::MulAdd(g, hn::Sub(one, g), one)));
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
