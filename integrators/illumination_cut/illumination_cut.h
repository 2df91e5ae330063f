// IlluminationCut: pairs of a cluster of points and a cluster of lights, refined together until the light of each pair
// is bounded under a share of what its darkest point receives. [Bus et al. 2015; thesis ch. 3, Alg. 4 and 5,
// Eq. 3.3-3.4]
// Departs: 16 point clusters are tested against a light cluster at once, and the 256 points of a group descend the light
// tree together, each with bounds of its own at the end, so that a pair is dense SIMD loops and shadow packets; phase I
// keeps irradiance, so that textures are no error of it. docs/decisions/0006-illumination-cut.md
#pragma once

#include <array>
#include <memory>

#include "clustering/bounds.h"
#include "clustering/light_kernel.h"
#include "clustering/light_tree.h"
#include "clustering/pair_bounds.h"
#include "clustering/point_tree.h"
#include "core/rng.h"
#include "integrators/integrator.h"

namespace lumicut::illumination_cut {

inline constexpr size_t kLeaf = PointTree::kLeaf, kGroup = PointTree::kGroup, kRegion = PointTree::kRegion;
static_assert(kGroup == kMaxLit);

enum class Visibility { full, sampling, recursive, unbiased };
enum class Representation { mean, random, stochastic };

struct IlluminationCutParams {
  float error = 0.02f;
  Visibility visibility = Visibility::sampling;
  Representation representative = Representation::mean;
  float dark_floor = 0.01f, coarse_separation = 0.15f;
  uint32_t refine_coarse = 0;  // times that the coarse image is made anew by pairs
  bool shadow_a_pixel = false;
  float material_weight = 0.0f;
};

// Which points of a group are meant, a bit each.
using GroupLanes = std::array<uint16_t, kLanes>;

struct RegionItem {
  uint32_t node;
  uint32_t groups;  // a bit each
};

struct GroupItem {
  uint32_t node;
  GroupLanes lanes;
};

// Working memory of one region.
struct Workspace {
  LitPoints lit;
  float weight[kMaxLit];  // visibility of the lit points, or its estimate
  uint8_t known[kMaxLit];
  // Those of them whose shadows are asked for, and for each the one that stands for it.
  const uint32_t* own = nullptr;
  size_t own_count = 0;
  uint32_t of_pixels[kMaxLit], stands[kMaxLit];
  // Points that are asked for at once.
  float x[kMaxLit + kLanes], y[kMaxLit + kLanes], z[kMaxLit + kLanes];
  uint32_t asked[kMaxLit];
  uint8_t occluded[kMaxLit + kLanes];
  size_t asked_count = 0;
  std::vector<RegionItem> region_stack;
  std::vector<GroupItem> group_stack;
  PointBlock blocks[kRegion / kLeaf];
  float sum[3][kRegion];
  uint32_t clusters[kRegion], rays[kRegion], point_bounds[kRegion];
  uint32_t leaf_bounds[kRegion / kLeaf], group_bounds[kLanes];
  float allowed[kRegion], leaf_allowed[kRegion / kLeaf], group_allowed[kLanes];  // error of a pair
  Counters total;
};

class IlluminationCut final : public Integrator {
 public:
  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override;

  size_t batch_size() const override { return size_t{1} << 17; }

  void shade(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override;

 private:
  // What stands for a node's lights: where shadow rays go, and what shines.
  struct Representative {
    const Vpl& seen;
    Vpl shining;
    const DirectionScatter* scatter = nullptr;
  };
  Representative representative(uint32_t index) const;

  // What a node's lights together give to a point if nothing stands between, about and up to a factor.
  float gives(uint32_t index, const Vec3f& position, const Vec3f& normal) const;

  // One of a node's lights, drawn in proportion to about what each gives to the point. The mean shines for all of them:
  // a light that faces away, or any one that is the same for every pair, would cast other shadows than they do.
  const Vpl& draw(uint32_t index, const Vec3f& position, const Vec3f& normal, float random) const;

  // Means by luminance, and of the two children's central lights the one nearer to them: it casts the shadows of the
  // coarse image.
  void find_means(const Progress& progress);

  void shade_batch(const ShadePoints& batch, std::span<Rgb> radiance, std::span<PointCounts> counts,
                   ShadeContext context) const;

  // ---- Phase I: the coarse image. [thesis sec. 3.2, "Phase I"] ----

  // Luminance of each point, roughly.
  std::vector<float> coarse_image(const PointTree& points, ShadeContext context) const;
  void floor_dark(size_t count, std::vector<float>& coarse) const;

  void push_children(uint32_t node, uint32_t lanes, std::vector<RegionItem>& stack) const;

  // Adds the pairs of `item` that are far enough apart to `irradiance`; returns the lanes whose lights, and those whose
  // points are to be refined.
  std::pair<uint32_t, uint32_t> coarse_pairs(const PointNodes& nodes, const ShadePoints& reps, size_t first,
                                             const RegionItem& item, bool may_descend, LitPoints& lit,
                                             float* irradiance, Counters& total) const;

  // ---- Phase II: the pairs. [thesis Alg. 4] ----

  void start_region(const PointTree& points, size_t region, const std::vector<float>& coarse, float error,
                    Workspace& work) const;

  void region_pairs(const PointTree& points, size_t region, Workspace& work, const Progress& progress) const;

  // All pairs of a batch: their light, and what they cost, which are empty or as long as the batch.
  void add_pairs(const PointTree& points, const std::vector<float>& coarse, float error, std::span<Rgb> radiance,
                 std::span<PointCounts> counts, ShadeContext context) const;

  static GroupLanes lanes_of(const PointTree& points, size_t region, size_t group);

  // A group's points against the lights under `root`.
  void group_pairs(const PointTree& points, size_t region, size_t group, uint32_t root, Workspace& work,
                   const Progress& progress) const;

  // Adds the light of a node, by its representative, to points of a group.
  void add_pair(const PointTree& points, size_t region, size_t group, uint32_t index, const GroupLanes& lanes,
                Workspace& work) const;

  // Whose shadow: of the light that alone is meant, traced whole; of the representative that is seen; of a drawn one.
  enum class Shadow { exact, of_seen, of_drawn };

  void add_light(const PointTree& points, size_t region, size_t group, const Representative& light,
                 const Rgb& intensity, const GroupLanes& lanes, Shadow shadow, uint32_t index, Workspace& work) const;

  // ---- Adaptive visibility. [thesis Alg. 5] ----

  static constexpr size_t kSampleFrom = 8;

  // Fills `own` and `stands`: all lit points, or one of each pixel. [thesis sec. 3.3, "Anti-aliasing"]
  void choose_own(const PointTree& points, size_t first, Workspace& work) const;

  static void ask(uint32_t own, Workspace& work);

  void answer(const Vpl& light, size_t base, Workspace& work) const;

  // Fills `weight` from few rays: one of each of 8 to 32 equal runs of points, and all where they disagree. Packets of
  // neighbours cost so little beside packets of spread samples that a second round of samples does not pay.
  void sample_visibility(const Vpl& light, size_t base, uint32_t index, size_t first, Workspace& work) const;

  // As printed: 8 or 16 rays of as many runs, and each run again where they disagree.
  void sample_recursively(const Vpl& light, size_t base, uint32_t begin, uint32_t end, Rng& rng, Workspace& work) const;

  // What was inferred is a control variate: some of it is traced, and its error taken off as often more.
  void correct(const Vpl& light, size_t base, float inferred, Rng& rng, Workspace& work) const;

  static constexpr uint32_t kCorrectOneIn = 8;

  const Scene* scene_ = nullptr;
  LightTree tree_;
  struct Mean {
    Vec3f place, direction;
    DirectionScatter scatter;
    uint32_t light = 0;  // the central one
    float radius = 0.0f;
  };
  std::vector<Mean> means_;  // a node; empty: the tree's own representatives serve
  Falloff falloff_;
  float error_ = 0.02f, floor_ = 0.01f, separation2_ = 0.0225f, material_weight_ = 0.0f;
  Visibility visibility_ = Visibility::sampling;
  uint32_t refine_coarse_ = 0;
  bool stochastic_ = false, shadow_a_pixel_ = false;
  uint64_t seed_ = 1;
};

}  // namespace lumicut::illumination_cut
