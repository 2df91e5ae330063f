// Lightcuts: each point is lit by a cut through the light tree, refined until every cluster's error bound lies under a
// share of the point's radiance. [Walter et al. 2005, sec. 3-4; tree: Walter et al. 2008, sec. 5]
// Departs: 16 neighbouring points descend together. Each keeps its own cut by its own bounds and its own radiance; what
// they share is the order of refinement (largest excess of any of them first), so that a bound is one SIMD evaluation
// and the shadow rays to a representative are one packet. docs/decisions/0002-packet-lightcuts.md
#include <memory>

#include "clusters/bounds.h"
#include "clusters/light_kernel.h"
#include "clusters/light_tree.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

constexpr uint32_t kAll = (1u << kLanes) - 1;

// Share of the `error` parameter that one cluster may use, so that the mean error of an image stays below the parameter.
constexpr float kClusterShare = 0.75f;

// A cluster in the cuts of the points in `active`.
struct alignas(64) CutEntry {
  float bound[kLanes];
  float estimate[3][kLanes];  // radiance, shadows included
  uint32_t node;
  uint32_t active;   // points whose cut holds this cluster
  uint32_t visible;  // points that see the representative
};

struct HeapItem {
  float excess;  // largest bound over allowed error
  uint32_t entry;
  bool operator<(const HeapItem& o) const { return excess < o.excess || (excess == o.excess && entry > o.entry); }
};

// Working memory of one thread's block, kept between blocks.
struct Workspace {
  PointBlock block;
  LitPoints lit;
  std::vector<CutEntry> entries;
  std::vector<uint32_t> free_entries;
  std::vector<HeapItem> heap;

  uint32_t allocate() {
    if (free_entries.empty()) {
      entries.emplace_back();
      return static_cast<uint32_t>(entries.size() - 1);
    }
    const uint32_t e = free_entries.back();
    free_entries.pop_back();
    return e;
  }
};

class Lightcuts final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const float clamp = clamp_distance(params, scene);
    clamp2_ = clamp * clamp;
    error_ = kClusterShare * static_cast<float>(params.real("error"));
    const auto limit = params.integer("max_cut");
    max_cut_ = limit == 0 ? std::numeric_limits<uint32_t>::max() : static_cast<uint32_t>(limit);
    seed_ = static_cast<uint64_t>(params.integer("seed"));
    const PhaseTimer timer(context.stats, "light tree");
    tree_ = LightTree::build(vpls.lights,
                             {LightTree::method_of(params.choice("tree")), 2.0f * scene.radius(),
                              static_cast<uint32_t>(params.integer("representatives")), seed_},
                             context.progress);
    context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes()));
  }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    parallel_chunks(points.size(), 16 * kLanes, [&](size_t begin, size_t end) {
      auto work = std::make_unique<Workspace>();
      Counters total;
      for (size_t first = begin; first < end; first += kLanes) {
        if (context.progress.cancelled()) return;
        shade_block(points, first, std::min(kLanes, end - first), radiance, counts, *work, total);
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  // State of one block's points while their cuts grow.
  struct Block {
    alignas(64) float total[kLanes] = {};   // luminance of the cut's estimate
    alignas(64) float sum[3][kLanes] = {};  // radiance of clusters that are final
    uint32_t cut[kLanes] = {}, rays[kLanes] = {};
    uint32_t bounds[kLanes] = {};
    uint32_t slot = 0;
  };

  void shade_block(const ShadePoints& points, size_t first, size_t count, std::span<Rgb> radiance,
                   std::span<PointCounts> counts, Workspace& work, Counters& total) const {
    work.block.load(points, first);
    Block b;
    if (tree_.slot_count() > 1)
      b.slot = Rng(seed_, Stage::representative, points.pixel[first], first).next_below(tree_.slot_count());
    const uint32_t all = count == kLanes ? kAll : (1u << count) - 1;
    for (uint32_t root : tree_.roots()) add(points, first, root, all, nullptr, work, b);
    while (!work.heap.empty()) {
      std::pop_heap(work.heap.begin(), work.heap.end());
      const uint32_t index = work.heap.back().entry;
      work.heap.pop_back();
      CutEntry& e = work.entries[index];
      uint32_t refine = 0;
      for (size_t i = 0; i < kLanes; ++i)
        refine |= static_cast<uint32_t>(e.bound[i] > error_ * b.total[i] && b.cut[i] < max_cut_) << i;
      refine &= e.active;
      settle(e, e.active & ~refine, b);
      if (refine != 0) {
        for (size_t i = 0; i < kLanes; ++i)
          if (refine >> i & 1) {
            b.total[i] = std::max(0.0f, b.total[i] - luminance({e.estimate[0][i], e.estimate[1][i], e.estimate[2][i]}));
            --b.cut[i];
          }
        const uint32_t child = tree_.node(e.node).first_child;
        const CutEntry parent = e;  // `add` may move the entries
        work.free_entries.push_back(index);
        add(points, first, child, refine, &parent, work, b);
        add(points, first, child + 1, refine, &parent, work, b);
      } else {
        work.free_entries.push_back(index);
      }
    }
    for (size_t i = 0; i < count; ++i) {
      radiance[first + i] = {b.sum[0][i], b.sum[1][i], b.sum[2][i]};
      if (!counts.empty()) counts[first + i] = {b.cut[i], b.rays[i], b.bounds[i]};
      total.clusters += b.cut[i], total.rays += b.rays[i], total.bounds += b.bounds[i];
    }
    total.points += count;
  }

  // The cluster stays in the cuts of `lanes` for good.
  static void settle(const CutEntry& e, uint32_t lanes, Block& b) {
    for (int k = 0; k < 3; ++k)
      for (size_t i = 0; i < kLanes; ++i) b.sum[k][i] += lanes >> i & 1 ? e.estimate[k][i] : 0.0f;
  }

  // Puts a node into the cuts of the points in `active`; `parent` holds what its parent knew of the shared
  // representative.
  void add(const ShadePoints& points, size_t first, uint32_t node_index, uint32_t active, const CutEntry* parent,
           Workspace& work, Block& b) const {
    const LightNode& node = tree_.node(node_index);
    const uint32_t index = work.allocate();
    CutEntry& e = work.entries[index];
    e.node = node_index;
    light_node_bounds(node, work.block, clamp2_, e.bound);
    uint32_t reached = 0;
    for (size_t i = 0; i < kLanes; ++i) reached |= static_cast<uint32_t>(e.bound[i] > 0.0f) << i;
    for (size_t i = 0; i < kLanes; ++i) b.bounds[i] += active >> i & 1;
    e.active = active & reached;
    if (e.active == 0) {
      work.free_entries.push_back(index);
      return;
    }

    const uint32_t rep = tree_.representative(node_index, b.slot);
    const Vpl& light = tree_.lights()[rep];
    LitPoints& lit = work.lit;
    light_points(light, node.intensity, clamp2_, points, first, kLanes, lit);
    keep_lanes(lit, e.active);
    if (parent != nullptr && tree_.representative(parent->node, b.slot) == rep) {
      for (size_t i = 0; i < lit.count; ++i) lit.occluded[i] = !(parent->visible >> lit.index[i] & 1);
      e.visible = parent->visible;
    } else {
      trace_lit(scene_->accel(), light, lit);
      e.visible = 0;
      for (size_t i = 0; i < lit.count; ++i) {
        e.visible |= static_cast<uint32_t>(lit.occluded[i] == 0) << lit.index[i];
        ++b.rays[lit.index[i]];
      }
    }
    for (auto& channel : e.estimate) std::fill(channel, channel + kLanes, 0.0f);
    for (size_t i = 0; i < lit.count; ++i) {
      if (lit.occluded[i]) continue;
      const uint32_t lane = lit.index[i];
      e.estimate[0][lane] = lit.r[i], e.estimate[1][lane] = lit.g[i], e.estimate[2][lane] = lit.b[i];
      b.total[lane] += luminance({lit.r[i], lit.g[i], lit.b[i]});
    }
    for (size_t i = 0; i < kLanes; ++i) b.cut[i] += e.active >> i & 1;
    if (node.leaf()) {  // exact
      settle(e, e.active, b);
      work.free_entries.push_back(index);
      return;
    }
    float excess = 0.0f;
    for (size_t i = 0; i < kLanes; ++i)
      if (e.active >> i & 1) excess = std::max(excess, e.bound[i] / std::max(b.total[i], 1e-30f));
    work.heap.push_back({excess, index});
    std::push_heap(work.heap.begin(), work.heap.end());
  }

  static void keep_lanes(LitPoints& lit, uint32_t lanes) {
    size_t kept = 0;
    for (size_t i = 0; i < lit.count; ++i) {
      if (!(lanes >> lit.index[i] & 1)) continue;
      lit.x[kept] = lit.x[i], lit.y[kept] = lit.y[i], lit.z[kept] = lit.z[i];
      lit.r[kept] = lit.r[i], lit.g[kept] = lit.g[i], lit.b[kept] = lit.b[i];
      lit.index[kept++] = lit.index[i];
    }
    lit.count = kept;
  }

  const Scene* scene_ = nullptr;
  LightTree tree_;
  float clamp2_ = 0.0f, error_ = 0.02f;
  uint32_t max_cut_ = 0;
  uint64_t seed_ = 1;
};

std::vector<ParamInfo> params() {
  return {
      {"error", "Error", "Error to stay under, as a share of the point's radiance; bounds each cluster", "of the radiance",
       ParamType::real, "0.02", 0, 1},
      {"max_cut", "Largest cut", "Most clusters a point may use; 0: no limit", "clusters", ParamType::integer, "0", 0,
       1e9},
      {"representatives", "Representatives",
       "Choices of representative lights that blocks of points draw from: 1 gives the smoothest image, more turn "
       "banding into noise",
       "", ParamType::integer, "1", 1, 64},
      {"tree", "Light tree", "How the lights are clustered: agglomerative is best, the others are baselines", "",
       ParamType::choice, "agglomerative", 0, 0, "agglomerative|divisive_3d|divisive_6d"},
  };
}

}  // namespace

extern const IntegratorEntry lightcuts_integrator;
const IntegratorEntry lightcuts_integrator = {
    "lightcuts",
    "Lightcuts",
    "A cut through the light tree for each point, with a bounded error",
    "Walter et al. 2005; Walter et al. 2008, sec. 5",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<Lightcuts>(); }};

}  // namespace lumicut
