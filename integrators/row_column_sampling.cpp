// Matrix row-column sampling: a few hundred random rows of the light transport matrix tell which columns (lights) are
// alike; one light of each cluster renders all points. [Hašan et al. 2007]
// Departs: rows come from a batch of the frame's points (262,144, or what the host gives), stratified over it; clusters
// are split across their principal axis. docs/integrators/row_column_sampling.md
#include "clustering/column_clusters.h"
#include "clustering/light_matrix.h"
#include "clustering/light_sum.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

// A light that a row's point does not see counts a little all the same: other points may see it.
constexpr float kShadowedShare = 0.07f;

struct RowColumnParams {
  uint32_t rows = 300, columns = 900;
  double sampled = 0;
};

class RowColumnSampling final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const auto& own = params.own<RowColumnParams>();
    falloff_ = Falloff(vpls.profiles);
    rows_ = own.rows;
    columns_ = own.columns;
    sampled_ = own.sampled;
    seed_ = params.common().seed;
    lights_ = order_lights(vpls.lights, &context.progress);
    times_ = race_times(lights_.size(), seed_, 0, &context.progress);
  }

  size_t batch_size() const override { return 262144; }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    std::fill(radiance.begin(), radiance.end(), Rgb{});
    std::fill(counts.begin(), counts.end(), PointCounts{});
    if (points.size() == 0 || lights_.empty()) return;
    const std::vector<ScaledLight> lights = choose_lights(points, context);
    const PhaseTimer timer(context.stats, "light sum");
    parallel_chunks(points.size(), kMaxLit, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      const auto work = std::make_unique<LitPoints>();
      std::vector<uint32_t> rays(end - begin);
      Counters total;
      total.points = end - begin;
      total.clusters = sum_lights(scene_->accel(), lights, falloff_, points, begin, end - begin, context.progress,
                                  *work, radiance.data() + begin, rays.data());
      for (size_t i = begin; i < end; ++i) {
        total.rays += rays[i - begin];
        if (!counts.empty()) counts[i] = {static_cast<uint32_t>(lights.size()), rays[i - begin], 0};
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  std::vector<ScaledLight> choose_lights(const ShadePoints& points, ShadeContext context) const {
    std::vector<ScaledLight> lights;
    if (columns_ >= lights_.size()) {
      for (const Vpl& v : lights_) lights.push_back({&v, v.intensity});
      return lights;
    }
    LightMatrix matrix;
    {
      const PhaseTimer timer(context.stats, "matrix rows");
      matrix = LightMatrix::build(*scene_, lights_, choose_rows(points), falloff_, kShadowedShare, context.progress);
      Counters traced;
      traced.rays = matrix.rays();
      context.stats.add(traced);
    }
    const PhaseTimer timer(context.stats, "column clusters");
    double sum = 0;
    for (double s : matrix.row_sums()) sum += s;
    // One factor for all rows keeps squares of norms in the range of floats.
    const std::vector<float> weights(matrix.rows(),
                                     sum > 0 ? static_cast<float>(static_cast<double>(matrix.rows()) / sum) : 0.0f);
    ColumnClusters clusters(matrix, weights);
    clusters.sample(static_cast<size_t>(sampled_ * static_cast<double>(columns_)), seed_, context.progress);
    clusters.split(columns_, context.progress);
    for (const auto& c : clusters.clusters()) {
      const ColumnRepresentative r = representative(clusters, c, lights_, times_);
      lights.push_back({&lights_[r.column], r.intensity});
    }
    return lights;
  }

  // One random point of each of `rows_` equal parts of the batch: it lies in Morton order, so that parts are patches.
  ShadePoints choose_rows(const ShadePoints& points) const {
    ShadePoints rows;
    const size_t n = points.size(), count = std::min(rows_, n);
    for (size_t r = 0; r < count; ++r) {
      const size_t begin = r * n / count, end = (r + 1) * n / count;
      Rng rng(seed_, Stage::visibility, r, n);
      rows.push(points.get(begin + rng.next_below(static_cast<uint32_t>(end - begin))));
    }
    rows.finish();
    return rows;
  }

  const Scene* scene_ = nullptr;
  std::vector<Vpl> lights_;
  std::vector<float> times_;
  Falloff falloff_;
  double sampled_ = 0;
  size_t rows_ = 0, columns_ = 0;
  uint64_t seed_ = 1;
};

ParamTable params() {
  using P = RowColumnParams;
  return describe(
      number<&P::rows>("rows", "Rows", "Points whose light is computed in full, in 262,144 points", "points", 1, 4096),
      number<&P::columns>("columns", "Columns", "Lights that render the image", "clusters", 1, 1e8),
      number<&P::sampled>("sampled", "Sampled share",
                          "Share of the columns that is found by sampling; the others come from splitting", "", 0, 1));
}

}  // namespace

extern const IntegratorEntry row_column_sampling_integrator;
const IntegratorEntry row_column_sampling_integrator = {
    "row_column_sampling",
    "Row-column sampling",
    "Clusters lights once for all points, by sampled rows of the light transport matrix",
    "Hašan et al. 2007",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<RowColumnSampling>(); }};

}  // namespace lumicut
