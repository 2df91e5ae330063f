// LightSlice: points in slices; lights clustered for each slice by what they give to it and its neighbours, as sampled
// rows of the light transport matrix tell, shadows included. [Ou and Pellacini 2011, sec. 4]
// Departs: slices are worked off in groups of 32 neighbours. A group's rows alone are in memory, and its initial
// clustering, where the paper has one of the whole matrix, is the group's own.
// docs/decisions/0011-light-slice-groups.md
#include <tbb/task_arena.h>

#include <array>
#include <chrono>

#include "clustering/column_clusters.h"
#include "clustering/light_matrix.h"
#include "clustering/light_sum.h"
#include "core/parallel.h"
#include "integrators/integrator.h"
#include "integrators/light_slice/slices.h"

namespace lumicut {

namespace {

constexpr size_t kGroup = 32;        // slices of a group: rows of its matrix
constexpr size_t kLeastPoints = 16;  // of a slice
constexpr size_t kBatch = 262144;
// A light that a row's point does not see counts a little all the same: other points of the slice may see it. Without
// this some lights stand for far stronger ones where they come out of the shadow.
constexpr float kShadowedShare = 0.07f;

// Seconds that tasks spent in each phase, told as shares of the wall time.
class SharedTimer {
 public:
  enum Phase { rows, clustering, sum, kPhases };
  explicit SharedTimer(Stats& stats) : stats_(stats) {}
  ~SharedTimer() {
    static const char* const kNames[kPhases] = {"matrix rows", "column clusters", "light sum"};
    const double wall = seconds_since(start_);
    double all = 0;
    for (const auto& t : nanoseconds_) all += static_cast<double>(t.load());
    for (int p = 0; p < kPhases && all > 0; ++p)
      stats_.add_phase(kNames[p], wall * static_cast<double>(nanoseconds_[p].load()) / all);
  }
  static std::chrono::steady_clock::time_point now() { return std::chrono::steady_clock::now(); }
  static double seconds_since(std::chrono::steady_clock::time_point t) {
    return std::chrono::duration<double>(now() - t).count();
  }
  void add(Phase p, double seconds) { nanoseconds_[p] += static_cast<uint64_t>(seconds * 1e9); }

 private:
  Stats& stats_;
  std::chrono::steady_clock::time_point start_ = now();
  std::array<std::atomic<uint64_t>, kPhases> nanoseconds_{};
};

struct LightSliceParams {
  uint32_t slices = 400, columns = 400, representatives = 1;
};

class LightSlice final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const auto& own = params.own<LightSliceParams>();
    falloff_ = Falloff(vpls.profiles);
    slices_ = own.slices;
    columns_ = own.columns;
    lights_ = order_lights(vpls.lights, &context.progress);
    times_.clear();
    for (uint32_t s = 0; s < own.representatives; ++s)
      times_.push_back(race_times(lights_.size(), params.common().seed, s, &context.progress));
  }

  size_t batch_size() const override { return kBatch; }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    std::fill(radiance.begin(), radiance.end(), Rgb{});
    std::fill(counts.begin(), counts.end(), PointCounts{});
    if (points.size() == 0 || lights_.empty()) return;
    Slices slices;
    {
      const PhaseTimer timer(context.stats, "slices");
      slices = build_slices(points, slices_, kLeastPoints, scene_->extent().radius(), &context.progress);
    }
    // Which of its pixel's points each is.
    std::vector<uint32_t> sample(points.size(), 0);
    for (size_t i = 1; i < points.size(); ++i)
      if (points.pixel[i] == points.pixel[i - 1]) sample[i] = sample[i - 1] + 1;
    SharedTimer timer(context.stats);
    parallel_chunks(slices.size(), kGroup, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      // No task of another group is begun while this one waits: memory and time stay each group's own.
      tbb::this_task_arena::isolate(
          [&] { shade_group(points, slices, sample, begin, end, radiance, counts, context, timer); });
    });
    context.progress.check();
  }

 private:
  // Slices [begin, end), a group.
  void shade_group(const ShadePoints& points, const Slices& slices, const std::vector<uint32_t>& sample, size_t begin,
                   size_t end, std::span<Rgb> radiance, std::span<PointCounts> counts, ShadeContext context,
                   SharedTimer& timer) const {
    const bool exact = columns_ >= lights_.size();
    LightMatrix matrix;
    std::vector<PointFeature> features;
    std::vector<float> normalise(end - begin);
    std::unique_ptr<ColumnClusters> initial;
    Counters total;
    if (!exact) {
      auto start = SharedTimer::now();
      ShadePoints rows;
      for (size_t s = begin; s < end; ++s) {
        rows.push(row_point(points.get(slices.representatives[s])));
        features.push_back(point_feature(points, slices.representatives[s], scene_->extent().radius()));
      }
      rows.finish();
      matrix = LightMatrix::build(*scene_, lights_, rows, falloff_, kShadowedShare, context.progress);
      total.rays += matrix.rays();
      timer.add(SharedTimer::rows, SharedTimer::seconds_since(start));
      start = SharedTimer::now();
      for (size_t r = 0; r < normalise.size(); ++r)
        normalise[r] = matrix.row_sums()[r] > 0 ? static_cast<float>(1.0 / matrix.row_sums()[r]) : 0.0f;
      initial = std::make_unique<ColumnClusters>(matrix, normalise);
      initial->split(columns_ / 2, context.progress);
      timer.add(SharedTimer::clustering, SharedTimer::seconds_since(start));
    }
    parallel_chunks(end - begin, 1, [&](size_t local, size_t) {
      if (context.progress.cancelled()) return;
      auto start = SharedTimer::now();
      std::vector<std::vector<ScaledLight>> lights(times_.size());
      if (exact) {
        for (auto& list : lights)
          for (const Vpl& v : lights_) list.push_back({&v, v.intensity});
      } else {
        std::vector<float> weights(normalise.size());
        for (size_t r = 0; r < weights.size(); ++r) weights[r] = normalise[r] * nearness(features, local, r);
        ColumnClusters clusters(*initial, weights);
        clusters.split(columns_, context.progress);
        for (size_t slot = 0; slot < times_.size(); ++slot)
          for (const auto& c : clusters.clusters()) {
            const ColumnRepresentative r = representative(clusters, c, lights_, times_[slot]);
            lights[slot].push_back({&lights_[r.column], r.intensity});
          }
      }
      timer.add(SharedTimer::clustering, SharedTimer::seconds_since(start));
      start = SharedTimer::now();
      shade_slice(points, slices, sample, begin + local, lights, radiance, counts, context);
      timer.add(SharedTimer::sum, SharedTimer::seconds_since(start));
    });
    context.stats.add(total);
  }

  // Rows tell where light comes from, not how bright a texture is just there.
  static SurfacePoint row_point(SurfacePoint p) {
    const float diffuse = luminance(p.diffuse), specular = luminance(p.specular);
    const float d = diffuse + specular > 0.0f ? std::max(diffuse, 1e-3f * specular) : 1.0f;
    p.diffuse = {d, d, d};
    p.specular = {specular, specular, specular};
    const float edge = luminance(p.grazing);
    p.grazing = {edge, edge, edge};
    return p;
  }

  // Weight of slice `other`'s row for slice `own`, both counted within the group: 1 for its own, falling off over the
  // distance of its fourth neighbour.
  static float nearness(const std::vector<PointFeature>& features, size_t own, size_t other) {
    if (own == other) return 1.0f;
    std::vector<float> d;
    for (size_t r = 0; r < features.size(); ++r)
      if (r != own) d.push_back(distance2(features[own], features[r]));
    const size_t k = std::min<size_t>(3, d.size() - 1);
    std::nth_element(d.begin(), d.begin() + static_cast<std::ptrdiff_t>(k), d.end());
    const float unit = std::max(d[k], 1e-20f);
    return 0.01f + 0.5f * std::exp(-distance2(features[own], features[other]) / unit);
  }

  void shade_slice(const ShadePoints& points, const Slices& slices, const std::vector<uint32_t>& sample, size_t slice,
                   const std::vector<std::vector<ScaledLight>>& lights, std::span<Rgb> radiance,
                   std::span<PointCounts> counts, ShadeContext context) const {
    const auto work = std::make_unique<LitPoints>();
    Counters total;
    std::vector<Rgb> sums(kMaxLit);
    std::vector<uint32_t> rays(kMaxLit), ids;
    ShadePoints own;
    for (size_t slot = 0; slot < lights.size(); ++slot) {
      if (context.progress.cancelled()) return;
      own.clear(), ids.clear();
      for (uint32_t i = slices.begins[slice]; i < slices.begins[slice + 1]; ++i) {
        const uint32_t id = slices.order[i];
        if (lights.size() > 1 && sample[id] % lights.size() != slot) continue;
        own.push(points.get(id));
        ids.push_back(id);
      }
      own.finish();
      for (size_t first = 0; first < ids.size(); first += kMaxLit) {
        const size_t n = std::min(kMaxLit, ids.size() - first);
        total.clusters += sum_lights(scene_->accel(), lights[slot], falloff_, own, first, n, context.progress, *work,
                                     sums.data(), rays.data());
        for (size_t i = 0; i < n; ++i) {
          radiance[ids[first + i]] = sums[i];
          if (!counts.empty()) counts[ids[first + i]] = {static_cast<uint32_t>(lights[slot].size()), rays[i], 0};
          total.rays += rays[i];
        }
      }
      total.points += ids.size();
    }
    context.stats.add(total);
  }

  const Scene* scene_ = nullptr;
  std::vector<Vpl> lights_;
  std::vector<std::vector<float>> times_;  // of each choice of representatives
  Falloff falloff_;
  size_t slices_ = 0, columns_ = 0;
};

ParamTable params() {
  using P = LightSliceParams;
  return describe(
      number<&P::slices>("slices", "Slices",
                         "Groups of points that share a clustering of the lights, in 262,144 points", "slices", 1,
                         65536),
      number<&P::columns>("columns", "Columns", "Clusters of lights that each slice is lit by", "clusters", 1, 1e8),
      number<&P::representatives>(
          "representatives", "Representatives",
          "Choices of representative lights that the samples of a pixel take in turn: with several samples, more turn "
          "blocks into noise",
          "", 1, 64));
}

}  // namespace

extern const IntegratorEntry light_slice_integrator;
const IntegratorEntry light_slice_integrator = {
    "light_slice",
    "LightSlice",
    "Clusters lights for slices of points by sampled rows of the light transport matrix",
    "Ou and Pellacini 2011",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<LightSlice>(); }};

}  // namespace lumicut
