// Unshadowed light at vectors of points: what light_kernel.cpp, block_kernel.cpp and light_cuts.cpp share.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERS_LIGHT_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERS_LIGHT_KERNEL_INL_H_
#undef LUMICUT_CLUSTERS_LIGHT_KERNEL_INL_H_
#else
#define LUMICUT_CLUSTERS_LIGHT_KERNEL_INL_H_
#endif

#include "clusters/lanes-inl.h"
#include "vpl/vpl.h"

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One SurfacePoint in all lanes, in place of ShadePoints or a PointBlock.
HWY_INLINE V3 Load3(D d, const Vec3f& v, size_t) { return Set3(d, v); }
HWY_INLINE V Load1(D d, float v, size_t) { return hn::Set(d, v); }

// Falloff of a spot towards `to_light`, from each point. Twin of spot_profile in vpl/vpl.h.
HWY_INLINE V SpotFalloff(D d, const Vpl& light, const V3& light_normal, const V3& to_light) {
  const V zero = hn::Zero(d);
  if (light.profile != 0) {  // lamps alone have one: lane by lane
    HWY_ALIGN float x[kLanes], y[kLanes], z[kLanes];
    hn::Store(to_light.x, d, x), hn::Store(to_light.y, d, y), hn::Store(to_light.z, d, z);
    for (size_t i = 0; i < hn::Lanes(d); ++i) x[i] = profile_share(light, {-x[i], -y[i], -z[i]});
    return hn::Load(d, x);
  }
  const V c = hn::Neg(Dot(light_normal, to_light)), one = hn::Set(d, 1.0f);
  const V outer = hn::Set(d, light.cos_outer);
  V x = light.blend_cosine > 0.0f ? hn::Mul(hn::Sub(c, outer), hn::Set(d, 1.0f / light.blend_cosine))
                                  : hn::IfThenElse(hn::Gt(c, outer), one, zero);
  x = hn::Min(one, hn::Max(zero, x));
  x = hn::Mul(hn::Mul(x, x), hn::NegMulAdd(hn::Set(d, 2.0f), x, hn::Set(d, 3.0f)));
  if (light.spot_cosine > 0.0f) x = hn::Mul(x, hn::Max(zero, c));
  if (light.spread_tan > 0.0f) {
    const V sine = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(c, c, one)));
    const V slope = hn::Div(hn::Mul(hn::Set(d, light.spread_tan), sine), hn::Max(c, hn::Set(d, 1e-6f)));
    x = hn::Mul(x, hn::Max(zero, hn::Sub(one, slope)));
  }
  return x;
}

// Both cosines, the light's profile and the clamped squared distance, at points of `position` and `normal`; `to_light`:
// unit. [thesis Eq. 1.1]
template <VplKind kKind>
HWY_INLINE V Geometry(D d, const Vpl& light, float clamp2, const V3& position, const V3& normal, V3& to_light) {
  const V zero = hn::Zero(d);
  const V3 light_normal = Set3(d, light.normal);
  V geometry = hn::Set(d, 1.0f);
  if constexpr (kKind == VplKind::directional) {
    to_light = {hn::Neg(light_normal.x), hn::Neg(light_normal.y), hn::Neg(light_normal.z)};
  } else {
    const V3 light_position = Set3(d, light.position);
    const V3 v{hn::Sub(light_position.x, position.x), hn::Sub(light_position.y, position.y),
               hn::Sub(light_position.z, position.z)};
    const V dist2 = hn::Max(Dot(v, v), hn::Set(d, 1e-30f));
    const V inverse = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(dist2));
    to_light = {hn::Mul(v.x, inverse), hn::Mul(v.y, inverse), hn::Mul(v.z, inverse)};
    geometry = hn::Div(hn::Set(d, 1.0f), hn::Max(dist2, hn::Set(d, clamp2)));
    if constexpr (kKind == VplKind::oriented) {
      geometry = hn::Mul(geometry, hn::Max(zero, hn::Neg(Dot(light_normal, to_light))));
    } else if constexpr (kKind == VplKind::spot) {
      geometry = hn::Mul(geometry, SpotFalloff(d, light, light_normal, to_light));
    }
  }
  return hn::Mul(geometry, hn::Max(zero, Dot(normal, to_light)));
}

// cosine^shininess, 0 from the horizon on.
HWY_INLINE V Lobe(D d, V cosine, V shininess) {
  const V base = hn::Min(hn::Max(cosine, hn::Set(d, 1e-20f)), hn::Set(d, 1.0f));
  const V lobe = hn::Exp(d, hn::Max(hn::Mul(shininess, hn::Log(d, base)), hn::Set(d, -80.0f)));
  return hn::IfThenElseZero(hn::Gt(cosine, hn::Zero(d)), lobe);
}

// Twin of ggx_terms in scene/bsdf.h: `lobe` is D·V, `fresnel` (1 − v·h)⁵. Finite for whatever cosines.
HWY_INLINE void GgxLobe(D d, V alpha, V cosine, const V3& normal, const V3& mirror, const V3& to_light, V& lobe,
                        V& fresnel) {
  const V one = hn::Set(d, 1.0f);
  const V a2 = hn::Mul(alpha, alpha), rest = hn::Sub(one, a2);
  const V3 w{hn::Sub(to_light.x, mirror.x), hn::Sub(to_light.y, mirror.y), hn::Sub(to_light.z, mirror.z)};
  const V nv = hn::Max(hn::Set(d, 1e-4f), Dot(normal, mirror)), nl = hn::Max(hn::Zero(d), cosine), nw = Dot(normal, w);
  const V sum = hn::Add(nv, nl), sum2 = hn::Mul(sum, sum);
  const V side2 = hn::Max(hn::Zero(d), hn::NegMulAdd(nw, nw, Dot(w, w)));
  const V q = hn::Add(sum2, side2), e = hn::MulAdd(a2, sum2, side2);
  const V root_v = hn::Sqrt(hn::MulAdd(hn::Mul(nv, nv), rest, a2)),
          root_l = hn::Sqrt(hn::MulAdd(hn::Mul(nl, nl), rest, a2));
  const V smith = hn::MulAdd(nl, root_v, hn::Mul(nv, root_l));
  lobe = hn::Div(hn::Mul(hn::Mul(a2, hn::Set(d, 0.15915494309f)), hn::Mul(q, q)), hn::Mul(hn::Mul(e, e), smith));
  const V m = hn::Max(hn::Zero(d), hn::NegMulAdd(hn::Set(d, 0.5f), hn::Sqrt(q), one)), m2 = hn::Mul(m, m);
  fresnel = hn::Mul(hn::Mul(m2, m2), m);
}

// Twin of SurfacePoint::fade: the diffuse part's factor.
HWY_INLINE V Fading(D d, V fade, V cosine) {
  const V m = hn::Sub(hn::Set(d, 1.0f), hn::Max(hn::Zero(d), cosine)), m2 = hn::Mul(m, m);
  return hn::NegMulAdd(fade, hn::Mul(m2, m2), hn::Set(d, 1.0f));
}

// What the lights of one direction give through the parts of a point's reflectance.
struct Parts {
  V diffuse, specular, grazing;
};

template <Lobes kLobes, class Points>
HWY_INLINE Parts PartsTowards(D d, const Points& points, size_t p, const V3& normal, const V3& mirror, V shininess,
                              const V3& to_light) {
  const V zero = hn::Zero(d);
  Parts parts{hn::Set(d, 1.0f), zero, zero};
  if constexpr (kLobes == Lobes::cosine) parts.specular = Lobe(d, Dot(mirror, to_light), shininess);
  if constexpr (kLobes == Lobes::ggx) {
    const auto ggx = hn::Lt(shininess, zero);
    if (!hn::AllTrue(d, ggx)) parts.specular = Lobe(d, Dot(mirror, to_light), hn::Max(zero, shininess));
    if (!hn::AllFalse(d, ggx)) {
      const V cosine = Dot(normal, to_light);
      V lobe, fresnel;
      GgxLobe(d, shininess, cosine, normal, mirror, to_light, lobe, fresnel);
      parts.diffuse = Fading(d, Load1(d, points.fade, p), cosine);
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
    const Parts parts =
        PartsTowards<kLobes>(d, points, p, normal, Load3(d, points.mirror, p), Load1(d, points.shininess, p), to_light);
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
