// (k, k-1) local search on a reduced instance. [thesis ch. 8]
//
// Departs: rather than the pseudo-disk structures of sec. 8.3, sets of up to k points are enumerated along links: two
// points of the set are linked when some point y shares a disk with each of them, where both disks are hit by at most k
// points of the set. An improving move that contains no smaller improving move is connected by links: its new points
// each share a disk to be taken over with some of the old ones, and if those groups were apart, one group alone would
// be an improving move. Nothing here knows of disks: any lists will do.
#include <algorithm>
#include <array>
#include <unordered_map>

#include "geometry/hitting_instance.h"
#include "geometry/work_queue.h"

namespace lumicut::hitting {
namespace {

class Search {
 public:
  Search(const Instance& in, int k, Solution& s)
      : in_(in),
        k_(k),
        s_(s),
        hits_(in.disk_id.size(), 0),
        disk_stamp_(in.disk_id.size(), 0),
        disk_seen_(in.disk_id.size(), 0),
        point_stamp_(s.size(), 0),
        queue_(s.size()) {
    for (uint32_t p = 0; p < s_.size(); ++p)
      if (s_[p])
        for (const uint32_t d : in_.disks_of[p]) ++hits_[d];
  }

  void run() {
    for (uint32_t p = 0; p < s_.size(); ++p)
      if (s_[p]) queue_.push(p);
    // Moves free others nearby: those are queued again by apply().
    queue_.run([&](uint32_t x) {
      while (s_[x] && improve_around(x)) {
      }
    });
  }

 private:
  // Points of the set that share a rarely hit disk with y (at most k hits).
  template <typename Fn>
  void owners(uint32_t y, Fn&& fn) const {
    for (const uint32_t d : in_.disks_of[y]) {
      if (hits_[d] > static_cast<uint32_t>(k_)) continue;
      for (const uint32_t x : in_.points_of[d])
        if (s_[x]) fn(x);
    }
  }
  void links(uint32_t x, std::vector<uint32_t>& out) {
    out.clear();
    const uint32_t mark = ++stamp_;
    point_stamp_[x] = mark;
    for (const uint32_t d : in_.disks_of[x]) {
      if (hits_[d] > static_cast<uint32_t>(k_)) continue;
      for (const uint32_t y : in_.points_of[d]) {
        if (s_[y] || point_stamp_[y] == mark) continue;
        point_stamp_[y] = mark;
        owners(y, [&](uint32_t z) {
          if (point_stamp_[z] != mark) point_stamp_[z] = mark, out.push_back(z);
        });
      }
    }
    std::sort(out.begin(), out.end());
  }

  // The disks that only points of X hit.
  void personal(const uint32_t* x, int n, std::vector<uint32_t>& out) {
    out.clear();
    const uint32_t mark = ++stamp_;
    for (int i = 0; i < n; ++i)
      for (const uint32_t d : in_.disks_of[x[i]]) {
        if (hits_[d] > static_cast<uint32_t>(n)) continue;
        if (disk_stamp_[d] != mark) disk_stamp_[d] = mark, disk_seen_[d] = 0;
        if (++disk_seen_[d] == hits_[d]) out.push_back(d);
      }
  }

  uint32_t smallest(const std::vector<uint32_t>& disks) const {
    return *std::min_element(disks.begin(), disks.end(), [&](uint32_t a, uint32_t b) {
      const size_t x = in_.points_of[a].size(), y = in_.points_of[b].size();
      return x != y ? x < y : a < b;
    });
  }
  bool covers(uint32_t p, uint32_t d) const {
    const auto list = in_.disks_of[p];
    return std::binary_search(list.begin(), list.end(), d);
  }
  // A point in all of `disks`.
  bool common_point(const std::vector<uint32_t>& disks, uint32_t& found) const {
    for (const uint32_t p : in_.points_of[smallest(disks)])
      if (std::all_of(disks.begin(), disks.end(), [&](uint32_t d) { return covers(p, d); })) {
        found = p;
        return true;
      }
    return false;
  }

  bool try_set(const uint32_t* x, int n) {
    personal(x, n, own_);
    if (own_.empty()) return apply(x, n, nullptr, 0);
    uint32_t y[3];
    if (n == 1) return false;
    if (common_point(own_, y[0])) return apply(x, n, y, 1);
    const int room = n - 1;
    const int used = room > 1 ? cover(own_, room, y) : 0;
    return used > 0 && apply(x, n, y, used);
  }

  // Up to `room` points, at least two, that are in all of `disks` together: how many (0: there are none).
  int cover(const std::vector<uint32_t>& disks, int room, uint32_t* y) {
    std::vector<uint32_t>& rest = rest_[room];
    for (const uint32_t p : in_.points_of[smallest(disks)]) {
      rest.clear();
      for (const uint32_t d : disks)
        if (!covers(p, d)) rest.push_back(d);
      y[0] = p;
      if (rest.empty()) return 1;
      if (common_point(rest, y[1])) return 2;
      if (room < 3) continue;
      if (const int more = cover(rest, room - 1, y + 1); more > 0) return 1 + more;
    }
    return 0;
  }

  bool apply(const uint32_t* x, int nx, const uint32_t* y, int ny) {
    touched_.clear();
    for (int i = 0; i < nx; ++i) {
      s_[x[i]] = 0;
      for (const uint32_t d : in_.disks_of[x[i]]) --hits_[d], touched_.push_back(d);
    }
    for (int i = 0; i < ny; ++i) {
      if (s_[y[i]]) continue;
      s_[y[i]] = 1;
      queue_.push(y[i]);
      for (const uint32_t d : in_.disks_of[y[i]]) ++hits_[d], touched_.push_back(d);
    }
    // Whoever owns, or links to an owner of, a disk whose count changed may have a move now.
    const uint32_t mark = ++stamp_;
    for (const uint32_t d : touched_)
      for (const uint32_t p : in_.points_of[d]) {
        if (point_stamp_[p] == mark) continue;
        point_stamp_[p] = mark;
        if (s_[p]) queue_.push(p);
        owners(p, [&](uint32_t z) { queue_.push(z); });
      }
    return true;
  }

  bool improve_around(uint32_t x) {
    uint32_t set[4] = {x, 0, 0, 0};
    if (try_set(set, 1)) return true;
    links(x, near_);
    const std::vector<uint32_t> near = near_;
    for (const uint32_t a : near) {
      set[1] = a;
      if (try_set(set, 2)) return true;
    }
    if (k_ < 3) return false;
    // Connected triples with x in them: x in the middle, or at an end.
    for (size_t i = 0; i < near.size(); ++i) {
      set[1] = near[i];
      for (size_t j = i + 1; j < near.size(); ++j) {
        set[2] = near[j];
        if (try_set(set, 3)) return true;
      }
    }
    std::vector<std::array<uint32_t, 2>> ends;
    for (const uint32_t a : near) {
      set[1] = a;
      links(a, near_);
      for (const uint32_t b : near_) {
        if (b == x || std::binary_search(near.begin(), near.end(), b)) continue;
        set[2] = b;
        if (try_set(set, 3)) return true;
        if (k_ > 3) ends.push_back({a, b});
      }
    }
    return k_ > 3 && improve_by_quadruples(x, near, ends);
  }

  // A connected quadruple is a connected triple, x in it, and what one of its points is linked with.
  bool improve_by_quadruples(uint32_t x, const std::vector<uint32_t>& near,
                             std::vector<std::array<uint32_t, 2>>& pairs) {
    for (size_t i = 0; i < near.size(); ++i)
      for (size_t j = i + 1; j < near.size(); ++j) pairs.push_back({near[i], near[j]});
    std::unordered_map<uint32_t, std::vector<uint32_t>> linked;
    const auto of = [&](uint32_t p) -> const std::vector<uint32_t>& {
      const auto [at, fresh] = linked.try_emplace(p);
      if (fresh) links(p, at->second);
      return at->second;
    };
    std::vector<std::array<uint32_t, 3>> triples;
    for (const auto& [a, b] : pairs)
      for (const uint32_t from : {x, a, b})
        for (const uint32_t c : of(from)) {
          if (c == x || c == a || c == b) continue;
          triples.push_back({a, b, c});
          std::sort(triples.back().begin(), triples.back().end());
        }
    std::sort(triples.begin(), triples.end());
    triples.erase(std::unique(triples.begin(), triples.end()), triples.end());
    for (const auto& t : triples) {
      const uint32_t set[4] = {x, t[0], t[1], t[2]};
      if (try_set(set, 4)) return true;
    }
    return false;
  }

  const Instance& in_;
  const int k_;
  Solution& s_;
  std::vector<uint32_t> hits_, disk_stamp_, disk_seen_, point_stamp_;
  WorkQueue queue_;
  std::vector<uint32_t> own_, near_, touched_;
  std::vector<uint32_t> rest_[4];  // by room
  uint32_t stamp_ = 0;
};

}  // namespace

void local_search(const Instance& in, int k, Solution& s) { Search(in, k, s).run(); }

}  // namespace lumicut::hitting
