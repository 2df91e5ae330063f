// Well-separated pair decomposition: the clusterings of the lights are all made before any point is known; a point
// takes that of a light near it, and splits what stands too near. [Bus, Mustafa and Biri 2015; thesis ch. 2, Alg. 2,
// Eq. 2.2] Departs: blocks of neighbouring points share a clustering, well-separated from the whole block; visibility
// of a cluster is taken from 16 of the block's points where these agree; bright clusters are split where their radiance
// is known, at the block, not by estimates between pairs. docs/decisions/0007-wspd-blocks.md
#include <memory>
#include <numeric>

#include "clustering/block_kernel.h"
#include "core/parallel.h"
#include "integrators/integrator.h"
#include "integrators/wspd/wspd_tree.h"

namespace lumicut {

namespace {

constexpr size_t kBlock = kMaxLit;   // most points of a block
constexpr size_t kSamples = kLanes;  // points of a block that stand for it
constexpr float kStrong = 0.2f;      // of the brightest cluster allowed: visibility is not taken over for whole blocks
constexpr size_t kPart = 64;         // of a block where the samples disagree: looked at alone

// Points of a batch, reordered so that blocks are contiguous; each block starts at a multiple of kLanes.
struct Blocks {
  struct Block {
    uint32_t first = 0, count = 0;  // in `points`
    Aabb box;
    Vec3f axis{};  // of the cone of normals
    float cos_half = 1.0f;
  };
  static constexpr uint32_t kPadding = 0xffffffffu;

  ShadePoints points;
  ShadePoints samples;           // kSamples a block
  std::vector<uint32_t> origin;  // of each point, in the batch
  std::vector<Block> blocks;

  // `largest`: points of a block. Below kSamples all are samples, else so many spread ones.
  Blocks(const ShadePoints& in, size_t largest);
  bool all_samples() const { return all_samples_; }
  size_t sample_count(const Block& b) const { return all_samples_ ? b.count : kSamples; }
  size_t sample(const Block& b, size_t s) const {
    return all_samples_ ? std::min<size_t>(s, b.count - 1) : s * b.count / kSamples;
  }

 private:
  void split(const ShadePoints& in, std::vector<uint32_t>& order, size_t begin, size_t end, size_t largest,
             bool inside);
  void close(const ShadePoints& in);

  bool all_samples_;
};

Blocks::Blocks(const ShadePoints& in, size_t largest) : all_samples_(largest < kSamples) {
  std::vector<uint32_t> order(in.size());
  std::iota(order.begin(), order.end(), 0u);
  points.reserve(in.size() + in.size() / 8);
  if (!order.empty()) split(in, order, 0, order.size(), largest, false);
  points.finish();
  samples.finish();
}

// Halves the box of positions and normals at its longest side, until blocks are small enough; and on inside of blocks,
// so that neighbours in memory stand together.
void Blocks::split(const ShadePoints& in, std::vector<uint32_t>& order, size_t begin, size_t end, size_t largest,
                   bool inside) {
  const bool opens = !inside && end - begin <= largest;
  if (opens) {
    Block b;
    b.first = static_cast<uint32_t>(origin.size());
    blocks.push_back(b);
  }
  bool done = end - begin <= kLanes && (inside || opens);
  if (!done) {
    Aabb box, turn;
    for (size_t i = begin; i < end; ++i) box.extend(in.position_at(order[i])), turn.extend(in.normal_at(order[i]));
    // Opposite normals count as much as the whole box.
    const float weight = 0.5f * box.diagonal();
    int axis = 0;
    float longest = -1.0f;
    for (int k = 0; k < 6; ++k) {
      const float side = k < 3 ? box.extent()[k] : turn.extent()[k - 3] * weight;
      if (side > longest) longest = side, axis = k;
    }
    const std::vector<float>& key = axis < 3 ? in.position[axis] : in.normal[axis - 3];
    const float middle = axis < 3 ? box.center()[axis] : turn.center()[axis - 3];
    const auto first = order.begin() + static_cast<std::ptrdiff_t>(begin),
               last = order.begin() + static_cast<std::ptrdiff_t>(end);
    auto cut = std::stable_partition(first, last, [&](uint32_t p) { return key[p] < middle; });
    if (cut == first || cut == last) cut = first + (last - first) / 2;  // all in one place
    const auto at = static_cast<size_t>(cut - order.begin());
    split(in, order, begin, at, largest, inside || opens);
    split(in, order, at, end, largest, inside || opens);
  } else {
    for (size_t i = begin; i < end; ++i) {
      points.push(in.get(order[i]));
      origin.push_back(order[i]);
    }
  }
  if (opens) close(in);
}

void Blocks::close(const ShadePoints& in) {
  Block& b = blocks.back();
  b.count = static_cast<uint32_t>(origin.size()) - b.first;
  Vec3f sum{};
  for (uint32_t i = b.first; i < b.first + b.count; ++i) {
    b.box.extend(in.position_at(origin[i]));
    sum += in.normal_at(origin[i]);
  }
  b.axis = length2(sum) > 0.0f ? normalize(sum) : Vec3f{0, 0, 1};
  for (uint32_t i = b.first; i < b.first + b.count; ++i)
    b.cos_half = std::min(b.cos_half, dot(b.axis, in.normal_at(origin[i])));
  for (size_t s = 0; s < kSamples; ++s) samples.push(in.get(origin[b.first + sample(b, s)]));
  const SurfacePoint last = in.get(origin.back());
  while (origin.size() % kLanes != 0) points.push(last), origin.push_back(kPadding);
}

// True where all of the ball lies behind the surface of every point of the block.
bool behind(const Blocks::Block& b, const WspdNode& n) {
  const Vec3f to = n.center - b.box.center();
  const float reach = n.radius + n.largest_sphere + 0.5f * b.box.diagonal(), distance = length(to);
  if (!(distance > reach)) return false;
  const float sine = std::sqrt(std::max(0.0f, 1.0f - b.cos_half * b.cos_half));
  // Largest dot(normal, to): to's angle to the axis less the cone's half-angle.
  const float cosine = std::clamp(dot(b.axis, to) / distance, -1.0f, 1.0f);
  if (cosine >= b.cos_half || b.cos_half <= 0.0f) return false;
  const float largest = cosine * b.cos_half + std::sqrt(std::max(0.0f, 1.0f - cosine * cosine)) * sine;
  return largest * distance + reach < 0.0f;
}

// A cluster in a block's clustering.
struct Cluster {
  uint32_t node = 0;
  bool strong = false;             // its shadows matter enough to be looked at in parts of the block
  BundleOrigin origin;             // of its shadow rays
  float share = 1.0f;              // R of Eq. 2.21
  uint32_t lit = 0, seen = 0;      // samples that get light from it; and are not in its shadow
  float luminance[kSamples] = {};  // what they would get if nothing stood between
  uint32_t seen_by = 0;            // a bit for each that does
};

// Working memory of one block.
struct Workspace {
  std::vector<Cluster> clusters;
  std::vector<uint32_t> stack;
  BlockSums part, sum;
  alignas(64) float x[kMaxLit], y[kMaxLit], z[kMaxLit];
  uint32_t index[kMaxLit];
  uint8_t occluded[kMaxLit];
  uint32_t rays[kMaxLit];
};

enum class Visibility { sampling, full };
enum class LocalVisibility { representative, cubemap };
enum class Clustering { exact, printed };

struct WspdParams {
  float separation = 0.25f, bright = 0.01f;
  Visibility visibility = Visibility::sampling;
  LocalVisibility local_visibility = LocalVisibility::representative;
  float normal_threshold = 0.01f;
  uint32_t block = 256;
  Clustering clusters = Clustering::exact;
};

class Wspd final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    take(scene, vpls, params);
    {
      const PhaseTimer timer(context.stats, "well-separated pairs");
      WspdTree::Options options;
      options.separation = separation_;
      options.normal_threshold = params.own<WspdParams>().normal_threshold;
      options.seed = params.common().seed;
      options.epsilon = 2e-5f * scene.extent().radius();
      options.accel = cubemaps_ ? &scene.accel() : nullptr;
      options.profiles = &vpls.profiles;
      tree_ = WspdTree::build(vpls.lights, options, context.progress);
    }
    tell(context.stats);
  }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    const Blocks blocks(points, largest_block_);
    parallel_chunks(blocks.blocks.size(), 1, [&](size_t b, size_t) {
      if (context.progress.cancelled()) return;
      const auto work = std::make_unique<Workspace>();
      Counters total;
      shade_block(blocks, b, *work, radiance, counts, total, context.progress);
      context.stats.add(total);
    });
    context.progress.check();
  }

  size_t batch_size() const override { return 16384; }

  std::vector<uint8_t> save_state() const override {
    std::vector<uint8_t> out;
    tree_.save(out);
    return out;
  }

  void load_state(const Scene& scene, const VplSet& vpls, const Params& params, std::span<const uint8_t> bytes,
                  ShadeContext context) override {
    take(scene, vpls, params);
    tree_ = WspdTree::load(bytes, vpls.profiles);
    if (tree_.lights().size() > vpls.lights.size()) fail_argument("wspd state: it has more lights than there are");
    tell(context.stats);
  }

 private:
  void take(const Scene& scene, const VplSet& vpls, const Params& params) {
    scene_ = &scene;
    const auto& own = params.own<WspdParams>();
    falloff_ = Falloff(vpls.profiles);
    separation_ = own.separation;
    point_separation_ = separation_ / (1.0f - separation_);
    bright_ = own.bright;
    sampling_ = own.visibility == Visibility::sampling;
    cubemaps_ = own.local_visibility == LocalVisibility::cubemap;
    printed_ = own.clusters == Clustering::printed;
    largest_block_ = printed_ ? 1 : own.block;
  }

  void tell(Stats& stats) const {
    stats.set_value("wspd_bytes", static_cast<double>(tree_.bytes()));
    stats.set_value("wspd_pairs", static_cast<double>(tree_.pair_count()));
    stats.set_value("wspd_cubemaps", static_cast<double>(tree_.cubemap_count()));
  }

  void shade_block(const Blocks& blocks, size_t b, Workspace& work, std::span<Rgb> radiance,
                   std::span<PointCounts> counts, Counters& total, const Progress& progress) const {
    const Blocks::Block& block = blocks.blocks[b];
    std::fill(work.rays, work.rays + block.count, 0u);
    std::fill(work.sum.r, work.sum.r + kMaxLit, 0.0f);
    std::fill(work.sum.g, work.sum.g + kMaxLit, 0.0f);
    std::fill(work.sum.b, work.sum.b + kMaxLit, 0.0f);
    work.clusters.clear();
    uint32_t tests = 0;
    if (printed_) {
      collect_as_printed(blocks, b, work, tests, progress);
    } else {
      collect(blocks, b, work, tests, progress);
      split_bright(blocks, b, work, progress);
    }

    uint32_t used = 0;
    for (size_t c = 0; c < work.clusters.size(); ++c) {
      if (c % 64 == 0 && progress.cancelled()) return;
      const Cluster& cluster = work.clusters[c];
      const bool agreed = blocks.all_samples() || (sampling_ && !cluster.strong && cluster.lit >= kSamples / 2);
      if ((agreed && cluster.seen == 0) || cluster.share == 0.0f) continue;
      ++used;
      if (agreed && cluster.seen == cluster.lit)
        light_block(tree_.groups(tree_.node(cluster.node)), cluster.share, falloff_, blocks.points, block.first,
                    block.count, true, work.sum);
      else
        for (size_t first = 0; first < block.count; first += kPart)
          shade_part(cluster, blocks.points, block.first + first, std::min<size_t>(kPart, block.count - first), first,
                     work);
    }
    for (uint32_t i = 0; i < block.count; ++i) {
      const uint32_t p = blocks.origin[block.first + i];
      radiance[p] = {work.sum.r[i], work.sum.g[i], work.sum.b[i]};
      total.rays += work.rays[i];
      if (!counts.empty()) counts[p] = {used, work.rays[i], tests};
    }
    total.points += block.count;
    total.clusters += uint64_t{used} * block.count;
    total.bounds += tests;
  }

  // Alg. 2 for all points of the block at once: the clustering of a light near its middle, split until well-separated
  // from its box.
  void collect(const Blocks& blocks, size_t b, Workspace& work, uint32_t& tests, const Progress& progress) const {
    const Blocks::Block& block = blocks.blocks[b];
    for (const uint32_t d : tree_.distant()) estimate(blocks, b, d, work);
    if (tree_.root() == WspdNode::kNone) return;
    const uint32_t leaf = tree_.near_leaf(blocks.points.position_at(block.first + block.count / 2));
    const auto add = [&](uint32_t v) {
      split(blocks, b, v, work, tests,
            [&](const WspdNode& n) { return well_separated(block.box, n, point_separation_); });
    };
    add(leaf);
    for (uint32_t w = leaf; w != WspdNode::kNone && !progress.cancelled(); w = tree_.node(w).parent)
      for (const uint32_t v : tree_.pairs(w)) add(v);
  }

  // Takes the cluster `v` where `stays`, else what it is split into; leaves stay.
  template <typename Stays>
  void split(const Blocks& blocks, size_t b, uint32_t v, Workspace& work, uint32_t& tests, const Stays& stays) const {
    work.stack.assign(1, v);
    while (!work.stack.empty()) {
      const uint32_t top = work.stack.back();
      work.stack.pop_back();
      const WspdNode& n = tree_.node(top);
      ++tests;
      if (behind(blocks.blocks[b], n)) continue;
      if (n.leaf() || stays(n))
        estimate(blocks, b, top, work);
      else
        for (uint32_t c = 0; c < n.child_count; ++c) work.stack.push_back(n.first_child + c);
    }
  }

  // Alg. 2 as printed, for a block of one point: clusters that are further from the light than d / ε stay, others are
  // split until well-separated from the point; and all until none gives the light more than its share, by power over
  // squared distance, which the thesis does beforehand for each pair. [thesis secs. 2.2, 2.3]
  void collect_as_printed(const Blocks& blocks, size_t b, Workspace& work, uint32_t& tests,
                          const Progress& progress) const {
    const Blocks::Block& block = blocks.blocks[b];
    for (const uint32_t d : tree_.distant()) estimate(blocks, b, d, work);
    if (tree_.root() == WspdNode::kNone) return;
    const Vec3f point = blocks.points.position_at(block.first);
    const uint32_t leaf = tree_.near_leaf(point);
    const Vec3f light = tree_.node(leaf).center;
    const float limit = length(point - light) / separation_;
    const auto given = [&](const WspdNode& n) {
      return n.power / std::max({length2(light - n.center), n.radius * n.radius, 1e-30f});
    };
    float received = 0.0f;
    for (uint32_t w = leaf; w != WspdNode::kNone; w = tree_.node(w).parent)
      for (const uint32_t v : tree_.pairs(w)) received += given(tree_.node(v));
    estimate(blocks, b, leaf, work);
    for (uint32_t w = leaf; w != WspdNode::kNone && !progress.cancelled(); w = tree_.node(w).parent)
      for (const uint32_t v : tree_.pairs(w))
        split(blocks, b, v, work, tests, [&](const WspdNode& n) {
          const bool apart =
              length(light - n.center) - n.radius >= limit || well_separated(block.box, n, point_separation_);
          return apart && given(n) <= bright_ * received;
        });
  }

  // What the cluster gives to the block's samples; it joins the clustering unless that is certainly nothing.
  void estimate(const Blocks& blocks, size_t b, uint32_t node, Workspace& work) const {
    const Blocks::Block& block = blocks.blocks[b];
    const WspdNode& n = tree_.node(node);
    const std::span<const Vpl> lights = tree_.groups(n);
    Cluster c;
    c.node = node;
    c.origin = shadow_origin(lights[0], block.box.center());
    const Vec3f to_block = block.box.center() - n.center;
    if (!c.origin.directional && !n.leaf()) {
      if (cubemaps_) {  // V to the ball's boundary, R inside
        const float distance = length(to_block);
        c.origin.light = distance > n.radius ? n.center + to_block * (n.radius / distance) : block.box.center();
        c.share = tree_.local_visibility(n, to_block);
      } else {
        c.origin = shadow_origin(representative(n, block.box.center()), block.box.center());
      }
    }
    light_block(lights, 1.0f, falloff_, blocks.samples, b * kSamples, kSamples, false, work.part);
    uint32_t lit[kSamples];
    for (uint32_t s = 0; s < blocks.sample_count(block); ++s) {
      c.luminance[s] = luminance({work.part.r[s], work.part.g[s], work.part.b[s]});
      if (!(c.luminance[s] > 0.0f)) continue;
      const Vec3f p = blocks.samples.position_at(b * kSamples + s);
      work.x[c.lit] = p.x, work.y[c.lit] = p.y, work.z[c.lit] = p.z;
      lit[c.lit++] = s;
    }
    if (c.lit > 0) {
      scene_->accel().occluded_from_point(c.origin, work.x, work.y, work.z, c.lit, work.occluded);
      for (uint32_t i = 0; i < c.lit; ++i) {
        ++work.rays[blocks.sample(block, lit[i])];
        if (work.occluded[i] != 0) continue;
        ++c.seen;
        c.seen_by |= 1u << lit[i];
      }
    }
    work.clusters.push_back(c);
  }

  // A light of the cluster that shines at the block, the strongest of a few.
  const Vpl& representative(const WspdNode& n, const Vec3f& point) const {
    const uint32_t count = n.last - n.first, step = std::max(1u, count / 8);
    uint32_t best = n.first;
    float most = -1.0f;
    for (uint32_t i = n.first; i < n.last; i += step) {
      const Vpl& v = tree_.lights()[i];
      const Vec3f d = normalize(point - v.position);
      const float c = v.kind == VplKind::omni ? 1.0f : std::max(0.0f, dot(v.normal, d));
      const float strength = c * luminance(v.intensity);
      if (strength > most) most = strength, best = i;
    }
    return tree_.lights()[best];
  }

  // Splits clusters that give any sample more than its share of the radiance. [thesis sec. 2.3, "high intensity
  // clusters"]
  void split_bright(const Blocks& blocks, size_t b, Workspace& work, const Progress& progress) const {
    float radiance[kSamples] = {}, mean = 0.0f;
    for (const Cluster& c : work.clusters)
      for (size_t s = 0; s < kSamples; ++s) radiance[s] += c.seen_by >> s & 1 ? c.luminance[s] * c.share : 0.0f;
    for (const float r : radiance) mean += r / static_cast<float>(blocks.sample_count(blocks.blocks[b]));
    float limit[kSamples];
    for (size_t s = 0; s < kSamples; ++s) limit[s] = bright_ * std::max(radiance[s], 0.25f * mean);
    // Shadows have no say in what is split: to split what is seen and leave what is hidden would correct clusters whose
    // shadow ray tells too much, and never those where it tells too little. (Measured: 6 % of the light was lost.)
    // Children join the end of the list and are looked at in their turn.
    size_t kept = 0;
    for (size_t c = 0; c < work.clusters.size(); ++c) {
      if (c % 64 == 0 && progress.cancelled()) return;
      const WspdNode& n = tree_.node(work.clusters[c].node);
      const bool directional = work.clusters[c].origin.directional;
      bool bright = bright_ == 0.0f;
      for (size_t s = 0; s < kSamples; ++s) bright = bright || work.clusters[c].luminance[s] > limit[s];
      if (n.leaf() || !bright) {
        for (size_t k = 0; k < kSamples; ++k)
          work.clusters[c].strong = work.clusters[c].strong || work.clusters[c].luminance[k] > kStrong * limit[k];
        if (kept != c) work.clusters[kept] = work.clusters[c];
        ++kept;
        continue;
      }
      for (uint32_t i = 0; i < n.child_count; ++i)
        if (directional || !behind(blocks.blocks[b], tree_.node(n.first_child + i)))
          estimate(blocks, b, n.first_child + i, work);
    }
    work.clusters.resize(kept);
  }

  // A cluster that the samples do not agree on, at points [first, first + count), which are points [offset, ...) of the
  // block.
  void shade_part(const Cluster& c, const ShadePoints& points, size_t first, size_t count, size_t offset,
                  Workspace& work) const {
    light_block(tree_.groups(tree_.node(c.node)), c.share, falloff_, points, first, count, false, work.part);
    uint32_t lit = 0;
    for (uint32_t i = 0; i < count; ++i)
      if (work.part.r[i] + work.part.g[i] + work.part.b[i] > 0.0f) work.index[lit++] = i;
    if (lit == 0) return;
    const auto trace = [&](uint32_t n) {
      for (uint32_t k = 0; k < n; ++k) {
        const uint32_t i = work.index[k * lit / n];
        work.x[k] = points.position[0][first + i], work.y[k] = points.position[1][first + i],
        work.z[k] = points.position[2][first + i];
        ++work.rays[offset + i];
      }
      scene_->accel().occluded_from_point(c.origin, work.x, work.y, work.z, n, work.occluded);
    };
    bool known = false;
    if (sampling_ && lit > kSamples) {
      trace(kSamples);
      known = std::equal(work.occluded + 1, work.occluded + kSamples, work.occluded);
      if (known && work.occluded[0] != 0) return;
      if (known) std::fill(work.occluded, work.occluded + lit, uint8_t{0});
    }
    if (!known) trace(lit);
    for (uint32_t k = 0; k < lit; ++k) {
      if (work.occluded[k] != 0) continue;
      const uint32_t i = work.index[k];
      work.sum.r[offset + i] += work.part.r[i], work.sum.g[offset + i] += work.part.g[i],
          work.sum.b[offset + i] += work.part.b[i];
    }
  }

  const Scene* scene_ = nullptr;
  WspdTree tree_;
  Falloff falloff_;
  float separation_ = 0.25f, point_separation_ = 1.0f / 3.0f, bright_ = 0.01f;
  bool sampling_ = true, cubemaps_ = true, printed_ = false;
  size_t largest_block_ = kBlock;
};

ParamTable params() {
  using P = WspdParams;
  return describe(
      number<&P::separation>("separation", "Separation", "Radius of a cluster over its distance: smaller is more exact",
                             "", 0.01, 0.9),
      number<&P::bright>("bright", "Brightest cluster",
                         "Clusters that give more than this share of the radiance are split", "of the radiance", 0, 1),
      choice<&P::visibility>(
          "visibility", "Visibility",
          "sampling: points of a block take over what 16 of them see, where these agree; full: each point looks itself",
          "", "sampling|full"),
      choice<&P::local_visibility>(
          "local_visibility", "Visibility in clusters",
          "cubemap: the share of a cluster's light that leaves it, by direction; representative: one of its lights "
          "stands for all",
          "", "representative|cubemap"),
      number<&P::normal_threshold>("normal_threshold", "Normal threshold",
                                   "Lights of a cluster whose normals differ by less count as one", "", 0, 2),
      number<&P::block>("block", "Largest block", "Most points that share a clustering", "points", 1, 256),
      choice<&P::clusters>("clusters", "Clusters",
                           "exact: split until well-separated from the points, and where bright at them; printed: the "
                           "thesis's Alg. 2, point by point, bright clusters split by estimates between pairs",
                           "", "exact|printed"));
}

}  // namespace

extern const IntegratorEntry wspd_integrator;
const IntegratorEntry wspd_integrator = {"wspd",
                                         "Well-separated pairs",
                                         "Clusterings made once for all views, which may be saved; no error bound",
                                         "Bus, Mustafa and Biri 2015; thesis ch. 2",
                                         params,
                                         []() -> std::unique_ptr<Integrator> { return std::make_unique<Wspd>(); }};

}  // namespace lumicut
