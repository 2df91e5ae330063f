#include "geometry/hitting_instance.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

namespace lumicut::hitting {
namespace {

Lists transpose(const Lists& a, size_t columns) {
  Lists t;
  t.offset.assign(columns + 1, 0);
  for (const uint32_t j : a.list) ++t.offset[j + 1];
  std::partial_sum(t.offset.begin(), t.offset.end(), t.offset.begin());
  t.list.resize(a.list.size());
  std::vector<size_t> fill(t.offset.begin(), t.offset.end() - 1);
  for (size_t i = 0; i < a.size(); ++i)
    for (const uint32_t j : a[i]) t.list[fill[j]++] = static_cast<uint32_t>(i);
  return t;
}

// Lists with the caller's points become lists with local ones, ascending.
void number_points(Instance& in, size_t points) {
  constexpr uint32_t kUnused = 0xffffffffu;
  std::vector<uint32_t> local(points, kUnused);
  for (const uint32_t p : in.points_of.list) local[p] = 0;
  for (uint32_t p = 0; p < local.size(); ++p)
    if (local[p] != kUnused) local[p] = static_cast<uint32_t>(in.point_id.size()), in.point_id.push_back(p);
  for (uint32_t& p : in.points_of.list) p = local[p];
  in.disks_of = transpose(in.points_of, in.point_id.size());
  in.points_of = transpose(in.disks_of, in.disk_id.size());  // sorts
}

bool contains(std::span<const uint32_t> sorted, uint32_t x) {
  return std::binary_search(sorted.begin(), sorted.end(), x);
}

}  // namespace

Instance make_instance(const PointTree& tree, std::span<const Disk> disks, std::span<const uint32_t> chosen) {
  Instance in;
  in.disk_id.assign(chosen.begin(), chosen.end());
  for (const uint32_t d : chosen) {
    tree.for_each_in(disks[d], [&](uint32_t p) { in.points_of.list.push_back(p); });
    in.points_of.offset.push_back(in.points_of.list.size());
  }
  number_points(in, tree.size());
  return in;
}

Instance make_instance(size_t points, std::span<const size_t> offsets, std::span<const uint32_t> members) {
  Instance in;
  in.disk_id.resize(offsets.empty() ? 0 : offsets.size() - 1);
  std::iota(in.disk_id.begin(), in.disk_id.end(), 0u);
  std::vector<uint32_t> seen(points, 0);
  for (size_t r = 0; r < in.disk_id.size(); ++r) {
    for (size_t i = offsets[r]; i < offsets[r + 1]; ++i)  // a point that a list names twice is in it once
      if (seen[members[i]] != r + 1)
        seen[members[i]] = static_cast<uint32_t>(r + 1), in.points_of.list.push_back(members[i]);
    in.points_of.offset.push_back(in.points_of.list.size());
  }
  number_points(in, points);
  return in;
}

Kernel reduce(const Instance& full) {
  const auto points = static_cast<uint32_t>(full.point_id.size()), disks = static_cast<uint32_t>(full.disk_id.size());
  std::vector<uint32_t> size(disks), degree(points), stands_for(points);
  std::vector<uint8_t> disk_alive(disks, 1), point_alive(points, 1), disk_dirty(disks, 1), point_dirty(points, 1);
  for (uint32_t d = 0; d < disks; ++d) size[d] = static_cast<uint32_t>(full.points_of[d].size());
  for (uint32_t p = 0; p < points; ++p) degree[p] = static_cast<uint32_t>(full.disks_of[p].size());
  std::iota(stands_for.begin(), stands_for.end(), 0u);
  std::vector<uint32_t> order, members;
  const auto by_key = [&](const std::vector<uint32_t>& key) {
    std::sort(order.begin(), order.end(),
              [&](uint32_t a, uint32_t b) { return key[a] != key[b] ? key[a] < key[b] : a < b; });
  };
  for (bool changed = true; changed;) {
    changed = false;
    // Disks, smallest first: all that hold its points are hit with it.
    order.clear();
    for (uint32_t d = 0; d < disks; ++d)
      if (disk_alive[d] && disk_dirty[d]) order.push_back(d), disk_dirty[d] = 0;
    by_key(size);
    for (const uint32_t d : order) {
      if (!disk_alive[d]) continue;
      members.clear();
      for (const uint32_t p : full.points_of[d])
        if (point_alive[p]) members.push_back(p);
      const uint32_t rarest = *std::min_element(members.begin(), members.end(),
                                                [&](uint32_t a, uint32_t b) { return degree[a] < degree[b]; });
      for (const uint32_t e : full.disks_of[rarest]) {
        if (e == d || !disk_alive[e] || size[e] < size[d]) continue;
        const auto list = full.points_of[e];
        if (!std::all_of(members.begin(), members.end(), [&](uint32_t p) { return contains(list, p); })) continue;
        disk_alive[e] = 0;
        changed = true;
        for (const uint32_t p : list)
          if (point_alive[p]) --degree[p], point_dirty[p] = 1;
      }
    }
    // Points, fewest disks first: another that hits all of them stands for it.
    order.clear();
    for (uint32_t p = 0; p < points; ++p)
      if (point_alive[p] && point_dirty[p]) order.push_back(p), point_dirty[p] = 0;
    by_key(degree);
    for (const uint32_t p : order) {
      members.clear();
      for (const uint32_t d : full.disks_of[p])
        if (disk_alive[d]) members.push_back(d);
      uint32_t stand_in = p;
      if (!members.empty()) {
        const uint32_t smallest = *std::min_element(members.begin(), members.end(),
                                                    [&](uint32_t a, uint32_t b) { return size[a] < size[b]; });
        for (const uint32_t q : full.points_of[smallest]) {
          if (q == p || !point_alive[q] || degree[q] < degree[p] || (degree[q] == degree[p] && q > p)) continue;
          const auto list = full.disks_of[q];
          if (std::all_of(members.begin(), members.end(), [&](uint32_t d) { return contains(list, d); })) {
            stand_in = q;
            break;
          }
        }
        if (stand_in == p) continue;
      }
      point_alive[p] = 0;
      stands_for[p] = stand_in;
      changed = true;
      for (const uint32_t d : members) --size[d], disk_dirty[d] = 1;
    }
  }

  Kernel k;
  std::vector<uint32_t> local(points);
  for (uint32_t p = 0; p < points; ++p)
    if (point_alive[p])
      local[p] = static_cast<uint32_t>(k.instance.point_id.size()), k.instance.point_id.push_back(full.point_id[p]);
  for (uint32_t d = 0; d < disks; ++d) {
    if (!disk_alive[d]) continue;
    k.instance.disk_id.push_back(full.disk_id[d]);
    for (const uint32_t p : full.points_of[d])
      if (point_alive[p]) k.instance.points_of.list.push_back(local[p]);
    k.instance.points_of.offset.push_back(k.instance.points_of.list.size());
  }
  k.instance.disks_of = transpose(k.instance.points_of, k.instance.point_id.size());
  k.stands_for.resize(points);
  for (uint32_t p = 0; p < points; ++p) {
    uint32_t q = p;
    while (!point_alive[q] && stands_for[q] != q) q = stands_for[q];
    k.stands_for[p] = point_alive[q] ? local[q] : 0xffffffffu;  // hits no disk of the kernel
  }
  return k;
}

size_t count(const Solution& s) { return static_cast<size_t>(std::count(s.begin(), s.end(), uint8_t{1})); }

Solution greedy(const Instance& in) {
  const size_t points = in.point_id.size();
  Solution s(points, 0);
  std::vector<uint32_t> gain(points);
  std::vector<uint8_t> hit(in.disk_id.size(), 0);
  std::vector<std::pair<uint32_t, uint32_t>> start(points);  // gain, ~point
  for (uint32_t p = 0; p < points; ++p)
    gain[p] = static_cast<uint32_t>(in.disks_of[p].size()), start[p] = {gain[p], ~p};
  std::priority_queue<std::pair<uint32_t, uint32_t>> heap(std::less<std::pair<uint32_t, uint32_t>>(), std::move(start));
  while (!heap.empty()) {
    const auto [g, inverse] = heap.top();
    heap.pop();
    const uint32_t p = ~inverse;
    if (gain[p] == 0) continue;
    if (g != gain[p]) {
      heap.emplace(gain[p], inverse);
      continue;
    }
    s[p] = 1;
    for (const uint32_t d : in.disks_of[p])
      if (!hit[d]) {
        hit[d] = 1;
        for (const uint32_t q : in.points_of[d]) --gain[q];
      }
  }
  return s;
}

void prune(const Instance& in, Solution& s) {
  std::vector<uint32_t> hits(in.disk_id.size(), 0), order;
  for (uint32_t p = 0; p < s.size(); ++p)
    if (s[p]) {
      order.push_back(p);
      for (const uint32_t d : in.disks_of[p]) ++hits[d];
    }
  // Those that hit few disks first: they are the likeliest to be superfluous.
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const size_t x = in.disks_of[a].size(), y = in.disks_of[b].size();
    return x != y ? x < y : a < b;
  });
  for (const uint32_t p : order) {
    const auto disks = in.disks_of[p];
    if (!std::all_of(disks.begin(), disks.end(), [&](uint32_t d) { return hits[d] > 1; })) continue;
    s[p] = 0;
    for (const uint32_t d : disks) --hits[d];
  }
}

double lower_bound(const Instance& in, int iterations, Solution& best) {
  const size_t points = in.point_id.size(), disks = in.disk_id.size();
  if (disks == 0) return 0;
  // y: prices of the disks. Start: each disk pays an equal share of its dearest point.
  std::vector<double> y(disks), cost(points);
  for (size_t d = 0; d < disks; ++d) {
    size_t most = 1;
    for (const uint32_t p : in.points_of[d]) most = std::max(most, in.disks_of[p].size());
    y[d] = 1.0 / static_cast<double>(most);
  }
  std::vector<int> slack(disks);
  std::vector<uint32_t> order, hits(disks);
  double bound = 0, step = 1.0;
  int since = 0;
  size_t best_size = count(best);
  for (int it = 0; it < iterations; ++it) {
    double value = 0;
    for (const double v : y) value += v;
    std::fill(slack.begin(), slack.end(), 1);
    for (uint32_t p = 0; p < points; ++p) {
      double c = 1.0;
      for (const uint32_t d : in.disks_of[p]) c -= y[d];
      cost[p] = c;
      if (c < 0) {
        value += c;
        for (const uint32_t d : in.disks_of[p]) --slack[d];
      }
    }
    if (value > bound) {
      if (value > bound + 1e-3 * std::max(1.0, bound)) since = 0;
      bound = value;
    }
    // No hitting set has fewer than ceil(bound) points: done when one has as many.
    if (std::ceil(bound - 1e-6) >= static_cast<double>(best_size)) break;
    if (it % 20 == 10 &&
        value > 0.97 * bound) {  // a hitting set from the reduced costs: cheapest points first, then prune
      Solution s(points, 0);
      std::fill(hits.begin(), hits.end(), 0u);
      order.resize(points);
      std::iota(order.begin(), order.end(), 0u);
      std::sort(order.begin(), order.end(),
                [&](uint32_t a, uint32_t b) { return cost[a] != cost[b] ? cost[a] < cost[b] : a < b; });
      size_t left = disks;
      for (const uint32_t p : order) {
        if (left == 0) break;
        bool needed = false;
        for (const uint32_t d : in.disks_of[p]) needed = needed || hits[d] == 0;
        if (!needed) continue;
        s[p] = 1;
        for (const uint32_t d : in.disks_of[p])
          if (hits[d]++ == 0) --left;
      }
      // Dearest first out.
      for (size_t i = order.size(); i-- > 0;) {
        const uint32_t p = order[i];
        const auto list = in.disks_of[p];
        if (!s[p] || !std::all_of(list.begin(), list.end(), [&](uint32_t d) { return hits[d] > 1; })) continue;
        s[p] = 0;
        for (const uint32_t d : list) --hits[d];
      }
      if (const size_t n = count(s); n < best_size) best_size = n, best = std::move(s);
    }
    if (++since > 15) step *= 0.7, since = 0;
    double norm2 = 0;
    for (size_t d = 0; d < disks; ++d) {
      if (slack[d] < 0 && y[d] <= 0) continue;
      norm2 += static_cast<double>(slack[d]) * slack[d];
    }
    if (norm2 == 0 || step < 1e-4) break;
    const double target = std::max(static_cast<double>(best_size) - value, 0.1 + 1e-3 * value);
    const double t = step * target / norm2;
    for (size_t d = 0; d < disks; ++d) y[d] = std::max(0.0, y[d] + t * slack[d]);
  }
  return bound;
}

}  // namespace lumicut::hitting
