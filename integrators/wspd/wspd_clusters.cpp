// What stands for the lights of a cluster: subgroups by normal, and cubemaps of local visibility.
#include "core/parallel.h"
#include "integrators/wspd/wspd_tree.h"
#include "lights/falloff.h"

namespace lumicut {

namespace {

// How unlike two lights shine: the distance of their normals; more than any such where they are of different make.
float unlike2(const Vpl& a, const Vpl& b) {
  if (a.kind == VplKind::sphere && b.kind == VplKind::sphere && a.ray_mask == b.ray_mask)
    return length2(a.normal - b.normal);
  if (a.kind == VplKind::lobed && b.kind == VplKind::lobed && a.ray_mask == b.ray_mask) {
    const float by_mirror = 0.5f * (a.slope() + b.slope() + a.retro + b.retro);
    return length2(a.normal - b.normal) + by_mirror * by_mirror * length2(a.mirror() - b.mirror());
  }
  if (a.kind != b.kind || a.edge_or_radius != b.edge_or_radius || a.blend_cosine != b.blend_cosine ||
      a.spot_cosine != b.spot_cosine || a.spread_tan != b.spread_tan || a.ray_mask != b.ray_mask ||
      a.facing != b.facing)
    return 9.0f;
  return length2(a.normal - b.normal);
}

// One light in place of several: mean position and normal, weighted by intensity, and their sum.
Vpl mean_light(std::span<const Vpl> lights, const std::vector<uint8_t>& group_of, uint8_t group) {
  double position[3] = {}, normal[3] = {}, intensity[3] = {}, from_centre[3] = {}, radius = 0, total = 0;
  const Vpl* strongest = nullptr;
  for (size_t i = 0; i < lights.size(); ++i) {
    if (group_of[i] != group) continue;
    const Vpl& v = lights[i];
    const double w = luminance(v.intensity);
    for (int k = 0; k < 3; ++k) {
      position[k] += w * v.position[k], normal[k] += w * v.normal[k],
          intensity[k] += static_cast<double>(v.intensity[k]), from_centre[k] += w * v.from_centre[k];
    }
    radius += w * v.radius();
    total += w;
    if (strongest == nullptr || luminance(v.intensity) > luminance(strongest->intensity)) strongest = &v;
  }
  Vpl out = *strongest;
  if (out.kind == VplKind::sphere) out.radius() = static_cast<float>(radius / total);
  const double length_of_normal = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  for (int k = 0; k < 3; ++k) {
    out.position[k] = static_cast<float>(position[k] / total);
    out.from_centre[k] = static_cast<float>(from_centre[k] / total);
    // Normals that cancel each other: the strongest light's own.
    if (length_of_normal > 1e-3 * total) out.normal[k] = static_cast<float>(normal[k] / length_of_normal);
    out.intensity[k] = static_cast<float>(intensity[k]);
  }
  return out;
}

float intensity_share(const Vpl& v, const Falloff& falloff, const Vec3f& direction) {
  const float c = dot(v.normal, direction);
  switch (v.kind) {
    case VplKind::omni:
      return 1.0f;
    case VplKind::oriented:
    case VplKind::sphere:
    case VplKind::lobed:
      return std::max(0.0f, c);
    case VplKind::spot:
      return falloff.of_spot(v, direction);
    case VplKind::directional:
      break;
  }
  return 0.0f;
}

}  // namespace

size_t cube_cell(const Vec3f& d) {
  const float a[3] = {std::abs(d.x), std::abs(d.y), std::abs(d.z)};
  const int axis = a[0] >= a[1] ? (a[0] >= a[2] ? 0 : 2) : (a[1] >= a[2] ? 1 : 2);
  if (!(a[axis] > 0.0f)) return 0;
  const float scale = 0.5f * kCubeSide / a[axis];
  const auto cell = [&](float x) {
    return static_cast<size_t>(std::clamp(static_cast<int>(x * scale + 0.5f * kCubeSide), 0, int{kCubeSide} - 1));
  };
  const size_t face = 2 * static_cast<size_t>(axis) + (d[axis] < 0.0f ? 1 : 0);
  return (face * kCubeSide + cell(d[(axis + 1) % 3])) * kCubeSide + cell(d[(axis + 2) % 3]);
}

Vec3f cube_direction(size_t cell) {
  const size_t face = cell / (kCubeSide * kCubeSide);
  const auto axis = static_cast<int>(face / 2);
  const auto at = [](size_t i) { return (2.0f * static_cast<float>(i) + 1.0f) / kCubeSide - 1.0f; };
  Vec3f d;
  d[axis] = face % 2 == 0 ? 1.0f : -1.0f;
  d[(axis + 1) % 3] = at(cell / kCubeSide % kCubeSide);
  d[(axis + 2) % 3] = at(cell % kCubeSide);
  return normalize(d);
}

// Nodes in a pair, distant clusters, and all below them.
std::vector<uint8_t> WspdTree::used_nodes() const {
  std::vector<uint8_t> used(nodes_.size(), 0);
  for (size_t n = 0; n < nodes_.size(); ++n)
    if (nodes_[n].leaf() || pair_begin_[n + 1] > pair_begin_[n]) used[n] = 1;
  for (uint32_t n : distant_) used[n] = 1;
  for (size_t n = 0; n < nodes_.size(); ++n)
    if (nodes_[n].parent != WspdNode::kNone && used[nodes_[n].parent] != 0) used[n] = 1;
  return used;
}

// Alg. 3: farthest-first centres among the normals.
void WspdTree::find_groups(const Options& options, Progress& progress) {
  const std::vector<uint8_t> used = used_nodes();
  progress.begin("subgroups by normal", nodes_.size());
  constexpr size_t kChunk = 256;
  std::vector<std::vector<Vpl>> parts((nodes_.size() + kChunk - 1) / kChunk);
  const float threshold2 = options.normal_threshold * options.normal_threshold;
  parallel_chunks(nodes_.size(), kChunk, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    std::vector<Vpl>& part = parts[begin / kChunk];
    std::vector<float> distance;
    std::vector<uint8_t> group_of;
    for (size_t n = begin; n < end; ++n) {
      if (progress.cancelled()) return;
      WspdNode& node = nodes_[n];
      if (used[n] == 0) continue;
      const std::span<const Vpl> lights(lights_.data() + node.first, node.last - node.first);
      node.first_group = static_cast<uint32_t>(part.size());
      node.group_count = 1;
      group_of.assign(lights.size(), 0);
      if (lights.size() == 1) {
        part.push_back(lights[0]);
        continue;
      }
      if (lights[0].kind != VplKind::directional) {
        size_t center = lights.size() / 2;
        distance.assign(lights.size(), std::numeric_limits<float>::infinity());
        for (uint8_t g = 0;; ++g) {
          size_t farthest = 0;
          for (size_t i = 0; i < lights.size(); ++i) {
            const float d = unlike2(lights[i], lights[center]);
            if (d < distance[i]) distance[i] = d, group_of[i] = g;
            if (distance[i] > distance[farthest]) farthest = i;
          }
          node.group_count = g + 1u;
          if (distance[farthest] <= threshold2 || node.group_count == kMaxGroups) break;
          center = farthest;
        }
      }
      for (uint32_t g = 0; g < node.group_count; ++g)
        part.push_back(mean_light(lights, group_of, static_cast<uint8_t>(g)));
    }
    progress.advance(end - begin);
  });
  progress.check();
  for (size_t p = 0; p < parts.size(); ++p) {
    for (size_t n = p * kChunk; n < std::min(nodes_.size(), (p + 1) * kChunk); ++n)
      nodes_[n].first_group += nodes_[n].group_count > 0 ? static_cast<uint32_t>(groups_.size()) : 0u;
    groups_.insert(groups_.end(), parts[p].begin(), parts[p].end());
    parts[p] = {};
  }
}

// Eq. 2.21, with at most kSampled of the cluster's lights.
void WspdTree::find_cubemaps(const Options& options, Progress& progress) {
  constexpr size_t kChunk = 64, kSampled = 6;
  Falloff falloff;
  falloff.profiles = options.profiles;
  const std::vector<uint8_t> used = used_nodes();
  progress.begin("local visibility", nodes_.size());
  std::vector<std::vector<Cubemap>> parts((nodes_.size() + kChunk - 1) / kChunk);
  parallel_chunks(nodes_.size(), kChunk, [&](size_t begin, size_t end) {
    std::vector<Ray> rays;
    struct Sample {
      uint32_t cell;
      float weight;
    };
    std::vector<Sample> samples;
    for (size_t n = begin; n < end; ++n) {
      if (progress.cancelled()) return;
      WspdNode& node = nodes_[n];
      if (used[n] == 0 || node.leaf() || lights_[node.first].kind == VplKind::directional ||
          node.radius < 4.0f * options.epsilon)
        continue;
      rays.clear(), samples.clear();
      const uint32_t count = node.last - node.first, taken = std::min<uint32_t>(count, kSampled);
      for (uint32_t s = 0; s < taken; ++s) {
        const Vpl& v = lights_[node.first + static_cast<uint32_t>((2ull * s + 1) * count / (2ull * taken))];
        const Vec3f from = v.position - node.center;
        for (uint32_t cell = 0; cell < kCubeCells; ++cell) {
          const Vec3f d = cube_direction(cell);
          const float weight = luminance(v.intensity) * intensity_share(v, falloff, d);
          if (!(weight > 0.0f)) continue;
          // Where the ray leaves the ball.
          const float b = dot(from, d);
          const float t = -b + std::sqrt(std::max(0.0f, b * b - length2(from) + node.radius * node.radius));
          if (!(t > 0.0f)) continue;
          Ray r;
          r.org = v.position, r.dir = d, r.tfar = t, r.mask = v.ray_mask, r.flags = kFromLight;
          rays.push_back(r);
          samples.push_back({cell, weight});
        }
      }
      options.accel->occluded(rays);
      float all[kCubeCells] = {}, seen[kCubeCells] = {};
      bool blocked = false;
      for (size_t i = 0; i < rays.size(); ++i) {
        const bool hit = rays[i].tfar < 0.0f;
        blocked = blocked || hit;
        all[samples[i].cell] += samples[i].weight;
        if (!hit) seen[samples[i].cell] += samples[i].weight;
      }
      if (!blocked) continue;
      Cubemap map;
      for (size_t c = 0; c < kCubeCells; ++c)
        map[c] = all[c] > 0.0f ? static_cast<uint8_t>(std::lround(255.0f * std::min(1.0f, seen[c] / all[c]))) : 255;
      node.cubemap = static_cast<uint32_t>(parts[begin / kChunk].size());
      parts[begin / kChunk].push_back(map);
    }
    progress.advance(end - begin);
  });
  progress.check();
  for (size_t p = 0; p < parts.size(); ++p) {
    for (size_t n = p * kChunk; n < std::min(nodes_.size(), (p + 1) * kChunk); ++n)
      if (nodes_[n].cubemap != WspdNode::kNone) nodes_[n].cubemap += static_cast<uint32_t>(cubemaps_.size());
    cubemaps_.insert(cubemaps_.end(), parts[p].begin(), parts[p].end());
  }
}

}  // namespace lumicut
