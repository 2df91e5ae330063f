// lumicut-geometry instance: hitting-set instances of the thesis, as files for the other commands.
#include <cstdio>
#include <memory>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/instances.h"
#include "io/atomic_file.h"

namespace lumicut {
namespace {

struct Arguments {
  std::string kind, family = "uniform", points, disks, start;
  int side = 20;
  uint32_t count = 50000, disk_count = 50000;
  double radius = 0.01;
  uint64_t seed = 1;
};

int run(const Arguments& a) {
  for (const std::string& path : {a.points, a.disks, a.start}) check_output(path);
  io::check_distinct({a.points, a.disks, a.start});
  check_finite("--radius", a.radius);
  std::vector<Point2> points;
  std::vector<Disk> disks;
  if (a.kind == "tight") {
    const TightInstance t = tight_instance(a.side);
    points = t.points, disks = t.disks;
    if (!a.start.empty()) write_points(a.start, points, t.start);
    std::fprintf(stderr, "start of %zu points, where %zu do: %.3f times as many\n", t.start.size(), t.small,
                 static_cast<double>(t.start.size()) / static_cast<double>(t.small));
  } else {
    if (!a.start.empty()) fail_argument("--start: of tight alone");
    points = a.family == "uniform" ? uniform_points(a.count, a.seed) : gauss9_points(a.count, a.seed);
    disks = a.kind == "fix" ? fixed_disks(points, a.radius) : random_disks(points, a.disk_count, a.radius, a.seed + 1);
  }
  std::string p, d;
  char line[128];
  for (const Point2& q : points) {
    std::snprintf(line, sizeof line, "%.17g,%.17g\n", q.x, q.y);
    p += line;
  }
  for (const Disk& q : disks) {
    std::snprintf(line, sizeof line, "%.17g,%.17g,%.17g\n", q.centre.x, q.centre.y, q.radius);
    d += line;
  }
  write_text(a.points, p), write_text(a.disks, d);
  std::fprintf(stderr, "%zu points, %zu disks\n", points.size(), disks.size());
  return 0;
}

}  // namespace

Command add_instance(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand("instance", "Instances of hitting sets that papers measure, as CSV files");
  command
      ->add_option("kind", a->kind,
                   "rnd: disks at random, radii up to --radius; fix: one of --radius around each point; tight: where "
                   "(3,2) local search stays at nearly eight times the optimum")
      ->check(CLI::IsMember({"rnd", "fix", "tight"}))
      ->required();
  command->add_option("--points", a->points, "CSV to write: x,y")->required();
  command->add_option("--disks", a->disks, "CSV to write: x,y,radius")->required();
  command->add_option("--start", a->start, "CSV to write, of tight: the hitting set that local search cannot improve");
  command->add_option("--family", a->family, "Of the points of rnd and fix, in the unit square")
      ->check(CLI::IsMember({"uniform", "gauss9"}));
  command->add_option("--count", a->count, "Points of rnd and fix")->check(CLI::Range(1, 100000000));
  command->add_option("--disk-count", a->disk_count, "Disks of rnd, before those without points are left out")
      ->check(CLI::Range(1, 100000000));
  command->add_option("--radius", a->radius, "Of rnd and fix")->check(CLI::Range(0.0, 1e6));
  command->add_option("--side", a->side, "Of tight: edges along the triangle")->check(CLI::Range(1, 300));
  command->add_option("--seed", a->seed, "Of rnd and fix");
  return [a] { return run(*a); };
}

}  // namespace lumicut
