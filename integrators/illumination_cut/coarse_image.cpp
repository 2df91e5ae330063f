// Phase I: the coarse image. [thesis sec. 3.2, "Phase I"]
#include <bit>

#include "bsdf/point_bsdf.h"
#include "core/parallel.h"
#include "integrators/illumination_cut/illumination_cut.h"

namespace lumicut::illumination_cut {

namespace {

// Share of the light that a surface sends back, to first order: what turns irradiance into radiance.
float reflectance(const SurfacePoint& p) {
  const float specular = p.lobe != kCosineLobe ? luminance(specular_albedo(p)) * std::numbers::inv_pi_v<float>
                                               : luminance(p.specular) * (2.0f / (p.shape + 1.0f));
  return luminance(p.diffuse) + specular;
}

}  // namespace

std::vector<float> IlluminationCut::coarse_image(const PointTree& points, ShadeContext context) const {
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
          const uint32_t again =
              coarse_pairs(points.leaves[g], leaf_reps, g * kLanes, below, false, *lit, leaf.data() + g * kLanes, total)
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
  floor_dark(points.size(), coarse);
  return coarse;
}

void IlluminationCut::floor_dark(size_t count, std::vector<float>& coarse) const {
  double mean = 0.0;
  for (size_t i = 0; i < count; ++i) mean += coarse[i];
  // Black points would ask for every light; nobody sees a small share of the mean.
  const auto least = static_cast<float>(floor_ * mean / static_cast<double>(count));
  for (size_t i = 0; i < count; ++i) coarse[i] = std::max(coarse[i], least);
}

void IlluminationCut::push_children(uint32_t node, uint32_t lanes, std::vector<RegionItem>& stack) const {
  if (lanes == 0) return;
  const uint32_t child = tree_.node(node).first_child;
  stack.push_back({child + 1, lanes});
  stack.push_back({child, lanes});
}

std::pair<uint32_t, uint32_t> IlluminationCut::coarse_pairs(const PointNodes& nodes, const ShadePoints& reps,
                                                            size_t first, const RegionItem& item, bool may_descend,
                                                            LitPoints& lit, float* irradiance, Counters& total) const {
  const LightNode& node = tree_.node(item.node);
  alignas(64) float bounds[kLanes], distances2[kLanes];
  pair_bounds(node, nodes, bounds);
  pair_distances2(node, nodes, distances2);
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
    light_points(light.shining, node.intensity, falloff_, reps, first, kLanes, lit, &lanes, light.scatter);
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

}  // namespace lumicut::illumination_cut
