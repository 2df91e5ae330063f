// Convex hull of a sliding window of a simple polygonal chain: points enter at the front and leave at the back, O(1)
// amortised each, and the hull is explicit at all times. [Bus & Buzer 2015; Bus 2015 (thesis), ch. 9, Alg. 10-11]
//
// C* is the hull; C- the hull of the window's points when the phase began, built backwards so that deletions rewind it;
// C+ the hull of the points inserted since. "Regions" (what each point added to C-) tell when C+ comes out of C-.
// Departs from the thesis:
// - the three hulls are circular doubly linked lists rather than deques: what a point removed keeps its links, so that
// a
//   deletion rewinds C- in O(1) and no seam between two deques is to be kept; the back opening is not needed then.
// - in the mixed state the new piece of C* (cases 2b, 2c) is found by wrapping from C*'s surviving neighbours, with a
//   monotone tangent pointer on what C- exposes, rather than by Melkman insertions into a temporary hull.
// - collinear and repeated points: hulls are strictly convex, consecutive equal points share one node.
// - the region of a phase's first point is searched from the outside in, O(window) once a phase.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

class DynamicHull {
 public:
  struct Options {
    // Tests every new segment against the whole window, O(window) an insertion: for debugging. Without it a chain that
    // crosses or touches itself gives a wrong hull, silently (or Error(invalid_state) where it is noticed).
    bool check_simple = false;
  };

  DynamicHull() : DynamicHull(Options()) {}
  explicit DynamicHull(const Options& options);

  // Appends a point at the chain's front. Throws invalid_argument on a coordinate that is not finite or beyond 1e150.
  void push_front(const Point2& p);
  // Removes the chain's oldest point. Throws invalid_state when empty.
  void pop_back();

  // Points in the window, repeated ones counted.
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  size_t hull_size() const { return hull_size_; }
  // Strictly convex hull, counter-clockwise, from the vertex that was inserted last; 1 point or 2 when degenerate.
  void hull(std::vector<Point2>& out) const;
  template <typename Fn>
  void for_each_hull_vertex(Fn&& fn) const {
    if (hull_size_ == 0) return;
    uint32_t v = front_;
    do fn(node(v).point), v = node(v).star.next;
    while (v != front_);
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;
  struct Links {
    uint32_t prev, next;
  };
  struct Node {
    Point2 point;
    Links star;     // C*, while on_star
    Links part;     // C- or C+, while on that hull (and as it was, when removed from it)
    Links removed;  // C-: first and last vertex that this point removed; kNone: none
    Links outer;    // C-: its neighbours when it was inserted, i.e. the outer edges of its region
    Links cover;    // C-: creators of the regions beyond those two edges; kNone: the plane
    uint32_t repeats;
    bool on_star, on_part;
  };
  // A convex polygon under Melkman insertion: `last` is the vertex inserted last.
  struct Ring {
    uint32_t last = kNone;
    uint32_t size = 0;
  };

  Node& node(uint32_t id) { return nodes_[id & mask_]; }
  const Node& node(uint32_t id) const { return nodes_[id & mask_]; }
  const Point2& at(uint32_t id) const { return nodes_[id & mask_].point; }
  bool older(uint32_t a, uint32_t b) const { return static_cast<int32_t>(a - b) < 0; }
  bool in_minus(uint32_t id) const { return older(id, plus_begin_); }

  template <Links Node::*L>
  bool find_visible(const Ring& ring, const Point2& p, uint32_t& left, uint32_t& right) const;
  void insert_star(uint32_t id);
  void insert_plus(uint32_t id);
  void insert_minus(uint32_t id);
  void cover_edge(uint32_t from, uint32_t to, uint32_t by);
  void begin_phase();
  void locate_region(uint32_t id);
  void first_region(const Point2& p);
  void delete_oldest();
  void link_star_arc(uint32_t x, uint32_t y);
  void grow();
  void check_segment(const Point2& p) const;
  [[noreturn]] static void fail_not_simple();

  Options options_;
  std::vector<Node> nodes_;
  uint32_t mask_ = 0;
  uint32_t begin_ = 0, end_ = 0;  // ids of the window's nodes
  uint32_t plus_begin_ = 0;       // ids below are C-'s
  uint32_t front_ = kNone;        // newest vertex of C*
  uint32_t region_ = kNone;       // creator of the highest region that a point of C+ lies in
  size_t size_ = 0, hull_size_ = 0;
  size_t plus_on_star_ = 0;  // vertices of C* in C+: 0 is the thesis's decremental state
  Ring plus_, minus_;
  std::vector<uint32_t> arc_, chain_;
};

}  // namespace lumicut
