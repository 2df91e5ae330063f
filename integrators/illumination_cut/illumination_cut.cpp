#include "integrators/illumination_cut/illumination_cut.h"

#include "core/parallel.h"

namespace lumicut::illumination_cut {

void IlluminationCut::prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) {
  scene_ = &scene;
  const auto& own = params.own<IlluminationCutParams>();
  falloff_ = Falloff(vpls.profiles);
  error_ = own.error;
  floor_ = own.dark_floor;
  visibility_ = own.visibility;
  refine_coarse_ = own.refine_coarse;
  shadow_a_pixel_ = own.shadow_a_pixel;
  material_weight_ = own.material_weight;
  stochastic_ = own.representative == Representation::stochastic;
  seed_ = params.common().seed;
  separation2_ = own.coarse_separation * own.coarse_separation;
  const PhaseTimer timer(context.stats, "light tree");
  tree_ = LightTree::build(vpls.lights, {LightTree::Method::agglomerative, 2.0f * scene.extent().radius(), 1, seed_},
                           context.progress);
  means_.clear();
  if (own.representative == Representation::mean) find_means(context.progress);
  context.stats.set_value("light_tree_bytes", static_cast<double>(tree_.bytes() + means_.size() * sizeof(Mean)));
}

void IlluminationCut::shade(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
                            ShadeContext context) const {
  std::fill(radiance.begin(), radiance.end(), Rgb{});
  std::fill(counts.begin(), counts.end(), PointCounts{});
  if (batch.size() == 0 || tree_.roots().empty()) return;
  // Isolated: a thread that waits here must not start another batch, or memory would grow.
  tbb::this_task_arena::isolate([&] { shade_batch(batch, radiance, counts, context); });
  context.progress.check();
}

IlluminationCut::Representative IlluminationCut::representative(uint32_t index) const {
  const LightNode& node = tree_.node(index);
  if (means_.empty() || node.leaf()) return {tree_.lights()[node.light], tree_.lights()[node.light]};
  const Mean& mean = means_[index];
  Representative r{tree_.lights()[mean.light], tree_.lights()[mean.light]};
  // The profile of a spot is bent too much for means.
  if (node.kind == VplKind::spot) return r;
  r.shining.position = mean.place;
  if (node.kind == VplKind::sphere) r.shining.radius() = mean.radius;
  if (faces_one_side(node.kind))  // lobed lights by the lobe of the central one
    r.shining.normal = mean.direction, r.scatter = &mean.scatter;
  return r;
}

float IlluminationCut::gives(uint32_t index, const Vec3f& position, const Vec3f& normal) const {
  constexpr float kHorizon = 0.01f;  // some of the lights may be above it where their mean is below
  const LightNode& node = tree_.node(index);
  const Mean& mean = means_[index];
  const float light = luminance(node.intensity);
  if (node.kind == VplKind::directional) return light * std::max(kHorizon, -dot(normal, mean.direction));
  const Vec3f v = mean.place - position;
  const float dist2 = std::max(length2(v), 1e-30f);
  const Vec3f to_light = v / std::sqrt(dist2);
  const bool faces = faces_one_side(node.kind);
  const float cosine = faces ? mean_cosine(mean.direction, mean.scatter, to_light) : 1.0f;
  const float least2 = node.kind == VplKind::sphere ? mean.radius * mean.radius : node.least_distance2;
  return light * cosine * std::max(kHorizon, dot(normal, to_light)) / std::max(dist2, least2);
}

const Vpl& IlluminationCut::draw(uint32_t index, const Vec3f& position, const Vec3f& normal, float random) const {
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

void IlluminationCut::find_means(const Progress& progress) {
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

void IlluminationCut::shade_batch(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
                                  ShadeContext context) const {
  PointTree points;
  {
    const PhaseTimer timer(context.stats, "point tree");
    points = PointTree::build(batch, scene_->extent().radius() / 8.0f, context.progress, material_weight_);
  }
  std::vector<float> coarse;
  {
    const PhaseTimer timer(context.stats, "coarse image");
    coarse = coarse_image(points, context);
  }
  // By pairs of a larger error, as a sharper image of what is bright and dark.
  for (uint32_t round = refine_coarse_; round > 0; --round) {
    const PhaseTimer timer(context.stats, "coarse image");
    add_pairs(points, coarse, error_ * std::ldexp(1.0f, 2 * static_cast<int>(round)), radiance, {}, context);
    if (context.progress.cancelled()) return;
    for (size_t i = 0; i < points.size(); ++i) coarse[i] = luminance(radiance[points.order[i]]);
    floor_dark(points.size(), coarse);
  }
  const PhaseTimer timer(context.stats, "pairs");
  add_pairs(points, coarse, error_, radiance, counts, context);
  Counters shaded;
  shaded.points = points.size();
  context.stats.add(shaded);
}

void IlluminationCut::add_pairs(const PointTree& points, const std::vector<float>& coarse, float error,
                                std::span<Rgb> radiance, std::span<PointCounts> counts, ShadeContext context) const {
  parallel_chunks(points.region_count(), 1, [&](size_t region, size_t) {
    if (context.progress.cancelled()) return;
    const auto work = std::make_unique<Workspace>();
    start_region(points, region, coarse, error, *work);
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
    context.stats.add(work->total);
  });
}

}  // namespace lumicut::illumination_cut

namespace lumicut {

namespace {

ParamTable params() {
  using P = illumination_cut::IlluminationCutParams;
  return describe(
      number<&P::error>(
          "error", "Error",
          "Bounds each pair of clusters, as a share of its darkest point's radiance; it is no bound of the pixel's "
          "error",
          "of the radiance", 0, 1),
      choice<&P::visibility>(
          "visibility", "Visibility",
          "full: every shadow ray; sampling: few rays a pair, all where they disagree; recursive: there few again, of "
          "each run of points (Alg. 5); unbiased: as sampling, with random corrections",
          "", "full|sampling|recursive|unbiased"),
      choice<&P::representative>(
          "representative", "Representative",
          "What stands for a cluster of lights. mean: their mean shines, one drawn for each pair casts shadows; "
          "random: one, drawn once by luminance; stochastic: drawn anew for each 16 points and pair, noise in place of "
          "banding",
          "", "mean|random|stochastic"),
      number<&P::dark_floor>("dark_floor", "Dark floor", "Points darker than this are held to its error",
                             "of the mean radiance", 0, 1),
      number<&P::coarse_separation>(
          "coarse_separation", "Coarse separation",
          "Coarse image: largest cluster that is taken as one, seen from its partner; smaller is slower and surer",
          "of the distance", 0.001, 1),
      number<&P::refine_coarse>("refine_coarse", "Refine coarse",
                                "Times that the coarse image is made anew by pairs, of four times the error and more",
                                "", 0, 4),
      flag<&P::shadow_a_pixel>("shadow_a_pixel", "Shadow a pixel",
                               "Samples of one pixel share a shadow ray in each pair"),
      number<&P::material_weight>(
          "material_weight", "Material weight",
          "How much points of unlike reflectance are held apart in the point tree, beside normals a right angle apart",
          "", 0, 100));
}

}  // namespace

extern const IntegratorEntry illumination_cut_integrator;
const IntegratorEntry illumination_cut_integrator = {
    "illumination_cut",
    "IlluminationCut",
    "Clusters points and lights together, with an error bound for each pair: for whole frames",
    "Bus, Mustafa and Biri 2015",
    params,
    []() -> std::unique_ptr<Integrator> { return std::make_unique<illumination_cut::IlluminationCut>(); }};

}  // namespace lumicut
