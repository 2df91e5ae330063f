// Stochastic lightcuts: a cut of fixed size for each point, and one random light of each of its clusters: unbiased
// noise in place of the banding of fixed representatives. [Yuksel 2019]
// Departs:
// - 16 neighbouring points share a cut, chosen by the sum of their error bounds; each draws lights of its own.
// - Within a cluster that is small as seen from the point, lights are drawn by intensity alone, in one step; the
//   descent by distance and orientation goes on only as long as they matter.
//   docs/decisions/0012-stochastic-lightcuts-descent.md
#include <memory>

#include "bsdf/point_bsdf.h"
#include "clustering/bounds.h"
#include "clustering/light_kernel.h"
#include "clustering/light_tree.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "integrators/integrator.h"
#include "scene/rng_at_point.h"

namespace lumicut {

namespace {

struct CutNode {
  uint32_t node;
  float key;  // sum of the points' bounds
  bool operator<(const CutNode& o) const { return key < o.key || (key == o.key && node > o.node); }
};

// Working memory of one thread.
struct Workspace {
  PointBlock block;
  std::vector<CutNode> heap, leaves;
  std::vector<Ray> rays;  // shadow rays of one point, and what they carry
  std::vector<Rgb> light;
};

struct StochasticParams {
  uint32_t lights = 64;
};

class StochasticLightcuts final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    scene_ = &scene;
    falloff_ = Falloff(vpls.profiles);
    size_ = params.own<StochasticParams>().lights;
    seed_ = params.common().seed;
    const PhaseTimer timer(context.stats, "light tree");
    tree_ = LightTree::build(vpls.lights, {LightTree::Method::agglomerative, 2.0f * scene.extent().radius(), 1, seed_},
                             context.progress);
    // Leaves of a node lie together: a range of lights, and sums of luminance up to each, draw one by its intensity.
    const size_t n = tree_.node_count();
    ranges_.resize(n);
    for (size_t i = n; i-- > 0;) {
      const LightNode& node = tree_.node(static_cast<uint32_t>(i));
      ranges_[i] = node.leaf() ? Range{node.light, node.light + 1}
                               : Range{ranges_[node.first_child].begin, ranges_[node.first_child + 1].end};
    }
    upto_.assign(tree_.lights().size() + 1, 0.0);
    for (size_t l = 0; l < tree_.lights().size(); ++l)
      upto_[l + 1] = upto_[l] + static_cast<double>(luminance(tree_.lights()[l].intensity));
    context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes()));
  }

  bool chooses_at_each_point() const override { return true; }
  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    parallel_chunks(points.size(), 16 * kLanes, [&](size_t begin, size_t end) {
      const auto work = std::make_unique<Workspace>();
      Counters total;
      for (size_t first = begin; first < end; first += kLanes) {
        if (context.progress.cancelled()) return;
        shade_block(points, first, std::min(kLanes, end - first), radiance, counts, context.progress, *work, total);
      }
      context.stats.add(total);
    });
    context.progress.check();
  }

 private:
  struct Range {
    uint32_t begin, end;
  };
  struct Draw {
    uint32_t light;
    float probability;  // 0: the cluster gives the point nothing
  };

  void shade_block(const ShadePoints& points, size_t first, size_t count, std::span<Rgb> radiance,
                   std::span<PointCounts> counts, const Progress& progress, Workspace& work, Counters& total) const {
    work.block.load(points, first);
    const uint32_t bounds = choose_cut(count, progress, work);
    for (size_t i = 0; i < count; ++i) {
      PointCounts c;
      radiance[first + i] = shade_point(points.get(first + i), progress, work, c);
      c.bounds = bounds;
      if (!counts.empty()) counts[first + i] = c;
      total.clusters += c.clusters, total.rays += c.rays, total.bounds += c.bounds;
    }
    total.points += count;
  }

  // Leaves the cut in work.heap. Returns the number of bounds evaluated for each point.
  uint32_t choose_cut(size_t count, const Progress& progress, Workspace& work) const {
    uint32_t evaluated = 0;
    work.heap.clear(), work.leaves.clear();
    const auto add = [&](uint32_t index) {
      alignas(64) float bound[kLanes];
      light_node_bounds(tree_.node(index), work.block, bound);
      ++evaluated;
      float key = 0.0f;
      for (size_t i = 0; i < count; ++i) key += bound[i];
      if (!(key > 0.0f)) return;  // none of its lights reaches any of the points
      if (tree_.node(index).leaf()) {
        work.leaves.push_back({index, key});
      } else {
        work.heap.push_back({index, key});
        std::push_heap(work.heap.begin(), work.heap.end());
      }
    };
    for (uint32_t root : tree_.roots()) add(root);
    uint32_t steps = 0;
    while (!work.heap.empty() && work.heap.size() + work.leaves.size() < size_) {
      if (++steps % 1024 == 0 && progress.cancelled()) break;
      std::pop_heap(work.heap.begin(), work.heap.end());
      const uint32_t child = tree_.node(work.heap.back().node).first_child;
      work.heap.pop_back();
      add(child);
      add(child + 1);
    }
    work.heap.insert(work.heap.end(), work.leaves.begin(), work.leaves.end());
    // In the tree's order: shadow rays to neighbouring clusters follow each other.
    std::sort(work.heap.begin(), work.heap.end(),
              [&](const CutNode& a, const CutNode& b) { return ranges_[a.node].begin < ranges_[b.node].begin; });
    return evaluated;
  }

  Rgb shade_point(const SurfacePoint& point, const Progress& progress, Workspace& work, PointCounts& c) const {
    work.rays.clear(), work.light.clear();
    Rng rng = rng_at_point(*scene_, point, seed_, Stage::representative);
    uint32_t steps = 0;
    for (const CutNode& cut : work.heap) {
      if (steps++ % 1024 == 0 && progress.cancelled()) break;
      const Draw draw = draw_light(cut.node, point, rng);
      if (!(draw.probability > 0.0f)) continue;
      const Vpl& light = tree_.lights()[draw.light];
      const Rgb given = light_point(light, light.intensity * (1.0f / draw.probability), falloff_, point);
      if (!(max_component(given) > 0.0f)) continue;
      // As all methods trace them: from the light.
      Ray ray;
      ray.mask = light.ray_mask;
      if (light.kind == VplKind::directional) {
        ray.org = point.position, ray.dir = -light.normal;
      } else {
        ray.org = shadow_origin(light, point.position).light, ray.dir = point.position - ray.org,
        ray.tfar = 0x1.fffffep-1f, ray.flags = kFromLight;
      }
      work.rays.push_back(ray);
      work.light.push_back(given);
    }
    c.rays = static_cast<uint32_t>(work.rays.size());
    if (!work.rays.empty()) scene_->accel().occluded(work.rays);
    Rgb sum{};
    for (size_t i = 0; i < work.rays.size(); ++i) {
      if (work.rays[i].tfar < 0.0f) continue;
      sum += work.light[i];
      ++c.clusters;
    }
    return sum;
  }

  // One light of the node's, with the probability that it was drawn. Every light that can give the point anything is
  // drawn with a probability above 0.
  Draw draw_light(uint32_t index, const SurfacePoint& point, Rng& rng) const {
    float probability = 1.0f;
    while (!tree_.node(index).leaf()) {
      const LightNode& node = tree_.node(index);
      if (node.kind == VplKind::directional) break;
      const Vec3f to_center = node.center - point.position;
      const float least2 = node.least_distance2;
      if (length2(node.half) < kSmall2 * std::max(length2(to_center), least2)) break;
      const Weights a = weights(tree_.node(node.first_child), point),
                    b = weights(tree_.node(node.first_child + 1), point);
      // By the nearest and by the farthest that the children may be: half of each. [Yuksel 2019, sec. 4.2]
      const float near = a.near + b.near, far = a.far + b.far;
      if (!(near > 0.0f) || !(far > 0.0f)) return {0, 0.0f};
      const float left = 0.5f * (a.near / near + a.far / far);
      if (rng.next_float() < left) {
        probability *= left;
        index = node.first_child;
      } else {
        probability *= 1.0f - left;
        index = node.first_child + 1;
      }
    }
    const Range range = ranges_[index];
    if (range.end - range.begin == 1) return {range.begin, probability};
    const double from = upto_[range.begin], all = upto_[range.end] - from;
    const double at = from + all * rng.next_float();
    const auto found = std::upper_bound(upto_.begin() + range.begin + 1, upto_.begin() + range.end, at);
    const auto light = std::min<uint32_t>(static_cast<uint32_t>(found - upto_.begin()) - 1, range.end - 1);
    return {light, probability * static_cast<float>((upto_[light + 1] - upto_[light]) / all)};
  }

  struct Weights {
    float near, far;
  };
  // Intensity, cosines and lobe over the squared distance, least and largest; the box taken as the sphere around it. 0
  // only where no light of the node can give anything.
  Weights weights(const LightNode& node, const SurfacePoint& point) const {
    const Vec3f v = node.center - point.position;
    // Spheres shine from all around their centres.
    const float radius = length(node.half) + node.largest_radius, distance = length(v);
    const float reach = 1.0f / std::max(std::max(distance, radius), 1e-30f);
    const auto best_cosine = [&](const Vec3f& axis) { return std::min(1.0f, (dot(axis, v) + radius) * reach + 1e-5f); };
    const float cosine = best_cosine(point.normal);
    if (!(cosine > 0.0f)) return {0.0f, 0.0f};
    float reflected = luminance(point.diffuse);
    if (point.lobes() != Lobes::none) reflected += lobe_importance(point, cosine, best_cosine(point.mirror));
    float emitted = 1.0f;
    if (faces_one_side(node.kind) && distance > radius) {
      const float c = -dot(node.axis, v) / distance;
      const float wide =
          c >= node.cos_half ? 1.0f : c * node.cos_half + std::sqrt(std::max(0.0f, 1.0f - c * c)) * node.sin_half;
      emitted = std::min(1.0f, wide + 1.5707964f * radius / distance + 1e-5f);  // asin x ≤ π/2 x
      if (!(emitted > 0.0f)) return {0.0f, 0.0f};
    }
    const Vec3f a{std::abs(v.x), std::abs(v.y), std::abs(v.z)};
    const float least2 = node.least_distance2;
    const float near2 = std::max(length2(max(a - node.half, Vec3f{})), least2),
                far2 = std::max(length2(a + node.half), least2);
    const float w = luminance(node.intensity) * cosine * reflected * emitted;
    return {w / std::max(near2, 1e-30f), w / std::max(far2, 1e-30f)};
  }

  static constexpr float kSmall2 = 0.1f * 0.1f;

  const Scene* scene_ = nullptr;
  LightTree tree_;
  std::vector<Range> ranges_;  // of the lights below each node
  std::vector<double> upto_;   // luminance of the lights before each
  Falloff falloff_;
  size_t size_ = 0;
  uint64_t seed_ = 1;
};

ParamTable params() {
  return describe(number<&StochasticParams::lights>(
      "lights", "Lights", "Clusters in each point's cut, and so shadow rays: twice as many halve the variance",
      "lights", 1, 1e8));
}

}  // namespace

extern const IntegratorEntry stochastic_lightcuts_integrator;
const IntegratorEntry stochastic_lightcuts_integrator = {
    "stochastic_lightcuts",
    "Stochastic lightcuts",
    "A cut of fixed size for each point, and a random light of each of its clusters: unbiased, with noise",
    "Yuksel 2019",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<StochasticLightcuts>(); }};

}  // namespace lumicut
