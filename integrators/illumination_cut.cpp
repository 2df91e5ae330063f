// IlluminationCut: pairs of a cluster of points and a cluster of lights, refined together until the light of each pair
// is bounded under a share of what its darkest point receives. [Bus et al. 2015; thesis ch. 3, Alg. 4 and 5,
// Eq. 3.3-3.4] Departs: 16 point clusters are tested against a light cluster at once, and the 256 points of a group
// descend the light tree together, each with bounds of its own at the end, so that a pair is dense SIMD loops and
// shadow packets; phase I keeps irradiance, so that textures are no error of it; see
// docs/decisions/0006-illumination-cut.md
#include <array>
#include <bit>
#include <memory>

#include "bsdf/point_bsdf.h"
#include "clustering/bounds.h"
#include "clustering/light_kernel.h"
#include "clustering/light_tree.h"
#include "clustering/pair_bounds.h"
#include "clustering/point_tree.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

constexpr size_t kLeaf = PointTree::kLeaf, kGroup = PointTree::kGroup, kRegion = PointTree::kRegion;
static_assert(kGroup == kMaxLit);

enum class Visibility { full, sampling, unbiased };

// Which points of a group are meant, a bit each.
using GroupLanes = std::array<uint16_t, kLanes>;

struct RegionItem {
  uint32_t node;
  uint32_t groups;  // a bit each
};

struct GroupItem {
  uint32_t node;
  GroupLanes lanes;
};

// Share of the light that a surface sends back, to first order: what turns irradiance into radiance.
float reflectance(const SurfacePoint& p) {
  const float specular = p.lobe != kCosineLobe ? luminance(specular_albedo(p)) * std::numbers::inv_pi_v<float>
                                               : luminance(p.specular) * (2.0f / (p.shape + 1.0f));
  return luminance(p.diffuse) + specular;
}

// Working memory of one region.
struct Workspace {
  LitPoints lit;
  float weight[kMaxLit];  // visibility of the lit points, or its estimate
  uint8_t known[kMaxLit];
  // Points that are asked for at once.
  float x[kMaxLit + kLanes], y[kMaxLit + kLanes], z[kMaxLit + kLanes];
  uint32_t asked[kMaxLit];
  uint8_t occluded[kMaxLit + kLanes];
  size_t asked_count = 0;
  std::vector<RegionItem> region_stack;
  std::vector<GroupItem> group_stack;
  PointBlock blocks[kRegion / kLeaf];
  float sum[3][kRegion];
  uint32_t clusters[kRegion], rays[kRegion], point_bounds[kRegion];
  uint32_t leaf_bounds[kRegion / kLeaf], group_bounds[kLanes];
  float allowed[kRegion], leaf_allowed[kRegion / kLeaf], group_allowed[kLanes];  // error of a pair
  Counters total;
};

class IlluminationCut final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    const float clamp = clamp_distance(params, scene);
    clamp2_ = clamp * clamp;
    error_ = static_cast<float>(params.real("error"));
    floor_ = static_cast<float>(params.real("dark_floor"));
    const std::string& visibility = params.choice("visibility");
    visibility_ = visibility == "full"       ? Visibility::full
                  : visibility == "sampling" ? Visibility::sampling
                                             : Visibility::unbiased;
    const std::string& representative = params.choice("representative");
    stochastic_ = representative == "stochastic";
    seed_ = static_cast<uint64_t>(params.integer("seed"));
    const float separation = static_cast<float>(params.real("coarse_separation"));
    separation2_ = separation * separation;
    const PhaseTimer timer(context.stats, "light tree");
    tree_ = LightTree::build(vpls.lights, {LightTree::Method::agglomerative, 2.0f * scene.radius(), 1, seed_},
                             context.progress);
    means_.clear();
    if (representative == "mean") find_means(context.progress);
    context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes() + means_.size() * sizeof(Mean)));
  }

  size_t batch_size() const override { return size_t{1} << 17; }

  void shade(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    std::fill(radiance.begin(), radiance.end(), Rgb{});
    std::fill(counts.begin(), counts.end(), PointCounts{});
    if (batch.size() == 0 || tree_.roots().empty()) return;
    // Isolated: a thread that waits here must not start another batch, or memory would grow.
    tbb::this_task_arena::isolate([&] { shade_batch(batch, radiance, counts, context); });
    context.progress.check();
  }

 private:
  // What stands for a node's lights: where shadow rays go, and what shines.
  struct Representative {
    const Vpl& seen;
    Vpl shining;
    const DirectionScatter* scatter = nullptr;
  };
  Representative representative(uint32_t index) const {
    const LightNode& node = tree_.node(index);
    if (means_.empty() || node.leaf()) return {tree_.lights()[node.light], tree_.lights()[node.light]};
    const Mean& mean = means_[index];
    Representative r{tree_.lights()[mean.light], tree_.lights()[mean.light]};
    // The profile of a spot is bent too much for means.
    if (node.kind == VplKind::spot) return r;
    r.shining.position = mean.place;
    if (node.kind == VplKind::sphere) r.shining.radius() = mean.radius;
    if (node.kind == VplKind::oriented || node.kind == VplKind::sphere)
      r.shining.normal = mean.direction, r.scatter = &mean.scatter;
    return r;
  }

  // What a node's lights together give to a point if nothing stands between, about and up to a factor.
  float gives(uint32_t index, const Vec3f& position, const Vec3f& normal) const {
    constexpr float kHorizon = 0.01f;  // some of the lights may be above it where their mean is below
    const LightNode& node = tree_.node(index);
    const Mean& mean = means_[index];
    const float light = luminance(node.intensity);
    if (node.kind == VplKind::directional) return light * std::max(kHorizon, -dot(normal, mean.direction));
    const Vec3f v = mean.place - position;
    const float dist2 = std::max(length2(v), 1e-30f);
    const Vec3f to_light = v / std::sqrt(dist2);
    const bool faces = node.kind == VplKind::oriented || node.kind == VplKind::sphere;
    const float cosine = faces ? mean_cosine(mean.direction, mean.scatter, to_light) : 1.0f;
    const float least2 = node.kind == VplKind::sphere ? mean.radius * mean.radius : clamp2_;
    return light * cosine * std::max(kHorizon, dot(normal, to_light)) / std::max(dist2, least2);
  }

  // One of a node's lights, drawn in proportion to about what each gives to the point. The mean shines for all of them:
  // a light that faces away, or any one that is the same for every pair, would cast other shadows than they do.
  const Vpl& draw(uint32_t index, const Vec3f& position, const Vec3f& normal, float random) const {
    while (!tree_.node(index).leaf()) {
      const uint32_t left = tree_.node(index).first_child;
      const float l = gives(left, position, normal), r = gives(left + 1, position, normal);
      const float p = l + r > 0.0f ? l / (l + r) : 0.5f;
      const bool go_left = random < p || !(r > 0.0f);
      random = go_left ? random / p : (random - p) / (1.0f - p);
      index = left + static_cast<uint32_t>(!go_left);
    }
    return tree_.lights()[tree_.node(index).light];
  }

  // Means by luminance, and of the two children's central lights the one nearer to them: it casts the shadows of the
  // coarse image.
  void find_means(const Progress& progress) {
    const auto count = static_cast<uint32_t>(tree_.node_count());
    means_.resize(count);
    for (uint32_t n = count; n-- > 0;) {  // children come after their parents
      if (n % 65536 == 0) progress.check();
      const LightNode& node = tree_.node(n);
      Mean& mean = means_[n];
      if (node.leaf()) {
        const Vpl& light = tree_.lights()[node.light];
        mean = {light.position, light.normal, {}, node.light, light.kind == VplKind::sphere ? light.radius() : 0.0f};
        continue;
      }
      const uint32_t left = node.first_child, right = left + 1;
      const float l = luminance(tree_.node(left).intensity), r = luminance(tree_.node(right).intensity);
      const float share = l + r > 0.0f ? l / (l + r) : 0.5f;
      mean.place = means_[left].place * share + means_[right].place * (1.0f - share);
      mean.direction = means_[left].direction * share + means_[right].direction * (1.0f - share);
      mean.radius = means_[left].radius * share + means_[right].radius * (1.0f - share);
      const float size2 = std::max(length2(node.half), 1e-30f);
      const DirectionScatter &a = means_[left].scatter, &b = means_[right].scatter;
      const Vec3f apart = means_[left].direction - means_[right].direction;
      const float other = 1.0f - share, k = share * other * 0.63661977f;  // 2/π
      mean.scatter = {
          a.xx * share + b.xx * other + k * apart.x * apart.x, a.yy * share + b.yy * other + k * apart.y * apart.y,
          a.zz * share + b.zz * other + k * apart.z * apart.z, a.xy * share + b.xy * other + k * apart.x * apart.y,
          a.xz * share + b.xz * other + k * apart.x * apart.z, a.yz * share + b.yz * other + k * apart.y * apart.z};
      const auto distance = [&](uint32_t child) {
        const Vpl& light = tree_.lights()[means_[child].light];
        return length2(light.position - mean.place) / size2 + length2(light.normal - mean.direction);
      };
      mean.light = means_[distance(left) <= distance(right) ? left : right].light;
    }
  }

  void shade_batch(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
                   ShadeContext context) const {
    PointTree points;
    {
      const PhaseTimer timer(context.stats, "point tree");
      points = PointTree::build(batch, scene_->radius() / 8.0f, context.progress);
    }
    std::vector<float> coarse;
    {
      const PhaseTimer timer(context.stats, "coarse image");
      coarse = coarse_image(points, context);
    }
    const PhaseTimer timer(context.stats, "pairs");
    parallel_chunks(points.region_count(), 1, [&](size_t region, size_t) {
      if (context.progress.cancelled()) return;
      const auto work = std::make_unique<Workspace>();
      start_region(points, region, coarse, *work);
      region_pairs(points, region, *work, context.progress);
      const size_t first = region * kRegion, n = std::min(kRegion, points.size() - first);
      for (size_t i = 0; i < n; ++i) {
        const uint32_t at = points.order[first + i];
        radiance[at] = {work->sum[0][i], work->sum[1][i], work->sum[2][i]};
        work->total.clusters += work->clusters[i], work->total.rays += work->rays[i];
        if (counts.empty()) continue;
        // A bound of a cluster is shared by its points. [thesis sec. 3.3, Fig. 3.8]
        const float bounds = static_cast<float>(work->point_bounds[i]) +
                             static_cast<float>(work->leaf_bounds[i / kLeaf]) / static_cast<float>(kLeaf) +
                             static_cast<float>(work->group_bounds[i / kGroup]) / static_cast<float>(kGroup);
        counts[at] = {work->clusters[i], work->rays[i], static_cast<uint32_t>(std::ceil(bounds))};
      }
      work->total.points = n;
      context.stats.add(work->total);
    });
  }

  // ---- Phase I: the coarse image. [thesis sec. 3.2, "Phase I"] ----

  // Luminance of each point, roughly.
  std::vector<float> coarse_image(const PointTree& points, ShadeContext context) const {
    // One point stands for each leaf and each group: the middle one in the order of the tree.
    const auto representatives = [&](size_t per_node) {
      ShadePoints reps;
      for (size_t first = 0; first < points.size(); first += per_node)
        reps.push(points.points.get(first + std::min(per_node, points.size() - first) / 2));
      reps.finish();
      return reps;
    };
    const ShadePoints leaf_reps = representatives(kLeaf), group_reps = representatives(kGroup);
    std::vector<float> leaf(round_up_to_lanes(points.leaf_count()), 0.0f),
        group(round_up_to_lanes(points.group_count()), 0.0f);
    parallel_chunks(points.region_count(), 1, [&](size_t region, size_t) {
      Counters total;
      auto lit = std::make_unique<LitPoints>();
      std::vector<RegionItem> stack, inner;
      for (uint32_t root : tree_.roots()) stack.push_back({root, points.groups[region].used});
      uint32_t steps = 0;
      while (!stack.empty()) {
        const RegionItem item = stack.back();
        stack.pop_back();
        if (++steps % 64 == 0 && context.progress.cancelled()) return;
        const auto [split, descend] = coarse_pairs(points.groups[region], group_reps, region * kLanes, item, true, *lit,
                                                   group.data() + region * kLanes, total);
        for (uint32_t rest = descend; rest != 0; rest &= rest - 1) {
          const size_t g = region * kLanes + static_cast<size_t>(std::countr_zero(rest));
          inner.push_back({item.node, points.leaves[g].used});
          while (!inner.empty()) {
            if (++steps % 64 == 0 && context.progress.cancelled()) return;
            const RegionItem below = inner.back();
            inner.pop_back();
            const uint32_t again = coarse_pairs(points.leaves[g], leaf_reps, g * kLanes, below, false, *lit,
                                                leaf.data() + g * kLanes, total)
                                       .first;
            push_children(below.node, again, inner);
          }
        }
        push_children(item.node, split, stack);
      }
      context.stats.add(total);
    });
    context.progress.check();
    // Pushed down: what a group receives, its leaves and points do.
    std::vector<float> coarse(round_up_to_lanes(points.size()));
    for (size_t i = 0; i < points.size(); ++i)
      coarse[i] = (leaf[i / kLeaf] + group[i / kGroup]) * reflectance(points.points.get(i));
    double mean = 0.0;
    for (size_t i = 0; i < points.size(); ++i) mean += coarse[i];
    // Black points would ask for every light; nobody sees a small share of the mean.
    const auto least = static_cast<float>(floor_ * mean / static_cast<double>(points.size()));
    for (size_t i = 0; i < points.size(); ++i) coarse[i] = std::max(coarse[i], least);
    return coarse;
  }

  void push_children(uint32_t node, uint32_t lanes, std::vector<RegionItem>& stack) const {
    if (lanes == 0) return;
    const uint32_t child = tree_.node(node).first_child;
    stack.push_back({child + 1, lanes});
    stack.push_back({child, lanes});
  }

  // Adds the pairs of `item` that are far enough apart to `irradiance`; returns the lanes whose lights, and those whose
  // points are to be refined.
  std::pair<uint32_t, uint32_t> coarse_pairs(const PointNodes& nodes, const ShadePoints& reps, size_t first,
                                             const RegionItem& item, bool may_descend, LitPoints& lit,
                                             float* irradiance, Counters& total) const {
    const LightNode& node = tree_.node(item.node);
    alignas(64) float bounds[kLanes], distances2[kLanes];
    pair_bounds(node, nodes, clamp2_, bounds);
    pair_distances2(node, nodes, clamp2_, distances2);
    const float size2 = node.kind == VplKind::directional ? 0.0f : length2(node.half);
    const bool narrow = node.leaf() || node.kind == VplKind::omni || node.cos_half > 0.94f;  // 20 degrees
    uint32_t accept = 0, split = 0, descend = 0;
    for (uint32_t i = 0; i < kLanes; ++i) {
      const bool small_lights = node.leaf() || (narrow && size2 < separation2_ * distances2[i]);
      const bool small_points = !may_descend || nodes.radius2[i] < separation2_ * distances2[i];
      const bool reached = bounds[i] > 0.0f;
      accept |= static_cast<uint32_t>(reached && small_lights && small_points) << i;
      const bool lights_first = !small_lights && (small_points || size2 >= nodes.radius2[i]);
      split |= static_cast<uint32_t>(reached && lights_first) << i;
      descend |= static_cast<uint32_t>(reached && !lights_first && !small_points) << i;
    }
    accept &= item.groups, split &= item.groups, descend &= item.groups;
    total.bounds += static_cast<uint64_t>(std::popcount(item.groups));
    if (accept != 0) {
      const Representative light = representative(item.node);
      const auto lanes = static_cast<uint16_t>(accept);
      light_points(light.shining, node.intensity, clamp2_, reps, first, kLanes, lit, &lanes, light.scatter);
      trace_lit(scene_->accel(), light.seen, lit);
      total.rays += lit.count;
      for (size_t i = 0; i < lit.count; ++i) {
        if (lit.occluded[i]) continue;
        const uint32_t lane = lit.index[i];
        irradiance[lane] += luminance({lit.r[i], lit.g[i], lit.b[i]}) / reflectance(reps.get(first + lane));
      }
    }
    return {split, descend};
  }

  // ---- Phase II: the pairs. [thesis Alg. 4] ----

  void start_region(const PointTree& points, size_t region, const std::vector<float>& coarse, Workspace& work) const {
    for (auto& channel : work.sum) std::fill(channel, channel + kRegion, 0.0f);
    std::fill(work.clusters, work.clusters + kRegion, 0u);
    std::fill(work.rays, work.rays + kRegion, 0u);
    std::fill(work.point_bounds, work.point_bounds + kRegion, 0u);
    std::fill(work.leaf_bounds, work.leaf_bounds + kRegion / kLeaf, 0u);
    std::fill(work.group_bounds, work.group_bounds + kLanes, 0u);
    const size_t first = region * kRegion, n = std::min(kRegion, points.size() - first);
    const float none = std::numeric_limits<float>::infinity();
    std::fill(work.allowed, work.allowed + kRegion, none);
    std::fill(work.leaf_allowed, work.leaf_allowed + kRegion / kLeaf, none);
    std::fill(work.group_allowed, work.group_allowed + kLanes, none);
    for (size_t i = 0; i < n; ++i) {
      const float allowed = error_ * coarse[first + i];
      work.allowed[i] = allowed;
      work.leaf_allowed[i / kLeaf] = std::min(work.leaf_allowed[i / kLeaf], allowed);
      work.group_allowed[i / kGroup] = std::min(work.group_allowed[i / kGroup], allowed);
    }
    for (size_t leaf = 0; leaf * kLeaf < n; ++leaf) work.blocks[leaf].load(points.points, first + leaf * kLeaf);
  }

  void region_pairs(const PointTree& points, size_t region, Workspace& work, const Progress& progress) const {
    const PointNodes& nodes = points.groups[region];
    auto& stack = work.region_stack;
    for (uint32_t root : tree_.roots()) stack.push_back({root, nodes.used});
    while (!stack.empty()) {
      const RegionItem item = stack.back();
      stack.pop_back();
      if (progress.cancelled()) return;
      const LightNode& node = tree_.node(item.node);
      alignas(64) float bounds[kLanes];
      pair_bounds(node, nodes, clamp2_, bounds);
      work.total.bounds += static_cast<uint64_t>(std::popcount(item.groups));
      const float size2 = node.kind == VplKind::directional ? 0.0f : length2(node.half);
      uint32_t split = 0;
      for (uint32_t i = 0; i < kLanes; ++i) {
        if (!(item.groups >> i & 1)) continue;
        ++work.group_bounds[i];
        if (!(bounds[i] > 0.0f)) continue;
        if (bounds[i] <= work.group_allowed[i] || node.leaf()) {
          add_pair(points, region, i, item.node, lanes_of(points, region, i), work);
        } else if (size2 > nodes.radius2[i]) {
          split |= 1u << i;
        } else {
          group_pairs(points, region, i, item.node, work, progress);
        }
      }
      push_children(item.node, split, stack);
    }
  }

  static GroupLanes lanes_of(const PointTree& points, size_t region, size_t group) {
    GroupLanes lanes;
    const size_t first = region * kRegion + group * kGroup;
    for (size_t leaf = 0; leaf < kLanes; ++leaf) {
      const size_t at = first + leaf * kLeaf;
      const size_t n = at < points.size() ? std::min(kLeaf, points.size() - at) : 0;
      lanes[leaf] = static_cast<uint16_t>((1u << n) - 1);
    }
    return lanes;
  }

  // A group's points against the lights under `root`.
  void group_pairs(const PointTree& points, size_t region, size_t group, uint32_t root, Workspace& work,
                   const Progress& progress) const {
    const PointNodes& nodes = points.leaves[region * kLanes + group];
    auto& stack = work.group_stack;
    stack.push_back({root, lanes_of(points, region, group)});
    const size_t first_leaf = group * kLanes;
    uint32_t steps = 0;
    while (!stack.empty()) {
      GroupItem item = stack.back();
      stack.pop_back();
      if (++steps % 64 == 0 && progress.cancelled()) {
        stack.clear();
        return;
      }
      const LightNode& node = tree_.node(item.node);
      const float size2 = node.kind == VplKind::directional ? 0.0f : length2(node.half);
      alignas(64) float bounds[kLanes];
      pair_bounds(node, nodes, clamp2_, bounds);
      GroupLanes accepted{};
      bool any = false, rest = false;
      for (size_t j = 0; j < kLanes; ++j) {
        const uint32_t lanes = item.lanes[j];
        if (lanes == 0) continue;
        const size_t leaf = first_leaf + j;
        ++work.leaf_bounds[leaf];
        ++work.total.bounds;
        if (!(bounds[j] > 0.0f)) {
          item.lanes[j] = 0;
        } else if (bounds[j] <= work.leaf_allowed[leaf] || node.leaf()) {
          accepted[j] = static_cast<uint16_t>(lanes);
          item.lanes[j] = 0;
          any = true;
        } else if (size2 > nodes.radius2[j]) {
          rest = true;  // no point of the leaf would do better by much
        } else {
          alignas(64) float point_bounds[kLanes];
          light_node_bounds(node, work.blocks[leaf], clamp2_, point_bounds);
          const float* allowed = work.allowed + leaf * kLeaf;
          uint32_t ok = 0, reached = 0;
          for (size_t i = 0; i < kLanes; ++i) {
            reached |= static_cast<uint32_t>(point_bounds[i] > 0.0f) << i;
            ok |= static_cast<uint32_t>(point_bounds[i] <= allowed[i]) << i;
            work.point_bounds[leaf * kLeaf + i] += lanes >> i & 1;
          }
          work.total.bounds += static_cast<uint64_t>(std::popcount(lanes));
          accepted[j] = static_cast<uint16_t>(lanes & reached & ok);
          item.lanes[j] = static_cast<uint16_t>(lanes & reached & ~ok);
          any = any || accepted[j] != 0;
          rest = rest || item.lanes[j] != 0;
        }
      }
      if (any) add_pair(points, region, group, item.node, accepted, work);
      if (!rest) continue;
      item.node = node.first_child + 1;
      stack.push_back(item);
      item.node = node.first_child;
      stack.push_back(item);
    }
  }

  // Adds the light of a node, by its representative, to points of a group.
  void add_pair(const PointTree& points, size_t region, size_t group, uint32_t index, const GroupLanes& lanes,
                Workspace& work) const {
    const LightNode& node = tree_.node(index);
    if (!stochastic_ || node.leaf()) {
      const Representative light = representative(index);
      const Shadow shadow = node.leaf()                                    ? Shadow::exact
                            : means_.empty() || node.kind == VplKind::spot ? Shadow::of_seen
                                                                           : Shadow::of_drawn;
      add_light(points, region, group, light, node.intensity, lanes, shadow, index, work);
      return;
    }
    // One representative a leaf of points, drawn in proportion to luminance: unbiased, and its error is noise.
    for (size_t j = 0; j < kLanes; ++j) {
      if (lanes[j] == 0) continue;
      GroupLanes one{};
      one[j] = lanes[j];
      const size_t first = region * kRegion + group * kGroup + j * kLeaf;
      Rng rng(seed_, Stage::representative, (uint64_t{points.points.pixel[first]} << 32) | first, index);
      const LightNode* at = &node;
      while (!at->leaf()) {
        const LightNode &left = tree_.node(at->first_child), &right = tree_.node(at->first_child + 1);
        const float l = luminance(left.intensity), r = luminance(right.intensity);
        at = rng.next_float() * (l + r) < l ? &left : &right;
      }
      const float share = luminance(node.intensity) / luminance(at->intensity);
      const Vpl& light = tree_.lights()[at->light];
      add_light(points, region, group, {light, light}, at->intensity * share, one, Shadow::of_seen, index, work);
    }
  }

  // Whose shadow: of the light that alone is meant, traced whole; of the representative that is seen; of a drawn one.
  enum class Shadow { exact, of_seen, of_drawn };

  void add_light(const PointTree& points, size_t region, size_t group, const Representative& light,
                 const Rgb& intensity, const GroupLanes& lanes, Shadow shadow, uint32_t index, Workspace& work) const {
    const size_t base = group * kGroup, first = region * kRegion + base;
    LitPoints& lit = work.lit;
    light_points(light.shining, intensity, clamp2_, points.points, first, std::min(kGroup, points.size() - first), lit,
                 lanes.data(), light.scatter);
    if (lit.count == 0) return;
    const Vpl* seen = &light.seen;
    if (shadow == Shadow::of_drawn) {
      const size_t middle = first + lit.index[lit.count / 2];
      Rng rng(seed_, Stage::representative, (uint64_t{points.points.pixel[first]} << 32) | first, index);
      seen = &draw(index, points.points.position_at(middle), points.points.normal_at(middle), rng.next_float());
    }
    if (visibility_ == Visibility::full || shadow == Shadow::exact || lit.count < kSampleFrom) {
      trace_lit(scene_->accel(), *seen, lit);
      for (size_t i = 0; i < lit.count; ++i) {
        work.weight[i] = lit.occluded[i] ? 0.0f : 1.0f;
        ++work.rays[base + lit.index[i]];
      }
    } else {
      sample_visibility(*seen, base, index, first, work);
    }
    for (size_t i = 0; i < lit.count; ++i) {
      const size_t at = base + lit.index[i];
      if (work.weight[i] == 0.0f) continue;
      work.sum[0][at] += work.weight[i] * lit.r[i];
      work.sum[1][at] += work.weight[i] * lit.g[i];
      work.sum[2][at] += work.weight[i] * lit.b[i];
      ++work.clusters[at];
    }
  }

  // ---- Adaptive visibility. [thesis Alg. 5] ----

  static constexpr size_t kSampleFrom = 8;

  static void ask(uint32_t i, Workspace& work) {
    const size_t k = work.asked_count++;
    work.asked[k] = i;
    work.x[k] = work.lit.x[i], work.y[k] = work.lit.y[i], work.z[k] = work.lit.z[i];
  }

  void answer(const Vpl& light, size_t base, Workspace& work) const {
    const bool directional = light.kind == VplKind::directional;
    scene_->accel().occluded_from_point(directional ? -light.normal : light.position, directional, work.x, work.y,
                                        work.z, work.asked_count, work.occluded);
    for (size_t k = 0; k < work.asked_count; ++k) {
      const uint32_t i = work.asked[k];
      work.known[i] = 1;
      work.weight[i] = work.occluded[k] ? 0.0f : 1.0f;
      ++work.rays[base + work.lit.index[i]];
    }
    work.asked_count = 0;
  }

  // Fills `weight` from few rays: one of each of 8 to 32 equal runs of points, and all where they disagree. Packets of
  // neighbours cost so little beside packets of spread samples that a second round of samples does not pay.
  void sample_visibility(const Vpl& light, size_t base, uint32_t index, size_t first, Workspace& work) const {
    const auto n = static_cast<uint32_t>(work.lit.count);
    const uint32_t runs = n > 128 ? 32 : n > 32 ? 16 : 8;
    std::fill(work.known, work.known + n, uint8_t{0});
    Rng rng(seed_, Stage::visibility, first, index);
    uint32_t samples[32];
    const auto run_begin = [&](uint32_t r) { return r * n / runs; };
    for (uint32_t r = 0; r < runs; ++r) {
      samples[r] = run_begin(r) + rng.next_below(run_begin(r + 1) - run_begin(r));
      ask(samples[r], work);
    }
    answer(light, base, work);
    const float seen = work.weight[samples[0]];
    bool agree = true;
    for (uint32_t r = 1; r < runs; ++r) agree = agree && work.weight[samples[r]] == seen;
    if (!agree) {
      for (uint32_t i = 0; i < n; ++i)
        if (!work.known[i]) ask(i, work);
      if (work.asked_count > 0) answer(light, base, work);
      return;
    }
    std::fill(work.weight, work.weight + n, seen);
    if (visibility_ == Visibility::unbiased) correct(light, base, seen, rng, work);
  }

  // What was inferred is a control variate: some of it is traced, and its error taken off as often more.
  void correct(const Vpl& light, size_t base, float inferred, Rng& rng, Workspace& work) const {
    const auto n = static_cast<uint32_t>(work.lit.count);
    for (uint32_t i = 0; i < n; ++i)
      if (!work.known[i] && rng.next_below(kCorrectOneIn) == 0) ask(i, work);
    const size_t asked = work.asked_count;
    if (asked == 0) return;
    answer(light, base, work);
    for (size_t k = 0; k < asked; ++k) {
      float& w = work.weight[work.asked[k]];
      w = inferred + (w - inferred) * static_cast<float>(kCorrectOneIn);
    }
  }

  static constexpr uint32_t kCorrectOneIn = 8;

  const Scene* scene_ = nullptr;
  LightTree tree_;
  struct Mean {
    Vec3f place, direction;
    DirectionScatter scatter;
    uint32_t light = 0;  // the central one
    float radius = 0.0f;
  };
  std::vector<Mean> means_;  // a node; empty: the tree's own representatives serve
  float clamp2_ = 0.0f, error_ = 0.02f, floor_ = 0.01f, separation2_ = 0.0225f;
  Visibility visibility_ = Visibility::sampling;
  bool stochastic_ = false;
  uint64_t seed_ = 1;
};

std::vector<ParamInfo> params() {
  return {
      {"error", "Error",
       "Bounds each pair of clusters, as a share of its darkest point's radiance; it is no bound of the pixel's error",
       "of the radiance", ParamType::real, "0.02", 0, 1},
      {"visibility", "Visibility",
       "full: every shadow ray; sampling: few rays a pair, more where they disagree; unbiased: as sampling, with "
       "random "
       "corrections",
       "", ParamType::choice, "sampling", 0, 0, "full|sampling|unbiased"},
      {"representative", "Representative",
       "What stands for a cluster of lights. mean: their mean shines, one drawn for each pair casts shadows; random: "
       "one, drawn once by luminance; stochastic: drawn anew for each 16 points and pair, noise in place of banding",
       "", ParamType::choice, "mean", 0, 0, "mean|random|stochastic"},
      {"dark_floor", "Dark floor", "Points darker than this are held to its error", "of the mean radiance",
       ParamType::real, "0.01", 0, 1},
      {"coarse_separation", "Coarse separation",
       "Coarse image: largest cluster that is taken as one, seen from its partner; smaller is slower and surer",
       "of the distance", ParamType::real, "0.15", 0.001, 1},
  };
}

}  // namespace

extern const IntegratorEntry illumination_cut_integrator;
const IntegratorEntry illumination_cut_integrator = {
    "illumination_cut",
    "IlluminationCut",
    "Clusters points and lights together, with an error bound for each pair: for whole frames",
    "Bus, Mustafa and Biri 2015",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<IlluminationCut>(); }};

}  // namespace lumicut
