#include "clustering/light_tree.h"

#include <map>
#include <numeric>

#include "bsdf/burley.h"
#include "clustering/light_policy.h"
#include "core/cone.h"
#include "core/rng.h"

namespace lumicut {

namespace {

// What merging needs of a cluster.
struct Cluster {
  Aabb positions, directions;
  Rgb intensity{};
  float widest_spot = 1.0f;  // least cosine of the spots' own opening
  float least_distance2 = 0.0f, largest_radius = 0.0f;
  float largest_even = 0.0f, largest_rise = 0.0f, largest_groove = 0.0f, steepest_groove = 0.0f;
};

Cluster merge(const Cluster& a, const Cluster& b) {
  return {merge(a.positions, b.positions),
          merge(a.directions, b.directions),
          a.intensity + b.intensity,
          std::min(a.widest_spot, b.widest_spot),
          std::min(a.least_distance2, b.least_distance2),
          std::max(a.largest_radius, b.largest_radius),
          std::max(a.largest_even, b.largest_even),
          std::max(a.largest_rise, b.largest_rise),
          std::max(a.largest_groove, b.largest_groove),
          std::max(a.steepest_groove, b.steepest_groove)};
}

// With slack for rounding.
void add_lobe(const Vpl& v, Cluster& c) {
  const float cosine = std::min(1.0f, std::max(0.0f, dot(v.normal, v.mirror())));
  const float rise = 1.0001f * std::max(0.0f, v.retro - v.dim), of_view = 1.0f + rise * burley_edge(cosine);
  const float groove = v.slope() * 1.0001f * std::sqrt(std::max(1e-6f, 1.0f - cosine * cosine)) * of_view;
  c.largest_even = (1.0f + v.again) * of_view, c.largest_rise = rise;
  c.largest_groove = groove * (1.0f + rise), c.steepest_groove = c.largest_groove / std::max(1e-4f, cosine);
}

// Splits in the middle of the longest axis. Ids as in agglomerate.h: leaves first, children before parents.
std::vector<Merge> divide(const std::vector<Vpl>& lights, const std::vector<uint32_t>& members,
                          const LightTree::Options& options, Progress& progress) {
  const bool six = options.method == LightTree::Method::divisive_6d;
  const float scale = options.scene_diagonal / 16.0f;
  const auto feature = [&](uint32_t i, int axis) {
    const Vpl& v = lights[members[i]];
    if (axis < 3) return v.kind == VplKind::directional ? v.normal[axis] * scale : v.position[axis];
    return v.normal[axis - 3] * scale;
  };
  const auto n = static_cast<uint32_t>(members.size());
  std::vector<uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  std::vector<Merge> merges;
  if (n < 2) return merges;
  merges.reserve(n - 1);

  struct Task {
    uint32_t begin, end, mid;
    bool expanded;
  };
  std::vector<Task> tasks{{0, n, 0, false}};
  std::vector<uint32_t> done;  // ids of finished subtrees, children of a task on top
  while (!tasks.empty()) {
    Task& task = tasks.back();
    if (task.end - task.begin == 1) {
      done.push_back(order[task.begin]);
      tasks.pop_back();
      continue;
    }
    if (task.expanded) {
      const uint32_t right = done.back();
      done.pop_back();
      const uint32_t left = done.back();
      done.pop_back();
      merges.push_back({left, right, 0.0f});
      done.push_back(n + static_cast<uint32_t>(merges.size()) - 1);
      tasks.pop_back();
      continue;
    }
    if (task.end - task.begin > 4096) progress.check();
    float lo[6], hi[6];
    int longest = 0;
    for (int a = 0; a < (six ? 6 : 3); ++a) {
      lo[a] = std::numeric_limits<float>::infinity(), hi[a] = -lo[a];
      for (uint32_t i = task.begin; i < task.end; ++i) {
        const float f = feature(order[i], a);
        lo[a] = std::min(lo[a], f), hi[a] = std::max(hi[a], f);
      }
      if (hi[a] - lo[a] > hi[longest] - lo[longest]) longest = a;
    }
    const float middle = 0.5f * (lo[longest] + hi[longest]);
    const auto first = order.begin() + task.begin, last = order.begin() + task.end;
    auto split = std::partition(first, last, [&](uint32_t i) { return feature(i, longest) < middle; });
    if (split == first || split == last) split = first + (last - first) / 2;  // all in one place
    const auto mid = static_cast<uint32_t>(split - order.begin());
    task.expanded = true;
    const Task left{task.begin, mid, 0, false}, right{mid, task.end, 0, false};
    tasks.push_back(right);
    tasks.push_back(left);
  }
  return merges;
}

std::vector<Merge> topology(const std::vector<Vpl>& lights, const std::vector<uint32_t>& members,
                            const LightTree::Options& options, Progress& progress) {
  if (options.method != LightTree::Method::agglomerative) return divide(lights, members, options, progress);
  std::vector<LightLeaf> leaves;
  leaves.reserve(members.size());
  for (uint32_t m : members)
    leaves.push_back({lights[m].position, lights[m].normal, lights[m].kind, luminance(lights[m].intensity)});
  return agglomerate_lights(leaves, options.scene_diagonal, Strategy::parallel, &progress);
}

LightNode make_node(const Cluster& c, VplKind kind) {
  LightNode n;
  n.kind = kind;
  n.intensity = c.intensity;
  n.least_distance2 = c.least_distance2, n.largest_radius = c.largest_radius;
  n.largest_even = c.largest_even, n.largest_rise = c.largest_rise, n.largest_groove = c.largest_groove,
  n.steepest_groove = c.steepest_groove;
  if (kind != VplKind::directional)
    n.center = c.positions.center(), n.half = max(c.positions.hi - n.center, n.center - c.positions.lo);
  if (kind != VplKind::omni) {
    Cone cone = cone_of_direction_box(c.directions);
    if (kind == VplKind::spot && cone.cos_half > -1.0f) {
      // A spot lights all directions within its own opening of its axis.
      const float own_sine = std::sqrt(std::max(0.0f, 1.0f - c.widest_spot * c.widest_spot));
      const bool all = c.widest_spot <= -cone.cos_half;  // the sum of the angles passes π
      cone.cos_half = all ? -1.0f : cone.cos_half * c.widest_spot - cone.sin_half() * own_sine - 1e-6f;
    }
    const Frame f(cone.axis);
    n.tangent = f.t, n.bitangent = f.b, n.axis = f.n;
    n.cos_half = std::max(-1.0f, cone.cos_half), n.sin_half = cone.sin_half();
  }
  const auto along = [&](const Vec3f& v) {
    return std::abs(v.x) * n.half.x + std::abs(v.y) * n.half.y + std::abs(v.z) * n.half.z;
  };
  n.frame_half = {along(n.tangent), along(n.bitangent), along(n.axis)};
  return n;
}

}  // namespace

LightTree LightTree::build(const std::vector<Vpl>& lights, const Options& options, Progress& progress) {
  progress.begin("light tree", lights.size());
  LightTree tree;
  tree.slots_.resize(std::max(1u, options.representatives) - 1);
  std::map<std::pair<VplKind, uint32_t>, std::vector<uint32_t>> kinds;  // and by what stops them
  for (uint32_t i = 0; i < lights.size(); ++i)
    if (max_component(lights[i].intensity) > 0.0f) kinds[{lights[i].kind, lights[i].ray_mask}].push_back(i);
  for (const auto& [kind, members] : kinds) {
    tree.add_kind(lights, members, options, progress);
    progress.advance(members.size());
  }
  return tree;
}

void LightTree::add_kind(const std::vector<Vpl>& lights, const std::vector<uint32_t>& members, const Options& options,
                         Progress& progress) {
  const std::vector<Merge> merges = topology(lights, members, options, progress);
  const auto n = static_cast<uint32_t>(members.size());
  const uint32_t count = 2 * n - 1;

  std::vector<Cluster> clusters(count);
  for (uint32_t i = 0; i < n; ++i) {
    const Vpl& v = lights[members[i]];
    Cluster& c = clusters[i];
    c.positions.extend(v.position);
    if (v.facing) {
      const Vec3f centre = v.position - v.from_centre;
      const float r = length(v.from_centre);  // a place on the disk is no farther from the centre
      c.positions.extend(centre - Vec3f{r, r, r}), c.positions.extend(centre + Vec3f{r, r, r});
    }
    c.directions.extend(v.normal);
    c.intensity = v.intensity;
    c.least_distance2 = v.clamp2;
    if (v.kind == VplKind::sphere) c.largest_radius = v.radius(), c.least_distance2 = v.radius() * v.radius();
    if (v.kind == VplKind::lobed) add_lobe(v, c);
    // The profile of a narrowed area light ends where its cosine does.
    if (v.kind == VplKind::spot)
      c.widest_spot = v.profile == 0 && v.spot_cosine > 0.0f ? std::max(0.0f, v.cos_outer()) : v.cos_outer();
  }
  for (uint32_t k = 0; k < merges.size(); ++k)
    clusters[n + k] = merge(clusters[merges[k].left], clusters[merges[k].right]);

  // Top-down layout, siblings side by side, subtrees together.
  const auto base = static_cast<uint32_t>(nodes_.size());
  const auto first_light = static_cast<uint32_t>(lights_.size());
  roots_.push_back(base);
  nodes_.resize(base + count);
  for (auto& slot : slots_) slot.resize(base + count);
  std::vector<uint32_t> place(count);
  std::vector<std::pair<uint32_t, uint32_t>> stack{{count - 1, base}};
  uint32_t next = base + 1;
  while (!stack.empty()) {
    const auto [cluster, at] = stack.back();
    stack.pop_back();
    place[cluster] = at;
    nodes_[at] = make_node(clusters[cluster], lights[members[0]].kind);
    if (cluster < n) {
      nodes_[at].light = static_cast<uint32_t>(lights_.size());
      lights_.push_back(lights[members[cluster]]);
      continue;
    }
    nodes_[at].first_child = next;
    stack.emplace_back(merges[cluster - n].right, next + 1);
    stack.emplace_back(merges[cluster - n].left, next);
    next += 2;
  }
  // Bottom-up: the representative is a child's, by luminance.
  for (uint32_t slot = 0; slot <= slots_.size(); ++slot) {
    const auto rep = [&](uint32_t node) -> uint32_t& {
      return slot == 0 ? nodes_[node].light : slots_[slot - 1][node];
    };
    if (slot > 0)
      for (uint32_t i = 0; i < n; ++i) rep(place[i]) = nodes_[place[i]].light;
    for (uint32_t k = 0; k < merges.size(); ++k) {
      const uint32_t left = place[merges[k].left], right = place[merges[k].right];
      const float il = luminance(nodes_[left].intensity), ir = luminance(nodes_[right].intensity);
      Rng rng(options.seed, Stage::light_tree, k, (uint64_t{slot} << 32) | first_light);
      rep(place[n + k]) = rng.next_float() * (il + ir) < il ? rep(left) : rep(right);
    }
  }
}

size_t LightTree::bytes() const {
  size_t b = nodes_.size() * sizeof(LightNode) + lights_.size() * sizeof(Vpl);
  for (const auto& s : slots_) b += s.size() * sizeof(uint32_t);
  return b;
}

}  // namespace lumicut
