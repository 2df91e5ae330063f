#include "geometry/hitting_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/error.h"
#include "geometry/hitting_instance.h"
#include "geometry/point_tree.h"
#include "geometry/predicates.h"

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

// The memory-bounded path: every k-th point along the tree's order, which is spatial, and a point for each disk that
// holds none of those. Whatever hits all disks among the candidates does so among all points.
HittingSet solve_thinned(std::span<const Point2> points, const PointTree& full, std::span<const Disk> disks,
                         const std::vector<uint32_t>& chosen, size_t incidences, const HittingSetOptions& options) {
  PointTree tree = full;
  // A bound that holds for all points: disks that have no point in common, small ones first, need one each.
  std::vector<uint32_t> order = chosen;
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return disks[a].radius != disks[b].radius ? disks[a].radius < disks[b].radius : a < b;
  });
  size_t apart = 0;
  for (const uint32_t d : order) {
    if (tree.any_flagged_in(disks[d])) continue;
    ++apart;
    full.for_each_in(disks[d], [&](uint32_t p) { tree.set_flag(p, true); });
  }
  tree.clear_flags();
  const size_t step = incidences / std::max<size_t>(options.max_incidences, 1) + 1;
  size_t seen = 0;
  full.for_each_in({{0, 0}, 1e150}, [&](uint32_t p) {
    if (seen++ % step == 0) tree.set_flag(p, true);
  });
  for (const uint32_t d : order) {
    if (tree.any_flagged_in(disks[d])) continue;
    uint32_t some = 0;
    full.for_each_in(disks[d], [&](uint32_t p) { some = p; });
    tree.set_flag(some, true);
  }
  std::vector<Point2> candidates;
  std::vector<uint32_t> id;
  for (uint32_t p = 0; p < points.size(); ++p)
    if (tree.flagged(p)) candidates.push_back(points[p]), id.push_back(p);
  HittingSet result = solve_lists(make_instance(PointTree(candidates), disks, chosen), options);
  for (uint32_t& p : result.points) p = id[p];
  result.lower_bound = apart;
  result.candidates = candidates.size();
  return result;
}

// Local search on the dominance reduction. `start` hits every disk.
std::vector<uint32_t> improve(const Instance& full, size_t points, std::span<const uint32_t> start, int k) {
  if (k < 2 || k > 4) fail_argument("hitting set: local search with k = " + std::to_string(k) + "; 2 to 4 expected");
  const Kernel kernel = reduce(full);
  std::vector<uint8_t> chosen(points, 0);
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

void validate_ranges(size_t points, std::span<const size_t> offsets, std::span<const uint32_t> members) {
  if (offsets.empty() || offsets[0] != 0 || offsets.back() != members.size() ||
      !std::is_sorted(offsets.begin(), offsets.end()))
    fail_argument("hitting set: offsets go from 0 up to the " + std::to_string(members.size()) + " members");
  for (size_t i = 0; i < members.size(); ++i)
    if (members[i] >= points)
      fail_argument("hitting set: member " + std::to_string(i) + " is point " + std::to_string(members[i]) + " of " +
                    std::to_string(points));
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
  std::vector<uint32_t> chosen;
  size_t incidences = 0, empty = 0;
  for (size_t d = 0; d < disks.size(); ++d) {
    const size_t size = tree.count_in(disks[d]);
    incidences += size;
    if (size > 0)
      chosen.push_back(static_cast<uint32_t>(d));
    else if (options.drop_empty_disks)
      ++empty;
    else
      fail_argument("hitting set: disk " + std::to_string(d) + " holds no point, so nothing can hit it");
  }
  HittingSet result;
  if (incidences <= options.max_incidences) {
    result = solve_lists(make_instance(tree, disks, chosen), options);
    result.candidates = points.size();
  } else {
    result = solve_thinned(points, tree, disks, chosen, incidences, options);
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
  const auto unhit = unhit_disks(points, disks, start);
  if (!unhit.empty())
    fail_argument("hitting set: the start of the local search does not hit disk " + std::to_string(unhit[0]));
  std::vector<uint32_t> all(disks.size());
  std::iota(all.begin(), all.end(), 0u);
  return improve(make_instance(PointTree(points), disks, all), points.size(), start, k);
}

HittingSet solve_hitting_set(size_t points, std::span<const size_t> offsets, std::span<const uint32_t> members,
                             const HittingSetOptions& options) {
  validate_ranges(points, offsets, members);
  std::vector<size_t> kept{0};
  std::vector<uint32_t> list;
  size_t empty = 0;
  for (size_t r = 0; r + 1 < offsets.size(); ++r) {
    if (offsets[r] == offsets[r + 1]) {
      if (!options.drop_empty_disks)
        fail_argument("hitting set: range " + std::to_string(r) + " holds no point, so nothing can hit it");
      ++empty;
      continue;
    }
    list.insert(list.end(), members.begin() + static_cast<ptrdiff_t>(offsets[r]),
                members.begin() + static_cast<ptrdiff_t>(offsets[r + 1]));
    kept.push_back(list.size());
  }
  HittingSet result = solve_lists(make_instance(points, kept, list), options);
  result.candidates = points;
  result.empty_disks = empty;
  return result;
}

std::vector<uint32_t> improve_hitting_set(size_t points, std::span<const size_t> offsets,
                                          std::span<const uint32_t> members, std::span<const uint32_t> start, int k) {
  validate_ranges(points, offsets, members);
  std::vector<uint8_t> chosen(points, 0);
  for (const uint32_t p : start) {
    if (p >= points) fail_argument("hitting set: point " + std::to_string(p) + " of " + std::to_string(points));
    chosen[p] = 1;
  }
  for (size_t r = 0; r + 1 < offsets.size(); ++r)
    if (std::none_of(members.begin() + static_cast<ptrdiff_t>(offsets[r]),
                     members.begin() + static_cast<ptrdiff_t>(offsets[r + 1]),
                     [&](uint32_t p) { return chosen[p] != 0; }))
      fail_argument("hitting set: the start of the local search does not hit range " + std::to_string(r));
  return improve(make_instance(points, offsets, members), points, start, k);
}

Ranges points_in_copies(std::span<const Point2> points, std::span<const Point2> shape, std::span<const Disk> copies) {
  validate_hitting_instance(points, copies);
  validate_hitting_instance(shape, {});
  double reach2 = 0;  // of the disk around the shape
  for (size_t i = 0; i < shape.size(); ++i) {
    const Point2 &a = shape[i], &b = shape[(i + 1) % shape.size()], &c = shape[(i + 2) % shape.size()];
    if (shape.size() < 3 || orientation(a, b, c) <= 0 || orientation(a, b, {0, 0}) < 0)
      fail_argument("shape: corner " + std::to_string(i) +
                    ": a strictly convex polygon, counter-clockwise around the origin, is expected");
    reach2 = std::max(reach2, dist2(a, {0, 0}));
  }
  if (shape.empty()) fail_argument("shape: no corners");
  // One turn: corners that go round twice are convex at each.
  for (size_t i = 1; i + 1 < shape.size(); ++i)
    if (orientation(shape[0], shape[i], shape[i + 1]) <= 0) fail_argument("shape: its border crosses itself");
  const double reach = std::sqrt(reach2) * (1 + 1e-12);
  const PointTree tree(points);
  Ranges ranges;
  for (const Disk& copy : copies) {
    tree.for_each_in({copy.centre, reach * copy.radius}, [&](uint32_t p) {
      const Point2 at{points[p].x - copy.centre.x, points[p].y - copy.centre.y};
      for (size_t i = 0; i < shape.size(); ++i) {
        const Point2 &a = shape[i], &b = shape[(i + 1) % shape.size()];
        const double side = (b.x - a.x) * (at.y - copy.radius * a.y) - (b.y - a.y) * (at.x - copy.radius * a.x);
        if (side < 0) return;
      }
      ranges.members.push_back(p);
    });
    ranges.offsets.push_back(ranges.members.size());
  }
  return ranges;
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
