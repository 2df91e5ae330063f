// Oren and Nayar's diffuse lobe in Fujii's form: facets that hide one another, so that a rough body looks flat and is brighter
// towards where the light comes from. Lambert's kd/π times
//   whole · (1 + slope·t + again·(1 − edge(n·l))),  s = l·v − (n·l)(n·v),  t = s / max(n·l, n·v) where s > 0, else s
// `again`: what the facets reflect more than once; 0 in Blender before 4.3. The colour and `whole` lie in the point's diffuse.
// [Oren, Nayar 1994; Fujii 2012, "improved Oren-Nayar", qualitative; its albedo: Portsmouth, Kutz, Hill 2024, EON]
// Departs from Blender 4.3 in coloured surfaces, where one `again` stands for all channels: even light is exact in each.
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_OREN_NAYAR_H_
#define LUMICUT_BSDF_OREN_NAYAR_H_

#include <algorithm>

#include "bsdf/shade_points.h"

namespace lumicut {

// π/2 − 2/3, over π: mean of t at the horizon; and the mean share of that over even light.
inline constexpr float kGrooveEdge = 0.28779341f, kMeanGrooveEdge = 0.25187715f;

// Mean of t over the light's projected solid angle for a viewer at `cosine`, over that at the horizon: to 2e-3, the
// polynomial of EON.
inline float groove_edge(float cosine) {
  const float m = std::min(1.0f, std::max(0.0f, 1.0f - cosine));
  return m * (0.19812198f + m * (1.70644758f + m * (-1.15241865f + m * 0.24784909f)));
}

// What it multiplies Lambert's part by, for a viewer at `view` to the normal and a light at `cosine` to it and at `beta` to
// the viewer's mirror direction; or with both exchanged.
inline float oren_nayar_factor(float slope, float again, float view, float cosine, float beta) {
  const float s = view * cosine - beta;  // l·v = 2 (n·v)(n·l) − l·m
  const float t = s > 0.0f ? std::min(1.0f, s) / std::max(1e-4f, std::max(cosine, view)) : s;
  return std::max(0.0f, 1.0f + slope * t + again * (1.0f - groove_edge(cosine)));
}
inline float oren_nayar_factor(const SurfacePoint& p, float cosine, float beta) {
  return oren_nayar_factor(p.slope, p.again, dot(p.normal, p.mirror), cosine, beta);
}

// Its mean over the light's projected solid angle, for a viewer at `view`.
inline float mean_oren_nayar_factor(float slope, float again, float view) {
  return 1.0f + slope * kGrooveEdge * groove_edge(view) + again * (1.0f - kMeanGrooveEdge);
}

// What facets of a slope (0..1) make of a Lambert part of that colour: its factor, and the numbers of the point.
struct Grooves {
  Rgb scale{1, 1, 1};
  float slope = 0.0f, again = 0.0f;
};

// For a surface seen at `view`, of a slope above 0; `once`: without what comes back.
inline Grooves grooves(const Rgb& color, float slope, bool once, float view) {
  const float whole = 1.0f / (1.0f + slope * kGrooveEdge);
  Grooves g{Rgb{1, 1, 1} * whole, slope, 0.0f};
  if (once) return g;
  // In Blender 4.3 the colour stands in this as one facet's more than in the series of reflections.
  const float lost = (1.0f - whole) * (1.0f - kMeanGrooveEdge);
  const auto again = [&](float c) {
    return c * c * (1.0f - lost) / ((1.0f - kMeanGrooveEdge) * (1.0f - c * lost)) * slope * kGrooveEdge *
           (1.0f - groove_edge(view));
  };
  g.again = again(std::min(1.0f, luminance(color)));
  const float mean = mean_oren_nayar_factor(slope, g.again, view);
  for (int k = 0; k < 3; ++k) g.scale[k] *= mean_oren_nayar_factor(slope, again(std::min(1.0f, color[k])), view) / mean;
  return g;
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_OREN_NAYAR_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_OREN_NAYAR_SIMD_
#undef LUMICUT_BSDF_OREN_NAYAR_SIMD_
#else
#define LUMICUT_BSDF_OREN_NAYAR_SIMD_
#endif

#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE V GrooveEdge(D d, V cosine) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V m = hn::Min(one, hn::Max(zero, hn::Sub(one, cosine)));
  const V upper = hn::MulAdd(m, hn::Set(d, 0.24784909f), hn::Set(d, -1.15241865f));
  return hn::Mul(m, hn::MulAdd(m, hn::MulAdd(m, upper, hn::Set(d, 1.70644758f)), hn::Set(d, 0.19812198f)));
}

// SIMD counterpart of oren_nayar_factor; `view`: n·m.
HWY_INLINE V OrenNayarFactor(D d, V slope, V again, V view, V cosine, V beta) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V s = hn::MulSub(view, cosine, beta);
  const V lit = hn::Div(hn::Min(one, s), hn::Max(hn::Set(d, 1e-4f), hn::Max(cosine, view)));
  const V t = hn::IfThenElse(hn::Gt(s, zero), lit, s);
  const V returned = hn::MulAdd(again, hn::Sub(one, GrooveEdge(d, cosine)), one);
  return hn::Max(zero, hn::MulAdd(slope, t, returned));
}

// The largest n·l·factor over lights of at most `cosine` to the normal and views of at least `view`, over `cosine` and times
// `steep`: n·l·t is at most the sine of the view, times n·l / max(n·l, n·v); nor is t ever above that sine over n·v.
HWY_INLINE V BoundOfOrenNayarFactor(D d, V slope, V again, V view, V cosine, V steep) {
  const V one = hn::Set(d, 1.0f), tiny = hn::Set(d, 1e-4f), slack = hn::Set(d, 1.0001f);
  const V sine = hn::Mul(slack, hn::Sqrt(hn::Max(hn::Set(d, 1e-6f), hn::NegMulAdd(view, view, one))));
  const V returned = hn::MulAdd(again, hn::Sub(one, GrooveEdge(d, cosine)), one);
  const V least = hn::Max(tiny, view), low = hn::Max(least, cosine);
  const V of_product = hn::Mul(steep, hn::MulAdd(slope, hn::Div(sine, low), returned));
  const V of_factor = hn::MulAdd(slope, hn::Div(sine, least), hn::Add(one, again));
  return hn::Min(of_product, of_factor);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
