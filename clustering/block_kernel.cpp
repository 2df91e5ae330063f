#include "clustering/block_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/block_kernel.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clustering/kernel_dispatch-inl.h"
#include "clustering/light_kernel-inl.h"
#include "clustering/sphere_integral-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {

struct BlockKernel {
  template <VplKind kKind, Lobes kLobes>
  static HWY_INLINE void Run(std::span<const Vpl> lights, float weight, Falloff falloff, const ShadePoints& points,
                             size_t first, size_t count, bool add, BlockSums& sums) {
    const D d;
    const V zero = hn::Zero(d), vweight = hn::Set(d, weight);
    for (size_t i = 0; i < count; i += hn::Lanes(d)) {
      const size_t p = first + i;
      const V3 position = Load3(d, points.position, p), normal = Load3(d, points.normal, p);
      V3 mirror{zero, zero, zero};
      if constexpr (kLobes != Lobes::none) mirror = Load3(d, points.mirror, p);
      const LobeShape shape = LoadShape<kLobes>(d, points, p);
      // Summed over lights: what diffuse, specular and grazing multiply.
      V3 even{zero, zero, zero}, lobed{zero, zero, zero}, edge{zero, zero, zero};
      const auto add_to = [](V3& total, const V3& intensity, V factor) {
        total = {hn::MulAdd(intensity.x, factor, total.x), hn::MulAdd(intensity.y, factor, total.y),
                 hn::MulAdd(intensity.z, factor, total.z)};
      };
      for (const Vpl& light : lights) {
        V3 to_light;
        const V3 intensity = Set3(d, light.intensity);
        if constexpr (kKind == VplKind::sphere) {
          const LobeSums parts = SphereLobes<kLobes, true>(d, light, points, p, position, normal, to_light);
          add_to(even, intensity, parts.diffuse);
          if constexpr (kLobes != Lobes::none) add_to(lobed, intensity, parts.specular);
          if constexpr (kLobes == Lobes::all) add_to(edge, intensity, parts.grazing);
          continue;
        }
        const V geometry = Geometry<kKind>(d, light, falloff, position, normal, to_light);
        if constexpr (kLobes == Lobes::all) {
          if (hn::AllFalse(d, hn::Gt(geometry, zero))) continue;
          const LobeSums parts = LobesTowards<kLobes>(d, normal, mirror, shape, to_light);
          add_to(even, intensity, hn::Mul(geometry, parts.diffuse));
          add_to(lobed, intensity, hn::Mul(geometry, parts.specular));
          add_to(edge, intensity, hn::Mul(geometry, parts.grazing));
        } else {
          add_to(even, intensity, geometry);
        }
        if constexpr (kLobes == Lobes::cosine) {
          const V beta = Dot(mirror, to_light);
          if (hn::AllFalse(d, hn::And(hn::Gt(beta, zero), hn::Gt(geometry, zero)))) continue;
          const LobeSums parts = LobesTowards<kLobes>(d, normal, mirror, shape, to_light);
          add_to(lobed, intensity, hn::Mul(parts.specular, geometry));
        }
      }
      const V3 diffuse = Load3(d, points.diffuse, p);
      V3 out{hn::Mul(diffuse.x, even.x), hn::Mul(diffuse.y, even.y), hn::Mul(diffuse.z, even.z)};
      if constexpr (kLobes == Lobes::all) {
        const V3 grazing = Load3(d, points.grazing, p);
        out = {hn::MulAdd(grazing.x, edge.x, out.x), hn::MulAdd(grazing.y, edge.y, out.y),
               hn::MulAdd(grazing.z, edge.z, out.z)};
      }
      if constexpr (kLobes != Lobes::none) {
        const V3 specular = Load3(d, points.specular, p);
        out = {hn::MulAdd(specular.x, lobed.x, out.x), hn::MulAdd(specular.y, lobed.y, out.y),
               hn::MulAdd(specular.z, lobed.z, out.z)};
      }
      const auto put = [&](float* to, V value) {
        hn::StoreU(hn::MulAdd(value, vweight, add ? hn::LoadU(d, to) : zero), d, to);
      };
      put(sums.r + i, out.x), put(sums.g + i, out.y), put(sums.b + i, out.z);
    }
  }
};

void LightBlock(std::span<const Vpl> lights, float weight, Falloff falloff, const ShadePoints& points, size_t first,
                size_t count, bool add, BlockSums& sums) {
  for (size_t begin = 0; begin < lights.size();) {
    size_t end = begin + 1;
    while (end < lights.size() && lights[end].kind == lights[begin].kind) ++end;
    const auto run = lights.subspan(begin, end - begin);
    RunKernel<BlockKernel>(lights[begin].kind, points.lobes(), run, weight, falloff, points, first, count, add, sums);
    add = true;
    begin = end;
  }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightBlock);

void light_block(std::span<const Vpl> lights, float weight, Falloff falloff, const ShadePoints& points, size_t first,
                 size_t count, bool add, BlockSums& sums) {
  HWY_DYNAMIC_DISPATCH(LightBlock)(lights, weight, falloff, points, first, count, add, sums);
}

}  // namespace lumicut
#endif
