// Lightcuts: each point is lit by a cut through the light tree, refined until every cluster's error bound lies under a
// share of the point's radiance. [Walter et al. 2005, sec. 3-4; tree: Walter et al. 2008, sec. 5]
// Departs: neighbouring points descend together (integrators/lightcuts/light_cuts.h). docs/decisions/0002-packet-lightcuts.md
#include <memory>
#include <numeric>

#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"
#include "integrators/lightcuts/light_cuts.h"
#include "integrators/lightcuts/reconstruction.h"

namespace lumicut {

namespace {

// Share of the `error` parameter that bounds one cluster. docs/integrators/README.md compares it with other methods.
constexpr float kClusterShare = 0.75f;

enum class ReconstructFrom { all, quarter, sixteenth };  // of the points have cuts of their own

struct LightcutsParams {
  float error = 0.02f;
  uint32_t max_cut = 0;  // 0: no limit
  uint32_t representatives = 1;
  LightTree::Method tree = LightTree::Method::agglomerative;
  ReconstructFrom reconstruction = ReconstructFrom::all;
  float dark_floor = 0.0f;
};

class Lightcuts final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const auto& own = params.own<LightcutsParams>();
    falloff_ = Falloff(vpls.profiles);
    error_ = kClusterShare * own.error;
    max_cut_ = own.max_cut == 0 ? std::numeric_limits<uint32_t>::max() : own.max_cut;
    seed_ = params.common().seed;
    dark_floor_ = own.dark_floor;
    stride_ = own.reconstruction == ReconstructFrom::all ? 0 : own.reconstruction == ReconstructFrom::quarter ? 4 : 16;
    const PhaseTimer timer(context.stats, "light tree");
    tree_ = LightTree::build(vpls.lights, {own.tree, 2.0f * scene.extent().radius(), own.representatives, seed_},
                             context.progress);
    context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes()));
  }

  // Of many points where their mean counts.
  size_t batch_size() const override { return dark_floor_ > 0.0f ? size_t{1} << 17 : Integrator::batch_size(); }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    const float floor = dark_floor_ > 0.0f ? dark_floor_ * mean_luminance(points, context) : 0.0f;
    if (stride_ > 0) return reconstruct(points, floor, radiance, counts, context);
    parallel_chunks(points.size(), 4 * kCutPoints, [&](size_t begin, size_t end) {
      const auto cuts = std::make_unique<LightCuts>();
      Counters total;
      for (size_t first = begin; first < end; first += kCutPoints) {
        if (context.progress.cancelled()) return;
        const size_t count = std::min(kCutPoints, end - first);
        const CutOptions options = options_at(points, first, floor, context);
        cuts->grow(tree_, scene_->accel(), options, points, first, count);
        for (size_t i = 0; i < count; ++i) {
          radiance[first + i] = cuts->radiance_of(i);
          const PointCounts c = cuts->counts_of(i);
          if (!counts.empty()) counts[first + i] = c;
          total.clusters += c.clusters, total.rays += c.rays, total.bounds += c.bounds;
        }
        total.points += count;
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  CutOptions options_at(const ShadePoints& points, size_t first, float floor, const ShadeContext& context) const {
    CutOptions options{falloff_, error_, floor, max_cut_, 0, &context.progress, nullptr};
    if (tree_.slot_count() > 1)
      options.slot = Rng(seed_, Stage::representative, points.pixel[first], first).next_below(tree_.slot_count());
    return options;
  }

  // Of evenly chosen points, by rough cuts.
  float mean_luminance(const ShadePoints& points, const ShadeContext& context) const {
    constexpr size_t kMost = 1024, kOneIn = 64;
    constexpr float kRough = 0.1f;
    const size_t n = std::min({kMost, std::max(kCutPoints, points.size() / kOneIn), points.size()});
    if (n == 0) return 0.0f;
    ShadePoints asked;
    for (size_t k = 0; k < n; ++k) asked.push(points.get(k * points.size() / n));
    asked.finish();
    std::vector<double> sums((n + kCutPoints - 1) / kCutPoints);
    parallel_chunks(n, kCutPoints, [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      const auto cuts = std::make_unique<LightCuts>();
      CutOptions options = options_at(asked, begin, 0.0f, context);
      options.error = std::max(error_, kRough);
      cuts->grow(tree_, scene_->accel(), options, asked, begin, end - begin);
      Counters total;
      for (size_t i = 0; i < end - begin; ++i) {
        const PointCounts c = cuts->counts_of(i);
        sums[begin / kCutPoints] += luminance(cuts->radiance_of(i));
        total.clusters += c.clusters, total.rays += c.rays, total.bounds += c.bounds;
      }
      context.stats.add(total);
    });
    return static_cast<float>(std::accumulate(sums.begin(), sums.end(), 0.0) / static_cast<double>(n));
  }

  void reconstruct(const ShadePoints& points, float floor, std::span<Rgb> radiance, std::span<PointCounts> counts,
                   ShadeContext context) const {
    std::vector<PointCounts> own(counts.empty() ? points.size() : 0);
    PointCounts* work = counts.empty() ? own.data() : counts.data();
    parallel_chunks(points.size(), Reconstruction::points_at_once(stride_), [&](size_t begin, size_t end) {
      if (context.progress.cancelled()) return;
      const auto by = std::make_unique<Reconstruction>(stride_);
      by->shade(tree_, scene_->accel(), options_at(points, begin, floor, context), points, begin, end, radiance.data(),
                work);
      Counters total;
      for (size_t i = begin; i < end; ++i)
        total.clusters += work[i].clusters, total.rays += work[i].rays, total.bounds += work[i].bounds;
      total.points += end - begin;
      context.stats.add(total);
    });
    context.progress.check();
  }

  const Scene* scene_ = nullptr;
  LightTree tree_;
  Falloff falloff_;
  float error_ = 0.02f, dark_floor_ = 0.0f;
  uint32_t max_cut_ = 0;
  uint64_t seed_ = 1;
  size_t stride_ = 0;  // of points with cuts of their own; 0: all have one
};

ParamTable params() {
  using P = LightcutsParams;
  return describe(
      number<&P::error>(
          "error", "Error",
          "Three quarters of it bound each cluster, as a share of the point's radiance; it is no bound of the pixel's "
          "error",
          "of the radiance", 0, 1),
      number<&P::max_cut>("max_cut", "Largest cut", "Most clusters a point may use; 0: no limit", "clusters", 0, 1e9),
      number<&P::representatives>(
          "representatives", "Representatives",
          "Choices of representative lights that blocks of points draw from: 1 gives the smoothest image, more turn "
          "banding into noise",
          "", 1, 64),
      choice<&P::tree>("tree", "Light tree",
                       "How the lights are clustered: agglomerative makes the smallest cuts, the others are baselines",
                       "", "agglomerative|divisive_3d|divisive_6d"),
      choice<&P::reconstruction>(
          "reconstruction", "Reconstruction",
          "One point of 4 or of 16 gets a cut of its own; those between take what it knows of visibility where that is "
          "smooth",
          "", "off|4|16"),
      number<&P::dark_floor>("dark_floor", "Dark floor",
                             "Points darker than this share of the mean are held to its error: no bound in the dark",
                             "of the mean radiance", 0, 1));
}

}  // namespace

extern const IntegratorEntry lightcuts_integrator;
const IntegratorEntry lightcuts_integrator = {
    "lightcuts",
    "Lightcuts",
    "A cut through the light tree for each point, with an error bound for each cluster",
    "Walter et al. 2005; Walter et al. 2008, sec. 5",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<Lightcuts>(); }};

}  // namespace lumicut
