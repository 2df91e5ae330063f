// Tree over a batch of shading points: 16 points a leaf, 16 leaves a group, 16 groups a region. [thesis sec. 3.2]
#pragma once

#include <vector>

#include "bsdf/shade_points.h"
#include "clustering/pair_bounds.h"
#include "core/progress.h"

namespace lumicut {

// Departs from the thesis' compressed octree over normals, then positions: points are split in two along the widest of
// the six axes of position and normal, so that normals are split first where they differ most and not where they do
// not; and every split falls on a multiple of the points of a child, so that leaves, groups and regions are full (the
// last of each aside) and the tree needs no pointers. docs/decisions/0006-illumination-cut.md
struct PointTree {
  static constexpr size_t kLeaf = kLanes, kGroup = kLanes * kLeaf, kRegion = kLanes * kGroup;

  ShadePoints points;              // in the order of the tree: leaf j holds points [j·kLeaf, (j + 1)·kLeaf)
  std::vector<uint32_t> order;     // index of each point in the batch
  std::vector<PointNodes> leaves;  // one a group: its leaves, lane by lane
  std::vector<PointNodes> groups;  // one a region: its groups

  size_t size() const { return points.size(); }
  size_t leaf_count() const { return (size() + kLeaf - 1) / kLeaf; }
  size_t group_count() const { return leaves.size(); }
  size_t region_count() const { return groups.size(); }

  // Positions are compared in units of `length`, the distance that counts as much as normals a right angle apart:
  // a sixteenth of the scene's diagonal serves (Walter et al. 2008, sec. 5, for lights). Runs on the caller's arena.
  // `material`: weight of diffuse and specular reflectance, of which a difference of 1 counts as so many right angles.
  // Throws Error(cancelled).
  static PointTree build(const ShadePoints& batch, float length, Progress& progress, float material = 0.0f);
};

}  // namespace lumicut
