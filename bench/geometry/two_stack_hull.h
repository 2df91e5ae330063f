// The simple rival of DynamicHull: a queue as two stacks. The back stack is a Melkman hull with a log of the cells that
// each insertion overwrote, so that the oldest point is undone; the front stack is a plain Melkman hull. A query has to
// look at two hulls.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/point2.h"
#include "geometry/predicates.h"

namespace lumicut::bench {

// Melkman's deque in one array, growing from its middle; the newest vertex stands at both ends.
class MelkmanDeque {
 public:
  struct State {
    size_t lo = 0, hi = 0, vertices = 0;
  };

  void reset(size_t capacity) {
    if (v_.size() < 2 * capacity + 4) v_.resize(2 * capacity + 4);
    s_ = {v_.size() / 2, v_.size() / 2, 0};
  }
  // Calls save(cell, value) before a cell is overwritten.
  template <typename Save>
  void push(const Point2& p, Save&& save) {
    const auto write = [&](size_t cell) { save(cell, v_[cell]), v_[cell] = p; };
    auto& [lo, hi, n] = s_;
    if (n == 0) {
      write(lo), n = 1;
    } else if (n == 1) {
      if (v_[lo] == p) return;
      write(++hi), write(--lo), n = 2;
    } else if (n == 2) {  // [f, s, f]
      const int turn = orientation(v_[lo + 1], v_[lo], p);
      if (turn == 0) {
        if (!between(v_[lo + 1], v_[lo], p)) write(lo), write(hi);
        return;
      }
      if (turn > 0)
        write(lo), write(++hi);
      else
        write(hi), write(--lo);
      n = 3;
    } else {
      if (orientation(v_[lo], v_[lo + 1], p) >= 0 && orientation(v_[hi - 1], v_[hi], p) >= 0) return;
      while (orientation(v_[lo], v_[lo + 1], p) <= 0) ++lo;
      while (orientation(v_[hi - 1], v_[hi], p) <= 0) --hi;
      write(--lo), write(++hi);
      n = hi - lo;
    }
  }
  const State& state() const { return s_; }
  void restore(const State& s) { s_ = s; }
  void put(size_t cell, const Point2& p) { v_[cell] = p; }
  template <typename Fn>
  void for_each_vertex(Fn&& fn) const {
    for (size_t i = 0; i < s_.vertices; ++i) fn(v_[s_.lo + i]);
  }

 private:
  std::vector<Point2> v_;
  State s_;
};

class TwoStackHull {
 public:
  TwoStackHull() { front_.reset(capacity_); }
  void push_front(const Point2& p) {
    const auto ignore = [](size_t, const Point2&) {};
    if (front_points_.size() >= capacity_) {  // the deque's array is full: build it again, larger
      capacity_ *= 2;
      front_.reset(capacity_);
      for (const Point2& q : front_points_) front_.push(q, ignore);
    }
    front_points_.push_back(p);
    front_.push(p, ignore);
  }
  void pop_back() {
    if (log_.empty()) {
      back_.reset(front_points_.size());
      saved_.clear();
      for (size_t i = front_points_.size(); i-- > 0;) {
        log_.push_back({back_.state(), saved_.size()});
        back_.push(front_points_[i], [&](size_t cell, const Point2& q) { saved_.push_back({cell, q}); });
      }
      front_points_.clear();
      front_.reset(capacity_);
    }
    for (; saved_.size() > log_.back().saved; saved_.pop_back()) back_.put(saved_.back().cell, saved_.back().point);
    back_.restore(log_.back().state);
    log_.pop_back();
  }
  template <typename Fn>
  void for_each_vertex(Fn&& fn) const {
    back_.for_each_vertex(fn);
    front_.for_each_vertex(fn);
  }

 private:
  struct Undo {
    MelkmanDeque::State state;
    size_t saved;
  };
  struct Saved {
    size_t cell;
    Point2 point;
  };
  size_t capacity_ = 1024;
  MelkmanDeque back_, front_;
  std::vector<Point2> front_points_;
  std::vector<Undo> log_;
  std::vector<Saved> saved_;
};

}  // namespace lumicut::bench
