// The sum over all VPLs at every point: the truth that clustering is measured against. [thesis Eq. 1.1]
#include "clustering/light_kernel.h"
#include "core/parallel.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

class Exhaustive final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params&, ShadeContext) override {
    scene_ = &scene;
    vpls_ = &vpls;
    falloff_ = Falloff(vpls.profiles);
  }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    parallel_chunks(points.size(), kMaxLit, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      auto lit = std::make_unique<LitPoints>();
      const size_t n = end - begin;
      float sum[3][kMaxLit] = {};
      uint32_t rays[kMaxLit] = {}, clusters[kMaxLit] = {};
      for (size_t l = 0; l < vpls_->lights.size(); ++l) {
        if (l % 256 == 0 && context.progress.cancelled()) return;
        const Vpl& light = vpls_->lights[l];
        light_points(light, light.intensity, falloff_, points, begin, n, *lit);
        trace_lit(scene_->accel(), light, *lit);
        for (size_t i = 0; i < lit->count; ++i) {  // no branch: what is seen follows no pattern
          const uint32_t k = lit->index[i], seen = 1u - lit->occluded[i];
          const auto share = static_cast<float>(seen);
          sum[0][k] += lit->r[i] * share, sum[1][k] += lit->g[i] * share, sum[2][k] += lit->b[i] * share;
          ++rays[k];
          clusters[k] += seen;
        }
      }
      Counters total;
      total.points = n;
      for (size_t k = 0; k < n; ++k) {
        radiance[begin + k] = {sum[0][k], sum[1][k], sum[2][k]};
        if (!counts.empty()) counts[begin + k] = {clusters[k], rays[k], 0};
        total.rays += rays[k], total.clusters += clusters[k];
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  const Scene* scene_ = nullptr;
  const VplSet* vpls_ = nullptr;
  Falloff falloff_;
};

}  // namespace

extern const IntegratorEntry exhaustive_integrator;
const IntegratorEntry exhaustive_integrator = {
    "exhaustive",
    "Exhaustive",
    "Sums every virtual light at every point: slow, and the reference for all other methods",
    "Keller 1997; thesis Eq. 1.1",
    nullptr,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<Exhaustive>(); }};

}  // namespace lumicut
