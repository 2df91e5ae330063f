// Cuts through the light tree for many points at once. [Walter et al. 2005, sec. 3-4]
#pragma once

#include <memory>
#include <vector>

#include "accel/accel.h"
#include "clustering/bounds.h"
#include "clustering/light_tree.h"
#include "core/progress.h"
#include "integrators/integrator.h"
#include "lights/falloff.h"

namespace lumicut {

inline constexpr size_t kCutGroups = 4;
inline constexpr size_t kCutPoints = kCutGroups * kLanes;

// What points were given by each node of their cuts: the nodes that were looked at, parents first.
struct CutRecord {
  static constexpr uint32_t kNone = 0xffffffffu;
  struct Visit {
    uint32_t node, parent;         // of the light tree; among the visits, or kNone
    uint32_t first_child = kNone;  // among the visits
    uint32_t children = 0;         // visited ones, one after the other: those whose bound is above 0 for any point
  };
  std::vector<Visit> visits;
  std::vector<float> luminance;  // [visit][point]: of the node where it is in the point's cut, else 0

  void clear() { visits.clear(), luminance.clear(); }
  uint32_t add(uint32_t node, uint32_t parent);
};

struct CutOptions {
  Falloff falloff;
  float error = 0.02f;  // largest share of a point's luminance that a cluster's bound may reach
  float floor = 0.0f;   // points of less luminance count as of this one
  uint32_t max_cut = 0xffffffffu;
  uint32_t slot = 0;                   // of LightTree::representative
  const Progress* progress = nullptr;  // where it is cancelled, the cuts are left as they are
  CutRecord* record = nullptr;         // to be filled, unless null
};

// A cluster in the cuts of the points in `active`.
struct alignas(64) CutEntry {
  // What of the node is needed again, so that the tree's memory is not.
  uint32_t first_child, representative;
  Rgb intensity;
  uint16_t active[kCutGroups];
  uint32_t visit;  // of CutRecord
  uint32_t lit;    // a bit each group whose estimates are not all 0; those of the others are not even written
  alignas(64) float bound[kCutGroups][kLanes];
  float estimate[3][kCutGroups][kLanes];  // radiance, shadows included; 0 at the other points of a group
};

// Points, their cuts while these grow, and the result. Kept between blocks, so that none allocates.
struct LightCuts {
  PointBlock blocks[kCutGroups];
  alignas(64) float radiance[3][kCutGroups][kLanes];
  alignas(64) uint32_t clusters[kCutGroups][kLanes], rays[kCutGroups][kLanes], bounds[kCutGroups][kLanes];

  // Grows the cuts of points [first, first + count), count <= kCutPoints, first a multiple of kLanes. Each point keeps
  // its own cut by its own bounds and its own radiance; the points share the order of refinement, largest excess of any
  // of them first.
  void grow(const LightTree& tree, const Accel& accel, const CutOptions& options, const ShadePoints& points,
            size_t first, size_t count);

  // Of point i of those.
  Rgb radiance_of(size_t i) const {
    const size_t g = i / kLanes, k = i % kLanes;
    return {radiance[0][g][k], radiance[1][g][k], radiance[2][g][k]};
  }
  PointCounts counts_of(size_t i) const {
    const size_t g = i / kLanes, k = i % kLanes;
    return {clusters[g][k], rays[g][k], bounds[g][k]};
  }

  struct HeapItem {
    float excess;  // largest bound over luminance
    uint32_t entry;
    bool operator<(const HeapItem& o) const { return excess < o.excess || (excess == o.excess && entry > o.entry); }
  };
  std::vector<HeapItem> heap;
  std::vector<uint32_t> resting;  // entries that no point needs refined, as it stood when they were added
  alignas(64) float luminance[kCutGroups][kLanes];                                           // of the cut's estimate
  alignas(64) float x[kCutPoints + kLanes], y[kCutPoints + kLanes], z[kCutPoints + kLanes];  // ends of shadow rays
  uint8_t occluded[kCutPoints + kLanes];

  CutEntry& entry(uint32_t i) { return chunks_[i / kChunk][i % kChunk]; }
  uint32_t allocate();
  void release(uint32_t i) { free_.push_back(i); }
  void drop() { heap.clear(), resting.clear(); }

 private:
  static constexpr size_t kChunk = 64;  // entries stay where they are
  std::vector<std::unique_ptr<CutEntry[]>> chunks_;
  std::vector<uint32_t> free_;
  uint32_t used_ = 0;
};

// Radiance by a light of that intensity at the points in `active` of a block, without shadows: 0 at its others. Returns
// the points that get any; where none does, nothing is written.
uint32_t estimate_light(const Vpl& light, const Rgb& intensity, Falloff falloff, const PointBlock& block,
                        uint32_t active, float* r, float* g, float* b);

}  // namespace lumicut
