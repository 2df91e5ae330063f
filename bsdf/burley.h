// Burley's diffuse lobe: darker towards grazing directions where the surface is smooth, brighter back to where the light
// comes from where it is rough. Lambert's kd/π times
//   (1 + k·(1 − n·l)⁵)·(1 + k·(1 − n·v)⁵),  k = retro·(l·h)² − dim,  retro = 2·roughness, dim = ½
// or shares of both, beside what is Lambert's. [Burley 2012, 5.3]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_BURLEY_H_
#define LUMICUT_BSDF_BURLEY_H_

#include <algorithm>
#include <array>
#include <cmath>

#include "bsdf/shade_points.h"

namespace lumicut {

// (1 − c)⁵ above the horizon.
inline float burley_edge(float cosine) {
  const float m = std::min(1.0f, std::max(0.0f, 1.0f - cosine)), m2 = m * m;
  return m2 * m2 * m;
}

// What it multiplies Lambert's part by, for a viewer at `view` to the normal and a light at `cosine` to it and at `beta` to
// the viewer's mirror direction; or with both exchanged.
inline float burley_factor(float retro, float dim, float view, float cosine, float beta) {
  // l·v = 2 (n·v)(n·l) − l·m, (l·h)² = (1 + l·v)/2
  const float half2 = std::min(1.0f, std::max(0.0f, 0.5f + view * cosine - 0.5f * beta));
  const float k = retro * half2 - dim;
  return (1.0f + k * burley_edge(cosine)) * (1.0f + k * burley_edge(view));
}
inline float burley_factor(const SurfacePoint& p, float cosine, float beta) {
  return burley_factor(p.retro, p.dim, dot(p.normal, p.mirror), cosine, beta);
}

// Its mean over the light's projected solid angle, for a viewer at `view` to the normal: over the azimuth in closed form,
// over the cosine by Gauss's rule (to 1e-4).
inline float mean_burley_factor(float retro, float dim, float view) {
  constexpr std::array<float, 4> kPlaces{0.0694318442f, 0.3300094782f, 0.6699905218f, 0.9305681558f},
      kWeights{0.1739274226f, 0.3260725774f, 0.3260725774f, 0.1739274226f};
  const float edge_v = burley_edge(view), sine2_v = std::max(0.0f, 1.0f - view * view);
  float sum = 0.0f;
  for (size_t i = 0; i < kPlaces.size(); ++i) {
    const float c = kPlaces[i], edge_l = burley_edge(c);
    const float k = 0.5f * retro * (1.0f + view * c) - dim;
    const float k2 = k * k + 0.125f * retro * retro * sine2_v * (1.0f - c * c);
    sum += kWeights[i] * 2.0f * c * (1.0f + k * (edge_l + edge_v) + k2 * edge_l * edge_v);
  }
  return sum;
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_BURLEY_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_BURLEY_SIMD_
#undef LUMICUT_BSDF_BURLEY_SIMD_
#else
#define LUMICUT_BSDF_BURLEY_SIMD_
#endif

#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE V BurleyEdge(D d, V cosine) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V m = hn::Min(one, hn::Max(zero, hn::Sub(one, cosine))), m2 = hn::Mul(m, m);
  return hn::Mul(hn::Mul(m2, m2), m);
}

// SIMD counterpart of burley_factor; `view`: n·m.
HWY_INLINE V BurleyFactor(D d, V retro, V dim, V view, V cosine, V beta) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  const V half2 = hn::Min(one, hn::Max(zero, hn::NegMulAdd(half, beta, hn::MulAdd(view, cosine, half))));
  const V k = hn::MulSub(retro, half2, dim);
  return hn::Mul(hn::MulAdd(k, BurleyEdge(d, cosine), one), hn::MulAdd(k, BurleyEdge(d, view), one));
}

// The largest n·l·factor over lights of at most `cosine` to the normal and views of at least `view`, over `cosine` and times
// `steep`: for k ≤ 3/2 the product grows with n·l; nor is the factor ever above 1 + k for the light. `rise`: the largest k,
// at least 0.
HWY_INLINE V BoundOfBurleyFactor(D d, V rise, V view, V cosine, V steep) {
  const V one = hn::Set(d, 1.0f);
  const V of_light = hn::Min(hn::Mul(hn::MulAdd(rise, BurleyEdge(d, cosine), one), steep), hn::Add(rise, one));
  return hn::Mul(of_light, hn::MulAdd(rise, BurleyEdge(d, view), one));
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
