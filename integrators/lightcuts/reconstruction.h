// Reconstruction cuts: most points take what neighbours with cuts of their own know of visibility.
// [Walter et al. 2005, sec. 5]
// Departs: the paper replaces a cluster by a directional light that gives a neighbour what its cut gave it. Here it is
// the ratio between the two ways to light a neighbour that is interpolated, by its cut and by the cluster's
// representative without shadows; the representative is then evaluated at the point itself, with its own normal and
// textures. Blocks have a fixed number of points in the order in which they come (Morton order), and none is divided:
// points that no neighbour of their block stands for get cuts of their own.
#pragma once

#include <vector>

#include "integrators/integrator.h"
#include "integrators/lightcuts/light_cuts.h"

namespace lumicut {

// Work of one thread, kept between blocks.
class Reconstruction {
 public:
  // `stride`: one point of so many gets a cut in any case; 4 or 16.
  explicit Reconstruction(size_t stride) : stride_(stride) {}

  // Points of one call: kCutPoints cuts stand for so many.
  static size_t points_at_once(size_t stride) { return stride * kCutPoints; }

  // Fills radiance and work of the points [begin, end), begin a multiple of points_at_once. Work that is not done by
  // cuts has no bounds.
  void shade(const LightTree& tree, const Accel& accel, CutOptions options, const ShadePoints& points, size_t begin,
             size_t end, Rgb* radiance, PointCounts* counts);

 private:
  static constexpr size_t kSamples = 4;  // that a block's other points are reconstructed from

  struct Node {
    uint32_t visit;
    float rest[kSamples];  // what samples whose cut ended above get of it
  };
  struct Group {  // kLanes points of a block
    PointBlock points;
    uint32_t wanted;                 // those to reconstruct
    float weight[kSamples][kLanes];  // 0: a sample that does not stand for the point; else they sum to 1
    float radiance[3][kLanes];
    alignas(64) float estimate[3][kLanes];  // of one light
    uint32_t clusters[kLanes], rays[kLanes];
  };

  void grow(const LightTree& tree, const Accel& accel, const CutOptions& options, const ShadePoints& points,
            size_t first, size_t count, const std::vector<size_t>& place, Rgb* radiance, PointCounts* counts);
  void weigh(const ShadePoints& points, size_t begin, size_t first, size_t count, Group& group);
  void reconstruct(const LightTree& tree, const Accel& accel, const CutOptions& options, size_t samples, size_t groups);
  void trace(const Accel& accel, const Vpl& light, Group& group, uint32_t lit);

  size_t stride_;
  LightCuts cuts_;
  CutRecord record_;
  std::vector<float> below_;  // [visit][sample]: luminance by the node and all below it
  std::vector<Node> stack_;
  std::vector<size_t> alone_;
  Group groups_[kCutGroups];
  size_t sample_begin_ = 0;  // the block's first among those of the record
};

}  // namespace lumicut
