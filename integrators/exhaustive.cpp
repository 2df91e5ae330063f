// The sum over all VPLs at every point: the truth that clustering is measured against. [thesis Eq. 1.1]
#include "clusters/light_kernel.h"
#include "core/parallel.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

class Exhaustive final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext) override {
    scene_ = &scene;
    vpls_ = &vpls;
    const float clamp = clamp_distance(params, scene);
    clamp2_ = clamp * clamp;
  }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    parallel_chunks(points.size(), kMaxLit, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      auto lit = std::make_unique<LitPoints>();
      const size_t n = end - begin;
      std::fill(radiance.begin() + begin, radiance.begin() + end, Rgb{});
      std::vector<PointCounts> local(n);
      Counters total;
      total.points = n;
      for (size_t l = 0; l < vpls_->lights.size(); ++l) {
        if (l % 256 == 0 && context.progress.cancelled()) return;
        const Vpl& light = vpls_->lights[l];
        light_points(light, light.intensity, clamp2_, points, begin, n, *lit);
        trace_lit(scene_->accel(), light, *lit);
        total.rays += lit->count;
        for (size_t i = 0; i < lit->count; ++i) {
          const uint32_t k = lit->index[i];
          ++local[k].rays;
          if (lit->occluded[i]) continue;
          radiance[begin + k] += Rgb{lit->r[i], lit->g[i], lit->b[i]};
          ++local[k].clusters;
          ++total.clusters;
        }
      }
      if (!counts.empty()) std::copy(local.begin(), local.end(), counts.begin() + begin);
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  const Scene* scene_ = nullptr;
  const VplSet* vpls_ = nullptr;
  float clamp2_ = 0.0f;
};

}  // namespace

extern const IntegratorEntry exhaustive_integrator;
const IntegratorEntry exhaustive_integrator = {
    "exhaustive",
    "Exhaustive",
    "Sums every virtual light at every point: slow, and the reference for all other methods",
    "Keller 1997; thesis Eq. 1.1",
    [] { return std::vector<ParamInfo>{}; },
    []() -> std::unique_ptr<Integrator> { return std::make_unique<Exhaustive>(); }};

}  // namespace lumicut
