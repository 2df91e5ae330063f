// Hitting sets for disks by rounding with epsilon-nets. [Bus, Mustafa, Ray 2015; Bus 2015 (thesis), ch. 7, Alg. 8]
//
// Target lumicut_geometry_cgal. O(n) memory: no incidence lists. The default solver (hitting_set.h) gives smaller sets.
// Departs from the thesis:
// - unless asked for otherwise, the points in a disk are reported by a kd-tree over all points, not from the net's
//   Delaunay triangulation (Lemmas 7.2, 7.3); whether a disk is hit, by flags in the same tree, not by the nearest point
//   of the set. Both find the same sets.
// - its nets are the certified ones of epsilon_net.h, about a third of the thesis's size, unless asked for otherwise.
// - guesses for the optimum, which the thesis leaves open: .35, .5, .7 and 1 times the size of a first hitting set.
// - every phase leaves a hitting set, Q ∪ R ∪ S; the best of all phases and guesses is kept, and phases end at eleven,
// as
//   in the thesis's Table 7.1. Weights are renormalised before they overflow.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/epsilon_net.h"
#include "geometry/point2.h"

namespace lumicut {

struct DnetOptions {
  double c1 = 30;   // Q is a (c1/OPT)-net
  double c2 = 12;   // R is a (c2/OPT)-net of the weights
  double c3 = 2;    // a disk is reweighed only when its weight is at most c3·W/OPT
  double c4 = 2;    // by this factor
  double c5 = 0.6;  // the last phase is one that adds at most c5·OPT points
  int max_phases = 11;
  enum class Structures { kd_tree, delaunay };
  Structures structures = Structures::kd_tree;
  double optimum = 0;  // guess of it; 0: four guesses
  EpsilonNetOptions net;
  bool drop_empty_disks = false;
  bool prune = false;  // drop points that are not needed, in the end; O(incidences of the set)
  uint64_t seed = 0;
};

struct DnetResult {
  std::vector<uint32_t> points;  // indices, ascending
  size_t q = 0, r = 0, s = 0;    // sizes of the three parts
  int phases = 0;
  double guess = 0;
  size_t reports = 0, reweighed = 0;  // disks whose points were reported, and of those reweighed
  size_t empty_disks = 0;
};

// Errors as solve_hitting_set's.
DnetResult dnet_hitting_set(std::span<const Point2> points, std::span<const Disk> disks,
                            const DnetOptions& options = {});

}  // namespace lumicut
