// Small sets of points that hit every disk of a list. [Bus 2015 (thesis), ch. 5-8]
//
// The default solver is not the thesis's: dominance reduction, greedy, pruning, Lagrangian lower bound, and the (2,1)
// and (3,2) local search of ch. 8, which beats the rounding algorithm (dnet.h) wherever incidence lists fit in memory.
// Where they do not, the points are thinned to candidates along the tree's order, with one for each disk that would be
// left without, and the same solver runs on what those hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

struct HittingSetOptions {
  bool drop_empty_disks = false;  // disks without points: false refuses them by index
  bool local_search = true;       // (2,1) and (3,2) moves
  int bound_iterations = 400;     // subgradient steps for the lower bound, which also steer further greedy starts
  // (point, disk) pairs held in memory, about 24 bytes each. More: points are thinned until about so many are left.
  size_t max_incidences = size_t{1} << 27;
};

struct HittingSet {
  std::vector<uint32_t> points;  // indices, ascending
  // No hitting set has fewer points than this (an integer). gap(): how far above it this one may be.
  size_t lower_bound = 0;
  double gap() const {
    return points.empty() ? 0.0 : static_cast<double>(points.size()) / static_cast<double>(lower_bound) - 1.0;
  }
  size_t empty_disks = 0;                      // dropped
  size_t kernel_points = 0, kernel_disks = 0;  // after dominance reduction
  size_t greedy = 0, pruned = 0;               // sizes on the way
  size_t candidates = 0;  // points considered; fewer than all: memory-bounded path, where the bound is a weaker one
};

// Throws invalid_argument on coordinates, radii that are not finite (or negative, or beyond 1e70) and, unless they are
// to be dropped, on disks without points. Deterministic.
HittingSet solve_hitting_set(std::span<const Point2> points, std::span<const Disk> disks,
                             const HittingSetOptions& options = {});

// The point that hits most disks still unhit, again and again; the smaller index on ties. `pruned` then drops what is
// not needed. Lists of all incidences.
std::vector<uint32_t> greedy_hitting_set(std::span<const Point2> points, std::span<const Disk> disks, bool pruned);

// Ch. 8: replaces up to `k` points (2, 3 or 4) of a hitting set by fewer, as long as it can. With k = 3 the result has
// at most 8 times the optimum's points, and that is tight [Theorem 8.1]; with k = 4 at most 5 times.
// `start` must hit every disk. Found by neighbourhood enumeration on the reduced instance, not by the structures of
// sec. 8.3 (docs/decisions/0010-geometry-local-search.md).
std::vector<uint32_t> improve_hitting_set(std::span<const Point2> points, std::span<const Disk> disks,
                                          std::span<const uint32_t> start, int k);

// The same two for ranges of any kind, given by their points: range i holds members[offsets[i] .. offsets[i + 1]), each
// below `points`; offsets: one more than there are ranges. Theorem 8.1 holds where the ranges are pseudodisks (regions
// whose borders cross at most twice).
HittingSet solve_hitting_set(size_t points, std::span<const size_t> offsets, std::span<const uint32_t> members,
                             const HittingSetOptions& options = {});
std::vector<uint32_t> improve_hitting_set(size_t points, std::span<const size_t> offsets,
                                          std::span<const uint32_t> members, std::span<const uint32_t> start, int k);

// Points in copies of a convex shape, which are pseudodisks: copy i is the shape, its corners counter-clockwise around
// the origin, times disks[i].radius, moved to disks[i].centre. Ranges as above.
struct Ranges {
  std::vector<size_t> offsets{0};
  std::vector<uint32_t> members;
};
Ranges points_in_copies(std::span<const Point2> points, std::span<const Point2> shape, std::span<const Disk> copies);

// Every disk that `set` does not hit, ascending.
std::vector<uint32_t> unhit_disks(std::span<const Point2> points, std::span<const Disk> disks,
                                  std::span<const uint32_t> set);

// Shared with dnet.h: the argument checks above.
void validate_hitting_instance(std::span<const Point2> points, std::span<const Disk> disks);

}  // namespace lumicut
