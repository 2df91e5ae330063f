// Face clusters of an emissive mesh as leaves of the light tree: a glowing scan in a closed box. All trees are cut by
// the same plain Lightcuts (a heap a point, bounds of clusters/bounds.h), at the same error parameter:
//   agglomerative          all lights, Walter 2008 Eq. 2: what the renderer has by default
//   divisive               halves in the middle of the longest axis of positions: the renderer's quick tree
//   k faces clusters over  lights of a face cluster (Carr & Hart's k-means) are joined first, agglomeratively; then the
//                          clusters, by their mean places and normals: the same lights, another tree
//   face-cluster tree      Carr & Hart's balanced hierarchy of the faces is the tree; lights hang below their faces
//   k leaves alone         one light stands for all of a face cluster: fewer lights, and an error of its own
#include <algorithm>
#include <cmath>
#include <memory>
#include <queue>

#include "bench/experiments/experiment_scene.h"
#include "bench/experiments/experiments.h"
#include "bench/geometry/bench_util.h"
#include "clusters/bounds.h"
#include "clusters/light_kernel.h"
#include "clusters/light_policy.h"
#include "clusters/light_tree.h"
#include "core/cone.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "integrators/integrator.h"

namespace lumicut::bench {
namespace {

constexpr uint64_t kSeeds = 4;
constexpr float kError = 0.75f * 0.02f;  // integrators/lightcuts.cpp at its default

// Node i < lights.size() is that light; the others' children come before them; the last is the root.
struct Tree {
  std::vector<LightNode> nodes;
  std::vector<std::pair<uint32_t, uint32_t>> children;
};

Tree make_tree(const std::vector<Vpl>& lights, const std::vector<std::pair<uint32_t, uint32_t>>& merges,
               uint64_t seed) {
  Tree t;
  const auto n = static_cast<uint32_t>(lights.size());
  std::vector<Aabb> positions(n + merges.size()), directions(n + merges.size());
  t.nodes.resize(positions.size());
  t.children.resize(positions.size(), {kNoNode, kNoNode});
  Rng rng(seed, Stage::light_tree);  // chooses representatives
  for (uint32_t i = 0; i < t.nodes.size(); ++i) {
    LightNode& node = t.nodes[i];
    if (i < n) {
      positions[i].extend(lights[i].position);
      directions[i].extend(lights[i].normal);
      node.intensity = lights[i].intensity;
      node.light = i;
    } else {
      const auto [a, b] = t.children[i] = merges[i - n];
      positions[i] = merge(positions[a], positions[b]);
      directions[i] = merge(directions[a], directions[b]);
      const float la = luminance(t.nodes[a].intensity), lb = luminance(t.nodes[b].intensity);
      node.intensity = t.nodes[a].intensity + t.nodes[b].intensity;
      node.light = rng.next_float() * (la + lb) < la ? t.nodes[a].light : t.nodes[b].light;
      node.first_child = a;  // marks it as inner
    }
    node.kind = VplKind::oriented;
    node.center = positions[i].center();
    node.half = max(positions[i].hi - node.center, node.center - positions[i].lo);
    const Cone cone = cone_of_direction_box(directions[i]);
    const Frame f(cone.axis);
    node.tangent = f.t, node.bitangent = f.b, node.axis = f.n;
    node.cos_half = std::max(-1.0f, cone.cos_half), node.sin_half = cone.sin_half();
    const auto along = [&](const Vec3f& v) {
      return std::abs(v.x) * node.half.x + std::abs(v.y) * node.half.y + std::abs(v.z) * node.half.z;
    };
    node.frame_half = {along(node.tangent), along(node.bitangent), along(node.axis)};
  }
  return t;
}

using Merges = std::vector<std::pair<uint32_t, uint32_t>>;

// Joins `items` (nodes of the tree that is being made) by Eq. 2 of `leaves`; returns the root.
uint32_t join(const std::vector<uint32_t>& items, const std::vector<LightLeaf>& leaves, float diagonal, uint32_t lights,
              Merges& merges) {
  const std::vector<Merge> found = agglomerate_lights(leaves, diagonal, Strategy::parallel);
  const auto n = static_cast<uint32_t>(items.size()), base = lights + static_cast<uint32_t>(merges.size());
  const auto node = [&](uint32_t id) { return id < n ? items[id] : base + id - n; };
  for (const Merge& m : found) merges.emplace_back(node(m.left), node(m.right));
  return found.empty() ? items[0] : lights + static_cast<uint32_t>(merges.size()) - 1;
}

std::vector<LightLeaf> leaves_of(const std::vector<Vpl>& lights, const std::vector<uint32_t>& members) {
  std::vector<LightLeaf> out;
  for (const uint32_t m : members)
    out.push_back({lights[m].position, lights[m].normal, VplKind::oriented, luminance(lights[m].intensity)});
  return out;
}

Merges agglomerative(const std::vector<Vpl>& lights, float diagonal) {
  std::vector<uint32_t> all(lights.size());
  for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  Merges merges;
  join(all, leaves_of(lights, all), diagonal, static_cast<uint32_t>(lights.size()), merges);
  return merges;
}

// Lights of each label joined first, then the labels.
Merges grouped(const std::vector<Vpl>& lights, const std::vector<std::vector<uint32_t>>& groups, float diagonal) {
  Merges merges;
  std::vector<uint32_t> roots;
  std::vector<LightLeaf> means;
  for (const auto& members : groups) {
    if (members.empty()) continue;
    roots.push_back(join(members, leaves_of(lights, members), diagonal, static_cast<uint32_t>(lights.size()), merges));
    LightLeaf mean;
    mean.kind = VplKind::oriented;
    for (const uint32_t m : members) {
      const float w = luminance(lights[m].intensity);
      mean.position += lights[m].position * w, mean.normal += lights[m].normal * w, mean.intensity += w;
    }
    mean.position = mean.position * (1 / mean.intensity);
    mean.normal = length(mean.normal) > 1e-6f * mean.intensity ? normalize(mean.normal) : lights[members[0]].normal;
    means.push_back(mean);
  }
  join(roots, means, diagonal, static_cast<uint32_t>(lights.size()), merges);
  return merges;
}

// The hierarchy of the faces; lights of a face in a row below it; faces without lights drop out.
Merges along_faces(const std::vector<Vpl>& lights, const std::vector<std::vector<uint32_t>>& of_face,
                   const FaceClusterTree& faces) {
  Merges merges;
  const auto n = static_cast<uint32_t>(lights.size());
  std::vector<uint32_t> root(faces.nodes().size(), kNoNode), order, stack{faces.root()};
  while (!stack.empty()) {
    const uint32_t x = stack.back();
    stack.pop_back();
    order.push_back(x);
    const auto& node = faces.nodes()[x];
    if (node.left != FaceClusterTree::kNone) stack.push_back(node.left), stack.push_back(node.right);
  }
  const auto pair = [&](uint32_t a, uint32_t b) {
    if (a == kNoNode || b == kNoNode) return a == kNoNode ? b : a;
    merges.emplace_back(a, b);
    return n + static_cast<uint32_t>(merges.size()) - 1;
  };
  for (size_t i = order.size(); i-- > 0;) {
    const auto& node = faces.nodes()[order[i]];
    if (node.left != FaceClusterTree::kNone)
      root[order[i]] = pair(root[node.left], root[node.right]);
    else
      for (const uint32_t l : of_face[order[i]]) root[order[i]] = pair(root[order[i]], l);
  }
  return merges;
}

Merges divisive(const std::vector<Vpl>& lights) {
  Merges merges;
  const auto n = static_cast<uint32_t>(lights.size());
  std::vector<uint32_t> order(n);
  for (uint32_t i = 0; i < n; ++i) order[i] = i;
  const auto build = [&](const auto& self, uint32_t begin, uint32_t end) -> uint32_t {
    if (end - begin == 1) return order[begin];
    Aabb box;
    for (uint32_t i = begin; i < end; ++i) box.extend(lights[order[i]].position);
    const Vec3f e = box.extent();
    const int axis = e.x >= e.y && e.x >= e.z ? 0 : (e.y >= e.z ? 1 : 2);
    const float middle = box.center()[axis];
    auto cut = std::partition(order.begin() + begin, order.begin() + end,
                              [&](uint32_t l) { return lights[l].position[axis] < middle; });
    auto at = static_cast<uint32_t>(cut - order.begin());
    if (at == begin || at == end) at = begin + (end - begin) / 2;
    const uint32_t a = self(self, begin, at), b = self(self, at, end);
    merges.emplace_back(a, b);
    return n + static_cast<uint32_t>(merges.size()) - 1;
  };
  build(build, 0, n);
  return merges;
}

struct Cut {
  std::vector<Rgb> image;
  double clusters = 0, bounds = 0, rays = 0;  // means a point
};

Cut cut(const ExperimentScene& s, const std::vector<Vpl>& lights, const Tree& tree) {
  Cut out;
  out.image.resize(s.points.size());
  std::vector<uint64_t> clusters(s.points.size()), bounds(s.points.size()), rays(s.points.size());
  const auto root = static_cast<uint32_t>(tree.nodes.size()) - 1;
  parallel_chunks(s.points.size(), 16 * kLanes, [&](size_t begin, size_t end) {
    const auto block = std::make_unique<PointBlock>();
    std::vector<float> bound(tree.nodes.size() * kLanes);
    std::vector<uint32_t> stamp(tree.nodes.size(), 0);
    struct Entry {
      float bound;
      uint32_t node;
      Rgb estimate;
      bool seen;
      bool operator<(const Entry& o) const { return bound < o.bound || (bound == o.bound && node < o.node); }
    };
    std::vector<Entry> heap;
    for (size_t first = begin; first < end; first += kLanes) {
      block->load(s.points, first);
      const auto now = static_cast<uint32_t>(first / kLanes + 1);
      for (size_t k = 0; k < kLanes && first + k < end; ++k) {
        const size_t i = first + k;
        const SurfacePoint p = s.points.get(i);
        const auto bound_of = [&](uint32_t node) {
          if (stamp[node] != now) {
            stamp[node] = now;
            light_node_bounds(tree.nodes[node], *block, s.clamp2, &bound[size_t{node} * kLanes]);
          }
          ++bounds[i];
          return tree.children[node].first == kNoNode ? 0.0f : bound[size_t{node} * kLanes + k];
        };
        const auto estimate = [&](uint32_t node, const Entry* parent) {
          Entry e{bound_of(node), node, {}, false};
          const uint32_t rep = tree.nodes[node].light;
          const Rgb light = light_point(lights[rep], tree.nodes[node].intensity, s.clamp2, p);
          if (parent != nullptr && tree.nodes[parent->node].light == rep) {
            e.seen = parent->seen;
          } else if (luminance(light) > 0) {
            uint8_t occluded = 0;
            s.scene->accel().occluded_from_point(lights[rep].position, false, &p.position.x, &p.position.y,
                                                 &p.position.z, 1, &occluded);
            e.seen = occluded == 0;
            ++rays[i];
          }
          if (e.seen) e.estimate = light;
          return e;
        };
        heap.assign(1, estimate(root, nullptr));
        Rgb sum = heap[0].estimate;
        while (heap[0].bound > kError * std::max(0.0f, luminance(sum))) {
          std::pop_heap(heap.begin(), heap.end());
          const Entry e = heap.back();
          heap.pop_back();
          sum -= e.estimate;
          for (const uint32_t child : {tree.children[e.node].first, tree.children[e.node].second}) {
            heap.push_back(estimate(child, &e));
            sum += heap.back().estimate;
            std::push_heap(heap.begin(), heap.end());
          }
        }
        clusters[i] = heap.size();
        Rgb total{};  // anew: differences leave roundings
        for (const Entry& e : heap) total += e.estimate;
        out.image[i] = total;
      }
    }
  });
  const auto n = static_cast<double>(s.points.size());
  for (size_t i = 0; i < clusters.size(); ++i) {
    out.clusters += static_cast<double>(clusters[i]) / n, out.bounds += static_cast<double>(bounds[i]) / n;
    out.rays += static_cast<double>(rays[i]) / n;
  }
  return out;
}

}  // namespace

bool face_leaves(const char* name) {
  const std::string folder = scenes_folder();
  const BenchMesh mesh = smoke() ? scan(5000) : folder.empty() ? BenchMesh{} : load_obj(folder, name);
  if (mesh.triangles() == 0) return false;
  const auto s = make_lantern(mesh, sized(48u, 8u), sized(20000u, 500u));
  const std::vector<Vpl>& lights = s->lights.lights;
  const float diagonal = 2.0f * s->scene->radius();
  // Which face each light is on: a ray back into the surface.
  std::vector<std::vector<uint32_t>> of_face(mesh.triangles());
  size_t lost = 0;
  for (uint32_t l = 0; l < lights.size(); ++l) {
    RayHit hit;
    hit.ray.org = lights[l].position + lights[l].normal * (4 * s->scene->epsilon());
    hit.ray.dir = -lights[l].normal;
    s->scene->accel().intersect({&hit, 1});
    const bool found = hit.hit.geom == 1 && hit.ray.tfar < 20 * s->scene->epsilon();
    lost += !found;
    of_face[found ? hit.hit.prim : 0].push_back(l);
  }
  FaceMesh faces;
  for (const Vec3f& p : s->scene->meshes()[1].positions)
    faces.vertices.push_back({static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
  for (size_t t = 0; t < mesh.triangles(); ++t)
    faces.faces.push_back({mesh.indices[3 * t], mesh.indices[3 * t + 1], mesh.indices[3 * t + 2]});
  std::printf("\n## faces, %s: %ux%u, %zu faces, %zu lights (%zu on no face); CPU relative to the first row\n", name,
              s->side, s->side, mesh.triangles(), lights.size(), lost);
  {  // the renderer's own, for the first row
    Params params(all_params(*find_integrator("lightcuts")));
    const auto integrator = find_integrator("lightcuts")->create();
    Progress progress;
    Stats stats;
    integrator->prepare(*s->scene, s->lights, params, {progress, stats});
    std::vector<Rgb> image(s->points.size());
    integrator->shade(s->points, image, {}, {progress, stats});
    std::printf("lightcuts: cut %.1f, RMSE %.4f\n",
                static_cast<double>(stats.counters().clusters) / static_cast<double>(s->points.size()),
                rmse(image, s->reference));
  }
  std::printf("means of %llu choices of representatives\n", static_cast<unsigned long long>(kSeeds));
  std::printf("%-34s | %6s | %8s %6s | %6s %6s %6s | %-23s %6s | %s\n", "tree", "lights", "clusters", "tree", "cut",
              "bounds", "rays", "RMSE", "mean", "cutting");
  double first_build = 0, first_cut = 0;
  const auto row = [&](const char* label, const std::vector<Vpl>& own, double clustering, auto&& topology) {
    Merges merges;
    const double build = time_of([&] { merges = topology(); });
    double cutting = 0, error = 0, least = 1e30, most = 0, mean = 0, clusters = 0, bounds = 0, rays = 0;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const Tree tree = make_tree(own, merges, seed);
      Cut c;
      cutting += time_of([&] { c = cut(*s, own, tree); });
      const double e = rmse(c.image, s->reference);
      error += e / kSeeds, least = std::min(least, e), most = std::max(most, e);
      mean += mean_error(c.image, s->reference) / kSeeds;
      clusters += c.clusters / kSeeds, bounds += c.bounds / kSeeds, rays += c.rays / kSeeds;
    }
    if (first_build == 0) {
      first_build = build, first_cut = cutting;
      std::printf("(one cutting takes %.1f times the first tree's building)\n", cutting / kSeeds / build);
    }
    std::printf("%-34s | %6zu | %8.2f %6.2f | %6.1f %6.1f %6.1f | %.4f (%.4f..%.4f) %5.2f%% | %.2f\n", label,
                own.size(), clustering / first_build, build / first_build, clusters, bounds, rays, error, least, most,
                100 * mean, cutting / first_cut);
    std::fflush(stdout);
  };
  row("agglomerative", lights, 0, [&] { return agglomerative(lights, diagonal); });
  row("divisive", lights, 0, [&] { return divisive(lights); });
  {
    std::unique_ptr<FaceClusterTree> hierarchy;
    const double time =
        time_of([&] { hierarchy = std::make_unique<FaceClusterTree>(faces, std::span<const double>()); });
    row("face-cluster tree", lights, time, [&] { return along_faces(lights, of_face, *hierarchy); });
  }
  for (const uint32_t k : {256u, 2048u}) {
    std::vector<std::vector<uint32_t>> groups;
    const double time = time_of([&] {
      FaceKmeansOptions options;
      options.clusters = k;
      FaceKmeans clusters(faces, options);
      clusters.run(30);
      groups.resize(clusters.seeds().size());
      for (size_t f = 0; f < of_face.size(); ++f)
        for (const uint32_t l : of_face[f]) groups[clusters.labels()[f]].push_back(l);
    });
    row((std::to_string(k) + " face clusters over their lights").c_str(), lights, time,
        [&] { return grouped(lights, groups, diagonal); });
    std::vector<Vpl> alone;
    Rng rng(1, Stage::test, k);
    for (const auto& members : groups) {
      if (members.empty()) continue;
      Rgb sum{};
      float weight = 0;
      uint32_t chosen = members[0];
      for (const uint32_t m : members) {
        const float w = luminance(lights[m].intensity);
        sum += lights[m].intensity, weight += w;
        if (rng.next_float() * weight < w) chosen = m;
      }
      alone.push_back(lights[chosen]);
      alone.back().intensity = sum;
    }
    row((std::to_string(k) + " leaves alone").c_str(), alone, time, [&] { return agglomerative(alone, diagonal); });
  }
  return true;
}

}  // namespace lumicut::bench
