// lumicut-geometry balltree: ball trees by five builders, measured, searched and drawn.
#include <algorithm>
#include <cstdio>
#include <memory>

#include "core/error.h"
#include "geometry/balltree.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "io/atomic_file.h"

namespace lumicut {
namespace {

struct Arguments {
  std::string balls, builder = "bottom-up", picture, queries, kind = "nearest", by = "centre", out = "-";
  bool radii = false;
  int size = 1000;
  size_t count = 1;
};

const std::pair<const char*, BallTreeBuilder> kBuilders[] = {{"kd", BallTreeBuilder::kd},
                                                             {"top-down", BallTreeBuilder::top_down},
                                                             {"insertion", BallTreeBuilder::insertion},
                                                             {"cheap-insertion", BallTreeBuilder::cheap_insertion},
                                                             {"bottom-up", BallTreeBuilder::bottom_up}};

struct Balls {
  std::vector<double> centres, radii;
  size_t dimension = 0;
  size_t size() const { return dimension == 0 ? 0 : centres.size() / dimension; }
};

Balls read_balls(const std::string& path, bool with_radii) {
  auto file = open_text(path);
  size_t columns = 0;
  const std::vector<double> table = read_table_csv(file, path, columns, 1e15, with_radii);
  if (columns == 0) fail_argument(path + ": no balls");
  if (with_radii && columns == 1) fail_argument(path + ": one column, where centre and radius are wanted");
  Balls b;
  b.dimension = with_radii ? columns - 1 : columns;
  for (size_t i = 0; i < table.size(); i += columns) {
    b.centres.insert(b.centres.end(), table.begin() + static_cast<ptrdiff_t>(i),
                     table.begin() + static_cast<ptrdiff_t>(i + b.dimension));
    if (with_radii) b.radii.push_back(table[i + b.dimension]);
  }
  return b;
}

std::string answers(const Arguments& a, const BallTree& tree, const Balls& queries) {
  std::string text;
  for (size_t i = 0; i < queries.size(); ++i) {
    const auto centre = std::span(queries.centres).subspan(i * queries.dimension, queries.dimension);
    const double radius = queries.radii.empty() ? 0.0 : queries.radii[i];
    const auto by = a.by == "least"      ? BallTree::Distance::least
                    : a.by == "greatest" ? BallTree::Distance::greatest
                                         : BallTree::Distance::centre;
    const std::vector<uint32_t> found = a.kind == "best-mate"      ? std::vector{tree.best_mate(centre, radius)}
                                        : a.kind == "containing"   ? tree.containing(centre, radius)
                                        : a.kind == "intersecting" ? tree.intersecting(centre, radius)
                                        : a.kind == "contained"    ? tree.contained(centre, radius)
                                                                   : tree.nearest(centre, a.count, by);
    for (size_t k = 0; k < found.size(); ++k) text += (k == 0 ? "" : ",") + std::to_string(found[k]);
    text += '\n';
  }
  return text;
}

// Outer balls blue, inner ones red.
std::string draw(const Arguments& a, const BallTree& tree, const Balls& balls) {
  std::vector<Circle> circles;
  std::vector<Point2> points;
  const double depth = std::max<double>(1, static_cast<double>(tree.depth()) - 1);
  tree.for_each_ball([&](std::span<const double> centre, double radius, size_t level, uint32_t leaf) {
    if (leaf != BallTree::kNone && balls.radii.empty()) return;
    const double t = static_cast<double>(level) / depth;
    circles.push_back({{{centre[0], centre[1]}, radius},
                       {static_cast<uint8_t>(40 + 190 * t), 90, static_cast<uint8_t>(220 - 180 * t)}});
  });
  if (balls.radii.empty())
    for (size_t i = 0; i < balls.size(); ++i) points.push_back({balls.centres[2 * i], balls.centres[2 * i + 1]});
  return draw_circles(as_svg(a.picture), points, circles, {}, a.size);
}

int run(const Arguments& a) {
  check_output(a.picture);
  if (!a.queries.empty()) check_output(a.out);
  io::check_distinct({a.queries.empty() || a.out == "-" ? "" : a.out, a.picture}, {a.balls, a.queries});
  const Balls balls = read_balls(a.balls, a.radii);
  if (!a.picture.empty() && balls.dimension != 2)
    fail_argument("--picture: " + a.balls + " has " + std::to_string(balls.dimension) +
                  " dimensions, and pictures two");
  Balls queries;
  if (!a.queries.empty()) {
    queries = read_balls(a.queries, a.kind != "nearest" && a.kind != "containing" && a.kind != "best-mate");
    if (queries.dimension == balls.dimension + 1 && (a.kind == "containing" || a.kind == "best-mate"))
      queries = read_balls(a.queries, true);
    if (queries.dimension != balls.dimension)
      fail_argument(a.queries + ": " + std::to_string(queries.dimension) + " dimensions, and " + a.balls + " has " +
                    std::to_string(balls.dimension));
  }
  for (const auto& [name, builder] : kBuilders) {
    if (a.builder != "all" && a.builder != name) continue;
    if (builder == BallTreeBuilder::bottom_up && balls.dimension > 16 && a.builder == "all") {
      std::fprintf(stderr, "%-16s at most 16 dimensions\n", name);
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    const BallTree tree = [&, builder = builder] {
      ProgressLine line;
      return BallTree::build(balls.centres, balls.radii, static_cast<int>(balls.dimension), builder, &line.progress());
    }();
    const double seconds = seconds_since(start);
    std::fprintf(stderr, "%-16s %zu balls, %zu dimensions: volume %.6g, depth %zu, %.3f s\n", name, tree.size(),
                 balls.dimension, tree.total_volume(), tree.depth(), seconds);
    if (a.builder == "all") continue;
    if (!a.queries.empty()) {
      const auto searched = std::chrono::steady_clock::now();
      const std::string text = answers(a, tree, queries);
      std::fprintf(stderr, "%zu queries, %.3f s\n", queries.size(), seconds_since(searched));
      write_text(a.out, text);
    }
    if (!a.picture.empty()) write_text(a.picture, draw(a, tree, balls));
  }
  return 0;
}

}  // namespace

Command add_balltree(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command =
      app.add_subcommand("balltree", "Ball trees over points or balls of any dimension: volumes, searches, pictures");
  command->add_option("balls", a->balls, "CSV: a row of coordinates a point")->required();
  command->add_flag("--radii", a->radii, "The last column holds radii");
  command->add_option("--builder", a->builder, "Builder; all: compares them")
      ->check(CLI::IsMember({"kd", "top-down", "insertion", "cheap-insertion", "bottom-up", "all"}));
  command->add_option("--queries", a->queries, "CSV: a query a row, as the balls; writes a row of indices for each");
  command
      ->add_option(
          "--kind", a->kind,
          "Of queries. nearest: --count leaves; containing: leaves that hold the point or ball; "
          "intersecting, contained: leaves that touch the ball or lie in it; best-mate: the leaf whose joint ball with "
          "the point or ball is least")
      ->check(CLI::IsMember({"nearest", "containing", "intersecting", "contained", "best-mate"}));
  command
      ->add_option("--by", a->by, "Of nearest leaves: distance to their centres, to their nearest points or furthest")
      ->check(CLI::IsMember({"centre", "least", "greatest"}));
  command->add_option("--count", a->count, "Of nearest leaves")->check(CLI::Range(1, 1000000));
  command->add_option("--out", a->out, "CSV of the answers (-: standard output)");
  add_picture(*command, a->picture, a->size, "Picture of a tree in the plane, .svg or .png");
  return [a] {
    if (a->builder == "all" && (!a->queries.empty() || !a->picture.empty()))
      fail_argument("--builder all: queries and pictures are of one builder's tree");
    return run(*a);
  };
}

}  // namespace lumicut
