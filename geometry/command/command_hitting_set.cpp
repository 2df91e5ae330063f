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
  std::string points, disks, out = "-", picture, method = "default", start;
  bool drop_empty = false;
  int size = 1000, k = 3;
};

std::vector<uint32_t> solve(const Arguments& a, const std::vector<Point2>& points, const std::vector<Disk>& disks) {
  if (a.method == "default") {
    HittingSetOptions o;
    o.drop_empty_disks = a.drop_empty;
    const HittingSet h = solve_hitting_set(points, disks, o);
    std::fprintf(stderr, "%zu empty disks dropped; no set has fewer than %zu points, gap %.2f %%; greedy %zu\n",
                 h.empty_disks, h.lower_bound, 100 * h.gap(), h.greedy);
    return h.points;
  }
  if (a.method == "dnet") {
#ifdef LUMICUT_HAS_CGAL
    DnetOptions o;
    o.drop_empty_disks = a.drop_empty;
    return dnet_hitting_set(points, disks, o).points;
#else
    fail_argument("--method dnet: this command was built without CGAL");
#endif
  }
  if (a.drop_empty) fail_argument("--drop-empty: not with --method " + a.method);
  if (a.method != "local") return greedy_hitting_set(points, disks, a.method == "pruned");
  std::vector<uint32_t> start;
  if (a.start.empty()) {
    start = greedy_hitting_set(points, disks, true);
  } else {
    auto file = open_text(a.start);
    for (const double v : read_numbers_csv(file, a.start, "index")) {
      if (!(v >= 0 && v < static_cast<double>(points.size())) || v != static_cast<double>(static_cast<uint32_t>(v)))
        fail_argument(a.start + ": index " + std::to_string(v) + " is of none of " + std::to_string(points.size()) +
                      " points");
      start.push_back(static_cast<uint32_t>(v));
    }
  }
  std::fprintf(stderr, "starts from %zu points\n", start.size());
  return improve_hitting_set(points, disks, start, a.k);
}

int run(const Arguments& a) {
  check_output(a.out);
  io::check_distinct({a.out == "-" ? "" : a.out, a.picture});
  check_output(a.picture);
  auto points_file = open_text(a.points), disks_file = open_text(a.disks);
  const auto points = read_points_csv(points_file, a.points);
  const auto disks = read_disks_csv(disks_file, a.disks);
  const auto start = std::chrono::steady_clock::now();
  const std::vector<uint32_t> chosen = solve(a, points, disks);
  std::fprintf(stderr, "%zu points hit %zu disks; %.2f s\n", chosen.size(), disks.size(), seconds_since(start));
  write_points(a.out, points, chosen);
  if (!a.picture.empty())
    write_text(a.picture, draw_hitting_set(a.picture.ends_with(".svg"), points, disks, chosen, a.size));
  return 0;
}

}  // namespace

Command add_hitting_set(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand("hitting-set", "Few points that hit every disk");
  command->add_option("--points", a->points, "CSV: x,y")->required();
  command->add_option("--disks", a->disks, "CSV: x,y,radius")->required();
  command->add_option("--out", a->out, "CSV of the chosen points: index,x,y (-: standard output)");
  command->add_option("--picture", a->picture, "Picture of the instance, .svg or .png");
  command->add_option("--size", a->size, "Its size in pixels")->check(CLI::Range(50, 10000));
  command
      ->add_option("--method", a->method,
                   "default: all we know; greedy, pruned: the point that hits most, again and again, and without what "
                   "is not needed; "
                   "dnet: rounding by epsilon-nets; local: local search alone")
      ->check(CLI::IsMember({"default", "greedy", "pruned", "dnet", "local"}));
  command->add_option("--start", a->start,
                      "Of --method local: CSV of indices that hit every disk (none: pruned greedy)");
  command->add_option("--exchange", a->k, "Of --method local: most points that one step gives up for fewer")
      ->check(CLI::Range(2, 3));
  command->add_flag("--drop-empty", a->drop_empty, "Leave out disks without points rather than refuse them");
  return [a] { return run(*a); };
}

}  // namespace lumicut
