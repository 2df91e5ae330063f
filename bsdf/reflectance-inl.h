// Reflectance at vectors of points: Lambert's lobe and the glossy one. SIMD counterpart of bsdf/point_bsdf.h.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_BSDF_REFLECTANCE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_REFLECTANCE_INL_H_
#undef LUMICUT_BSDF_REFLECTANCE_INL_H_
#else
#define LUMICUT_BSDF_REFLECTANCE_INL_H_
#endif

#include "bsdf/lanes-inl.h"
#include "bsdf/lobes.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// What light from one direction, or of many lights, gives through the parts of a point's reflectance: the factors of its
// diffuse, specular and grazing colours.
struct LobeSums {
  V diffuse, specular, grazing;
};

template <Lobes kLobes>
HWY_INLINE LobeSums LobesTowards(D d, const V3& normal, const V3& mirror, const LobeShape& shape, const V3& to_light) {
  const V zero = hn::Zero(d);
  LobeSums parts{hn::Set(d, 1.0f), zero, zero};
  if constexpr (kLobes != Lobes::none) {
    const V cosine = Dot(normal, to_light);
    const V beta = Dot(mirror, to_light);
    const LobeValue v = ValueOfLobes<kLobes>(d, shape, {normal, mirror, to_light, cosine, beta});
    parts.specular = v.lobe;
    if constexpr (kLobes == Lobes::all) {
      const DiffuseShape& even = shape.diffuse;
      DiffuseCosines cosines{Dot(normal, mirror), cosine, beta, hn::Zero(d), hn::Zero(d)};
      if (even.bent)
        cosines.smooth_normal = Dot(even.smooth, normal), cosines.smooth_light = Dot(even.smooth, to_light);
      parts.diffuse = DiffuseFactor(d, even, cosines);
      parts.grazing = hn::Mul(v.lobe, v.fresnel);
      parts.specular = hn::NegMulAdd(v.lobe, v.fresnel, v.lobe);
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
    const LobeSums parts =
        LobesTowards<kLobes>(d, normal, Load3(d, points.mirror, p), LoadShape<kLobes>(d, points, p), to_light);
    if constexpr (kLobes == Lobes::all) {
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
