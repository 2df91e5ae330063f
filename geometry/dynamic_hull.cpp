#include "geometry/dynamic_hull.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "geometry/predicates.h"

namespace lumicut {

DynamicHull::DynamicHull(const Options& options) : options_(options), nodes_(64), mask_(63) {}

void DynamicHull::fail_not_simple() {
  fail_state("dynamic hull: the chain is not simple (it crosses or touches itself); its hull is lost");
}

// Melkman's step: may `p` be outside the ring, judged at its newest vertex, and between which neighbours does it go
// then? What lies from left's next to right's previous is removed. False: p is inside or on the ring.
template <DynamicHull::Links DynamicHull::Node::*L>
bool DynamicHull::find_visible(const Ring& ring, const Point2& p, uint32_t& left, uint32_t& right) const {
  const uint32_t f = ring.last;
  left = right = f;
  if (ring.size == 1) return !(at(f) == p);
  if (ring.size == 2) {
    const uint32_t s = (node(f).*L).next;
    const int turn = orientation(at(s), at(f), p);
    if (turn == 0) {
      if (between(at(s), at(f), p)) return false;
      left = right = between(at(s), p, at(f)) ? s : f;
    } else {
      left = turn > 0 ? f : s;
      right = turn > 0 ? s : f;
    }
    return true;
  }
  int turn_left = orientation(at((node(f).*L).prev), at(f), p);
  int turn_right = orientation(at(f), at((node(f).*L).next), p);
  if (turn_left >= 0 && turn_right >= 0) return false;
  uint32_t steps = 0;
  while (turn_left <= 0) {
    left = (node(left).*L).prev;
    if (++steps > ring.size) fail_not_simple();
    turn_left = orientation(at((node(left).*L).prev), at(left), p);
  }
  while (turn_right <= 0) {
    right = (node(right).*L).next;
    if (++steps > ring.size) fail_not_simple();
    turn_right = orientation(at(right), at((node(right).*L).next), p);
  }
  return true;
}

void DynamicHull::insert_plus(uint32_t id) {
  Node& n = node(id);
  if (plus_.size == 0) {
    n.part = {id, id};
    n.on_part = true;
    plus_ = {id, 1};
    return;
  }
  uint32_t left, right;
  n.on_part = find_visible<&Node::part>(plus_, n.point, left, right);
  if (!n.on_part) return;
  for (uint32_t v = node(left).part.next; v != right; v = node(v).part.next) {
    node(v).on_part = false;
    --plus_.size;
  }
  n.part = {left, right};
  node(left).part.next = id;
  node(right).part.prev = id;
  plus_.last = id;
  ++plus_.size;
}

// The region that `by` creates lies beyond the directed edge, whose owner is the end that was inserted later (is
// older).
void DynamicHull::cover_edge(uint32_t from, uint32_t to, uint32_t by) {
  if (from == to) return;
  if (older(from, to))
    node(from).cover.next = by;
  else
    node(to).cover.prev = by;
}

void DynamicHull::insert_minus(uint32_t id) {
  Node& n = node(id);
  n.removed = n.outer = n.cover = {kNone, kNone};
  if (minus_.size == 0) {
    n.part = n.outer = {id, id};
    n.on_part = true;
    minus_ = {id, 1};
    return;
  }
  uint32_t left, right;
  n.on_part = find_visible<&Node::part>(minus_, n.point, left, right);
  if (!n.on_part) return;
  uint32_t v = left;
  do {
    const uint32_t next = node(v).part.next;
    cover_edge(v, next, id);
    v = next;
    if (v != right) node(v).on_part = false, --minus_.size;
  } while (v != right);
  if (node(left).part.next != right) n.removed = {node(left).part.next, node(right).part.prev};
  n.part = n.outer = {left, right};
  node(left).part.next = id;
  node(right).part.prev = id;
  minus_.last = id;
  ++minus_.size;
}

void DynamicHull::begin_phase() {
  plus_begin_ = end_;
  plus_ = minus_ = Ring();
  plus_on_star_ = 0;
  region_ = kNone;
  for (uint32_t id = end_; id != begin_;) insert_minus(--id);
}

void DynamicHull::insert_star(uint32_t id) {
  Node& n = node(id);
  if (hull_size_ == 0) {
    n.star = {id, id};
  } else {
    uint32_t left, right;
    if (!find_visible<&Node::star>({front_, static_cast<uint32_t>(hull_size_)}, n.point, left, right)) return;
    for (uint32_t v = node(left).star.next; v != right; v = node(v).star.next) {
      node(v).on_star = false;
      --hull_size_;
      if (!in_minus(v)) --plus_on_star_;
    }
    n.star = {left, right};
    node(left).star.next = id;
    node(right).star.prev = id;
  }
  n.on_star = true;
  front_ = id;
  ++hull_size_;
  if (!in_minus(id)) ++plus_on_star_;
}

// The region of C+'s first point, from the outermost inwards: a point of C-_k lies in region k unless it also lies
// within all edges that k's insertion hid.
void DynamicHull::first_region(const Point2& p) {
  for (uint32_t k = begin_; k != plus_begin_; ++k) {
    const Node& n = node(k);
    if (n.outer.prev == kNone) continue;
    region_ = k;
    if (n.outer.prev == n.outer.next && n.removed.prev == kNone) {
      if (n.outer.prev == k || !(at(n.outer.prev) == p)) return;
      continue;
    }
    uint32_t v = n.outer.prev, w = n.removed.prev == kNone ? n.outer.next : n.removed.prev;
    for (;;) {
      if (orientation(at(v), at(w), p) < 0) return;
      if (w == n.outer.next) break;
      v = w;
      w = w == n.removed.next ? n.outer.next : node(w).part.next;
    }
  }
}

// Follows the chain's newest segment, which stays inside C-, through the regions that it enters. [Alg. 10, lines 5-6]
void DynamicHull::locate_region(uint32_t id) {
  const Point2& p = at(id);
  if (id == plus_begin_) return first_region(p);
  while (region_ != kNone) {
    const Node& k = node(region_);
    const bool out_left = orientation(at(k.outer.prev), k.point, p) < 0;
    const bool out_right = orientation(k.point, at(k.outer.next), p) < 0;
    if (!out_left && !out_right) return;
    bool left = out_left;
    if (out_left && out_right) left = orientation(at(id - 1), p, k.point) > 0;
    const uint32_t beyond = left ? k.cover.prev : k.cover.next;
    // Regions beyond are made by older points; none there means that p left the hull where a simple chain cannot.
    if (beyond == kNone || older(beyond, begin_)) fail_not_simple();
    region_ = beyond;
  }
}

// Puts arc_ between x and y of C*, in the place of the oldest point.
void DynamicHull::link_star_arc(uint32_t x, uint32_t y) {
  uint32_t last = x;
  --hull_size_;
  for (const uint32_t v : arc_) {
    Node& n = node(v);
    if (n.on_star) fail_not_simple();
    n.on_star = true;
    n.star.prev = last;
    node(last).star.next = v;
    last = v;
    ++hull_size_;
    if (!in_minus(v)) ++plus_on_star_;
    if (older(front_, v)) front_ = v;
  }
  node(last).star.next = y;
  node(y).star.prev = last;
}

// Alg. 11. Rewinds C-, then mends C* between the deleted point's neighbours.
void DynamicHull::delete_oldest() {
  const uint32_t i = begin_;
  Node& n = node(i);
  chain_.clear();  // what C- exposes, counter-clockwise: its neighbours of i, and between them what i had hidden
  if (n.on_part && n.part.prev != i) {
    const uint32_t u = n.part.prev, v = n.part.next;
    chain_.push_back(u);
    if (n.removed.prev == kNone) {
      node(u).part.next = v;
      node(v).part.prev = u;
    } else {
      node(u).part.next = n.removed.prev;
      node(v).part.prev = n.removed.next;
      for (uint32_t w = n.removed.prev; w != v; w = node(w).part.next) {
        node(w).on_part = true;
        chain_.push_back(w);
      }
    }
    if (u != v || chain_.size() > 1) chain_.push_back(v);
  }
  if (!n.on_star) return;  // case 3
  n.on_star = false;
  if (hull_size_ == 1) {
    hull_size_ = 0;
    front_ = kNone;
    if (end_ - begin_ > 1) fail_not_simple();
    return;
  }
  const uint32_t x = n.star.prev, y = n.star.next;
  const bool x_minus = in_minus(x), y_minus = in_minus(y);
  arc_.clear();
  if (x_minus && y_minus) {  // cases 1 and 2a: C* changes as C- does
    if (chain_.empty() || x != chain_.front() || y != chain_.back()) fail_not_simple();
    if (chain_.size() > 2) arc_.assign(chain_.begin() + 1, chain_.end() - 1);
    const bool emerges = plus_on_star_ == 0 && region_ == i;
    link_star_arc(x, y);
    if (emerges) {
      for (uint32_t id = plus_begin_; id != end_; ++id) insert_star(id);
      region_ = kNone;
    }
    return;
  }

  // Cases 2b and 2c. A surviving vertex of C* in C+ has as its neighbour either its own neighbour on C+ or the tangent
  // point on the chain, whichever is further out; wrap from both sides until C* passes over to the chain.
  if (x_minus && chain_.size() > 2 && chain_.front() == chain_.back()) chain_.pop_back();
  if (y_minus && chain_.size() > 2 && chain_.front() == chain_.back()) chain_.erase(chain_.begin());
  const int count = static_cast<int>(chain_.size());
  int a = 0, b = count - 1;
  uint32_t guard = 0;
  const uint32_t limit = end_ - begin_;
  bool closed = false;  // C- lies inside C+
  if (!x_minus) {
    for (uint32_t at_v = x;;) {
      const Point2& p = at(at_v);
      const uint32_t next = node(at_v).part.next;
      if (count > 0) {
        for (; a + 1 < count; ++a) {
          const Point2 &q = at(chain_[a]), &r = at(chain_[a + 1]);
          const int turn = orientation(p, q, r);
          if (turn > 0 || (turn == 0 && !between(p, r, q))) break;
        }
        const Point2 &q = at(chain_[a]), &r = at(next);
        const int turn = orientation(p, q, r);
        if (turn > 0 || (turn == 0 && !between(p, r, q))) break;
      }
      if (++guard > limit) fail_not_simple();
      at_v = next;
      if (at_v == y) {
        closed = true;
        break;
      }
      arc_.push_back(at_v);
    }
  } else if (count == 0 || x != chain_.front()) {
    fail_not_simple();
  }
  if (!closed) {
    const size_t left_end = arc_.size();
    if (!y_minus) {
      for (uint32_t at_v = y;;) {
        const Point2& p = at(at_v);
        for (; b > 0; --b) {
          const Point2 &q = at(chain_[b]), &r = at(chain_[b - 1]);
          const int turn = orientation(q, p, r);
          if (turn > 0 || (turn == 0 && !between(p, r, q))) break;
        }
        const uint32_t prev = node(at_v).part.prev;
        const Point2 &q = at(chain_[b]), &r = at(prev);
        const int turn = orientation(q, p, r);
        if (turn > 0 || (turn == 0 && !between(p, r, q))) break;
        if (++guard > limit) fail_not_simple();
        at_v = prev;
        arc_.push_back(at_v);
      }
    } else if (y != chain_.back()) {
      fail_not_simple();
    }
    // Left wrap, the chain from a to b (without x and y themselves), right wrap turned round.
    const int from = x_minus ? 1 : a, to = y_minus ? count - 2 : b;
    if (from > to + 1) fail_not_simple();
    std::reverse(arc_.begin() + static_cast<std::ptrdiff_t>(left_end), arc_.end());
    arc_.insert(arc_.begin() + static_cast<std::ptrdiff_t>(left_end), chain_.begin() + from, chain_.begin() + (to + 1));
  }
  link_star_arc(x, y);
}

void DynamicHull::push_front(const Point2& p) {
  if (!(std::fabs(p.x) <= 1e150) || !(std::fabs(p.y) <= 1e150))
    fail_argument("dynamic hull: point (" + std::to_string(p.x) + ", " + std::to_string(p.y) +
                  ") has a coordinate that is not finite or beyond 1e150");
  if (begin_ != end_ && at(end_ - 1) == p) {
    ++node(end_ - 1).repeats;
    ++size_;
    return;
  }
  if (options_.check_simple) check_segment(p);
  if (end_ - begin_ > mask_) grow();
  const uint32_t id = end_++;
  Node& n = node(id);
  n = Node{p, {}, {}, {kNone, kNone}, {kNone, kNone}, {kNone, kNone}, 1, false, false};
  ++size_;
  const bool decremental = plus_on_star_ == 0 && begin_ != plus_begin_;
  insert_plus(id);
  insert_star(id);
  if (decremental && !n.on_star) locate_region(id);
}

void DynamicHull::pop_back() {
  if (size_ == 0) fail_state("dynamic hull: pop_back on an empty window");
  --size_;
  if (node(begin_).repeats > 1) {
    --node(begin_).repeats;
    return;
  }
  if (begin_ == plus_begin_) begin_phase();
  delete_oldest();
  ++begin_;
}

void DynamicHull::hull(std::vector<Point2>& out) const {
  out.clear();
  for_each_hull_vertex([&](const Point2& p) { out.push_back(p); });
}

void DynamicHull::grow() {
  if (nodes_.size() >= (size_t{1} << 30)) fail_state("dynamic hull: more than 2^30 points in the window");
  std::vector<Node> larger(nodes_.size() * 2);
  const auto mask = static_cast<uint32_t>(larger.size() - 1);
  for (uint32_t id = begin_; id != end_; ++id) larger[id & mask] = node(id);
  nodes_.swap(larger);
  mask_ = mask;
}

void DynamicHull::check_segment(const Point2& p) const {
  if (begin_ == end_) return;
  const Point2& q = at(end_ - 1);
  for (uint32_t id = begin_; id != end_; ++id) {
    const Point2& a = at(id);
    if (id + 1 == end_) break;
    const Point2& b = at(id + 1);
    const int o1 = orientation(q, p, a), o2 = orientation(q, p, b);
    const int o3 = orientation(a, b, q), o4 = orientation(a, b, p);
    bool touch;
    if (id + 2 == end_)  // the previous segment shares q: only folding back is wrong
      touch = o4 == 0 && (between(a, b, p) || between(q, p, a));
    else
      touch = (o1 * o2 < 0 && o3 * o4 < 0) || (o1 == 0 && between(q, p, a)) || (o2 == 0 && between(q, p, b)) ||
              (o3 == 0 && between(a, b, q)) || (o4 == 0 && between(a, b, p));
    if (touch)
      fail_argument("dynamic hull: the segment to (" + std::to_string(p.x) + ", " + std::to_string(p.y) +
                    ") crosses or touches the chain");
  }
}

}  // namespace lumicut
