// Reflection by GGX facets: F·D·V, where F goes from F0 to F90 as a dielectric's reflectance does.
// [Walter et al. 2007; Heitz 2014; Fresnel]
// Scalar and SIMD forms. The SIMD part is compiled once a target.
#ifndef LUMICUT_BSDF_GGX_REFLECTION_H_
#define LUMICUT_BSDF_GGX_REFLECTION_H_

#include "bsdf/dielectric.h"
#include "bsdf/ggx.h"
#include "bsdf/shade_points.h"

namespace lumicut {

// Of what is seen along visible half vectors, the share that facets towards the light do not mask, where heights are
// correlated. Cosines to the normal.
inline float masking_reflected(float alpha2, float nv, float nl) {
  const float root_v = ggx_root(alpha2, nv), root_l = ggx_root(alpha2, nl);
  return nl * (nv + root_v) / (nl * root_v + nv * root_l);
}

struct GgxTerms {
  float distribution;  // D(h)
  float visibility;    // masking over 4 (n·v)(n·l)
  float half_cosine;   // v·h
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
  t.half_cosine = 0.5f * std::sqrt(q);
  return t;
}

// The lobe of a SurfacePoint: shape is α, specular F0, grazing F90, ior that of the way between them.
// [requirements: bsdf/lobes.h]
struct GgxReflection {
  static Rgb value(const SurfacePoint& p, const Vec3f& to_light) {
    const GgxTerms t = ggx_terms(p.shape, p.normal, p.mirror, to_light);
    const float share = fresnel_share(t.half_cosine, p.ior);
    return (p.specular * (1.0f - share) + p.grazing * share) * (t.distribution * t.visibility);
  }
  // By visible half vectors. [Heitz 2018]
  static Vec3f sample(const SurfacePoint& p, float u, float v) {
    const Frame frame(p.normal);
    const Vec3f view = frame.to_local(reflect(p.mirror, p.normal));
    const Vec3f h = sample_visible_normal({view.x, view.y, std::max(1e-4f, view.z)}, p.shape, u, v);
    return frame.to_world(normalize(reflect(view, h)));
  }
  static float pdf(float share, const SurfacePoint& p, const Vec3f& direction) {
    const float nv = std::max(1e-4f, dot(p.normal, p.mirror));
    const float d = ggx_terms(p.shape, p.normal, p.mirror, direction).distribution;
    return share * d * 0.5f / (nv + ggx_root(p.shape * p.shape, nv));
  }
  static Rgb albedo(const SurfacePoint& p) {
    return p.specular + max(p.grazing - p.specular, Rgb{}) * fresnel_share(dot(p.normal, p.mirror), p.ior);
  }
  // The largest D·V·(n·l)/cosine: the half vector is turned from the normal by at least half as much as the light from
  // the mirror direction.
  static float importance(const SurfacePoint& p, float cosine, float beta) {
    const float a2 = p.shape * p.shape, far = 0.5f * (1.0f - std::min(1.0f, beta));  // sin² of the half vector's turn
    const float e = a2 * (1.0f - far) + far, nv = std::max(1e-4f, dot(p.normal, p.mirror));
    const float largest =
        a2 * std::numbers::inv_pi_v<float> / (e * e) * 0.5f / (cosine * ggx_root(a2, nv) + nv * ggx_root(a2, cosine));
    return luminance(albedo(p)) * largest;
  }
};

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_GGX_REFLECTION_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_GGX_REFLECTION_SIMD_
#undef LUMICUT_BSDF_GGX_REFLECTION_SIMD_
#else
#define LUMICUT_BSDF_GGX_REFLECTION_SIMD_
#endif

#include "bsdf/dielectric.h"
#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// SIMD counterpart of lumicut::GgxReflection.
struct GgxReflection {
  static constexpr bool kFresnel = true, kBoundOverCosine = true, kAroundMirror = false;
  // A part in 10^4 against the rounding of sharp lobes' angles.
  static constexpr float kSlack = 1.0002f;

  // D·V and the share of F90. Finite for whatever cosines.
  static HWY_INLINE LobeValue Value(D d, const LobeNumbers& of, const LobeDirections& at) {
    const V one = hn::Set(d, 1.0f);
    const V a2 = hn::Mul(of.shape, of.shape), rest = hn::Sub(one, a2);
    const V3 &normal = at.normal, &mirror = at.mirror, &to_light = at.to_light;
    const V3 w{hn::Sub(to_light.x, mirror.x), hn::Sub(to_light.y, mirror.y), hn::Sub(to_light.z, mirror.z)};
    const V nv = hn::Max(hn::Set(d, 1e-4f), Dot(normal, mirror)), nl = hn::Max(hn::Zero(d), at.cosine),
            nw = Dot(normal, w);
    const V sum = hn::Add(nv, nl), sum2 = hn::Mul(sum, sum);
    const V side2 = hn::Max(hn::Zero(d), hn::NegMulAdd(nw, nw, Dot(w, w)));
    const V q = hn::Add(sum2, side2), e = hn::MulAdd(a2, sum2, side2);
    const V root_v = hn::Sqrt(hn::MulAdd(hn::Mul(nv, nv), rest, a2)),
            root_l = hn::Sqrt(hn::MulAdd(hn::Mul(nl, nl), rest, a2));
    const V smith = hn::MulAdd(nl, root_v, hn::Mul(nv, root_l));
    const V lobe =
        hn::Div(hn::Mul(hn::Mul(a2, hn::Set(d, 0.15915494309f)), hn::Mul(q, q)), hn::Mul(hn::Mul(e, e), smith));
    const V half_cosine = hn::Min(one, hn::Mul(hn::Set(d, 0.5f), hn::Sqrt(q)));
    return {lobe, FresnelShare(d, hn::Max(hn::Set(d, 1e-6f), half_cosine), of.ior)};
  }

  // Largest D·V·(n·l) over the cone's cosine, and largest Fresnel term. The half vector is turned from the normal by at
  // least half as much as the light from the mirror direction; D is largest where α² is that turn's squared tangent, V
  // grows with n·l.
  static HWY_INLINE LobeValue Bound(D d, const LobeCone& cone) {
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const V low2 = hn::Mul(cone.low, cone.low), high2 = hn::Mul(cone.high, cone.high);
    const V beta = hn::Min(one, hn::Add(cone.beta, hn::Set(d, 1e-6f)));
    const V nl = hn::Min(one, hn::Max(cone.cosine, hn::Set(d, 1e-7f)));
    const V sine2 = hn::Mul(hn::Set(d, 0.5f), hn::Sub(one, beta)), cosine2 = hn::Sub(one, sine2);
    const V best = hn::Div(sine2, hn::Max(cosine2, hn::Set(d, 1e-6f)));
    const V a2 = hn::Min(high2, hn::Max(low2, best));
    const V e = hn::MulAdd(a2, cosine2, sine2), rest = hn::Sub(one, low2);
    const V nv = hn::Max(cone.view_cosine, hn::Set(d, 1e-4f));
    const V root_v = hn::Sqrt(hn::Max(zero, hn::MulAdd(hn::Mul(nv, nv), rest, low2)));
    const V root_l = hn::Sqrt(hn::Max(zero, hn::MulAdd(hn::Mul(nl, nl), rest, low2)));
    const V smith = hn::MulAdd(nl, root_v, hn::Mul(nv, root_l));
    const V lobe = hn::Div(hn::Mul(a2, hn::Set(d, 0.15915494309f * kSlack)), hn::Mul(hn::Mul(e, e), smith));
    return {lobe, BoundOfFresnel(d, cone)};
  }

  // Largest share of F90: the half vector's cosine v·h is least where v·l is. Lights are at most `beta` to the mirror
  // direction and above the horizon, views at least `view_cosine` to the normal.
  static HWY_INLINE V BoundOfFresnel(D d, const LobeCone& cone) {
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), tiny = hn::Set(d, 1e-6f);
    const V sine = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(cone.view_cosine, cone.view_cosine, one)));
    const V apart = hn::Min(hn::Add(sine, tiny), hn::Add(cone.beta, tiny));  // −v·l, at most
    const V vh = hn::Sqrt(hn::Max(zero, hn::Mul(hn::Set(d, 0.5f), hn::Sub(one, apart))));
    return BoundOfFresnelShare(d, vh, cone.ior_low, cone.ior_high);
  }

  static HWY_INLINE V Width(D d, V alpha) { return hn::Mul(hn::Set(d, 2.0f), hn::Mul(alpha, alpha)); }
};

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
