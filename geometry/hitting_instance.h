// A hitting-set instance as incidence lists, its dominance reduction, and what the solvers do on the reduced one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/point2.h"
#include "geometry/point_tree.h"

namespace lumicut::hitting {

// Compressed lists: item i owns list[offset[i] .. offset[i + 1]).
struct Lists {
  std::vector<size_t> offset{0};
  std::vector<uint32_t> list;
  std::span<const uint32_t> operator[](size_t i) const { return {list.data() + offset[i], offset[i + 1] - offset[i]}; }
  size_t size() const { return offset.size() - 1; }
};

// Ids are local; `point_id` and `disk_id` tell the caller's.
struct Instance {
  std::vector<uint32_t> point_id, disk_id;
  Lists points_of;  // by disk, ascending
  Lists disks_of;   // by point, ascending
};

// All incidences of the chosen disks; points that hit none of them are left out.
Instance make_instance(const PointTree& tree, std::span<const Disk> disks, std::span<const uint32_t> chosen);

// The same of ranges of any kind: range i holds members[offsets[i] .. offsets[i + 1]), points below `points`.
Instance make_instance(size_t points, std::span<const size_t> offsets, std::span<const uint32_t> members);

struct Kernel {
  Instance instance;
  std::vector<uint32_t> stands_for;  // by local point of the unreduced instance: the kernel's point that hits as much
};

// Drops disks that hold another disk's points, and points whose disks another point hits as well, until none is left.
Kernel reduce(const Instance& full);

// A solution is a set of local points, as flags.
using Solution = std::vector<uint8_t>;

// By the most disks still unhit; the smaller index on ties.
Solution greedy(const Instance& in);
void prune(const Instance& in, Solution& s);
size_t count(const Solution& s);

// Lagrangian relaxation by subgradients: returns the best bound found (a real number; every hitting set has at least
// that many points), and improves `best` by greedy rounds on the reduced costs.
double lower_bound(const Instance& in, int iterations, Solution& best);

// (2,1) moves, from k = 3 on (3,2) moves, with k = 4 (4,3) moves, until none is left.
void local_search(const Instance& in, int k, Solution& s);

}  // namespace lumicut::hitting
