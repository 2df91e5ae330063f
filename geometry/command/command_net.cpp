// lumicut-geometry net: epsilon-nets of points for disks.
#include <cstdio>
#include <memory>
#include <numeric>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "io/atomic_file.h"
#ifdef LUMICUT_HAS_CGAL
#include "geometry/epsilon_net.h"
#endif

namespace lumicut {
namespace {

struct Arguments {
  std::string points, weights, out = "-", picture;
  int size = 1000;
  double epsilon = 0.01, c0 = 0;
  uint64_t seed = 0;
  bool thesis = false;
};

int run(const Arguments& a) {
#ifdef LUMICUT_HAS_CGAL
  check_finite("--c0", a.c0);
  check_output(a.out), check_output(a.picture);
  io::check_distinct({a.out == "-" ? "" : a.out, a.picture}, {a.points, a.weights});
  auto file = open_text(a.points);
  const auto points = read_points_csv(file, a.points, 1e70);
  std::vector<double> weights;
  if (!a.weights.empty()) {
    auto weights_file = open_text(a.weights);
    weights = read_weights_csv(weights_file, a.weights);
    if (weights.size() != points.size())
      fail_argument(a.weights + ": " + std::to_string(weights.size()) + " weights of " + std::to_string(points.size()) +
                    " points");
  }
  EpsilonNetOptions o;
  if (a.thesis) o.mode = EpsilonNetOptions::Mode::thesis;
  o.c0 = a.c0, o.seed = a.seed;
  const EpsilonNet n = epsilon_net(points, weights, a.epsilon, o);
  const double whole =
      weights.empty() ? static_cast<double>(points.size()) : std::accumulate(weights.begin(), weights.end(), 0.0);
  std::fprintf(
      stderr,
      "%zu points, %.2f/epsilon, %zu of them by the first sample; the heaviest disk without one holds %.6g of %.6g\n",
      n.points.size(), static_cast<double>(n.points.size()) * a.epsilon, n.sample,
      heaviest_unhit_disk(points, weights, n.points), whole);
  write_points(a.out, points, n.points);
  if (!a.picture.empty()) write_text(a.picture, draw_hitting_set(as_svg(a.picture), points, {}, n.points, a.size));
  return 0;
#else
  (void)a;
  fail_argument("net: this command was built without CGAL");
#endif
}

}  // namespace

Command add_net(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command =
      app.add_subcommand("net", "Points in every disk that holds at least epsilon of the weight of all points");
  command->add_option("--points", a->points, "CSV: x,y")->required();
  command->add_option("--weights", a->weights, "CSV: a weight a line, of each point (none: all alike)");
  command->add_option("--epsilon", a->epsilon, "In (0, 1]");
  command->add_option("--out", a->out, "CSV of the chosen points (-: standard output)");
  command->add_option("--c0", a->c0, "Size of the random sample, over epsilon (0: 0.7, with --thesis 7)")
      ->check(CLI::Range(0.0, 1e6));
  command->add_option("--seed", a->seed, "Of the sample");
  add_picture(*command, a->picture, a->size, "Picture of points and net, .svg or .png");
  command->add_flag("--thesis", a->thesis, "The thesis's construction rather than the certified one");
  return [a] { return run(*a); };
}

}  // namespace lumicut
