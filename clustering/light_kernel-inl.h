// Unshadowed light at vectors of points: what light_kernel.cpp, block_kernel.cpp and light_cuts.cpp share.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERING_LIGHT_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERING_LIGHT_KERNEL_INL_H_
#undef LUMICUT_CLUSTERING_LIGHT_KERNEL_INL_H_
#else
#define LUMICUT_CLUSTERING_LIGHT_KERNEL_INL_H_
#endif

#include "bsdf/reflectance-inl.h"
#include "lights/falloff.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Falloff of a spot towards `to_light`, from each point. SIMD counterpart of Falloff::of_spot.
HWY_INLINE V SpotFalloff(D d, const Vpl& light, Falloff falloff, const V3& light_normal, const V3& to_light) {
  const V zero = hn::Zero(d);
  if (light.profile != 0) {  // of the scene's lights alone: lane by lane
    const LightProfile* profile = falloff.profile(light);
    HWY_ALIGN float x[kLanes], y[kLanes], z[kLanes];
    hn::Store(to_light.x, d, x), hn::Store(to_light.y, d, y), hn::Store(to_light.z, d, z);
    for (size_t i = 0; i < hn::Lanes(d); ++i) x[i] = profile_share(light, profile, {-x[i], -y[i], -z[i]});
    return hn::Load(d, x);
  }
  const V c = hn::Neg(Dot(light_normal, to_light)), one = hn::Set(d, 1.0f);
  const V outer = hn::Set(d, light.cos_outer());
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

// Moves a lamp's place onto the disk that faces each point; the distances to its centre. SIMD counterpart of place_facing.
HWY_INLINE V PlaceFacing(D d, const Vpl& light, const V3& position, V3& place) {
  const V3 offset = Set3(d, light.from_centre);
  const V3 axis{hn::Sub(position.x, hn::Sub(place.x, offset.x)), hn::Sub(position.y, hn::Sub(place.y, offset.y)),
                hn::Sub(position.z, hn::Sub(place.z, offset.z))};
  const V d2 = hn::Max(Dot(axis, axis), hn::Set(d, 1e-30f)), share = hn::Div(Dot(axis, offset), d2);
  place = {hn::NegMulAdd(axis.x, share, place.x), hn::NegMulAdd(axis.y, share, place.y),
           hn::NegMulAdd(axis.z, share, place.z)};
  return hn::Sqrt(d2);
}

// What a lobed light's intensity is multiplied by towards `to_light`, from each point at `cosine` to its normal.
HWY_INLINE V LobeFactor(D d, const Vpl& light, const V3& to_light, V cosine) {
  const V beta = hn::Neg(Dot(Set3(d, light.mirror()), to_light)), view = hn::Set(d, dot(light.normal, light.mirror()));
  V factor = DiffuseFalloff(d, hn::Set(d, light.falloff), cosine);
  if (light.slope() > 0.0f)
    factor =
        hn::Mul(factor, OrenNayarFactor(d, hn::Set(d, light.slope()), hn::Set(d, light.again), view, cosine, beta));
  if (light.burley())
    factor = hn::Mul(factor, BurleyFactor(d, hn::Set(d, light.retro), hn::Set(d, light.dim), view, cosine, beta));
  return factor;
}

// Both cosines, the light's profile and the clamped squared distance, at points of `position` and `normal`; `to_light`:
// unit. [thesis Eq. 1.1]
template <VplKind kKind>
HWY_INLINE V Geometry(D d, const Vpl& light, Falloff falloff, const V3& position, const V3& normal, V3& to_light) {
  const V zero = hn::Zero(d);
  const V3 light_normal = Set3(d, light.normal);
  V geometry = hn::Set(d, 1.0f);
  if constexpr (kKind == VplKind::directional) {
    to_light = {hn::Neg(light_normal.x), hn::Neg(light_normal.y), hn::Neg(light_normal.z)};
  } else {
    V3 light_position = Set3(d, light.position);
    V to_centre = zero;
    if constexpr (kKind == VplKind::spot)
      if (light.facing) to_centre = PlaceFacing(d, light, position, light_position);
    const V3 v{hn::Sub(light_position.x, position.x), hn::Sub(light_position.y, position.y),
               hn::Sub(light_position.z, position.z)};
    const V dist2 = hn::Max(Dot(v, v), hn::Set(d, 1e-30f));
    const V inverse = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(dist2));
    to_light = {hn::Mul(v.x, inverse), hn::Mul(v.y, inverse), hn::Mul(v.z, inverse)};
    geometry = hn::Div(hn::Set(d, 1.0f), hn::Max(dist2, hn::Set(d, light.clamp2)));
    if constexpr (kKind == VplKind::oriented) {
      geometry = hn::Mul(geometry, hn::Max(zero, hn::Neg(Dot(light_normal, to_light))));
    } else if constexpr (kKind == VplKind::lobed) {
      const V cosine = hn::Max(zero, hn::Neg(Dot(light_normal, to_light)));
      geometry = hn::Mul(geometry, hn::Mul(cosine, LobeFactor(d, light, to_light, cosine)));
    } else if constexpr (kKind == VplKind::spot) {
      geometry = hn::Mul(geometry, SpotFalloff(d, light, falloff, light_normal, to_light));
      if (light.facing) geometry = hn::Mul(geometry, hn::Mul(to_centre, inverse));  // the cosine at the disk
    }
  }
  return hn::Mul(geometry, hn::Max(zero, Dot(normal, to_light)));
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
