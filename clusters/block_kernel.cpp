#include "clusters/block_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clusters/block_kernel.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "hwy/highway.h"

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;

struct Vec3v {
  V x, y, z;
};

HWY_INLINE V DotV(const Vec3v& a, const Vec3v& b) {
  return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x)));
}
HWY_INLINE Vec3v LoadV(D d, const std::vector<float> (&a)[3], size_t i) {
  return {hn::LoadU(d, a[0].data() + i), hn::LoadU(d, a[1].data() + i), hn::LoadU(d, a[2].data() + i)};
}
HWY_INLINE Vec3v SetV(D d, const Vec3f& v) { return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)}; }

// spot_profile of vpl/vpl.h.
HWY_INLINE V SpotProfile(D d, const Vpl& light, V c) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), outer = hn::Set(d, light.cos_outer);
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

// Geometry term without shadows, and the unit direction to the light. [thesis Eq. 1.1]
template <VplKind kKind>
HWY_INLINE V Geometry(D d, const Vpl& light, V clamp2, const Vec3v& position, const Vec3v& normal, Vec3v& to_light) {
  const V zero = hn::Zero(d);
  if constexpr (kKind == VplKind::directional) {
    to_light = SetV(d, -light.normal);
    return hn::Max(zero, DotV(normal, to_light));
  } else {
    const Vec3v at = SetV(d, light.position);
    const Vec3v v{hn::Sub(at.x, position.x), hn::Sub(at.y, position.y), hn::Sub(at.z, position.z)};
    const V dist2 = hn::Max(DotV(v, v), hn::Set(d, 1e-30f));
    const V inverse = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(dist2));
    to_light = {hn::Mul(v.x, inverse), hn::Mul(v.y, inverse), hn::Mul(v.z, inverse)};
    V geometry = hn::Div(hn::Max(zero, DotV(normal, to_light)), hn::Max(dist2, clamp2));
    if constexpr (kKind != VplKind::omni) {
      const V c = hn::Neg(DotV(SetV(d, light.normal), to_light));
      geometry = hn::Mul(geometry, kKind == VplKind::oriented ? hn::Max(zero, c) : SpotProfile(d, light, c));
    }
    return geometry;
  }
}

template <VplKind kKind, bool kGlossy>
HWY_INLINE void Run(std::span<const Vpl> lights, float weight, float clamp2, const ShadePoints& points, size_t first,
                    size_t count, bool add, BlockSums& sums) {
  const D d;
  const V zero = hn::Zero(d), vclamp2 = hn::Set(d, clamp2), vweight = hn::Set(d, weight);
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const size_t p = first + i;
    const Vec3v position = LoadV(d, points.position, p), normal = LoadV(d, points.normal, p);
    Vec3v mirror{zero, zero, zero};
    V shininess = zero;
    if constexpr (kGlossy) mirror = LoadV(d, points.mirror, p), shininess = hn::LoadU(d, points.shininess.data() + p);
    Vec3v even{zero, zero, zero}, lobed{zero, zero, zero};  // summed over lights: what diffuse and specular multiply
    for (const Vpl& light : lights) {
      Vec3v to_light;
      const V geometry = Geometry<kKind>(d, light, vclamp2, position, normal, to_light);
      const Vec3v intensity = SetV(d, light.intensity);
      even = {hn::MulAdd(intensity.x, geometry, even.x), hn::MulAdd(intensity.y, geometry, even.y),
              hn::MulAdd(intensity.z, geometry, even.z)};
      if constexpr (kGlossy) {
        const V cosine = DotV(mirror, to_light);
        if (hn::AllFalse(d, hn::And(hn::Gt(cosine, zero), hn::Gt(geometry, zero)))) continue;
        const V base = hn::Min(hn::Max(cosine, hn::Set(d, 1e-20f)), hn::Set(d, 1.0f));
        V lobe = hn::Exp(d, hn::Max(hn::Mul(shininess, hn::Log(d, base)), hn::Set(d, -80.0f)));
        lobe = hn::Mul(hn::IfThenElseZero(hn::Gt(cosine, zero), lobe), geometry);
        lobed = {hn::MulAdd(intensity.x, lobe, lobed.x), hn::MulAdd(intensity.y, lobe, lobed.y),
                 hn::MulAdd(intensity.z, lobe, lobed.z)};
      }
    }
    const Vec3v diffuse = LoadV(d, points.diffuse, p);
    Vec3v out{hn::Mul(diffuse.x, even.x), hn::Mul(diffuse.y, even.y), hn::Mul(diffuse.z, even.z)};
    if constexpr (kGlossy) {
      const Vec3v specular = LoadV(d, points.specular, p);
      out = {hn::MulAdd(specular.x, lobed.x, out.x), hn::MulAdd(specular.y, lobed.y, out.y),
             hn::MulAdd(specular.z, lobed.z, out.z)};
    }
    const auto put = [&](float* to, V value) {
      hn::StoreU(hn::MulAdd(value, vweight, add ? hn::LoadU(d, to) : zero), d, to);
    };
    put(sums.r + i, out.x), put(sums.g + i, out.y), put(sums.b + i, out.z);
  }
}

template <VplKind kKind>
HWY_INLINE void RunKind(std::span<const Vpl> lights, float weight, float clamp2, const ShadePoints& points,
                        size_t first, size_t count, bool add, BlockSums& sums) {
  if (points.glossy())
    Run<kKind, true>(lights, weight, clamp2, points, first, count, add, sums);
  else
    Run<kKind, false>(lights, weight, clamp2, points, first, count, add, sums);
}

void LightBlock(std::span<const Vpl> lights, float weight, float clamp2, const ShadePoints& points, size_t first,
                size_t count, bool add, BlockSums& sums) {
  for (size_t begin = 0; begin < lights.size();) {
    size_t end = begin + 1;
    while (end < lights.size() && lights[end].kind == lights[begin].kind) ++end;
    const auto run = lights.subspan(begin, end - begin);
    switch (lights[begin].kind) {
      case VplKind::omni:
        RunKind<VplKind::omni>(run, weight, clamp2, points, first, count, add, sums);
        break;
      case VplKind::oriented:
        RunKind<VplKind::oriented>(run, weight, clamp2, points, first, count, add, sums);
        break;
      case VplKind::directional:
        RunKind<VplKind::directional>(run, weight, clamp2, points, first, count, add, sums);
        break;
      case VplKind::spot:
        RunKind<VplKind::spot>(run, weight, clamp2, points, first, count, add, sums);
        break;
    }
    add = true;
    begin = end;
  }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightBlock);

void light_block(std::span<const Vpl> lights, float weight, float clamp2, const ShadePoints& points, size_t first,
                 size_t count, bool add, BlockSums& sums) {
  HWY_DYNAMIC_DISPATCH(LightBlock)(lights, weight, clamp2, points, first, count, add, sums);
}

}  // namespace lumicut
#endif
