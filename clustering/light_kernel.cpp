#include "clustering/light_kernel.h"

#include "bsdf/point_bsdf.h"
#include "lights/light_reach.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/light_kernel.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clustering/kernel_dispatch-inl.h"
#include "clustering/light_kernel-inl.h"
#include "clustering/sphere_integral-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// SIMD counterpart of mean_cosine.
HWY_INLINE V MeanCosine(D d, const Vec3f& normal, const DirectionScatter& s, const V3& to_light) {
  const V c = hn::Neg(Dot(Set3(d, normal), to_light));
  const V diagonal = hn::MulAdd(hn::Mul(to_light.x, to_light.x), hn::Set(d, s.xx),
                                hn::MulAdd(hn::Mul(to_light.y, to_light.y), hn::Set(d, s.yy),
                                           hn::Mul(hn::Mul(to_light.z, to_light.z), hn::Set(d, s.zz))));
  const V mixed = hn::MulAdd(hn::Mul(to_light.x, to_light.y), hn::Set(d, s.xy),
                             hn::MulAdd(hn::Mul(to_light.x, to_light.z), hn::Set(d, s.xz),
                                        hn::Mul(hn::Mul(to_light.y, to_light.z), hn::Set(d, s.yz))));
  const V scatter = hn::Max(hn::Zero(d), hn::MulAdd(hn::Set(d, 2.0f), mixed, diagonal));
  return hn::Mul(hn::Set(d, 0.5f), hn::Add(c, hn::Sqrt(hn::MulAdd(c, c, scatter))));
}

// `kScatter`: the light is the mean of a cluster.
template <bool kScatter>
struct LightKernel {
  template <VplKind kKind, Lobes kLobes>
  static HWY_INLINE size_t Run(const Vpl& light, const Rgb& intensity, Falloff falloff, const ShadePoints& points,
                               size_t first, size_t count, LitPoints& lit, const uint16_t* wanted,
                               const DirectionScatter* scatter) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    const V zero = hn::Zero(d);
    size_t kept = 0;
    for (size_t i = 0; i < count; i += lanes) {
      const size_t p = first + i;
      // Points past the end are copies of the last one: they are lit too, but not kept.
      auto inside = hn::FirstN(d, std::min(lanes, count - i));
      if (wanted != nullptr) {
        const uint32_t bits = wanted[i / kLanes];
        if ((bits >> (i % kLanes) & ((1u << lanes) - 1)) == 0) continue;
        inside = hn::And(inside, MaskOf(d, bits, i % kLanes));
      }
      const V3 position = Load3(d, points.position, p), normal = Load3(d, points.normal, p);
      V3 to_light;
      V geometry;
      V3 f;
      hn::Mask<D> reached;
      if constexpr (kKind == VplKind::sphere) {
        f = SphereRadiance<kLobes, !kScatter>(d, light, points, p, position, normal, to_light);
        geometry = kScatter ? MeanCosine(d, light.normal, *scatter, to_light) : hn::Set(d, 1.0f);
        reached = inside;
      } else {
        constexpr VplKind kShape = kScatter ? VplKind::omni : kKind;
        geometry = Geometry<kShape>(d, light, falloff, position, normal, to_light);
        if constexpr (kScatter) {
          const V cosine = MeanCosine(d, light.normal, *scatter, to_light);
          geometry = hn::Mul(geometry, cosine);
          if constexpr (kKind == VplKind::lobed)
            geometry = hn::Mul(geometry, LobeFactor(d, light, to_light, hn::Min(cosine, hn::Set(d, 1.0f))));
        }
        reached = hn::And(hn::Gt(geometry, zero), inside);
        if (hn::AllFalse(d, reached)) continue;
        f = Reflectance<kLobes>(d, points, p, normal, to_light);
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
};

size_t LightPoints(const Vpl& light, const Rgb& intensity, Falloff falloff, const ShadePoints& points, size_t first,
                   size_t count, LitPoints& lit, const uint16_t* wanted, const DirectionScatter* scatter) {
  const Lobes lobes = points.lobes();
  if (scatter == nullptr)
    return RunKernel<LightKernel<false>>(light.kind, lobes, light, intensity, falloff, points, first, count, lit,
                                         wanted, scatter);
  if (light.kind == VplKind::sphere)
    return RunForLobes<LightKernel<true>, VplKind::sphere>(lobes, light, intensity, falloff, points, first, count, lit,
                                                           wanted, scatter);
  if (light.kind == VplKind::lobed)
    return RunForLobes<LightKernel<true>, VplKind::lobed>(lobes, light, intensity, falloff, points, first, count, lit,
                                                          wanted, scatter);
  return RunForLobes<LightKernel<true>, VplKind::oriented>(lobes, light, intensity, falloff, points, first, count, lit,
                                                           wanted, scatter);
}

Rgb SphereAt(const Vpl& light, const SurfacePoint& point) {
  const D d;
  V3 to_light;
  const V3 position = Set3(d, point.position), normal = Set3(d, point.normal);
  const V3 f = point.lobes() == Lobes::all
                   ? SphereRadiance<Lobes::all, true>(d, light, point, 0, position, normal, to_light)
                   : SphereRadiance<Lobes::cosine, true>(d, light, point, 0, position, normal, to_light);
  return {hn::GetLane(f.x), hn::GetLane(f.y), hn::GetLane(f.z)};
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightPoints);
HWY_EXPORT(SphereAt);

void light_points(const Vpl& light, const Rgb& intensity, Falloff falloff, const ShadePoints& points, size_t first,
                  size_t count, LitPoints& lit, const uint16_t* lanes, const DirectionScatter* scatter) {
  lit.count = HWY_DYNAMIC_DISPATCH(LightPoints)(light, intensity, falloff, points, first, count, lit, lanes, scatter);
}

// Scalar counterpart of LobeFactor.
static float lobe_factor(const Vpl& light, const Vec3f& to_light, float cosine) {
  const float view = dot(light.normal, light.mirror()), beta = -dot(light.mirror(), to_light);
  return diffuse_falloff(light.falloff, cosine) *
         (light.slope() > 0.0f ? oren_nayar_factor(light.slope(), light.again, view, cosine, beta) : 1.0f) *
         (light.burley() ? burley_factor(light.retro, light.dim, view, cosine, beta) : 1.0f);
}

Rgb light_point(const Vpl& light, const Rgb& intensity, Falloff falloff, const SurfacePoint& point) {
  if (light.kind == VplKind::sphere) return HWY_DYNAMIC_DISPATCH(SphereAt)(light, point) * intensity;
  Vec3f to_light = -light.normal;
  float geometry = 1.0f;
  if (light.kind != VplKind::directional) {
    const Vec3f v = (light.facing ? place_facing(light, point.position) : light.position) - point.position;
    const float dist2 = std::max(length2(v), 1e-30f);
    to_light = v / std::sqrt(dist2);
    geometry = 1.0f / std::max(dist2, light.clamp2);
    const float cosine = -dot(light.normal, to_light);
    if (light.kind == VplKind::oriented || light.kind == VplKind::lobed) geometry *= std::max(0.0f, cosine);
    if (light.kind == VplKind::lobed && cosine > 0.0f) geometry *= lobe_factor(light, to_light, cosine);
    if (light.kind == VplKind::spot) geometry *= falloff.of_spot(light, -to_light);
    if (light.facing) geometry *= length(light.position - light.from_centre - point.position) / std::sqrt(dist2);
  }
  geometry *= std::max(0.0f, dot(point.normal, to_light));
  if (!(geometry > 0.0f)) return {};
  return reflectance(point, to_light) * intensity * geometry;
}

Rgb light_point_limited(const Vpl& light, const Rgb& intensity, Falloff falloff, const SurfacePoint& point) {
  if (lights_all(light)) return light_point(light, intensity, falloff, point);
  SurfacePoint lit = point;
  limit(lit, light.seen_by, light.receivers);
  return light_point(light, intensity, falloff, lit);
}

}  // namespace lumicut
#endif
