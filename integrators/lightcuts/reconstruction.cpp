#include "integrators/lightcuts/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "clustering/light_kernel.h"

namespace lumicut {
namespace {

constexpr float kLeastCosine = 0.866f;  // between normals: 30 degrees, as in the paper
constexpr float kMostSlope = 0.2f;      // of the way from a sample to a point, off the sample's plane
// Nodes that give samples more than so many thresholds are not tried: their ratios hardly ever agree that well.
constexpr float kMostGiven = 8.0f;

float luminance_of(float r, float g, float b) { return 0.2126f * r + 0.7152f * g + 0.0722f * b; }

}  // namespace

void Reconstruction::grow(const LightTree& tree, const Accel& accel, const CutOptions& options,
                          const ShadePoints& points, size_t first, size_t count, const std::vector<size_t>& place,
                          Rgb* radiance, PointCounts* counts) {
  cuts_.grow(tree, accel, options, points, first, count);
  for (size_t i = 0; i < count; ++i) {
    const size_t to = place[first + i];
    radiance[to] = cuts_.radiance_of(i), counts[to] = cuts_.counts_of(i);
  }
}

// Weights of the samples at each point of a group, the nearest most. All of the block must stand for a point.
void Reconstruction::weigh(const ShadePoints& points, size_t begin, size_t first, size_t count, Group& group) {
  group.wanted = 0;
  for (size_t lane = 0; lane < kLanes; ++lane) {
    for (size_t s = 0; s < kSamples; ++s) group.weight[s][lane] = 0.0f;
    const size_t p = first + lane;
    if (lane >= count || (p - begin) % stride_ == 0) continue;
    const SurfacePoint point = points.get(p);
    float sum = 0.0f;
    bool stand = true;
    for (size_t s = 0; stand && s < kSamples; ++s) {
      const size_t at = begin + (sample_begin_ + s) * stride_;
      if (at >= points.size()) break;
      const SurfacePoint sample = points.get(at);
      const Vec3f way = point.position - sample.position;
      const float dist2 = length2(way), off = std::abs(dot(way, sample.normal));
      stand = dot(point.normal, sample.normal) >= kLeastCosine && off * off <= kMostSlope * kMostSlope * dist2 &&
              point.lobe == sample.lobe && point.not_lit_by == sample.not_lit_by &&
              (max_component(point.specular) > 0.0f) == (max_component(sample.specular) > 0.0f);
      sum += group.weight[s][lane] = 1.0f / std::max(dist2, 1e-30f);
    }
    if (stand) {
      for (size_t s = 0; s < kSamples; ++s) group.weight[s][lane] /= sum;
      group.wanted |= 1u << lane;
    } else {
      alone_.push_back(p);
    }
  }
}

void Reconstruction::trace(const Accel& accel, const Vpl& light, Group& group, uint32_t lit) {
  float x[2 * kLanes], y[2 * kLanes], z[2 * kLanes];
  uint8_t occluded[2 * kLanes];
  size_t n = 0;
  for (uint32_t m = lit; m != 0; m &= m - 1, ++n) {
    const auto lane = static_cast<size_t>(__builtin_ctz(m));
    x[n] = group.points.position[0][lane], y[n] = group.points.position[1][lane], z[n] = group.points.position[2][lane];
    ++group.rays[lane];
  }
  if (n == 0) return;
  trace_shadows(accel, light, x, y, z, n, occluded);
  n = 0;
  for (uint32_t m = lit; m != 0; m &= m - 1, ++n) {
    const auto lane = static_cast<size_t>(__builtin_ctz(m));
    ++group.clusters[lane];
    for (size_t k = 0; occluded[n] == 0 && k < 3; ++k) group.radiance[k][lane] += group.estimate[k][lane];
  }
}

// Walks the part of the light tree that the cuts looked at, for the points of one block.
void Reconstruction::reconstruct(const LightTree& tree, const Accel& accel, const CutOptions& options, size_t samples,
                                 size_t groups) {
  float least = std::numeric_limits<float>::max();  // radiance of a sample
  for (size_t s = 0; s < samples; ++s) {
    const size_t at = sample_begin_ + s;
    float total = 0.0f;
    for (size_t v = 0; v < record_.visits.size() && record_.visits[v].parent == CutRecord::kNone; ++v)
      total += below_[v * kCutPoints + at];
    least = std::min(least, total);
  }
  const float threshold = options.error * least;
  const auto descend = [&](const CutRecord::Visit& visit, const float* own) {
    const float whole = luminance(tree.node(visit.node).intensity);
    for (uint32_t c = 0; c < visit.children; ++c) {
      Node child{visit.first_child + c, {}};
      const float share =
          whole > 0.0f ? luminance(tree.node(record_.visits[child.visit].node).intensity) / whole : 0.0f;
      for (size_t s = 0; s < samples; ++s) child.rest[s] = own[s] * share;
      stack_.push_back(child);
    }
  };
  stack_.clear();
  for (uint32_t v = 0; v < record_.visits.size() && record_.visits[v].parent == CutRecord::kNone; ++v)
    stack_.push_back({v, {}});
  while (!stack_.empty()) {
    const Node node = stack_.back();
    stack_.pop_back();
    const CutRecord::Visit& visit = record_.visits[node.visit];
    float given[kSamples] = {}, own[kSamples] = {};
    bool any = false;
    for (size_t s = 0; s < samples; ++s) {
      const size_t at = node.visit * kCutPoints + sample_begin_ + s;
      own[s] = node.rest[s] + record_.luminance[at];
      given[s] = node.rest[s] + below_[at];
      any |= given[s] > 0.0f;
    }
    if (!any) continue;  // dark, or hidden from all samples
    if (visit.children > 0 && *std::max_element(given, given + kSamples) > kMostGiven * threshold) {
      descend(visit, own);
      continue;
    }

    const LightNode& cluster = tree.node(visit.node);
    const Vpl& light = tree.lights()[tree.representative(visit.node, options.slot)];
    // Of the samples, by the representative without shadows; then by their cuts, in parts of that.
    uint32_t lit[kCutGroups] = {};
    float ratio[kSamples];
    bool known[kSamples], smooth = true;
    float lo = std::numeric_limits<float>::max(), hi = 0.0f;
    int count = 0;
    for (size_t g = 0; g < groups; ++g) {
      Group& group = groups_[g];
      uint32_t lanes = group.wanted;
      for (size_t i = 0; i < kLanes; i += std::min(stride_, kLanes)) lanes |= 1u << i;
      lit[g] = estimate_light(light, cluster.intensity, options.falloff, group.points, lanes, group.estimate[0],
                              group.estimate[1], group.estimate[2]);
    }
    for (size_t s = 0; s < samples; ++s) {
      const size_t p = s * stride_, g = p / kLanes, lane = p % kLanes;
      const auto& e = groups_[g].estimate;
      const float estimate = (lit[g] >> lane & 1) != 0 ? luminance_of(e[0][lane], e[1][lane], e[2][lane]) : 0.0f;
      known[s] = estimate > 0.0f;
      ratio[s] = known[s] ? given[s] / estimate : 0.0f;
      if (known[s]) ++count, lo = std::min(lo, ratio[s]), hi = std::max(hi, ratio[s]);
      smooth &= known[s] || given[s] <= 0.0f;
    }
    smooth &= count >= 2;  // one alone tells nothing about what lies between
    for (size_t g = 0; smooth && g < groups; ++g) {
      const Group& group = groups_[g];
      for (uint32_t m = lit[g] & group.wanted; smooth && m != 0; m &= m - 1) {
        const auto lane = static_cast<size_t>(__builtin_ctz(m));
        float weight = 0.0f;
        for (size_t s = 0; s < samples; ++s) weight += known[s] ? group.weight[s][lane] : 0.0f;
        smooth = weight > 0.0f &&
                 (hi - lo) * luminance_of(group.estimate[0][lane], group.estimate[1][lane], group.estimate[2][lane]) <=
                     threshold;
      }
    }
    if (smooth) {
      for (size_t g = 0; g < groups; ++g) {
        Group& group = groups_[g];
        for (uint32_t m = lit[g] & group.wanted; m != 0; m &= m - 1) {
          const auto lane = static_cast<size_t>(__builtin_ctz(m));
          float sum = 0.0f, weight = 0.0f;
          for (size_t s = 0; s < samples; ++s)
            if (known[s]) sum += group.weight[s][lane] * ratio[s], weight += group.weight[s][lane];
          const float part = sum / weight;
          ++group.clusters[lane];
          for (size_t k = 0; k < 3; ++k) group.radiance[k][lane] += part * group.estimate[k][lane];
        }
      }
      continue;
    }
    if (visit.children == 0) {  // in the cuts of all
      for (size_t g = 0; g < groups; ++g)
        if ((lit[g] & groups_[g].wanted) != 0) trace(accel, light, groups_[g], lit[g] & groups_[g].wanted);
      continue;
    }
    descend(visit, own);
  }
}

void Reconstruction::shade(const LightTree& tree, const Accel& accel, CutOptions options, const ShadePoints& points,
                           size_t begin, size_t end, Rgb* radiance, PointCounts* counts) {
  alone_.clear();
  ShadePoints samples;
  std::vector<size_t> place;
  for (size_t p = begin; p < end; p += stride_) samples.push(points.get(p)), place.push_back(p);
  samples.finish();
  record_.clear();
  options.record = &record_;
  grow(tree, accel, options, samples, 0, place.size(), place, radiance, counts);
  options.record = nullptr;
  below_ = record_.luminance;
  for (size_t v = record_.visits.size(); v-- > 0;)
    if (const uint32_t parent = record_.visits[v].parent; parent != CutRecord::kNone)
      for (size_t s = 0; s < kCutPoints; ++s) below_[parent * kCutPoints + s] += below_[v * kCutPoints + s];

  const size_t in_block = kSamples * stride_;
  for (size_t first = begin; first < end; first += in_block) {
    if (options.progress != nullptr && options.progress->cancelled()) return;
    const size_t count = std::min(in_block, end - first), groups = (count + kLanes - 1) / kLanes;
    sample_begin_ = (first - begin) / stride_;
    bool any = false;
    for (size_t g = 0; g < groups; ++g) {
      Group& group = groups_[g];
      group.points.load(points, first + g * kLanes);
      weigh(points, begin, first + g * kLanes, std::min(kLanes, count - g * kLanes), group);
      for (auto& channel : group.radiance) std::fill_n(channel, kLanes, 0.0f);
      std::fill_n(group.clusters, kLanes, 0u), std::fill_n(group.rays, kLanes, 0u);
      any |= group.wanted != 0;
    }
    if (!any) continue;
    reconstruct(tree, accel, options, (count + stride_ - 1) / stride_, groups);
    for (size_t g = 0; g < groups; ++g)
      for (uint32_t m = groups_[g].wanted; m != 0; m &= m - 1) {
        const auto lane = static_cast<size_t>(__builtin_ctz(m));
        const size_t to = first + g * kLanes + lane;
        const Group& group = groups_[g];
        radiance[to] = {group.radiance[0][lane], group.radiance[1][lane], group.radiance[2][lane]};
        counts[to] = {group.clusters[lane], group.rays[lane], 0};
      }
  }

  ShadePoints rest;
  for (const size_t p : alone_) rest.push(points.get(p));
  rest.finish();
  for (size_t first = 0; first < alone_.size(); first += kCutPoints)
    grow(tree, accel, options, rest, first, std::min(kCutPoints, alone_.size() - first), alone_, radiance, counts);
}

}  // namespace lumicut
