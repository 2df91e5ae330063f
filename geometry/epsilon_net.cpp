#include "geometry/epsilon_net.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/hilbert_sort.h>
#include <CGAL/property_map.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/predicates.h"

namespace lumicut {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vb = CGAL::Triangulation_vertex_base_with_info_2<uint32_t, Kernel>;
using Fb = CGAL::Triangulation_face_base_with_info_2<uint32_t, Kernel>;
using Delaunay = CGAL::Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<Vb, Fb>>;
using Face = Delaunay::Face_handle;

Kernel::Point_2 cgal(const Point2& p) { return {p.x, p.y}; }

// +1: q strictly inside the circle through a, b, c taken counter-clockwise; 0 on it.
int in_circle(const Point2& a, const Point2& b, const Point2& c, const Point2& q) {
  return static_cast<int>(CGAL::side_of_oriented_circle(cgal(a), cgal(b), cgal(c), cgal(q)));
}

constexpr uint32_t kInfinite = 0xffffffffu;

class UnhitSearch {
 public:
  UnhitSearch(std::span<const Point2> points, std::span<const double> weights) : p_(points), w_(weights) {}

  double weight(uint32_t id) const { return w_.empty() ? 1.0 : w_[id]; }

  // Calls found(weight, members, candidates) for the heaviest disk of every pencil of empty disks (and of half-planes
  // about a hull vertex) with more weight than `above` - or as much, when `or_equal`. Only points of `active` are
  // looked at. `above` is read again for each pencil.
  template <typename Found>
  void run(std::span<const uint32_t> net, std::span<const uint32_t> active, const double& above, bool or_equal,
           Found&& found) {
    const auto enough = [&](double w) { return or_equal ? w >= above && w > 0 : w > above; };
    Delaunay t = triangulate(net);
    if (t.number_of_vertices() == 0) {
      double sum = 0;
      for (const uint32_t q : active) sum += weight(q);
      if (enough(sum)) {
        members_.assign(active.begin(), active.end());
        found(sum, members_, active);
      }
      return;
    }
    if (t.dimension() < 2) return run_on_line(t, active, enough, found);

    collect(t, active);
    // By indices: CGAL's own order of edges and of their sides goes by addresses in memory.
    struct Edge {
      uint32_t a, b;
      Face left, right;
      int i, j;
    };
    std::vector<Edge> edges;
    for (auto e = t.finite_edges_begin(); e != t.finite_edges_end(); ++e) {
      const Face f = e->first, g = f->neighbor(e->second);
      if (!enough(sums_[f->info()] + sums_[g->info()])) continue;
      const uint32_t a = f->vertex(Delaunay::ccw(e->second))->info(), b = f->vertex(Delaunay::cw(e->second))->info();
      const int i = e->second, j = t.mirror_index(f, i);
      edges.push_back(a < b ? Edge{a, b, f, g, i, j} : Edge{b, a, g, f, j, i});
    }
    std::sort(edges.begin(), edges.end(),
              [](const Edge& x, const Edge& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
    for (const auto& [a, b, left, right, i, j] : edges) {
      if (!enough(sums_[left->info()] + sums_[right->info()])) continue;
      const uint32_t apex_left = apex(t, left, i), apex_right = apex(t, right, j);
      sides_.clear();
      for (const uint32_t q : list(left)) {
        const int s = orientation(p_[a], p_[b], p_[q]);
        if (s > 0 || (s == 0 && apex_left != kInfinite)) add_side(a, b, q, s);
      }
      for (const uint32_t q : list(right)) {
        const int s = orientation(p_[a], p_[b], p_[q]);
        if (s < 0 || (s == 0 && apex_left == kInfinite)) add_side(a, b, q, s);
      }
      pencil(a, b, apex_left, apex_right, enough, found);
    }
    // Hull vertices: consecutive infinite faces around the infinite vertex.
    const auto begin = t.incident_faces(t.infinite_vertex());
    auto f = begin;
    do {
      // The infinite face of a hull edge: the hull lies on the right of ccw(i) → cw(i).
      const int i = f->index(t.infinite_vertex());
      const Face next = f->neighbor(Delaunay::cw(i));  // shares the vertex at ccw(i) and the infinite one
      const auto v = f->vertex(Delaunay::ccw(i));
      const int j = next->index(t.infinite_vertex());
      // Its neighbours on the hull, which runs counter-clockwise: before → v → after.
      const auto before = f->vertex(Delaunay::cw(i));
      const auto after =
          next->vertex(Delaunay::ccw(j)) == v ? next->vertex(Delaunay::cw(j)) : next->vertex(Delaunay::ccw(j));
      if (enough(sums_[f->info()] + sums_[next->info()])) {
        candidates_.clear();
        for (const uint32_t q : list(f)) candidates_.push_back(q);
        for (const uint32_t q : list(next))
          if (!outside(f, i, q)) candidates_.push_back(q);
        wedge(p_[v->info()], p_[before->info()], false, p_[after->info()], true, enough, found);
      }
      ++f;
    } while (f != begin);
  }

  // All points on one line? Then `order` lists them along it.
  bool collinear(std::vector<uint32_t>& order) const {
    order.resize(p_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return p_[a].x < p_[b].x || (p_[a].x == p_[b].x && (p_[a].y < p_[b].y || (p_[a].y == p_[b].y && a < b)));
    });
    if (p_.empty()) return true;
    const Point2 &a = p_[order.front()], &b = p_[order.back()];
    return std::all_of(p_.begin(), p_.end(), [&](const Point2& q) { return orientation(a, b, q) == 0; });
  }

 private:
  struct Event {
    uint32_t id;
    int side;  // +1 enters, -1 leaves
  };

  // In random rounds, each along a Hilbert curve, as CGAL's own range insertion goes; but that draws on a global
  // generator.
  Delaunay triangulate(std::span<const uint32_t> net) const {
    std::vector<std::vector<size_t>> rounds(24);
    for (const uint32_t id : net) rounds[static_cast<size_t>(std::countr_zero(hash64(id) | (1u << 23)))].push_back(id);
    Delaunay t;
    Face hint;
    for (size_t r = rounds.size(); r-- > 0;) {
      hilbert_order(rounds[r]);
      for (const size_t id : rounds[r]) {
        const auto v = t.insert(cgal(p_[id]), hint);
        v->info() = static_cast<uint32_t>(id);
        hint = v->face();
      }
    }
    return t;
  }
  void hilbert_order(std::vector<size_t>& ids) const {
    std::vector<std::pair<Kernel::Point_2, size_t>> v;
    v.reserve(ids.size());
    for (const size_t id : ids) v.emplace_back(cgal(p_[id]), id);
    using Map = CGAL::First_of_pair_property_map<std::pair<Kernel::Point_2, size_t>>;
    CGAL::hilbert_sort(v.begin(), v.end(), CGAL::Spatial_sort_traits_adapter_2<Kernel, Map>());
    for (size_t i = 0; i < v.size(); ++i) ids[i] = v[i].second;
  }
  static uint32_t apex(const Delaunay& t, Face f, int i) {
    return t.is_infinite(f->vertex(i)) ? kInfinite : f->vertex(i)->info();
  }
  std::span<const uint32_t> list(Face f) const {
    return {lists_.data() + offsets_[f->info()], offsets_[f->info() + 1] - offsets_[f->info()]};
  }
  // Strictly beyond the hull edge of the infinite face f.
  bool outside(Face f, int i, uint32_t q) const {
    return orientation(p_[f->vertex(Delaunay::ccw(i))->info()], p_[f->vertex(Delaunay::cw(i))->info()], p_[q]) > 0;
  }

  // For every face the active points in its (open) Delaunay disk, found from the face that a point lies in.
  // [Lemma 6.10]
  void collect(Delaunay& t, std::span<const uint32_t> active) {
    uint32_t faces = 0;
    for (auto f = t.all_faces_begin(); f != t.all_faces_end(); ++f) f->info() = faces++;
    std::vector<size_t> order(active.begin(), active.end());
    hilbert_order(order);
    std::vector<std::pair<uint32_t, uint32_t>> incidences;
    std::vector<Face> conflicts;
    Face hint;
    for (const size_t i : order) {
      const auto q = static_cast<uint32_t>(i);
      conflicts.clear();
      const auto at = cgal(p_[q]);
      hint = t.locate(at, hint);
      t.get_conflicts(at, std::back_inserter(conflicts), hint);
      for (const Face f : conflicts) incidences.emplace_back(f->info(), q);
    }
    offsets_.assign(faces + 1, 0);
    sums_.assign(faces, 0.0);
    for (const auto& [f, q] : incidences) ++offsets_[f + 1], sums_[f] += weight(q);
    std::partial_sum(offsets_.begin(), offsets_.end(), offsets_.begin());
    lists_.resize(incidences.size());
    std::vector<size_t> fill(offsets_.begin(), offsets_.end() - 1);
    for (const auto& [f, q] : incidences) lists_[fill[f]++] = q;
  }

  void add_side(uint32_t a, uint32_t b, uint32_t q, int side) {
    if (side == 0 && (!between(p_[a], p_[b], p_[q]) || p_[q] == p_[a] || p_[q] == p_[b])) return;
    sides_.push_back({q, side});
  }

  // Where along the pencil through a and b the circle through q stands: the cotangent of the angle that q sees ab
  // under, and a bound of its rounding error.
  struct Stop {
    uint32_t id;
    int side;
    double t, error;
  };
  Stop stop(uint32_t a, uint32_t b, uint32_t q, int side) const {
    const double ax = p_[a].x - p_[q].x, ay = p_[a].y - p_[q].y, bx = p_[b].x - p_[q].x, by = p_[b].y - p_[q].y;
    const double dot = ax * bx + ay * by, cross = ax * by - ay * bx;
    const double dot_error = 4.5e-16 * (std::fabs(ax * bx) + std::fabs(ay * by));
    const double cross_error = 4.5e-16 * (std::fabs(ax * by) + std::fabs(ay * bx));
    const double t = dot / cross;
    if (!(std::fabs(cross) > 4 * cross_error)) return {q, side, 0, std::numeric_limits<double>::infinity()};
    return {q, side, t, 2 * (dot_error + std::fabs(t) * cross_error) / std::fabs(cross) + 4e-16 * std::fabs(t)};
  }
  // Sign of t_q - t_r, exact. A point on the left is inside the circles beyond its own, one on the right those before.
  int compare(uint32_t a, uint32_t b, const Stop& q, const Stop& r) const {
    const double d = q.t - r.t, error = q.error + r.error;
    if (d > error) return 1;
    if (d < -error) return -1;
    return in_circle(p_[a], p_[b], p_[q.id], p_[r.id]) * q.side * r.side;
  }

  // Sweeps the empty disks through a and b from the right apex's circle to the left apex's. Candidates lie in sides_.
  // On the left a point is inside once the sweep has passed its circle, on the right until then.
  template <typename Enough, typename Found>
  void pencil(uint32_t a, uint32_t b, uint32_t apex_left, uint32_t apex_right, Enough&& enough, Found&& found) {
    double sum = 0, total = 0;
    for (const Event& s : sides_) total += weight(s.id);
    if (!enough(total)) return;
    const bool left_end = apex_left != kInfinite, right_end = apex_right != kInfinite;
    const Stop last = left_end ? stop(a, b, apex_left, 1) : Stop{},
               first = right_end ? stop(a, b, apex_right, -1) : Stop{};
    const bool open = !left_end || !right_end || compare(a, b, last, first) != 0;
    initial_.clear(), events_.clear(), stops_.clear(), candidates_.clear();
    for (const Event& s : sides_) {
      const Stop q = stop(a, b, s.id, s.side);
      bool inside = s.side == 0;
      if (s.side > 0) {
        if (left_end && compare(a, b, q, last) >= 0) continue;  // never inside
        if (right_end) {
          const int c = compare(a, b, q, first);
          inside = open ? c <= 0 : c < 0;
        }
        if (!inside && open) stops_.push_back(q);
      } else if (s.side < 0) {
        if (right_end && compare(a, b, q, first) <= 0) continue;
        inside = true;
        if (open && (!left_end || compare(a, b, q, last) < 0)) stops_.push_back(q);
      }
      candidates_.push_back(s.id);
      if (inside) initial_.push_back(s.id), sum += weight(s.id);
    }
    std::sort(stops_.begin(), stops_.end(), [&](const Stop& x, const Stop& y) {
      const int c = x.id == y.id ? 0 : compare(a, b, x, y);
      if (c != 0) return c < 0;
      return x.side != y.side ? x.side < y.side : x.id < y.id;  // leave first
    });
    for (const Stop& s : stops_) events_.push_back({s.id, s.side});
    sweep(sum, enough, found);
  }

  template <typename Enough, typename Found>
  void sweep(double sum, Enough&& enough, Found&& found) {
    double best = sum;
    size_t at = 0;
    for (size_t k = 0; k < events_.size(); ++k) {
      sum += events_[k].side * weight(events_[k].id);
      if (sum > best) best = sum, at = k + 1;
    }
    members_ = initial_;
    // Sums taken by adding and subtracting drift; the members decide.
    std::vector<uint32_t>& gone = scratch_;
    gone.clear();
    for (size_t k = 0; k < at; ++k) (events_[k].side > 0 ? members_ : gone).push_back(events_[k].id);
    if (!gone.empty()) {
      std::sort(members_.begin(), members_.end());
      std::sort(gone.begin(), gone.end());
      std::vector<uint32_t> left;
      std::set_difference(members_.begin(), members_.end(), gone.begin(), gone.end(), std::back_inserter(left));
      members_.swap(left);
    }
    double exact = 0;
    for (const uint32_t q : members_) exact += weight(q);
    if (enough(exact)) found(exact, members_, std::span<const uint32_t>(candidates_));
  }

  // Open half-planes through c: left of the direction d, which turns counter-clockwise from `start` - c until it is
  // c - `end` (toward_end), or until it is reversed (not toward_end). Candidates lie in candidates_.
  template <typename Enough, typename Found>
  void wedge(const Point2& c, const Point2& start, bool start_reversed, const Point2& end, bool toward_end,
             Enough&& enough, Found&& found) {
    const int s0 = start_reversed ? -1 : 1;
    initial_.clear(), events_.clear();
    double sum = 0;
    for (const uint32_t q : candidates_) {
      if (p_[q] == c) continue;
      const int o = orientation(c, start, p_[q]) * s0;
      const bool same_ray = o == 0 && ahead(c, start, p_[q]) == (s0 > 0);
      // Inside just after the start: strictly left, or straight behind.
      const bool inside = o > 0 || (o == 0 && !same_ray);
      if (inside) initial_.push_back(q), sum += weight(q);
      if (o == 0) continue;
      // The event's ray (q itself when it leaves, its opposite when it enters) lies left of the start; is it before the
      // end?
      const int side = inside ? -1 : 1;
      if (toward_end) {
        const int e = orientation(c, end, p_[q]);  // the last direction is c - end
        const int before_end = inside ? e : -e;    // > 0: that direction is left of the ray, so the ray comes first
        if (before_end <= 0) continue;
      }
      events_.push_back({q, side});
    }
    std::sort(events_.begin(), events_.end(), [&](const Event& x, const Event& y) {
      const int o = orientation(c, p_[x.id], p_[y.id]) * x.side * y.side;
      if (o != 0) return o > 0;
      return x.side != y.side ? x.side < y.side : x.id < y.id;
    });
    sweep(sum, enough, found);
  }
  static bool ahead(const Point2& c, const Point2& a, const Point2& q) {
    return (a.x - c.x) * (q.x - c.x) + (a.y - c.y) * (q.y - c.y) > 0;
  }

  // The net lies on one line: pencils through neighbours are unbounded on both sides, half-planes turn about both ends.
  template <typename Enough, typename Found>
  void run_on_line(const Delaunay& t, std::span<const uint32_t> active, Enough&& enough, Found&& found) {
    std::vector<uint32_t> net;
    for (auto v = t.finite_vertices_begin(); v != t.finite_vertices_end(); ++v) net.push_back(v->info());
    std::sort(net.begin(), net.end(),
              [&](uint32_t a, uint32_t b) { return p_[a].x < p_[b].x || (p_[a].x == p_[b].x && p_[a].y < p_[b].y); });
    for (size_t k = 0; k + 1 < net.size(); ++k) {
      sides_.clear();
      for (const uint32_t q : active) add_side(net[k], net[k + 1], q, orientation(p_[net[k]], p_[net[k + 1]], p_[q]));
      pencil(net[k], net[k + 1], kInfinite, kInfinite, enough, found);
    }
    const auto half_turn = [&](uint32_t c, const Point2& start, bool reversed) {
      candidates_.assign(active.begin(), active.end());
      wedge(p_[c], start, reversed, start, false, enough, found);
    };
    if (net.size() > 1) {
      half_turn(net.front(), p_[net[1]], false);
      half_turn(net.back(), p_[net[net.size() - 2]], false);
    } else {
      const auto other = std::find_if(active.begin(), active.end(), [&](uint32_t q) { return !(p_[q] == p_[net[0]]); });
      if (other == active.end()) return;
      half_turn(net[0], p_[*other], false);
      half_turn(net[0], p_[*other], true);
    }
  }

  std::span<const Point2> p_;
  std::span<const double> w_;
  std::vector<size_t> offsets_;
  std::vector<uint32_t> lists_, initial_, candidates_, members_, scratch_;
  std::vector<double> sums_;
  std::vector<Event> sides_, events_;
  std::vector<Stop> stops_;
};

void validate(std::span<const Point2> points, std::span<const double> weights) {
  if (!weights.empty() && weights.size() != points.size())
    fail_argument("epsilon net: " + std::to_string(weights.size()) + " weights for " + std::to_string(points.size()) +
                  " points");
  for (size_t i = 0; i < points.size(); ++i) {
    if (!(std::fabs(points[i].x) <= 1e70) || !(std::fabs(points[i].y) <= 1e70))
      fail_argument("epsilon net: point " + std::to_string(i) + " has a coordinate that is not finite or beyond 1e70");
    if (!weights.empty() && !(weights[i] >= 0 && weights[i] <= 1e300))
      fail_argument("epsilon net: weight " + std::to_string(i) + " is " + std::to_string(weights[i]) +
                    "; finite and not negative expected");
  }
}

struct Violation {
  double weight;
  std::vector<uint32_t> members;
};

class Builder {
 public:
  Builder(std::span<const Point2> points, std::span<const double> weights, uint64_t seed)
      : p_(points), w_(weights), search_(points, weights), seed_(seed), in_net_(points.size(), 0) {}

  // Each point of `ids` with probability min(1, rate·w).
  void sample(std::span<const uint32_t> ids, double rate, std::vector<uint32_t>& out) {
    Rng rng(seed_, Stage::test, ++draws_);
    for (const uint32_t q : ids)
      if (rng.next_float() < rate * search_.weight(q)) out.push_back(q);
  }

  void certified(double threshold, double rate, EpsilonNet& result) {
    std::vector<uint32_t> net, active(p_.size());
    std::iota(active.begin(), active.end(), 0u);
    sample(active, rate, net);
    make_planar(net);
    for (const uint32_t q : net) in_net_[q] = 1;
    result.sample = net.size();
    std::vector<uint8_t> seen(p_.size(), 0);
    std::vector<Violation> violations;
    while (!active.empty()) {
      ++result.rounds;
      violations.clear();
      std::vector<uint32_t> next;
      search_.run(net, active, threshold, true,
                  [&](double w, const std::vector<uint32_t>& members, std::span<const uint32_t> candidates) {
                    violations.push_back({w, members});
                    std::sort(violations.back().members.begin(), violations.back().members.end());
                    for (const uint32_t q : candidates)
                      if (!seen[q]) seen[q] = 1, next.push_back(q);
                  });
      for (const uint32_t q : next) seen[q] = 0;
      std::sort(next.begin(), next.end());
      if (violations.empty()) break;
      hit(violations, net);
      active.swap(next);
    }
    result.points = std::move(net);
  }

  // A point near the middle of every violating disk, heaviest first, unless one taken before lies in it.
  void hit(std::vector<Violation>& violations, std::vector<uint32_t>& net) {
    std::sort(violations.begin(), violations.end(), [](const Violation& a, const Violation& b) {
      return a.weight != b.weight ? a.weight > b.weight : a.members < b.members;
    });
    for (const Violation& v : violations) {
      if (std::any_of(v.members.begin(), v.members.end(), [&](uint32_t q) { return in_net_[q] != 0; })) continue;
      Point2 mean;
      for (const uint32_t q : v.members) mean.x += p_[q].x * search_.weight(q), mean.y += p_[q].y * search_.weight(q);
      mean = {mean.x / v.weight, mean.y / v.weight};
      uint32_t best = v.members[0];
      for (const uint32_t q : v.members)
        if (dist2(p_[q], mean) < dist2(p_[best], mean)) best = q;
      in_net_[best] = 1;
      net.push_back(best);
    }
  }

  // Alg. 6 on `ids`; adds to in_net_. `rate`: c1 over the threshold weight.
  void thesis(std::vector<uint32_t> ids, double threshold, double rate, double smallest_sample, EpsilonNet& result,
              int depth) {
    if (threshold < 13.0 * mean_weight(ids) || depth > 100) {  // line 1: so few points that all of them are the net
      for (const uint32_t q : ids) in_net_[q] = 1;
      return;
    }
    std::vector<uint32_t> net;
    const double expected = rate * total(ids);
    for (int attempt = 0; attempt < 100; ++attempt) {  // line 4
      net.clear();
      sample(ids, rate, net);
      if (static_cast<double>(net.size()) > smallest_sample * expected) break;
    }
    for (const uint32_t q : net) in_net_[q] = 1;
    if (depth == 0) result.sample = net.size();
    // Lines 9-17. Neighbouring edges share their heavy disks: solve one, and look again.
    struct Problem {
      std::vector<uint32_t> members, candidates;
    };
    std::vector<Problem> problems;
    for (std::vector<uint32_t> active = std::move(ids);;) {
      problems.clear();
      search_.run(net, active, threshold, true,
                  [&](double, const std::vector<uint32_t>& members, std::span<const uint32_t> candidates) {
                    problems.push_back({members, {candidates.begin(), candidates.end()}});
                  });
      if (problems.empty()) return;
      std::sort(problems.begin(), problems.end(),
                [](const Problem& x, const Problem& y) { return x.members < y.members; });
      active.clear();
      for (Problem& problem : problems) {
        std::sort(problem.candidates.begin(), problem.candidates.end());
        active.insert(active.end(), problem.candidates.begin(), problem.candidates.end());
        if (std::any_of(problem.members.begin(), problem.members.end(), [&](uint32_t q) { return in_net_[q] != 0; }))
          continue;
        thesis(problem.candidates, threshold, rate, smallest_sample, result, depth + 1);
      }
      std::sort(active.begin(), active.end());
      active.erase(std::unique(active.begin(), active.end()), active.end());
      for (const uint32_t q : active)
        if (in_net_[q]) net.push_back(q);
      std::sort(net.begin(), net.end());
      net.erase(std::unique(net.begin(), net.end()), net.end());
    }
  }
  void gather(EpsilonNet& result) const {
    result.points.clear();
    for (uint32_t q = 0; q < in_net_.size(); ++q)
      if (in_net_[q]) result.points.push_back(q);
  }

  // All points on one line: walk along it and take a point whenever the weight since the last one reaches the
  // threshold.
  bool on_a_line(double threshold) {
    std::vector<uint32_t> order;
    if (!search_.collinear(order)) return false;
    double run = 0;
    for (const uint32_t q : order) {
      run += search_.weight(q);
      if (run >= threshold) in_net_[q] = 1, run = 0;
    }
    // What repeats a chosen point is hit by it; the walk is right all the same, only then a point or two too many.
    return true;
  }

 private:
  double total(std::span<const uint32_t> ids) const {
    double sum = 0;
    for (const uint32_t q : ids) sum += search_.weight(q);
    return sum;
  }
  double mean_weight(std::span<const uint32_t> ids) const {
    return ids.empty() ? 0 : total(ids) / static_cast<double>(ids.size());
  }
  // A triangle at least, where the points are not collinear: nets on a line are slow to search.
  void make_planar(std::vector<uint32_t>& net) const {
    if (p_.empty()) return;
    if (net.empty()) net.push_back(0);
    const uint32_t a = net[0];
    uint32_t b = a;
    double far = 0;
    for (const uint32_t q : net)
      if (dist2(p_[a], p_[q]) > far) far = dist2(p_[a], p_[q]), b = q;
    if (b == a) {
      for (uint32_t q = 0; q < p_.size(); ++q)
        if (dist2(p_[a], p_[q]) > far) far = dist2(p_[a], p_[q]), b = q;
      net.push_back(b);
    }
    for (const uint32_t q : net)
      if (orientation(p_[a], p_[b], p_[q]) != 0) return;
    for (uint32_t q = 0; q < p_.size(); ++q)
      if (orientation(p_[a], p_[b], p_[q]) != 0) {
        net.push_back(q);
        return;
      }
  }

  std::span<const Point2> p_;
  std::span<const double> w_;
  UnhitSearch search_;
  uint64_t seed_, draws_ = 0;
  std::vector<uint8_t> in_net_;
};

}  // namespace

EpsilonNet epsilon_net(std::span<const Point2> points, std::span<const double> weights, double epsilon,
                       const EpsilonNetOptions& options) {
  validate(points, weights);
  if (!(epsilon > 0 && epsilon <= 1))
    fail_argument("epsilon net: epsilon is " + std::to_string(epsilon) + "; (0, 1] expected");
  if (!(options.c0 >= 0 && options.c0 <= 1e6)) fail_argument("epsilon net: c0 is " + std::to_string(options.c0));
  EpsilonNet result;
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) sum += weights.empty() ? 1.0 : weights[i];
  if (!(sum > 0)) return result;
  if (!(sum <= 1e300)) fail_argument("epsilon net: the weights' sum is not finite");
  // A disk with just epsilon of the weight must be hit although sums round.
  const double threshold = epsilon * sum * (1 - 1e-12);
  Builder builder(points, weights, options.seed);
  if (builder.on_a_line(threshold)) {
    builder.gather(result);
  } else if (options.mode == EpsilonNetOptions::Mode::certified) {
    builder.certified(threshold, (options.c0 > 0 ? options.c0 : 0.7) / threshold, result);
    std::sort(result.points.begin(), result.points.end());
  } else {
    std::vector<uint32_t> all(points.size());
    std::iota(all.begin(), all.end(), 0u);
    builder.thesis(std::move(all), threshold, (options.c0 > 0 ? options.c0 : 7.0) / threshold, 0.5, result, 0);
    builder.gather(result);
  }
  return result;
}

double heaviest_unhit_disk(std::span<const Point2> points, std::span<const double> weights,
                           std::span<const uint32_t> net, std::vector<uint32_t>* members) {
  validate(points, weights);
  for (const uint32_t q : net)
    if (q >= points.size())
      fail_argument("epsilon net: net point " + std::to_string(q) + " of " + std::to_string(points.size()));
  UnhitSearch search(points, weights);
  std::vector<uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0u);
  double best = 0;
  if (members) members->clear();
  search.run(net, all, best, false, [&](double w, const std::vector<uint32_t>& m, std::span<const uint32_t>) {
    if (w <= best) return;
    best = w;
    if (members) *members = m;
  });
  return best;
}

}  // namespace lumicut
