#include "geometry/hitting_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/error.h"
#include "geometry/hitting_instance.h"
#include "geometry/point_tree.h"

namespace lumicut {
namespace {

using namespace hitting;

// Solves one instance held in memory. Returns local points of the kernel, as the caller's ids.
HittingSet solve_lists(const Instance& full, const HittingSetOptions& options) {
  HittingSet result;
  const Kernel kernel = reduce(full);
  const Instance& in = kernel.instance;
  result.kernel_points = in.point_id.size();
  result.kernel_disks = in.disk_id.size();
  // Two starts: greedy on everything, taken over into the kernel, so that the result is never worse; and on the kernel.
  Solution plain = greedy(full), best(in.point_id.size(), 0);
  result.greedy = count(plain);
  prune(full, plain);
  for (size_t p = 0; p < plain.size(); ++p)
    if (plain[p] && kernel.stands_for[p] != 0xffffffffu) best[kernel.stands_for[p]] = 1;
  prune(in, best);
  Solution other = greedy(in);
  prune(in, other);
  if (count(other) < count(best)) best.swap(other);
  result.pruned = count(best);
  const double bound = lower_bound(in, options.bound_iterations, best);
  result.lower_bound = static_cast<size_t>(std::ceil(bound - 1e-6));
  if (in.disk_id.size() > 0) result.lower_bound = std::max<size_t>(result.lower_bound, 1);
  if (options.local_search && count(best) > result.lower_bound) local_search(in, 3, best);
  for (size_t p = 0; p < best.size(); ++p)
    if (best[p]) result.points.push_back(in.point_id[p]);
  return result;
}

// The memory-bounded path: only some disks have lists. Those with few points hit most of the others along the way.
HittingSet solve_by_sampling(const PointTree& points, std::span<const Disk> disks, const std::vector<uint32_t>& sizes,
                             const HittingSetOptions& options) {
  std::vector<uint32_t> order(disks.size());
  std::iota(order.begin(), order.end(), 0u);
  std::erase_if(order, [&](uint32_t d) { return sizes[d] == 0; });
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return sizes[a] != sizes[b] ? sizes[a] < sizes[b] : a < b; });
  PointTree tree = points;
  std::vector<uint32_t> chosen;
  std::vector<uint8_t> is_chosen(disks.size(), 0);
  size_t incidences = 0;
  HittingSet result;
  for (;;) {
    // Add unhit disks, small ones first; each one's middle point keeps this round from adding its neighbours as well.
    bool added = false, missed = false;
    for (const uint32_t d : order) {
      if (is_chosen[d] || tree.any_flagged_in(disks[d])) continue;
      missed = true;
      if (incidences + sizes[d] > options.max_incidences) continue;
      incidences += sizes[d];
      chosen.push_back(d);
      is_chosen[d] = 1;
      added = true;
      uint32_t middle = 0;
      size_t seen = 0;
      tree.for_each_in(disks[d], [&](uint32_t p) {
        // The tree's order is spatial: the one halfway through the list is a point inside, not at the rim.
        if (2 * seen++ <= sizes[d]) middle = p;
      });
      tree.set_flag(middle, true);
    }
    if (!missed) break;
    if (!added) {  // no room for more lists: take a point of every disk that is left
      for (const uint32_t d : order) {
        if (tree.any_flagged_in(disks[d])) continue;
        uint32_t last = 0;
        tree.for_each_in(disks[d], [&](uint32_t p) { last = p; });
        tree.set_flag(last, true);
        result.points.push_back(last);
      }
      std::sort(result.points.begin(), result.points.end());
      break;
    }
    std::vector<uint32_t> sorted = chosen;
    std::sort(sorted.begin(), sorted.end());
    result = solve_lists(make_instance(tree, disks, sorted), options);
    result.solved_disks = chosen.size();
    tree.clear_flags();
    for (const uint32_t p : result.points) tree.set_flag(p, true);
  }
  return result;
}

}  // namespace

void validate_hitting_instance(std::span<const Point2> points, std::span<const Disk> disks) {
  const auto bad = [](double v) { return !(std::fabs(v) <= 1e70); };
  for (size_t i = 0; i < points.size(); ++i)
    if (bad(points[i].x) || bad(points[i].y))
      fail_argument("hitting set: point " + std::to_string(i) + " has a coordinate that is not finite or beyond 1e70");
  for (size_t i = 0; i < disks.size(); ++i) {
    if (bad(disks[i].centre.x) || bad(disks[i].centre.y))
      fail_argument("hitting set: the centre of disk " + std::to_string(i) + " is not finite or beyond 1e70");
    if (bad(disks[i].radius) || disks[i].radius < 0)
      fail_argument("hitting set: the radius of disk " + std::to_string(i) + " is " + std::to_string(disks[i].radius) +
                    "; finite and not negative expected");
  }
}

HittingSet solve_hitting_set(std::span<const Point2> points, std::span<const Disk> disks,
                             const HittingSetOptions& options) {
  validate_hitting_instance(points, disks);
  const PointTree tree(points);
  std::vector<uint32_t> sizes(disks.size()), chosen;
  size_t incidences = 0, empty = 0;
  for (size_t d = 0; d < disks.size(); ++d) {
    sizes[d] = static_cast<uint32_t>(tree.count_in(disks[d]));
    incidences += sizes[d];
    if (sizes[d] > 0)
      chosen.push_back(static_cast<uint32_t>(d));
    else if (options.drop_empty_disks)
      ++empty;
    else
      fail_argument("hitting set: disk " + std::to_string(d) + " holds no point, so nothing can hit it");
  }
  HittingSet result;
  if (incidences <= options.max_incidences) {
    result = solve_lists(make_instance(tree, disks, chosen), options);
    result.solved_disks = chosen.size();
  } else {
    result = solve_by_sampling(tree, disks, sizes, options);
  }
  result.empty_disks = empty;
  return result;
}

std::vector<uint32_t> greedy_hitting_set(std::span<const Point2> points, std::span<const Disk> disks, bool pruned) {
  validate_hitting_instance(points, disks);
  std::vector<uint32_t> all(disks.size());
  std::iota(all.begin(), all.end(), 0u);
  const Instance in = make_instance(PointTree(points), disks, all);
  for (size_t d = 0; d < disks.size(); ++d)
    if (in.points_of[d].empty())
      fail_argument("hitting set: disk " + std::to_string(d) + " holds no point, so nothing can hit it");
  Solution s = greedy(in);
  if (pruned) prune(in, s);
  std::vector<uint32_t> set;
  for (size_t p = 0; p < s.size(); ++p)
    if (s[p]) set.push_back(in.point_id[p]);
  return set;
}

std::vector<uint32_t> improve_hitting_set(std::span<const Point2> points, std::span<const Disk> disks,
                                          std::span<const uint32_t> start, int k) {
  if (k != 2 && k != 3) fail_argument("hitting set: local search with k = " + std::to_string(k) + "; 2 or 3 expected");
  const auto unhit = unhit_disks(points, disks, start);
  if (!unhit.empty())
    fail_argument("hitting set: the start of the local search does not hit disk " + std::to_string(unhit[0]));
  std::vector<uint32_t> all(disks.size());
  std::iota(all.begin(), all.end(), 0u);
  const Instance full = make_instance(PointTree(points), disks, all);
  const Kernel kernel = reduce(full);
  std::vector<uint8_t> chosen(points.size(), 0);
  for (const uint32_t p : start) chosen[p] = 1;
  Solution s(kernel.instance.point_id.size(), 0);
  for (size_t p = 0; p < full.point_id.size(); ++p)
    if (chosen[full.point_id[p]] && kernel.stands_for[p] != 0xffffffffu) s[kernel.stands_for[p]] = 1;
  local_search(kernel.instance, k, s);
  std::vector<uint32_t> set;
  for (size_t p = 0; p < s.size(); ++p)
    if (s[p]) set.push_back(kernel.instance.point_id[p]);
  return set;
}

std::vector<uint32_t> unhit_disks(std::span<const Point2> points, std::span<const Disk> disks,
                                  std::span<const uint32_t> set) {
  validate_hitting_instance(points, disks);
  std::vector<Point2> chosen;
  for (const uint32_t p : set) {
    if (p >= points.size())
      fail_argument("hitting set: point " + std::to_string(p) + " of " + std::to_string(points.size()));
    chosen.push_back(points[p]);
  }
  PointTree tree(chosen);
  for (uint32_t i = 0; i < chosen.size(); ++i) tree.set_flag(i, true);
  std::vector<uint32_t> unhit;
  for (uint32_t d = 0; d < disks.size(); ++d)
    if (!tree.any_flagged_in(disks[d])) unhit.push_back(d);
  return unhit;
}

}  // namespace lumicut
