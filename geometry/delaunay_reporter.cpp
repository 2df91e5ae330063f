#include "geometry/delaunay_reporter.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_hierarchy_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/hilbert_sort.h>
#include <CGAL/property_map.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/point_tree.h"

namespace lumicut {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vb = CGAL::Triangulation_vertex_base_with_info_2<uint32_t, Kernel>;
using Fb = CGAL::Triangulation_face_base_with_info_2<uint32_t, Kernel>;
using Vhb = CGAL::Triangulation_hierarchy_vertex_base_2<Vb>;
// Located in by way of coarser triangulations: O(log n) a query.
using Delaunay = CGAL::Triangulation_hierarchy_2<
    CGAL::Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<Vhb, Fb>>>;
using Face = Delaunay::Face_handle;
using Vertex = Delaunay::Vertex_handle;

Kernel::Point_2 cgal(const Point2& p) { return {p.x, p.y}; }
Point2 of(const Vertex& v) { return {v->point().x(), v->point().y()}; }

std::vector<uint32_t> along_a_curve(std::span<const Point2> points, std::span<const uint32_t> ids) {
  std::vector<Kernel::Point_2> p;
  for (const uint32_t i : ids) p.push_back(cgal(points[i]));
  std::vector<size_t> order(ids.size());
  std::iota(order.begin(), order.end(), size_t{0});
  using Traits = CGAL::Spatial_sort_traits_adapter_2<Kernel, CGAL::Pointer_property_map<Kernel::Point_2>::type>;
  CGAL::hilbert_sort(order.begin(), order.end(), Traits(CGAL::make_property_map(p)));
  std::vector<uint32_t> sorted;
  for (const size_t i : order) sorted.push_back(ids[i]);
  return sorted;
}

// From a net point towards the centre of a Delaunay disk through it, of any length.
struct Spoke {
  double x, y;
  double error;  // of its direction, in radians
  uint32_t list;
};
constexpr double kEpsilon = 0x1p-53;

// The circumcentre of v, a, b (counter-clockwise) lies at v + (|u|² w' - |w|² u') / 2 cross(u, w), with u = a - v,
// w = b - v and ' a quarter turn clockwise. The numerator is |u| |w| |u - w| long, which bounds what rounding does to its
// direction.
Spoke to_circumcentre(const Point2& v, const Point2& a, const Point2& b, uint32_t list) {
  const double ux = a.x - v.x, uy = a.y - v.y, wx = b.x - v.x, wy = b.y - v.y;
  const double u2 = ux * ux + uy * uy, w2 = wx * wx + wy * wy;
  const double apart = std::sqrt((ux - wx) * (ux - wx) + (uy - wy) * (uy - wy));
  return {u2 * wy - w2 * uy, w2 * ux - u2 * wx, 16 * kEpsilon * (1 + (std::sqrt(u2) + std::sqrt(w2)) / apart), list};
}

Vertex nearest(const Delaunay& t, const Point2& p) { return t.nearest_vertex(cgal(p), t.locate(cgal(p))); }

double cross(const Spoke& a, double x, double y) { return a.x * y - a.y * x; }

}  // namespace

struct DelaunayReporter::Parts {
  std::span<const Point2> points;
  Delaunay t;
  std::vector<size_t> offset;      // of each face's list
  std::vector<uint32_t> list;      // points in the closed Delaunay disk, without those of the net, ascending
  std::vector<size_t> spokes_at;   // by net vertex
  std::vector<Spoke> spokes;       // of each, counter-clockwise
  std::vector<uint32_t> everyone;  // of a net that has no triangle

  bool holds(const Face& f, const Point2& p) const {
    return t.side_of_oriented_circle(f, cgal(p)) != CGAL::ON_NEGATIVE_SIDE;
  }
};

DelaunayReporter::DelaunayReporter(std::span<const Point2> points, std::span<const uint32_t> net)
    : parts_(std::make_unique<Parts>()) {
  Parts& s = *parts_;
  s.points = points;
  Delaunay& t = s.t;
  Face hint;
  for (const uint32_t q : along_a_curve(points, net)) hint = t.insert(cgal(points[q]), hint)->face();
  if (t.dimension() < 2) {
    s.everyone.resize(points.size());
    std::iota(s.everyone.begin(), s.everyone.end(), 0u);
    return;
  }
  uint32_t faces = 0, vertices = 0;
  for (auto f = t.all_faces_begin(); f != t.all_faces_end(); ++f) f->info() = faces++;

  std::vector<uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<std::pair<uint32_t, uint32_t>> pairs;  // face, point
  std::vector<uint32_t> seen(faces, 0xffffffffu);
  std::vector<Face> stack;
  hint = Face();
  for (const uint32_t p : along_a_curve(points, all)) {
    Delaunay::Locate_type type;
    int i;
    const Face at = t.locate(cgal(points[p]), type, i, hint);
    hint = at;
    if (type == Delaunay::VERTEX) continue;  // at a net point: in no disk that holds none
    stack.push_back(at), seen[at->info()] = p;
    while (!stack.empty()) {
      const Face f = stack.back();
      stack.pop_back();
      if (!s.holds(f, points[p])) continue;
      pairs.push_back({f->info(), p});
      for (int k = 0; k < 3; ++k)
        if (const Face g = f->neighbor(k); seen[g->info()] != p) seen[g->info()] = p, stack.push_back(g);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  s.offset.assign(faces + 1, 0);
  for (const auto& [f, p] : pairs) ++s.offset[f + 1], s.list.push_back(p);
  std::partial_sum(s.offset.begin(), s.offset.end(), s.offset.begin());

  for (auto v = t.finite_vertices_begin(); v != t.finite_vertices_end(); ++v) {
    v->info() = vertices++;
    s.spokes_at.push_back(s.spokes.size());
    const auto begin = t.incident_faces(v);
    auto f = begin;
    do {
      const int i = f->index(v);
      const Vertex a = f->vertex(Delaunay::ccw(i)), b = f->vertex(Delaunay::cw(i));
      const Point2 at = of(v);
      if (!t.is_infinite(a) && !t.is_infinite(b)) {
        s.spokes.push_back(to_circumcentre(at, of(a), of(b), f->info()));
      } else {  // The outward normal: the hull lies on the right of v → a, or on the left of v → b.
        const Point2 to = of(t.is_infinite(a) ? b : a);
        const double side = t.is_infinite(a) ? 1.0 : -1.0;
        s.spokes.push_back({side * (to.y - at.y), -side * (to.x - at.x), 4 * kEpsilon, f->info()});
      }
      ++f;
    } while (f != begin);
  }
  s.spokes_at.push_back(s.spokes.size());
}

DelaunayReporter::~DelaunayReporter() = default;

size_t DelaunayReporter::listed() const { return parts_->list.size(); }

void DelaunayReporter::report(const Disk& disk, std::vector<uint32_t>& found) const {
  const Parts& s = *parts_;
  const auto begin = static_cast<std::ptrdiff_t>(found.size());
  const auto look = [&](std::span<const uint32_t> list) {
    for (const uint32_t p : list)
      if (hits(s.points[p], disk)) found.push_back(p);
  };
  if (s.t.dimension() < 2) return look(s.everyone);
  const Vertex v = nearest(s.t, disk.centre);
  const std::span<const Spoke> spokes =
      std::span(s.spokes).subspan(s.spokes_at[v->info()], s.spokes_at[v->info() + 1] - s.spokes_at[v->info()]);
  const size_t n = spokes.size();
  const double x = disk.centre.x - v->point().x(), y = disk.centre.y - v->point().y();
  const double length = std::sqrt(x * x + y * y);
  // Spokes turn once around v, by less than half a turn each: the last one up to which the way from the first one to the
  // centre turns left no further.
  const auto reached = [&](size_t i) {  // spoke i comes, from spoke 0 on, not after the centre
    const double first = cross(spokes[0], spokes[i].x, spokes[i].y), here = cross(spokes[0], x, y);
    const double along = spokes[0].x * spokes[i].x + spokes[0].y * spokes[i].y,
                 ahead = spokes[0].x * x + spokes[0].y * y;
    const auto half = [](double c, double d) { return c > 0 || (c == 0 && d > 0) ? 0 : 1; };
    const int a = half(first, along), b = half(here, ahead);
    return a != b ? a < b : cross(spokes[i], x, y) >= 0;
  };
  size_t low = 0, high = n;
  while (high - low > 1) {
    const size_t mid = (low + high) / 2;
    (reached(mid) ? low : high) = mid;
  }
  const auto uncertain = [&](size_t i) {
    const Spoke& k = spokes[i];
    const double along = k.x * x + k.y * y;
    return along > 0 &&
           std::fabs(cross(k, x, y)) <= (k.error + 8 * kEpsilon) * std::sqrt(k.x * k.x + k.y * k.y) * length;
  };
  const auto list = [&](size_t i) {
    const uint32_t f = spokes[i].list;
    return std::span(s.list).subspan(s.offset[f], s.offset[f + 1] - s.offset[f]);
  };
  // Indices go round: from the spoke before the centre to the one after it, and further while it is not sure which they are.
  const auto around = [n](std::ptrdiff_t i) { return static_cast<size_t>(i + static_cast<std::ptrdiff_t>(n)) % n; };
  auto from = static_cast<std::ptrdiff_t>(low), to = from + 1;
  const auto room = [&] { return to - from + 1 < static_cast<std::ptrdiff_t>(n); };
  while (room() && uncertain(around(from))) --from;
  while (room() && uncertain(around(to))) ++to;
  for (std::ptrdiff_t i = from; i <= to; ++i) look(list(around(i)));
  std::sort(found.begin() + begin, found.end());
  found.erase(std::unique(found.begin() + begin, found.end()), found.end());
}

struct DelaunayNearest::Parts {
  std::span<const Point2> points;
  Delaunay t;
};

DelaunayNearest::DelaunayNearest(std::span<const Point2> points) : parts_(std::make_unique<Parts>()) {
  parts_->points = points;
}
DelaunayNearest::DelaunayNearest(DelaunayNearest&&) noexcept = default;
DelaunayNearest::~DelaunayNearest() = default;

void DelaunayNearest::insert(uint32_t point) { parts_->t.insert(cgal(parts_->points[point])); }

bool DelaunayNearest::hit(const Disk& disk) const {
  const Delaunay& t = parts_->t;
  if (t.number_of_vertices() == 0) return false;
  const Vertex v = nearest(t, disk.centre);
  if (hits(of(v), disk)) return true;
  // hits() rounds, and the nearest one is so exactly: another as near may pass.
  if (dist2(of(v), disk.centre) > (1 + 0x1p-48) * disk.radius * disk.radius) return false;
  const auto begin = t.incident_vertices(v);
  auto w = begin;
  if (begin != nullptr) do {
      if (!t.is_infinite(w) && hits(of(w), disk)) return true;
      ++w;
    } while (w != begin);
  return false;
}

}  // namespace lumicut
