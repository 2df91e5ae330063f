// Phase II: the pairs, and their adaptive visibility. [thesis Alg. 4 and 5]
#include <bit>

#include "integrators/illumination_cut/illumination_cut.h"

namespace lumicut::illumination_cut {

void IlluminationCut::start_region(const PointTree& points, size_t region, const std::vector<float>& coarse,
                                   float error, Workspace& work) const {
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
    const float allowed = error * coarse[first + i];
    work.allowed[i] = allowed;
    work.leaf_allowed[i / kLeaf] = std::min(work.leaf_allowed[i / kLeaf], allowed);
    work.group_allowed[i / kGroup] = std::min(work.group_allowed[i / kGroup], allowed);
  }
  for (size_t leaf = 0; leaf * kLeaf < n; ++leaf) work.blocks[leaf].load(points.points, first + leaf * kLeaf);
}

void IlluminationCut::region_pairs(const PointTree& points, size_t region, Workspace& work,
                                   const Progress& progress) const {
  const PointNodes& nodes = points.groups[region];
  auto& stack = work.region_stack;
  for (uint32_t root : tree_.roots()) stack.push_back({root, nodes.used});
  while (!stack.empty()) {
    const RegionItem item = stack.back();
    stack.pop_back();
    if (progress.cancelled()) return;
    const LightNode& node = tree_.node(item.node);
    alignas(64) float bounds[kLanes];
    pair_bounds(node, nodes, bounds);
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

GroupLanes IlluminationCut::lanes_of(const PointTree& points, size_t region, size_t group) {
  GroupLanes lanes;
  const size_t first = region * kRegion + group * kGroup;
  for (size_t leaf = 0; leaf < kLanes; ++leaf) {
    const size_t at = first + leaf * kLeaf;
    const size_t n = at < points.size() ? std::min(kLeaf, points.size() - at) : 0;
    lanes[leaf] = static_cast<uint16_t>((1u << n) - 1);
  }
  return lanes;
}

void IlluminationCut::group_pairs(const PointTree& points, size_t region, size_t group, uint32_t root, Workspace& work,
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
    pair_bounds(node, nodes, bounds);
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
        light_node_bounds(node, work.blocks[leaf], point_bounds);
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

void IlluminationCut::add_pair(const PointTree& points, size_t region, size_t group, uint32_t index,
                               const GroupLanes& lanes, Workspace& work) const {
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

void IlluminationCut::add_light(const PointTree& points, size_t region, size_t group, const Representative& light,
                                const Rgb& intensity, const GroupLanes& lanes, Shadow shadow, uint32_t index,
                                Workspace& work) const {
  const size_t base = group * kGroup, first = region * kRegion + base;
  LitPoints& lit = work.lit;
  light_points(light.shining, intensity, falloff_, points.points, first, std::min(kGroup, points.size() - first), lit,
               lanes.data(), light.scatter);
  if (lit.count == 0) return;
  const Vpl* seen = &light.seen;
  if (shadow == Shadow::of_drawn) {
    const size_t middle = first + lit.index[lit.count / 2];
    Rng rng(seed_, Stage::representative, (uint64_t{points.points.pixel[first]} << 32) | first, index);
    seen = &draw(index, points.points.position_at(middle), points.points.normal_at(middle), rng.next_float());
  }
  choose_own(points, first, work);
  if (visibility_ == Visibility::full || shadow == Shadow::exact || work.own_count < kSampleFrom) {
    for (uint32_t k = 0; k < work.own_count; ++k) ask(k, work);
    answer(*seen, base, work);
  } else {
    sample_visibility(*seen, base, index, first, work);
  }
  if (work.own_count < lit.count)
    for (size_t i = 0; i < lit.count; ++i) work.weight[i] = work.weight[work.stands[i]];
  for (size_t i = 0; i < lit.count; ++i) {
    const size_t at = base + lit.index[i];
    if (work.weight[i] == 0.0f) continue;
    work.sum[0][at] += work.weight[i] * lit.r[i];
    work.sum[1][at] += work.weight[i] * lit.g[i];
    work.sum[2][at] += work.weight[i] * lit.b[i];
    ++work.clusters[at];
  }
}

void IlluminationCut::choose_own(const PointTree& points, size_t first, Workspace& work) const {
  static constexpr auto kAll = [] {
    std::array<uint32_t, kMaxLit> all{};
    for (uint32_t i = 0; i < kMaxLit; ++i) all[i] = i;
    return all;
  }();
  const auto n = static_cast<uint32_t>(work.lit.count);
  if (!shadow_a_pixel_) {
    work.own = kAll.data(), work.own_count = n;
    return;
  }
  work.own = work.of_pixels, work.own_count = 0;
  constexpr uint32_t kSlots = 2 * kMaxLit;
  uint16_t slots[kSlots] = {};  // by pixel: one more than the lit point that stands for it
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t pixel = points.points.pixel[first + work.lit.index[i]];
    uint32_t slot = (pixel * 2654435761u) % kSlots;
    while (slots[slot] != 0 && points.points.pixel[first + work.lit.index[slots[slot] - 1u]] != pixel)
      slot = (slot + 1) % kSlots;
    if (slots[slot] == 0) slots[slot] = static_cast<uint16_t>(i + 1), work.of_pixels[work.own_count++] = i;
    work.stands[i] = slots[slot] - 1u;
  }
}

void IlluminationCut::ask(uint32_t own, Workspace& work) {
  const size_t k = work.asked_count++;
  const uint32_t i = work.own[own];
  work.asked[k] = i;
  work.x[k] = work.lit.x[i], work.y[k] = work.lit.y[i], work.z[k] = work.lit.z[i];
}

void IlluminationCut::answer(const Vpl& light, size_t base, Workspace& work) const {
  trace_shadows(scene_->accel(), light, work.x, work.y, work.z, work.asked_count, work.occluded);
  for (size_t k = 0; k < work.asked_count; ++k) {
    const uint32_t i = work.asked[k];
    work.known[i] = 1;
    work.weight[i] = work.occluded[k] ? 0.0f : 1.0f;
    ++work.rays[base + work.lit.index[i]];
  }
  work.asked_count = 0;
}

void IlluminationCut::sample_visibility(const Vpl& light, size_t base, uint32_t index, size_t first,
                                        Workspace& work) const {
  const auto n = static_cast<uint32_t>(work.own_count);
  const uint32_t runs = n > 128 ? 32 : n > 32 ? 16 : 8;
  std::fill(work.known, work.known + work.lit.count, uint8_t{0});
  Rng rng(seed_, Stage::visibility, first, index);
  if (visibility_ == Visibility::recursive) return sample_recursively(light, base, 0, n, rng, work);
  uint32_t samples[32];
  const auto run_begin = [&](uint32_t r) { return r * n / runs; };
  for (uint32_t r = 0; r < runs; ++r) {
    samples[r] = run_begin(r) + rng.next_below(run_begin(r + 1) - run_begin(r));
    ask(samples[r], work);
  }
  answer(light, base, work);
  const float seen = work.weight[work.own[samples[0]]];
  bool agree = true;
  for (uint32_t r = 1; r < runs; ++r) agree = agree && work.weight[work.own[samples[r]]] == seen;
  if (!agree) {
    for (uint32_t k = 0; k < n; ++k)
      if (!work.known[work.own[k]]) ask(k, work);
    if (work.asked_count > 0) answer(light, base, work);
    return;
  }
  std::fill(work.weight, work.weight + work.lit.count, seen);
  if (visibility_ == Visibility::unbiased) correct(light, base, seen, rng, work);
}

void IlluminationCut::sample_recursively(const Vpl& light, size_t base, uint32_t begin, uint32_t end, Rng& rng,
                                         Workspace& work) const {
  const uint32_t n = end - begin;
  const auto unknown = [&](uint32_t k) { return !work.known[work.own[k]]; };
  if (n < kSampleFrom) {
    for (uint32_t k = begin; k < end; ++k)
      if (unknown(k)) ask(k, work);
    if (work.asked_count > 0) answer(light, base, work);
    return;
  }
  const uint32_t runs = n > 32 ? 16 : 8;
  uint32_t samples[16];
  const auto run_begin = [&](uint32_t r) { return begin + r * n / runs; };
  for (uint32_t r = 0; r < runs; ++r) {
    samples[r] = run_begin(r) + rng.next_below(run_begin(r + 1) - run_begin(r));
    if (unknown(samples[r])) ask(samples[r], work);
  }
  if (work.asked_count > 0) answer(light, base, work);
  const float seen = work.weight[work.own[samples[0]]];
  bool agree = true;
  for (uint32_t r = 1; r < runs; ++r) agree = agree && work.weight[work.own[samples[r]]] == seen;
  if (!agree) {
    for (uint32_t r = 0; r < runs; ++r) sample_recursively(light, base, run_begin(r), run_begin(r + 1), rng, work);
    return;
  }
  for (uint32_t k = begin; k < end; ++k)
    if (unknown(k)) work.weight[work.own[k]] = seen;
}

void IlluminationCut::correct(const Vpl& light, size_t base, float inferred, Rng& rng, Workspace& work) const {
  for (uint32_t k = 0; k < work.own_count; ++k)
    if (!work.known[work.own[k]] && rng.next_below(kCorrectOneIn) == 0) ask(k, work);
  const size_t asked = work.asked_count;
  if (asked == 0) return;
  answer(light, base, work);
  for (size_t k = 0; k < asked; ++k) {
    float& w = work.weight[work.asked[k]];
    w = inferred + (w - inferred) * static_cast<float>(kCorrectOneIn);
  }
}

}  // namespace lumicut::illumination_cut
