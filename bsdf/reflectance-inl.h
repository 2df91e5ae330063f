// Reflectance at vectors of points: the lobes of bsdf/ put together. SIMD counterpart of bsdf/point_bsdf.h.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_BSDF_REFLECTANCE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_REFLECTANCE_INL_H_
#undef LUMICUT_BSDF_REFLECTANCE_INL_H_
#else
#define LUMICUT_BSDF_REFLECTANCE_INL_H_
#endif

#include "bsdf/cosine_lobe.h"
#include "bsdf/ggx_reflection.h"
#include "bsdf/lambert.h"
#include "bsdf/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// What of the reflectance is evaluated: the diffuse part alone, with Blinn's and Phong's lobes, or with GGX's too.
enum class Lobes { none, cosine, ggx };

// One SurfacePoint in all lanes, in place of ShadePoints or a PointBlock.
HWY_INLINE V3 Load3(D d, const Vec3f& v, size_t) { return Set3(d, v); }
HWY_INLINE V Load1(D d, float v, size_t) { return hn::Set(d, v); }

// What light from one direction, or of many lights, gives through the parts of a point's reflectance: the factors of its
// diffuse, specular and grazing colours.
struct LobeSums {
  V diffuse, specular, grazing;
};

// What the glossy lobe's shape depends on.
struct LobeShape {
  V exponent, alpha;
  HWY_INLINE hn::Mask<D> is_ggx(D d) const { return hn::Gt(alpha, hn::Zero(d)); }
};
template <Lobes kLobes, class Points>
HWY_INLINE LobeShape LoadShape(D d, const Points& points, size_t p) {
  const V zero = hn::Zero(d);
  return {kLobes != Lobes::none ? Load1(d, points.exponent, p) : zero,
          kLobes == Lobes::ggx ? Load1(d, points.alpha, p) : zero};
}

template <Lobes kLobes, class Points>
HWY_INLINE LobeSums LobesTowards(D d, const Points& points, size_t p, const V3& normal, const V3& mirror,
                                 const LobeShape& shape, const V3& to_light) {
  const V zero = hn::Zero(d);
  LobeSums parts{hn::Set(d, 1.0f), zero, zero};
  if constexpr (kLobes == Lobes::cosine) parts.specular = CosineLobe(d, Dot(mirror, to_light), shape.exponent);
  if constexpr (kLobes == Lobes::ggx) {
    const auto ggx = shape.is_ggx(d);
    if (!hn::AllTrue(d, ggx)) parts.specular = CosineLobe(d, Dot(mirror, to_light), shape.exponent);
    if (!hn::AllFalse(d, ggx)) {
      const V cosine = Dot(normal, to_light);
      V lobe, fresnel;
      GgxLobe(d, shape.alpha, cosine, normal, mirror, to_light, lobe, fresnel);
      parts.diffuse = DiffuseFalloff(d, Load1(d, points.falloff, p), cosine);
      parts.grazing = hn::IfThenElseZero(ggx, hn::Mul(lobe, fresnel));
      parts.specular = hn::IfThenElse(ggx, hn::NegMulAdd(lobe, fresnel, lobe), parts.specular);
    }
  }
  return parts;
}

// BRDF towards `to_light` at points [p, p + Lanes(d)) of ShadePoints or a PointBlock, where `normal` is theirs.
template <Lobes kLobes, class Points>
HWY_INLINE V3 Reflectance(D d, const Points& points, size_t p, const V3& normal, const V3& to_light) {
  V3 f = Load3(d, points.diffuse, p);
  if constexpr (kLobes != Lobes::none) {
    const V3 specular = Load3(d, points.specular, p);
    const LobeSums parts = LobesTowards<kLobes>(d, points, p, normal, Load3(d, points.mirror, p),
                                                LoadShape<kLobes>(d, points, p), to_light);
    if constexpr (kLobes == Lobes::ggx) {
      const V3 edge = Load3(d, points.grazing, p);
      f = {hn::MulAdd(edge.x, parts.grazing, hn::Mul(f.x, parts.diffuse)),
           hn::MulAdd(edge.y, parts.grazing, hn::Mul(f.y, parts.diffuse)),
           hn::MulAdd(edge.z, parts.grazing, hn::Mul(f.z, parts.diffuse))};
    }
    f = {hn::MulAdd(specular.x, parts.specular, f.x), hn::MulAdd(specular.y, parts.specular, f.y),
         hn::MulAdd(specular.z, parts.specular, f.z)};
  }
  return f;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
