// Epsilon-nets of weighted points for disks: a subset that hits every disk which holds at least epsilon of the weight.
// [Bus, Garg, Mustafa, Ray 2015; Bus 2015 (thesis), ch. 6, Alg. 6]
//
// Target lumicut_geometry_cgal: Delaunay triangulations are CGAL's (GPL).
//
// The oracle is exact: a disk without a point of the net grows until its rim holds two of the net's points, so the
// points in it lie in one of the empty disks through a Delaunay edge (sweep that pencil), or in an open half-plane
// through a hull vertex (turn it about the vertex). Membership and order are decided by exact predicates. Departs from
// the thesis:
// - certified mode is ours: a small sample, then a point of every disk that the oracle finds too heavy, until none is
// left.
//   A disk that is too heavy after a round was so before it, hence only points of violating pencils are looked at
//   again.
// - thesis mode solves the small subproblems (Lemmas 6.3, 6.4) by the same sampling, as the authors' own code does.
// - the proof of Lemma 6.8 lets every unhit disk grow to a second point; one that lies beyond a hull vertex never meets
// it.
//   The half-planes through hull vertices close that gap, in both modes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

struct EpsilonNetOptions {
  enum class Mode { certified, thesis };
  Mode mode = Mode::certified;
  // Size of the random sample times epsilon. 0: 0.7 in certified mode, 7 in thesis mode (the theory's value is 12).
  double c0 = 0;
  uint64_t seed = 0;
};

struct EpsilonNet {
  std::vector<uint32_t> points;  // indices, ascending
  size_t sample = 0;             // of which by the first random sample
  size_t rounds = 0;             // certified mode: triangulations built
};

// `weights`: one a point, finite and not negative; empty: all 1. `epsilon` in (0, 1]. Points may repeat or be
// collinear. Throws invalid_argument on anything else, naming it. Deterministic in the seed.
EpsilonNet epsilon_net(std::span<const Point2> points, std::span<const double> weights, double epsilon,
                       const EpsilonNetOptions& options = {});

// Weight of the heaviest disk that no point of the net lies in (0 when the net hits every point), and its points.
double heaviest_unhit_disk(std::span<const Point2> points, std::span<const double> weights,
                           std::span<const uint32_t> net, std::vector<uint32_t>* members = nullptr);

}  // namespace lumicut
