#include "clusters/light_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clusters/light_kernel.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "hwy/highway.h"

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;

struct V3 {
  V x, y, z;
};

HWY_INLINE V Dot(const V3& a, const V3& b) { return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x))); }
HWY_INLINE V3 Load3(D d, const std::vector<float> (&a)[3], size_t i) {
  return {hn::LoadU(d, a[0].data() + i), hn::LoadU(d, a[1].data() + i), hn::LoadU(d, a[2].data() + i)};
}
HWY_INLINE V3 Set3(D d, const Vec3f& v) { return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)}; }

template <VplKind kKind, bool kGlossy>
HWY_INLINE size_t Light(const Vpl& light, const Rgb& intensity, float clamp2, const ShadePoints& points, size_t first,
                        size_t count, LitPoints& lit, const uint16_t* wanted) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  const V zero = hn::Zero(d);
  const V3 light_position = Set3(d, light.position), light_normal = Set3(d, light.normal);
  const V vclamp2 = hn::Set(d, clamp2), tiny = hn::Set(d, 1e-30f);
  size_t kept = 0;
  for (size_t i = 0; i < count; i += lanes) {
    const size_t p = first + i;
    // Points past the end are copies of the last one: they are lit too, but not kept.
    auto inside = hn::FirstN(d, std::min(lanes, count - i));
    if (wanted != nullptr) {
      const uint32_t bits = static_cast<uint32_t>(wanted[i / kLanes]) >> (i % kLanes);
      if ((bits & ((1u << lanes) - 1)) == 0) continue;
      const uint8_t bytes[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
      inside = hn::And(inside, hn::LoadMaskBits(d, bytes));
    }
    const V3 position = Load3(d, points.position, p), normal = Load3(d, points.normal, p);
    V3 to_light;  // unit
    V geometry;
    if constexpr (kKind == VplKind::directional) {
      to_light = {hn::Neg(light_normal.x), hn::Neg(light_normal.y), hn::Neg(light_normal.z)};
      geometry = hn::Set(d, 1.0f);
    } else {
      const V3 v{hn::Sub(light_position.x, position.x), hn::Sub(light_position.y, position.y),
                 hn::Sub(light_position.z, position.z)};
      const V dist2 = hn::Max(Dot(v, v), tiny);
      const V inverse = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(dist2));
      to_light = {hn::Mul(v.x, inverse), hn::Mul(v.y, inverse), hn::Mul(v.z, inverse)};
      geometry = hn::Div(hn::Set(d, 1.0f), hn::Max(dist2, vclamp2));
      if constexpr (kKind == VplKind::oriented) {
        geometry = hn::Mul(geometry, hn::Max(zero, hn::Neg(Dot(light_normal, to_light))));
      } else if constexpr (kKind == VplKind::spot) {  // twin of spot_profile in vpl/vpl.h
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
        geometry = hn::Mul(geometry, x);
      }
    }
    geometry = hn::Mul(geometry, hn::Max(zero, Dot(normal, to_light)));
    const auto reached = hn::And(hn::Gt(geometry, zero), inside);
    if (hn::AllFalse(d, reached)) continue;

    V3 f = Load3(d, points.diffuse, p);
    if constexpr (kGlossy) {
      const V3 specular = Load3(d, points.specular, p);
      const V cosine = Dot(Load3(d, points.mirror, p), to_light);
      const V n = hn::LoadU(d, points.shininess.data() + p);
      const V base = hn::Min(hn::Max(cosine, hn::Set(d, 1e-20f)), hn::Set(d, 1.0f));
      V lobe = hn::Exp(d, hn::Max(hn::Mul(n, hn::Log(d, base)), hn::Set(d, -80.0f)));
      lobe = hn::IfThenElseZero(hn::Gt(cosine, zero), lobe);
      f = {hn::MulAdd(specular.x, lobe, f.x), hn::MulAdd(specular.y, lobe, f.y), hn::MulAdd(specular.z, lobe, f.z)};
    }
    const V r = hn::Mul(hn::Mul(f.x, geometry), hn::Set(d, intensity.x));
    const V g = hn::Mul(hn::Mul(f.y, geometry), hn::Set(d, intensity.y));
    const V b = hn::Mul(hn::Mul(f.z, geometry), hn::Set(d, intensity.z));
    const auto keep = hn::And(reached, hn::Gt(hn::Add(r, hn::Add(g, b)), zero));
    // Through a register: compressing into memory is microcode on Zen 4. The arrays have room for a whole vector.
    const hn::RebindToUnsigned<D> du;
    const auto index = hn::Iota(du, static_cast<uint32_t>(i));
    hn::StoreU(hn::Compress(index, hn::RebindMask(du, keep)), du, lit.index + kept);
    const auto put = [&](V v, float* to) { hn::StoreU(hn::Compress(v, keep), d, to); };
    put(position.x, lit.x + kept);
    put(position.y, lit.y + kept);
    put(position.z, lit.z + kept);
    put(r, lit.r + kept);
    put(g, lit.g + kept);
    put(b, lit.b + kept);
    kept += hn::CountTrue(d, keep);
  }
  return kept;
}

template <VplKind kKind>
HWY_INLINE size_t LightKind(const Vpl& light, const Rgb& intensity, float clamp2, const ShadePoints& points,
                            size_t first, size_t count, LitPoints& lit, const uint16_t* wanted) {
  return points.glossy() ? Light<kKind, true>(light, intensity, clamp2, points, first, count, lit, wanted)
                         : Light<kKind, false>(light, intensity, clamp2, points, first, count, lit, wanted);
}

size_t LightPoints(const Vpl& light, const Rgb& intensity, float clamp2, const ShadePoints& points, size_t first,
                   size_t count, LitPoints& lit, const uint16_t* wanted) {
  switch (light.kind) {
    case VplKind::omni:
      return LightKind<VplKind::omni>(light, intensity, clamp2, points, first, count, lit, wanted);
    case VplKind::oriented:
      return LightKind<VplKind::oriented>(light, intensity, clamp2, points, first, count, lit, wanted);
    case VplKind::directional:
      return LightKind<VplKind::directional>(light, intensity, clamp2, points, first, count, lit, wanted);
    case VplKind::spot:
      return LightKind<VplKind::spot>(light, intensity, clamp2, points, first, count, lit, wanted);
  }
  return 0;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightPoints);

void light_points(const Vpl& light, const Rgb& intensity, float clamp2, const ShadePoints& points, size_t first,
                  size_t count, LitPoints& lit, const uint16_t* lanes) {
  lit.count = HWY_DYNAMIC_DISPATCH(LightPoints)(light, intensity, clamp2, points, first, count, lit, lanes);
}

Rgb light_point(const Vpl& light, const Rgb& intensity, float clamp2, const SurfacePoint& point) {
  Vec3f to_light = -light.normal;
  float geometry = 1.0f;
  if (light.kind != VplKind::directional) {
    const Vec3f v = light.position - point.position;
    const float dist2 = std::max(length2(v), 1e-30f);
    to_light = v / std::sqrt(dist2);
    geometry = 1.0f / std::max(dist2, clamp2);
    const float cosine = -dot(light.normal, to_light);
    if (light.kind == VplKind::oriented) geometry *= std::max(0.0f, cosine);
    if (light.kind == VplKind::spot) geometry *= spot_profile(light, cosine);
  }
  geometry *= std::max(0.0f, dot(point.normal, to_light));
  if (!(geometry > 0.0f)) return {};
  Rgb f = point.diffuse;
  const float cosine = dot(point.mirror, to_light);
  if (cosine > 0.0f) f += point.specular * std::pow(std::min(1.0f, cosine), point.shininess);
  return f * intensity * geometry;
}

}  // namespace lumicut
#endif
