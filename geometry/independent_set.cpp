#include "geometry/independent_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

#include "core/error.h"
#include "geometry/balltree.h"
#include "geometry/hitting_set.h"
#include "geometry/work_queue.h"

namespace lumicut {
namespace {

constexpr size_t kMostTouching = size_t{1} << 29;  // entries of lists, 4 bytes each

// Sets of up to `exchange` - 1 chosen disks are enumerated along links: two are linked where a disk outside touches
// both, and at most `exchange` - 1 chosen ones in all. As with hitting sets, an improvement that contains no smaller
// one is connected by links: if its new disks fell into groups that touch different old ones, one group would do.
class Search {
 public:
  Search(std::span<const Disk> disks, int exchange, Progress* progress) : exchange_(exchange), touching_(disks.size()) {
    size_t pairs = 0;
    if (progress != nullptr) progress->begin("disks that touch", disks.size());
    std::vector<double> centres, radii;
    for (const Disk& d : disks) centres.push_back(d.centre.x), centres.push_back(d.centre.y), radii.push_back(d.radius);
    const BallTree tree = BallTree::build(centres, radii, 2, BallTreeBuilder::kd);
    for (uint32_t i = 0; i < disks.size(); ++i) {
      const Disk& d = disks[i];
      // The tree's test rounds otherwise than the one here, which is symmetric.
      const double reach = d.radius + 1e-9 * (std::fabs(d.centre.x) + std::fabs(d.centre.y) + d.radius);
      for (const uint32_t j : tree.intersecting(std::span(centres).subspan(2 * size_t{i}, 2), reach)) {
        const double sum = d.radius + disks[j].radius;
        if (j != i && dist2(d.centre, disks[j].centre) <= sum * sum) touching_[i].push_back(j);
      }
      pairs += touching_[i].size();
      if (pairs > kMostTouching)
        fail_argument("independent set: the first " + std::to_string(i + 1) + " of " + std::to_string(disks.size()) +
                      " disks touch others " + std::to_string(pairs) + " times; lists of at most " +
                      std::to_string(kMostTouching) + " are kept");
      touching_[i].shrink_to_fit();
      if (progress != nullptr) progress->advance(1), progress->check();
    }
    chosen_.assign(disks.size(), 0), taken_.assign(disks.size(), 0);
    queue_ = WorkQueue(disks.size());
    mark_.assign(disks.size(), 0);
  }

  bool free(uint32_t d) const { return !chosen_[d] && taken_[d] == 0; }
  void choose(uint32_t d) {
    chosen_[d] = 1;
    for (const uint32_t e : touching_[d]) ++taken_[e];
  }

  void run(Progress* progress) {
    for (uint32_t d = 0; d < chosen_.size(); ++d)
      if (free(d)) choose(d);
    for (uint32_t d = 0; d < chosen_.size(); ++d)
      if (chosen_[d]) queue_.push(d);
    queue_.run([&](uint32_t x) {
      if (progress != nullptr) progress->check();
      while (chosen_[x] && improve_around(x)) {
      }
    });
  }

  std::vector<uint32_t> result() const {
    std::vector<uint32_t> set;
    for (uint32_t d = 0; d < chosen_.size(); ++d)
      if (chosen_[d]) set.push_back(d);
    return set;
  }
  // A chosen disk that touches another one; none: no such.
  bool touches_chosen(uint32_t d) const { return taken_[d] > 0; }

 private:
  uint32_t most() const { return static_cast<uint32_t>(exchange_ - 1); }

  std::vector<uint32_t> links(uint32_t x) {
    std::vector<uint32_t> out;
    const uint32_t mark = ++stamp_;
    mark_[x] = mark;
    for (const uint32_t y : touching_[x]) {
      if (taken_[y] > most()) continue;
      uint32_t left = taken_[y];
      for (auto z = touching_[y].begin(); left > 0; ++z) {
        if (!chosen_[*z]) continue;
        --left;
        if (mark_[*z] != mark) mark_[*z] = mark, out.push_back(*z);
      }
    }
    std::sort(out.begin(), out.end());
    return out;
  }

  // One more than `x` holds, of the disks that touch no chosen ones but those of x.
  bool try_set(std::span<const uint32_t> x) {
    const uint32_t mark = ++stamp_;
    for (const uint32_t c : x) mark_[c] = mark;
    std::vector<uint32_t> outside, by_x;  // by_x: what x touches, as often as it does
    for (const uint32_t c : x)
      for (const uint32_t y : touching_[c])
        if (mark_[y] != mark && !chosen_[y] && taken_[y] <= x.size()) by_x.push_back(y);
    if (x.size() > 1) std::sort(by_x.begin(), by_x.end());
    for (size_t i = 0, next = 0; i < by_x.size(); i = next) {
      while (next < by_x.size() && by_x[next] == by_x[i]) ++next;
      if (next - i == taken_[by_x[i]]) outside.push_back(by_x[i]);
    }
    std::vector<uint32_t> picked;
    if (!pick(outside, x.size() + 1, picked)) return false;
    for (const uint32_t c : x) {
      chosen_[c] = 0;
      for (const uint32_t e : touching_[c]) --taken_[e];
    }
    for (const uint32_t c : picked) choose(c);
    // More than one more; and what was given up for nothing, where the improvement was one of fewer disks.
    outside.insert(outside.end(), x.begin(), x.end());
    for (const uint32_t c : outside)
      if (free(c)) choose(c), picked.push_back(c);
    // New moves need a disk whose count changed, and start at the chosen ones it touches.
    for (const uint32_t c : picked) queue_.push(c), enqueue_near(c);
    for (const uint32_t c : x) enqueue_near(c);
    return true;
  }
  void enqueue_near(uint32_t c) {
    for (const uint32_t y : touching_[c]) {
      if (chosen_[y])
        queue_.push(y);
      else
        for (const uint32_t z : touching_[y])
          if (chosen_[z]) queue_.push(z);
    }
  }

  // `count` of `from` that do not touch each other.
  bool pick(const std::vector<uint32_t>& from, size_t count, std::vector<uint32_t>& picked) const {
    if (from.size() < count) return false;
    for (size_t i = 0; i + count <= from.size(); ++i) {
      picked.push_back(from[i]);
      if (count == 1) return true;
      std::vector<uint32_t> rest;
      const auto& near = touching_[from[i]];
      auto at = std::upper_bound(near.begin(), near.end(), from[i]);
      const bool many = 8 * (from.size() - i) > near.size();
      for (size_t j = i + 1; j < from.size(); ++j) {
        if (many)
          while (at != near.end() && *at < from[j]) ++at;
        else
          at = std::lower_bound(at, near.end(), from[j]);
        if (at == near.end() || *at != from[j]) rest.push_back(from[j]);
      }
      if (pick(rest, count - 1, picked)) return true;
      picked.pop_back();
    }
    return false;
  }

  bool improve_around(uint32_t x) {
    if (try_set(std::array{x})) return true;
    if (exchange_ < 3) return false;
    const std::vector<uint32_t> near = links(x);
    for (const uint32_t a : near)
      if (try_set(std::array{x, a})) return true;
    if (exchange_ < 4) return false;
    std::vector<std::array<uint32_t, 2>> pairs;
    for (const uint32_t a : near) {
      for (const uint32_t b : near)
        if (a < b) pairs.push_back({a, b});
      for (const uint32_t b : links(a))
        if (b != x) pairs.push_back({std::min(a, b), std::max(a, b)});
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return std::any_of(pairs.begin(), pairs.end(), [&](const auto& p) { return try_set(std::array{x, p[0], p[1]}); });
  }

  const int exchange_;
  std::vector<std::vector<uint32_t>> touching_;  // ascending, without itself
  std::vector<uint8_t> chosen_;
  std::vector<uint32_t> taken_;  // by disk: chosen ones that it touches
  std::vector<uint32_t> mark_;
  WorkQueue queue_;
  uint32_t stamp_ = 0;
};

}  // namespace

std::vector<uint32_t> independent_disks(std::span<const Disk> disks, int exchange, std::span<const uint32_t> start,
                                        Progress* progress) {
  validate_hitting_instance({}, disks);
  if (exchange < 2 || exchange > 4)
    fail_argument("independent set: exchange " + std::to_string(exchange) + "; 2 to 4 expected");
  if (disks.empty()) return {};
  Search search(disks, exchange, progress);
  if (!start.empty()) {
    for (const uint32_t d : start) {
      if (d >= disks.size())
        fail_argument("independent set: disk " + std::to_string(d) + " of " + std::to_string(disks.size()));
      if (search.touches_chosen(d))
        fail_argument("independent set: disk " + std::to_string(d) + " of the start touches another of it");
      if (search.free(d)) search.choose(d);
    }
  } else {
    std::vector<uint32_t> order(disks.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return disks[a].radius < disks[b].radius; });
    for (const uint32_t d : order)
      if (search.free(d)) search.choose(d);
  }
  if (progress != nullptr) progress->begin("local search", 0);
  search.run(progress);
  return search.result();
}

}  // namespace lumicut
