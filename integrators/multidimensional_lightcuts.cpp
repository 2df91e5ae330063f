// Multidimensional lightcuts: a pixel's points and the lights are clustered together, and one cut through the graph of
// pairs bounds the error of the pixel's sum. [Walter et al. 2006; trees: Walter et al. 2008, sec. 5]
// Departs: 16 pixels descend together, as points do in lightcuts.cpp; a pixel's point tree is 16-wide, so that a
// pixel's children are one SIMD evaluation and one packet; and each light cluster looks at another random point of a
// cluster, so that the errors of a pixel's pairs are independent. docs/decisions/0013-multidimensional-lightcuts.md
#include <array>
#include <bit>
#include <memory>
#include <numeric>

#include "clustering/light_kernel.h"
#include "clustering/light_tree.h"
#include "clustering/pair_bounds.h"
#include "clustering/point_tree.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

constexpr uint32_t kNoBlock = 0xffffffffu;
constexpr size_t kMaxRows = 16;

// Up to 16 clusters of points: the pixels themselves, or the children of one cluster.
struct Block {
  PointNodes nodes;
  float count[kLanes] = {};     // points of a lane
  uint32_t child[kLanes] = {};  // block of a lane's children; kNoBlock: a single point
  uint32_t pixel[kLanes] = {};
  size_t first_rep = 0, rows = 1;  // representatives: `rows` choices of a point for each lane, row after row
};

// A light cluster and the clusters of one block, in the cuts of the lanes in `active`.
struct alignas(64) Pairs {
  float bound[kLanes];        // of a lane's sum over its points
  float estimate[3][kLanes];  // the same, shadows included
  uint32_t node, block, active;
};

struct HeapItem {
  float excess;  // largest bound over the pixel's radiance
  uint32_t pairs;
  bool operator<(const HeapItem& o) const { return excess < o.excess || (excess == o.excess && pairs > o.pairs); }
};

struct PixelRun {
  size_t first, count;
};

struct Workspace {
  LitPoints lit;
  std::vector<Block> blocks;
  ShadePoints reps;
  std::vector<Pairs> pairs;
  std::vector<uint32_t> free_pairs;
  std::vector<HeapItem> heap;
  std::array<float, kLanes> total;  // luminance of a pixel's cut
  std::array<Rgb, kLanes> sum;      // of pairs that are final
  std::array<PointCounts, kLanes> counts;

  uint32_t allocate() {
    if (free_pairs.empty()) {
      pairs.emplace_back();
      return static_cast<uint32_t>(pairs.size() - 1);
    }
    const uint32_t p = free_pairs.back();
    free_pairs.pop_back();
    return p;
  }
};

struct MultidimensionalParams {
  float error = 0.02f;
  uint32_t max_cut = 0;  // 0: no limit
};

class MultidimensionalLightcuts final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const auto& own = params.own<MultidimensionalParams>();
    falloff_ = Falloff(vpls.profiles);
    error_ = own.error;
    max_cut_ = own.max_cut == 0 ? std::numeric_limits<uint32_t>::max() : own.max_cut;
    seed_ = params.common().seed;
    const PhaseTimer timer(context.stats, "light tree");
    tree_ = LightTree::build(vpls.lights, {LightTree::Method::agglomerative, 2.0f * scene.extent().radius(), 1, seed_},
                             context.progress);
    context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes()));
  }

  // Points of a pixel get the mean of its radiance each: the method knows their sum alone.
  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    std::vector<PixelRun> runs;
    for (size_t i = 0; i < points.size(); ++i) {
      if (i == 0 || points.pixel[i] != points.pixel[i - 1]) runs.push_back({i, 0});
      ++runs.back().count;
    }
    parallel_chunks(runs.size(), 4 * kLanes, [&](size_t begin, size_t end) {
      const auto work = std::make_unique<Workspace>();
      Counters total;
      for (size_t first = begin; first < end; first += kLanes) {
        const std::span<const PixelRun> pixels{runs.data() + first, std::min(kLanes, end - first)};
        if (!shade_pixels(points, pixels, *work, context.progress)) return;
        for (size_t p = 0; p < pixels.size(); ++p) {
          const auto n = static_cast<uint32_t>(pixels[p].count);
          const PointCounts& c = work->counts[p];
          total.points += n, total.clusters += c.clusters, total.rays += c.rays, total.bounds += c.bounds;
          const Rgb mean = work->sum[p] * (1.0f / static_cast<float>(n));
          for (size_t i = pixels[p].first; i < pixels[p].first + n; ++i) {
            radiance[i] = mean;
            // A pixel's counts are spread over its points; the first takes the remainder.
            const auto share = [&](uint32_t all) { return all / n + (i == pixels[p].first ? all % n : 0); };
            if (!counts.empty()) counts[i] = {share(c.clusters), share(c.rays), share(c.bounds)};
          }
        }
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  // false: cancelled.
  bool shade_pixels(const ShadePoints& points, std::span<const PixelRun> pixels, Workspace& work,
                    const Progress& progress) const {
    if (progress.cancelled()) return false;
    if (!make_blocks(points, pixels, work, progress)) return false;
    work.total.fill(0.0f);
    work.sum.fill({});
    work.counts.fill({});
    work.pairs.clear();
    work.free_pairs.clear();
    work.heap.clear();
    for (uint32_t root : tree_.roots()) add(root, 0, work.blocks[0].nodes.used, work);
    uint32_t steps = 0;
    while (!work.heap.empty()) {
      if (++steps % 256 == 0 && progress.cancelled()) return false;
      std::pop_heap(work.heap.begin(), work.heap.end());
      const uint32_t index = work.heap.back().pairs;
      work.heap.pop_back();
      refine(index, work);
    }
    return !progress.cancelled();
  }

  void refine(uint32_t index, Workspace& work) const {
    const Pairs e = work.pairs[index];
    work.free_pairs.push_back(index);
    const Block& block = work.blocks[e.block];
    const LightNode& node = tree_.node(e.node);
    const float size2 = node.kind == VplKind::directional ? 0.0f : length2(node.half);
    uint32_t split_lights = 0, split_points = 0;
    for (uint32_t i = 0; i < kLanes; ++i) {
      if (!(e.active >> i & 1)) continue;
      const uint32_t pixel = block.pixel[i];
      const Rgb estimate{e.estimate[0][i], e.estimate[1][i], e.estimate[2][i]};
      const bool single = block.child[i] == kNoBlock;
      if ((node.leaf() && single) || !(e.bound[i] > error_ * work.total[pixel]) ||
          work.counts[pixel].clusters >= max_cut_) {
        work.sum[pixel] += estimate;
        continue;
      }
      work.total[pixel] = std::max(0.0f, work.total[pixel] - luminance(estimate));
      --work.counts[pixel].clusters;
      const bool lights = single || (!node.leaf() && size2 > block.nodes.radius2[i]);
      (lights ? split_lights : split_points) |= 1u << i;
    }
    if (split_lights != 0) {
      add(node.first_child, e.block, split_lights, work);
      add(node.first_child + 1, e.block, split_lights, work);
    }
    for (uint32_t rest = split_points; rest != 0; rest &= rest - 1) {
      const uint32_t child = block.child[std::countr_zero(rest)];
      add(e.node, child, work.blocks[child].nodes.used, work);
    }
  }

  // Puts the pairs of a light cluster and lanes of a block into their pixels' cuts.
  void add(uint32_t node_index, uint32_t block_index, uint32_t active, Workspace& work) const {
    const LightNode& node = tree_.node(node_index);
    const Block& block = work.blocks[block_index];
    const uint32_t index = work.allocate();
    Pairs& e = work.pairs[index];
    e.node = node_index, e.block = block_index;
    pair_bounds(node, block.nodes, e.bound);
    e.active = 0;
    for (uint32_t i = 0; i < kLanes; ++i) {
      if (!(active >> i & 1)) continue;
      ++work.counts[block.pixel[i]].bounds;
      if (e.bound[i] > 0.0f) e.active |= 1u << i;
      e.bound[i] *= block.count[i];
    }
    if (e.active == 0) {
      work.free_pairs.push_back(index);
      return;
    }
    for (auto& channel : e.estimate) std::fill(channel, channel + kLanes, 0.0f);
    const Vpl& light = tree_.lights()[node.light];
    const auto lanes = static_cast<uint16_t>(e.active);
    const size_t row = block.rows == 1 ? 0 : hash64(seed_, node_index) % block.rows;
    LitPoints& lit = work.lit;
    light_points(light, node.intensity, falloff_, work.reps, block.first_rep + row * kLanes, kLanes, lit, &lanes);
    trace_lit(scene_->accel(), light, lit);
    for (size_t k = 0; k < lit.count; ++k) {
      const uint32_t i = lit.index[k];
      ++work.counts[block.pixel[i]].rays;
      if (lit.occluded[k]) continue;
      const Rgb value = Rgb{lit.r[k], lit.g[k], lit.b[k]} * block.count[i];
      e.estimate[0][i] = value.x, e.estimate[1][i] = value.y, e.estimate[2][i] = value.z;
      work.total[block.pixel[i]] += luminance(value);
    }
    float excess = 0.0f;
    for (uint32_t i = 0; i < kLanes; ++i) {
      if (!(e.active >> i & 1)) continue;
      const uint32_t pixel = block.pixel[i];
      ++work.counts[pixel].clusters;
      excess = std::max(excess, e.bound[i] / std::max(work.total[pixel], 1e-30f));
    }
    work.heap.push_back({excess, index});
    std::push_heap(work.heap.begin(), work.heap.end());
  }

  // ---- Trees of the pixels' points ----

  // false: cancelled.
  bool make_blocks(const ShadePoints& points, std::span<const PixelRun> pixels, Workspace& work,
                   const Progress& progress) const {
    work.blocks.clear();
    work.reps.clear();
    // Points of each pixel by place and normal, so that runs of them are clusters.
    ShadePoints sorted;
    std::vector<PixelRun> runs;
    for (const PixelRun& pixel : pixels) {
      if (progress.cancelled()) return false;
      runs.push_back({sorted.size(), pixel.count});
      if (pixel.count <= kLanes) {
        for (size_t i = 0; i < pixel.count; ++i) sorted.push(points.get(pixel.first + i));
        continue;
      }
      ShadePoints own;
      for (size_t i = 0; i < pixel.count; ++i) own.push(points.get(pixel.first + i));
      own.finish();
      Progress unseen;  // a pixel is soon done
      for (uint32_t i : PointTree::build(own, scene_->extent().radius() / 8.0f, unseen).order) sorted.push(own.get(i));
    }
    sorted.finish();
    std::vector<uint32_t> lanes(runs.size());
    std::iota(lanes.begin(), lanes.end(), 0u);
    make_block(sorted, runs, lanes, work);
    work.reps.finish();
    return true;
  }

  // Appends a block of these runs of points, which belong to these pixels, and the blocks below it.
  uint32_t make_block(const ShadePoints& sorted, std::span<const PixelRun> runs, std::span<const uint32_t> pixels,
                      Workspace& work) const {
    const auto index = static_cast<uint32_t>(work.blocks.size());
    work.blocks.emplace_back();
    size_t most = 1;
    for (size_t lane = 0; lane < runs.size(); ++lane) {
      Block& block = work.blocks[index];
      block.nodes.set(lane, sorted, runs[lane].first, runs[lane].count);
      block.count[lane] = static_cast<float>(runs[lane].count);
      block.pixel[lane] = pixels[lane];
      most = std::max(most, runs[lane].count);
    }
    Block& block = work.blocks[index];
    if (runs.size() < kLanes) block.nodes.pad(runs.size());
    block.rows = std::min(most, kMaxRows);
    block.first_rep = work.reps.size();
    for (size_t row = 0; row < block.rows; ++row) {
      for (size_t lane = 0; lane < kLanes; ++lane) {
        const PixelRun& run = runs[std::min(lane, runs.size() - 1)];
        // One point of each stratum of the run; runs shorter than the rows go round.
        const size_t rows = std::min(block.rows, run.count), stratum = row % rows;
        const size_t begin = stratum * run.count / rows, end = (stratum + 1) * run.count / rows;
        Rng rng(seed_, Stage::point_tree, (uint64_t{index} << 32) | lane,
                (uint64_t{sorted.pixel[run.first]} << 8) | row);
        work.reps.push(sorted.get(run.first + begin + rng.next_below(static_cast<uint32_t>(end - begin))));
      }
    }
    for (size_t lane = 0; lane < runs.size(); ++lane) {
      work.blocks[index].child[lane] = kNoBlock;
      const PixelRun& run = runs[lane];
      if (run.count == 1) continue;
      const size_t parts = std::min(run.count, kLanes);
      std::array<PixelRun, kLanes> children;
      std::array<uint32_t, kLanes> pixel;
      for (size_t c = 0; c < parts; ++c) {
        const size_t begin = c * run.count / parts, end = (c + 1) * run.count / parts;
        children[c] = {run.first + begin, end - begin};
        pixel[c] = pixels[lane];
      }
      const uint32_t child = make_block(sorted, {children.data(), parts}, {pixel.data(), parts}, work);
      work.blocks[index].child[lane] = child;
    }
    return index;
  }

  const Scene* scene_ = nullptr;
  LightTree tree_;
  Falloff falloff_;
  float error_ = 0.02f;
  uint32_t max_cut_ = 0;
  uint64_t seed_ = 1;
};

ParamTable params() {
  using P = MultidimensionalParams;
  return describe(
      number<&P::error>(
          "error", "Error",
          "Bounds each pair of clusters, as a share of the pixel's radiance; it is no bound of the pixel's error",
          "of the radiance", 0, 1),
      number<&P::max_cut>("max_cut", "Largest cut", "Most pairs a pixel may use; 0: no limit", "clusters", 0, 1e9));
}

}  // namespace

extern const IntegratorEntry multidimensional_lightcuts_integrator;
const IntegratorEntry multidimensional_lightcuts_integrator = {
    "multidimensional_lightcuts",
    "Multidimensional lightcuts",
    "One cut for all samples of a pixel, with an error bound for each pair: for many samples a pixel",
    "Walter et al. 2006",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<MultidimensionalLightcuts>(); }};

}  // namespace lumicut
