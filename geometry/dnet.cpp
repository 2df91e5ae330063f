#include "geometry/dnet.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/delaunay_reporter.h"
#include "geometry/hitting_set.h"
#include "geometry/point_tree.h"

namespace lumicut {
namespace {

class Rounding {
 public:
  Rounding(std::span<const Point2> points, std::span<const Disk> disks, const DnetOptions& options)
      : points_(points), disks_(disks), o_(options), tree_(points) {}

  size_t drop_empty(bool allowed) {
    for (uint32_t d = 0; d < disks_.size(); ++d) {
      bool any = false;
      tree_.for_each_in(disks_[d], [&](uint32_t) { any = true; });
      if (any)
        alive_.push_back(d);
      else if (!allowed)
        fail_argument("hitting set: disk " + std::to_string(d) + " holds no point, so nothing can hit it");
    }
    return disks_.size() - alive_.size();
  }

  // Small disks first, a point of each that is not hit yet: an upper bound for the guesses.
  std::vector<uint32_t> first_set() {
    std::vector<uint32_t> order = alive_, set, members;
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return disks_[a].radius != disks_[b].radius ? disks_[a].radius < disks_[b].radius : a < b;
    });
    tree_.clear_flags();
    Rng rng(o_.seed, Stage::test, 1);
    for (const uint32_t d : order) {
      if (tree_.any_flagged_in(disks_[d])) continue;
      members.clear();
      tree_.for_each_in(disks_[d], [&](uint32_t p) { members.push_back(p); });
      const uint32_t p = members[rng.next_below(static_cast<uint32_t>(members.size()))];
      tree_.set_flag(p, true);
      set.push_back(p);
    }
    return set;
  }

  void round(double optimum, DnetResult& best) {
    DnetResult result;
    result.guess = optimum;
    EpsilonNetOptions net_options = o_.net;
    net_options.seed = hash64(o_.seed, 2);
    const auto q = epsilon_net(points_, {}, std::min(1.0, o_.c1 / optimum), net_options).points;
    const bool delaunay = o_.structures == DnetOptions::Structures::delaunay;
    std::optional<DelaunayReporter> reporter;
    if (delaunay) reporter.emplace(points_, q);
    start_set(q);
    std::vector<uint32_t> unhit;
    for (const uint32_t d : alive_)
      if (!hit(disks_[d])) unhit.push_back(d);
    std::vector<double> weight(points_.size(), 1.0);
    for (const uint32_t p : q) weight[p] = 0;  // line 5
    std::vector<uint32_t> s, members;
    for (int phase = 1; phase <= o_.max_phases; ++phase) {
      double total = std::accumulate(weight.begin(), weight.end(), 0.0);
      if (total > 1e200)
        for (double& w : weight) w /= total;
      total = std::min(total, std::accumulate(weight.begin(), weight.end(), 0.0));
      net_options.seed = hash64(o_.seed, 2 + static_cast<uint64_t>(phase));
      const auto r = total > 0 ? epsilon_net(points_, weight, std::min(1.0, o_.c2 / optimum), net_options).points
                               : std::vector<uint32_t>();
      start_set(r);
      s.clear();
      Rng rng(o_.seed, Stage::test, 3, static_cast<uint64_t>(phase));
      for (size_t i = unhit.size(); i > 1; --i)
        std::swap(unhit[i - 1], unhit[rng.next_below(static_cast<uint32_t>(i))]);
      for (const uint32_t d : unhit) {
        if (hit(disks_[d])) continue;
        members.clear();
        if (delaunay) {
          reporter->report(disks_[d], members);
          // Sums round by the order of their parts.
          std::sort(members.begin(), members.end(),
                    [&](uint32_t a, uint32_t b) { return tree_.place(a) < tree_.place(b); });
        } else {
          tree_.for_each_in(disks_[d], [&](uint32_t p) { members.push_back(p); });
        }
        double sum = 0;
        for (const uint32_t p : members) sum += weight[p];
        ++result.reports;
        // A point of the disk by weight joins S.
        double u = rng.next_float() * sum;
        uint32_t pick = members.back();
        for (const uint32_t p : members)
          if ((u -= weight[p]) < 0) {
            pick = p;
            break;
          }
        add(pick);
        s.push_back(pick);
        if (sum <= o_.c3 * total / optimum) {
          ++result.reweighed;
          for (const uint32_t p : members) total += (o_.c4 - 1) * weight[p], weight[p] *= o_.c4;
        }
      }
      result.phases = phase;
      std::vector<uint32_t> all(q.begin(), q.end());
      all.insert(all.end(), r.begin(), r.end());
      all.insert(all.end(), s.begin(), s.end());
      std::sort(all.begin(), all.end());
      all.erase(std::unique(all.begin(), all.end()), all.end());
      if (best.points.empty() || all.size() < best.points.size()) {
        const size_t reports = best.reports, reweighed = best.reweighed;
        best = result;
        best.points = std::move(all);
        best.q = q.size(), best.r = r.size(), best.s = s.size();
        best.reports = reports, best.reweighed = reweighed;
      }
      if (static_cast<double>(s.size()) <= o_.c5 * optimum) break;
    }
    best.reports += result.reports;
    best.reweighed += result.reweighed;
  }

  // Drops points without which every disk is still hit.
  void prune(std::vector<uint32_t>& set) const {
    std::vector<Point2> chosen;
    for (const uint32_t p : set) chosen.push_back(points_[p]);
    const PointTree small(chosen);
    std::vector<std::vector<uint32_t>> disks_of(set.size());
    std::vector<uint32_t> hits(disks_.size(), 0);
    for (const uint32_t d : alive_)
      small.for_each_in(disks_[d], [&](uint32_t i) { disks_of[i].push_back(d), ++hits[d]; });
    std::vector<uint32_t> order(set.size()), kept;
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return disks_of[a].size() != disks_of[b].size() ? disks_of[a].size() < disks_of[b].size() : a < b;
    });
    for (const uint32_t i : order) {
      if (std::all_of(disks_of[i].begin(), disks_of[i].end(), [&](uint32_t d) { return hits[d] > 1; })) {
        for (const uint32_t d : disks_of[i]) --hits[d];
      } else {
        kept.push_back(set[i]);
      }
    }
    std::sort(kept.begin(), kept.end());
    set.swap(kept);
  }

 private:
  // The set that disks are tested against.
  void start_set(std::span<const uint32_t> set) {
    if (o_.structures == DnetOptions::Structures::delaunay) {
      nearest_.emplace(points_);
    } else {
      tree_.clear_flags();
    }
    for (const uint32_t p : set) add(p);
  }
  void add(uint32_t p) {
    if (nearest_) {
      nearest_->insert(p);
    } else {
      tree_.set_flag(p, true);
    }
  }
  bool hit(const Disk& d) const { return nearest_ ? nearest_->hit(d) : tree_.any_flagged_in(d); }

  std::span<const Point2> points_;
  std::span<const Disk> disks_;
  const DnetOptions& o_;
  PointTree tree_;
  std::optional<DelaunayNearest> nearest_;
  std::vector<uint32_t> alive_;
};

}  // namespace

DnetResult dnet_hitting_set(std::span<const Point2> points, std::span<const Disk> disks, const DnetOptions& options) {
  validate_hitting_instance(points, disks);
  for (const double c : {options.c1, options.c2, options.c3, options.c4, options.c5})
    if (!(c > 0 && c < 1e6)) fail_argument("hitting set: dnet constant " + std::to_string(c) + "; (0, 1e6) expected");
  Rounding rounding(points, disks, options);
  DnetResult best;
  const size_t empty = rounding.drop_empty(options.drop_empty_disks);
  if (empty < disks.size()) {
    if (options.optimum > 0) {
      rounding.round(options.optimum, best);
    } else {
      const auto first = static_cast<double>(rounding.first_set().size());
      for (const double f : {0.35, 0.5, 0.7, 1.0}) rounding.round(std::max(1.0, f * first), best);
    }
    if (options.prune) rounding.prune(best.points);
  }
  best.empty_disks = empty;
  return best;
}

}  // namespace lumicut
