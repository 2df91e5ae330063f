// lumicut-geometry hitting-set: few points that hit every disk.
#include <cstdio>
#include <memory>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "geometry/hitting_set.h"
#include "io/atomic_file.h"
#ifdef LUMICUT_HAS_CGAL
#include "geometry/dnet.h"
#endif

namespace lumicut {
namespace {

struct Arguments {
  std::string points, disks, ranges, shape, out = "-", picture, method = "default", start, structures = "kd-tree";
  bool drop_empty = false;
  int size = 1000, k = 3;
};

void tell_bound(const HittingSet& h) {
  std::fprintf(stderr, "%zu empty disks dropped; no set has fewer than %zu points, gap %.2f %%; greedy %zu\n",
               h.empty_disks, h.lower_bound, 100 * h.gap(), h.greedy);
}

// Ranges that are no disks.
std::vector<uint32_t> solve(const Arguments& a, size_t points, const Ranges& ranges) {
  if (a.method != "default" && a.method != "local")
    fail_argument("--method " + a.method + ": of disks alone; --ranges and --shape take default and local");
  if (a.method == "default" || a.start.empty()) {
    HittingSetOptions o;
    o.drop_empty_disks = a.drop_empty, o.local_search = a.method == "default";
    const HittingSet h = solve_hitting_set(points, ranges.offsets, ranges.members, o);
    tell_bound(h);
    if (a.method == "default") return h.points;
    return improve_hitting_set(points, ranges.offsets, ranges.members, h.points, a.k);
  }
  return improve_hitting_set(points, ranges.offsets, ranges.members, read_indices(a.start, points, "points"), a.k);
}

std::vector<uint32_t> solve(const Arguments& a, const std::vector<Point2>& points, const std::vector<Disk>& disks) {
  if (a.method == "default") {
    HittingSetOptions o;
    o.drop_empty_disks = a.drop_empty;
    const HittingSet h = solve_hitting_set(points, disks, o);
    tell_bound(h);
    return h.points;
  }
  if (a.method == "dnet") {
#ifdef LUMICUT_HAS_CGAL
    DnetOptions o;
    o.drop_empty_disks = a.drop_empty;
    if (a.structures == "delaunay") o.structures = DnetOptions::Structures::delaunay;
    const DnetResult d = dnet_hitting_set(points, disks, o);
    std::fprintf(stderr, "disks reported %zu, of which reweighed %zu\n", d.reports, d.reweighed);
    return d.points;
#else
    fail_argument("--method dnet: this command was built without CGAL");
#endif
  }
  if (a.drop_empty) fail_argument("--drop-empty: not with --method " + a.method);
  if (a.method != "local") return greedy_hitting_set(points, disks, a.method == "pruned");
  const std::vector<uint32_t> start =
      a.start.empty() ? greedy_hitting_set(points, disks, true) : read_indices(a.start, points.size(), "points");
  std::fprintf(stderr, "starts from %zu points\n", start.size());
  return improve_hitting_set(points, disks, start, a.k);
}

int run(const Arguments& a) {
  check_output(a.out);
  io::check_distinct({a.out == "-" ? "" : a.out, a.picture}, {a.points, a.disks, a.ranges, a.start});
  check_output(a.picture);
  if (a.disks.empty() == a.ranges.empty()) fail_argument("either --disks or --ranges is wanted");
  if (!a.shape.empty() && a.disks.empty()) fail_argument("--shape: not with --ranges");
  auto points_file = open_text(a.points);
  const auto points = read_points_csv(points_file, a.points, 1e70);
  Ranges ranges;
  std::vector<Disk> disks;
  if (a.ranges.empty()) {
    auto file = open_text(a.disks);
    disks = read_disks_csv(file, a.disks, 1e70);
  } else {
    auto file = open_text(a.ranges);
    for (const auto& row : read_index_rows_csv(file, a.ranges, points.size())) {
      ranges.members.insert(ranges.members.end(), row.begin(), row.end());
      ranges.offsets.push_back(ranges.members.size());
    }
  }
  std::vector<Point2> shape;
  if (!a.shape.empty()) {
    auto file = open_text(a.shape);
    shape = read_points_csv(file, a.shape, 1e70);
    ranges = points_in_copies(points, shape, disks);
  }
  const bool of_disks = a.ranges.empty() && a.shape.empty();
  if (!of_disks && !a.picture.empty()) fail_argument("--picture: of disks alone");
  const auto start = std::chrono::steady_clock::now();
  const std::vector<uint32_t> chosen = [&] {
    ProgressLine line;
    line.progress().begin("hitting set", 0);
    return of_disks ? solve(a, points, disks) : solve(a, points.size(), ranges);
  }();
  std::fprintf(stderr, "%zu points hit %zu %s; %.2f s\n", chosen.size(),
               of_disks ? disks.size() : ranges.offsets.size() - 1, of_disks ? "disks" : "ranges",
               seconds_since(start));
  write_points(a.out, points, chosen);
  if (!a.picture.empty()) write_text(a.picture, draw_hitting_set(as_svg(a.picture), points, disks, chosen, a.size));
  return 0;
}

}  // namespace

Command add_hitting_set(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand("hitting-set", "Few points that hit every disk");
  command->add_option("--points", a->points, "CSV: x,y")->required();
  command->add_option("--disks", a->disks, "CSV: x,y,radius");
  command->add_option("--ranges", a->ranges,
                      "In place of disks, sets of any kind (pseudodisks, for what is proven to hold): CSV, a row of "
                      "indices of points each");
  command->add_option("--shape", a->shape,
                      "CSV: the corners of a convex polygon around 0,0, counter-clockwise; --disks then holds the "
                      "places of copies and how large they are");
  command->add_option("--out", a->out, "CSV of the chosen points: index,x,y (-: standard output)");
  add_picture(*command, a->picture, a->size, "Picture of the instance, .svg or .png");
  command
      ->add_option("--method", a->method,
                   "default: all we know; greedy, pruned: the point that hits most, again and again, and without what "
                   "is not needed; "
                   "dnet: rounding by epsilon-nets; local: local search alone")
      ->check(CLI::IsMember({"default", "greedy", "pruned", "dnet", "local"}));
  command->add_option("--start", a->start,
                      "Of --method local: CSV of indices that hit every disk (none: pruned greedy)");
  command->add_option("--exchange", a->k, "Of --method local: most points that one step gives up for fewer")
      ->check(CLI::Range(2, 4));
  command
      ->add_option("--structures", a->structures,
                   "Of --method dnet: a kd-tree, or the thesis's Delaunay triangulations; the sets are the same")
      ->check(CLI::IsMember({"kd-tree", "delaunay"}));
  command->add_flag("--drop-empty", a->drop_empty, "Leave out disks without points rather than refuse them");
  return [a] { return run(*a); };
}

}  // namespace lumicut
