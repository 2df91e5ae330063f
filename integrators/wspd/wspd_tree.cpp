#include "integrators/wspd/wspd_tree.h"

#include <tbb/parallel_sort.h>

#include <bit>
#include <cstring>
#include <string>

#include "core/parallel.h"
#include "core/rng.h"
#include "lights/falloff.h"

namespace lumicut {

namespace {

// Bits of x (21 of them), two apart.
uint64_t spread_bits(uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

// How unlike two lights shine: the distance of their normals; more than any such where they are of different make.
float unlike2(const Vpl& a, const Vpl& b) {
  if (a.kind == VplKind::sphere && b.kind == VplKind::sphere) return length2(a.normal - b.normal);
  if (a.kind != b.kind || a.edge_or_radius != b.edge_or_radius || a.blend_cosine != b.blend_cosine ||
      a.spot_cosine != b.spot_cosine || a.spread_tan != b.spread_tan)
    return 9.0f;
  return length2(a.normal - b.normal);
}

// One light in place of several: mean position and normal, weighted by intensity, and their sum.
Vpl mean_light(std::span<const Vpl> lights, const std::vector<uint8_t>& group_of, uint8_t group) {
  double position[3] = {}, normal[3] = {}, intensity[3] = {}, radius = 0, total = 0;
  const Vpl* strongest = nullptr;
  for (size_t i = 0; i < lights.size(); ++i) {
    if (group_of[i] != group) continue;
    const Vpl& v = lights[i];
    const double w = luminance(v.intensity);
    for (int k = 0; k < 3; ++k) {
      position[k] += w * v.position[k], normal[k] += w * v.normal[k],
          intensity[k] += static_cast<double>(v.intensity[k]);
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

uint64_t WspdTree::Cube::code(const Vec3f& p) const {
  uint64_t out = 0;
  for (int k = 0; k < 3; ++k) {
    // The lights fill half of the cube, somewhere in it: the random shift of the octree.
    const double x = 0.5 * ((static_cast<double>(p[k]) - lower[k]) / side + shift[static_cast<size_t>(k)]);
    const auto cell = static_cast<uint64_t>(std::clamp(x, 0.0, 1.0) * 2097151.0);
    out |= spread_bits(cell) << (2 - k);
  }
  return out;
}

uint32_t WspdTree::add_octree(const std::vector<Vpl>& lights, std::vector<uint32_t> members, bool distant,
                              const Cube& cube) {
  if (members.empty()) return WspdNode::kNone;
  std::vector<std::pair<uint64_t, uint32_t>> order(members.size());
  parallel_chunks(members.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vpl& v = lights[members[i]];
      order[i] = {cube.code(distant ? v.normal : v.position), members[i]};
    }
  });
  tbb::parallel_sort(order.begin(), order.end());
  const auto base = static_cast<uint32_t>(lights_.size());
  for (const auto& [code, index] : order) lights_.push_back(lights[index]);
  const auto root = static_cast<uint32_t>(nodes_.size());
  WspdNode top;
  top.first = base, top.last = static_cast<uint32_t>(lights_.size());
  nodes_.push_back(top);
  // Breadth first; a node's children are split at the highest place where its codes differ, however deep that lies.
  for (uint32_t n = root; n < nodes_.size(); ++n) {
    const uint32_t first = nodes_[n].first, last = nodes_[n].last;
    const uint64_t differ = order[first - base].first ^ order[last - 1 - base].first;
    if (differ == 0) continue;
    const int shift = (63 - std::countl_zero(differ)) / 3 * 3;
    const auto digit = [&](uint32_t light) { return order[light - base].first >> shift & 7; };
    nodes_[n].first_child = static_cast<uint32_t>(nodes_.size());
    for (uint32_t begin = first; begin < last;) {
      uint32_t low = begin + 1, high = last;  // the first light of another digit
      const uint64_t own = digit(begin);
      while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (digit(middle) == own)
          low = middle + 1;
        else
          high = middle;
      }
      WspdNode child;
      child.first = begin, child.last = low, child.parent = n;
      nodes_.push_back(child);
      ++nodes_[n].child_count;
      begin = low;
    }
  }
  if (!distant) {
    for (const auto& [code, index] : order) codes_.push_back(code);
    leaf_.resize(order.size());
    for (uint32_t n = root; n < nodes_.size(); ++n)
      if (nodes_[n].leaf()) std::fill(leaf_.begin() + nodes_[n].first, leaf_.begin() + nodes_[n].last, n);
  }
  return root;
}

void WspdTree::find_balls(Progress& progress) {
  parallel_chunks(nodes_.size(), 256, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      if (progress.cancelled()) return;
      WspdNode& node = nodes_[n];
      Aabb box;
      double power = 0;
      const auto place = [&](uint32_t i) {
        return lights_[i].kind == VplKind::directional ? lights_[i].normal : lights_[i].position;
      };
      for (uint32_t i = node.first; i < node.last; ++i) {
        box.extend(place(i));
        power += static_cast<double>(luminance(lights_[i].intensity));
        if (lights_[i].kind == VplKind::sphere)
          node.largest_sphere = std::max(node.largest_sphere, lights_[i].radius());
      }
      node.center = node.last - node.first == 1 ? place(node.first) : box.center();
      float radius2 = 0.0f;
      for (uint32_t i = node.first; i < node.last; ++i) radius2 = std::max(radius2, length2(place(i) - node.center));
      node.radius = std::sqrt(radius2);
      node.power = static_cast<float>(power);
    }
  });
  progress.check();
}

// Alg. 1. The first pairs are found one by one; from them tasks go on alone, and are joined in their order.
void WspdTree::find_pairs(float separation, Progress& progress) {
  using Pair = std::pair<uint32_t, uint32_t>;
  pair_begin_.assign(nodes_.size() + 1, 0);
  if (root_ == WspdNode::kNone) return;
  // Either keeps {w, v} or puts what it is split into on `next`.
  const auto step = [&](Pair pair, std::vector<Pair>& found, std::vector<Pair>& next) {
    auto [w, v] = pair;
    if (w == v) {
      const WspdNode& n = nodes_[w];
      for (uint32_t i = 0; i < n.child_count; ++i)
        for (uint32_t j = i; j < n.child_count; ++j) next.emplace_back(n.first_child + i, n.first_child + j);
      return;
    }
    if ((nodes_[w].leaf() && nodes_[v].leaf()) || well_separated(nodes_[w], nodes_[v], separation)) {
      found.emplace_back(w, v);
      return;
    }
    if (nodes_[w].leaf() || (!nodes_[v].leaf() && nodes_[w].radius < nodes_[v].radius)) std::swap(w, v);
    for (uint32_t i = 0; i < nodes_[w].child_count; ++i) next.emplace_back(nodes_[w].first_child + i, v);
  };
  std::vector<std::vector<Pair>> found(1);
  std::vector<Pair> open{{root_, root_}};
  while (!open.empty() && open.size() < 4096) {
    std::vector<Pair> next;
    for (const Pair& p : open) step(p, found[0], next);
    open = std::move(next);
  }
  progress.begin("well-separated pairs", open.size());
  found.resize(open.size() + 1);
  std::atomic<uint64_t> total{0};
  parallel_chunks(open.size(), 4, [&](size_t begin, size_t end) {
    std::vector<Pair> stack;
    for (size_t i = begin; i < end; ++i) {
      stack.assign(1, open[i]);
      for (uint32_t steps = 0; !stack.empty(); ++steps) {
        if (steps % 65536 == 0 && (progress.cancelled() || total > 0xffffffffull / 2)) return;
        const Pair p = stack.back();
        stack.pop_back();
        step(p, found[i + 1], stack);
      }
      total += found[i + 1].size();
    }
    progress.advance(end - begin);
  });
  progress.check();
  if (total + found[0].size() > 0xffffffffull / 2)
    throw Error(ErrorCode::out_of_memory, "wspd: more than 2^32 pairs; raise the separation or take fewer lights");
  for (const auto& part : found)
    for (const auto& [w, v] : part) ++pair_begin_[w + 1], ++pair_begin_[v + 1];
  for (size_t n = 0; n < nodes_.size(); ++n) pair_begin_[n + 1] += pair_begin_[n];
  pairs_.resize(pair_begin_.back());
  std::vector<uint64_t> at(pair_begin_.begin(), pair_begin_.end() - 1);
  for (auto& part : found) {
    for (const auto& [w, v] : part) pairs_[at[w]++] = v, pairs_[at[v]++] = w;
    part = {};
  }
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
  Falloff falloff = 0.0f;
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
          r.org = v.position, r.dir = d, r.tfar = t;
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

WspdTree WspdTree::build(const std::vector<Vpl>& lights, const Options& options, Progress& progress) {
  WspdTree tree;
  progress.begin("octree", 1);
  std::vector<uint32_t> placed, distant;
  Aabb box;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    if (!(luminance(lights[i].intensity) > 0.0f)) continue;
    if (lights[i].kind == VplKind::directional) {
      distant.push_back(i);
    } else {
      placed.push_back(i);
      box.extend(lights[i].position);
    }
  }
  tree.lights_.reserve(placed.size() + distant.size());
  if (!placed.empty()) {
    tree.cube_.lower = box.lo;
    tree.cube_.side = max_component(box.extent());
    if (!(tree.cube_.side > 0.0f)) tree.cube_.side = 1.0f;
    Rng rng(options.seed, Stage::octree_shift);
    for (double& s : tree.cube_.shift) s = static_cast<double>(rng.next_float());
  }
  tree.root_ = tree.add_octree(lights, placed, false, tree.cube_);
  Cube sphere;
  sphere.lower = {-1, -1, -1}, sphere.side = 2.0f;
  const uint32_t distant_root = tree.add_octree(lights, distant, true, sphere);
  tree.find_balls(progress);
  // Distant lights: directions count as points at distance 1.
  if (distant_root != WspdNode::kNone) {
    std::vector<uint32_t> stack{distant_root};
    while (!stack.empty()) {
      const uint32_t n = stack.back();
      stack.pop_back();
      if (tree.nodes_[n].leaf() || tree.nodes_[n].radius < options.separation)
        tree.distant_.push_back(n);
      else
        for (uint32_t c = 0; c < tree.nodes_[n].child_count; ++c) stack.push_back(tree.nodes_[n].first_child + c);
    }
  }
  tree.find_pairs(options.separation, progress);
  tree.find_groups(options, progress);
  if (options.accel != nullptr) tree.find_cubemaps(options, progress);
  return tree;
}

uint32_t WspdTree::near_leaf(const Vec3f& p) const {
  const uint64_t code = cube_.code(p);
  const auto after = static_cast<size_t>(std::lower_bound(codes_.begin(), codes_.end(), code) - codes_.begin());
  // The longest common prefix is with a neighbour in the order.
  if (after == codes_.size()) return leaf_.back();
  if (after > 0 && (codes_[after - 1] ^ code) < (codes_[after] ^ code)) return leaf_[after - 1];
  return leaf_[after];
}

namespace {

// Calls fn on all arrays of a tree in their order.
template <typename T>
size_t bytes_of(const std::vector<T>& v) {
  return v.size() * sizeof(T);
}

template <typename T>
void write_value(std::vector<uint8_t>& out, const T& value) {
  const auto* bytes = reinterpret_cast<const uint8_t*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof(T));
}

template <typename T>
void write_array(std::vector<uint8_t>& out, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  write_value(out, uint64_t{values.size()});
  const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
  out.insert(out.end(), bytes, bytes + bytes_of(values));
}

class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  template <typename T>
  void value(T& out) {
    if (bytes_.size() < sizeof(T)) fail_argument("wspd state: it ends too early");
    std::memcpy(static_cast<void*>(&out), bytes_.data(), sizeof(T));
    bytes_ = bytes_.subspan(sizeof(T));
  }
  template <typename T>
  void array(std::vector<T>& out) {
    uint64_t count = 0;
    value(count);
    if (count > bytes_.size() / sizeof(T)) fail_argument("wspd state: it ends too early");
    out.resize(count);
    if (count > 0) std::memcpy(static_cast<void*>(out.data()), bytes_.data(), count * sizeof(T));
    bytes_ = bytes_.subspan(count * sizeof(T));
  }
  void end() const {
    if (!bytes_.empty()) fail_argument("wspd state: bytes follow its end");
  }

 private:
  std::span<const uint8_t> bytes_;
};

}  // namespace

size_t WspdTree::bytes() const {
  return bytes_of(lights_) + bytes_of(codes_) + bytes_of(leaf_) + bytes_of(nodes_) + bytes_of(pair_begin_) +
         bytes_of(pairs_) + bytes_of(groups_) + bytes_of(cubemaps_) + bytes_of(distant_);
}

void WspdTree::save(std::vector<uint8_t>& out) const {
  out.reserve(out.size() + bytes() + 256);
  write_value(out, cube_.lower), write_value(out, cube_.side), write_value(out, cube_.shift), write_value(out, root_);
  write_array(out, lights_), write_array(out, codes_), write_array(out, leaf_), write_array(out, nodes_);
  write_array(out, pair_begin_), write_array(out, pairs_), write_array(out, groups_), write_array(out, cubemaps_);
  write_array(out, distant_);
}

WspdTree WspdTree::load(std::span<const uint8_t> bytes, const LightProfiles& profiles) {
  WspdTree t;
  Reader in(bytes);
  in.value(t.cube_.lower), in.value(t.cube_.side), in.value(t.cube_.shift), in.value(t.root_);
  in.array(t.lights_), in.array(t.codes_), in.array(t.leaf_), in.array(t.nodes_);
  in.array(t.pair_begin_), in.array(t.pairs_), in.array(t.groups_), in.array(t.cubemaps_);
  in.array(t.distant_);
  in.end();
  t.check(profiles);
  return t;
}

// All that following an index, choosing a cell and shading rely on.
void WspdTree::check(const LightProfiles& profiles) const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) fail_argument(std::string("wspd state: ") + what + " make no sense");
  };
  const size_t n = nodes_.size();
  const auto positive = [](float x) { return std::isfinite(x) && x >= 0.0f; };
  const auto light = [&](const Vpl& v) {
    return static_cast<uint32_t>(v.kind) < kVplKinds && is_finite(v.position) && is_finite(v.normal) &&
           positive(v.intensity.x) && positive(v.intensity.y) && positive(v.intensity.z) &&
           std::isfinite(v.edge_or_radius) && std::isfinite(v.blend_cosine) && std::isfinite(v.spot_cosine) &&
           std::isfinite(v.spread_tan) && (v.profile == 0 || profiles.find(v.profile) != nullptr);
  };
  require(is_finite(cube_.lower) && positive(cube_.side) && cube_.side > 0.0f, "bounds");
  for (const double s : cube_.shift) require(s >= 0.0 && s <= 1.0, "bounds");
  require(root_ == WspdNode::kNone ? codes_.empty() : root_ < n && !codes_.empty(), "roots");
  require(codes_.size() == leaf_.size() && codes_.size() <= lights_.size(), "lights");
  for (const Vpl& v : lights_) require(light(v), "lights");
  for (const Vpl& v : groups_) require(light(v), "subgroups");
  for (uint32_t leaf : leaf_) require(leaf < n, "leaves");
  for (size_t i = 0; i < n; ++i) {
    const WspdNode& node = nodes_[i];
    require(is_finite(node.center) && positive(node.radius) && positive(node.power) && positive(node.largest_sphere),
            "nodes");
    require(node.first < node.last && node.last <= lights_.size(), "nodes");
    require(node.child_count <= 8 && uint64_t{node.first_child} + node.child_count <= n, "nodes");
    require(node.leaf() || node.first_child > i, "nodes");  // so that no walk goes round
    require(node.parent == WspdNode::kNone || node.parent < i, "nodes");
    require(uint64_t{node.first_group} + node.group_count <= groups_.size(), "subgroups");
    require(node.cubemap == WspdNode::kNone || node.cubemap < cubemaps_.size(), "cubemaps");
  }
  require(pair_begin_.size() == n + 1 && pair_begin_[0] == 0 && pair_begin_[n] == pairs_.size(), "pairs");
  for (size_t i = 0; i < n; ++i) require(pair_begin_[i] <= pair_begin_[i + 1], "pairs");
  // Whatever a point may take for a cluster, or split one into, has something to be lit from.
  for (uint32_t p : pairs_) require(p < n && nodes_[p].group_count > 0, "pairs");
  for (uint32_t d : distant_) require(d < n && nodes_[d].group_count > 0, "distant lights");
  for (const WspdNode& node : nodes_) {
    require(!node.leaf() || node.group_count > 0, "subgroups");
    for (uint32_t c = 0; c < node.child_count && node.group_count > 0; ++c)
      require(nodes_[node.first_child + c].group_count > 0, "subgroups");
  }
}

}  // namespace lumicut
