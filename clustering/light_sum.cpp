#include "clustering/light_sum.h"

namespace lumicut {

uint64_t sum_lights(const Accel& accel, std::span<const ScaledLight> lights, Falloff falloff, const ShadePoints& points,
                    size_t first, size_t count, const Progress& progress, LitPoints& lit, Rgb* radiance,
                    uint32_t* rays) {
  std::fill(radiance, radiance + count, Rgb{});
  std::fill(rays, rays + count, 0u);
  uint64_t reached = 0;
  for (size_t l = 0; l < lights.size(); ++l) {
    if (l % 64 == 0 && progress.cancelled()) break;
    const Vpl& light = *lights[l].light;
    light_points(light, lights[l].intensity, falloff, points, first, count, lit);
    trace_lit(accel, light, lit);
    for (size_t i = 0; i < lit.count; ++i) {
      const uint32_t k = lit.index[i];
      ++rays[k];
      if (lit.occluded[i]) continue;
      radiance[k] += Rgb{lit.r[i], lit.g[i], lit.b[i]};
      ++reached;
    }
  }
  return reached;
}

}  // namespace lumicut
