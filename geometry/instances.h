// Instances of hitting sets: the families of the thesis's Table 7.1 that can be generated, and the one on which (3,2)
// local search is as bad as it can be. [Bus 2015 (thesis), sec. 7.3 and Theorem 8.5]
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

// In the unit square.
std::vector<Point2> uniform_points(size_t n, uint64_t seed);
// Nine Gaussians with random mean and covariance, scaled to the unit square.
std::vector<Point2> gauss9_points(size_t n, uint64_t seed);

// RND(largest): `count` centres uniform in the unit square and radii uniform in [0, largest], without the disks that
// hold no point.
std::vector<Disk> random_disks(std::span<const Point2> points, size_t count, double largest, uint64_t seed);
// FIX(radius): one around each point.
std::vector<Disk> fixed_disks(std::span<const Point2> points, double radius);

struct TightInstance {
  std::vector<Point2> points;   // first a hitting set of (side + 1)(side + 2) / 2 points, then those of `start`
  std::vector<Disk> disks;      // each holds two points: one of either set
  std::vector<uint32_t> start;  // 4 side² points that hit every disk; no (3,2) move improves it
  size_t small = 0;             // size of the small set: no hitting set need be larger
};

// A triangle of the triangular lattice, `side` (1 to 300) edges long. start / small goes to 8 as side grows.
//
// Departs: the thesis has the points from a theorem that such Delaunay triangulations exist. Here they are explicit:
// touching circles around the lattice's points, on the sphere (stereographic projection keeps circles and contact).
// Small set: the circles' spherical centres. Start: in each face the spherical centre of the circle through its three
// contacts, and each contact once for each face beside it, moved a little towards that face. In the plane a contact
// lies on the rim of the disk that has the centres of circle and face at the ends of a diameter (Thales); on the
// sphere, strictly outside.
TightInstance tight_instance(int side);

}  // namespace lumicut
