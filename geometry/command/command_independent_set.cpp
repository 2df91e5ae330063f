// lumicut-geometry independent-set: many disks that do not touch each other.
#include <cstdio>
#include <memory>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "geometry/independent_set.h"
#include "io/atomic_file.h"

namespace lumicut {
namespace {

struct Arguments {
  std::string disks, out = "-", picture, start;
  int exchange = 3, size = 1000;
};

int run(const Arguments& a) {
  check_output(a.out), check_output(a.picture);
  io::check_distinct({a.out == "-" ? "" : a.out, a.picture}, {a.disks, a.start});
  auto file = open_text(a.disks);
  const std::vector<Disk> disks = read_disks_csv(file, a.disks, 1e70);
  std::vector<uint32_t> from;
  if (!a.start.empty()) from = read_indices(a.start, disks.size(), "disks");
  const auto start = std::chrono::steady_clock::now();
  const std::vector<uint32_t> chosen = [&] {
    ProgressLine line;
    return independent_disks(disks, a.exchange, from, &line.progress());
  }();
  std::fprintf(stderr, "%zu of %zu disks; %.2f s\n", chosen.size(), disks.size(), seconds_since(start));
  std::string text = "index,x,y,radius\n";
  char line[128];
  for (const uint32_t i : chosen) {
    std::snprintf(line, sizeof line, "%u,%.17g,%.17g,%.17g\n", i, disks[i].centre.x, disks[i].centre.y,
                  disks[i].radius);
    text += line;
  }
  write_text(a.out, text);
  if (a.picture.empty()) return 0;
  std::vector<Circle> circles;
  for (const Disk& d : disks) circles.push_back({d, {200, 210, 220}});
  for (const uint32_t i : chosen) circles.push_back({disks[i], {208, 32, 32}});
  write_text(a.picture, draw_circles(as_svg(a.picture), {}, circles, {}, a.size));
  return 0;
}

}  // namespace

Command add_independent_set(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand("independent-set", "Many disks that do not touch each other, by local search");
  command->add_option("--disks", a->disks, "CSV: x,y,radius")->required();
  command->add_option("--out", a->out, "CSV of the chosen disks: index,x,y,radius (-: standard output)");
  command->add_option("--start", a->start, "CSV of indices of disks that do not touch (none: small ones first)");
  command->add_option("--exchange", a->exchange, "Most disks that one step takes in, for one fewer")
      ->check(CLI::Range(2, 4));
  add_picture(*command, a->picture, a->size, "Picture, .svg or .png: the chosen disks are red");
  return [a] { return run(*a); };
}

}  // namespace lumicut
