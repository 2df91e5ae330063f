// lumicut-geometry: the geometry library from the command line.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <iterator>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/csv.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/picture_ending.h"
#include "io/standard_streams.h"

namespace lumicut {

std::istringstream open_text(const std::string& path) {
  if (path == "-")
    return std::istringstream(std::string(std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>()));
  return std::istringstream(io::read_whole_file(path));
}

void check_output(const std::string& path) {
  if (!path.empty() && path != "-") io::check_writable(path);
}

void write_text(const std::string& path, const std::string& text) {
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    io::write_whole_file(path, text);
  }
}

void write_points(const std::string& path, const std::vector<Point2>& points, const std::vector<uint32_t>& chosen) {
  std::string text = "index,x,y\n";
  char line[96];
  for (const uint32_t i : chosen) {
    std::snprintf(line, sizeof line, "%u,%.17g,%.17g\n", i, points[i].x, points[i].y);
    text += line;
  }
  write_text(path, text);
}

std::vector<uint32_t> read_indices(const std::string& path, size_t count, const char* of) {
  std::vector<uint32_t> indices;
  auto file = open_text(path);
  size_t columns = 0;
  const std::vector<double> table = read_table_csv(file, path, columns);
  for (size_t i = 0; i < table.size(); i += columns) {
    const double v = table[i];
    if (!(v >= 0 && v < static_cast<double>(count)) || v != static_cast<double>(static_cast<uint32_t>(v)))
      fail_argument(path + ": index " + std::to_string(v) + " is of none of " + std::to_string(count) + " " + of);
    indices.push_back(static_cast<uint32_t>(v));
  }
  return indices;
}

void add_picture_option(CLI::App& command, const std::string& option, std::string& path, const std::string& what,
                        std::initializer_list<std::string_view> kinds) {
  command.add_option(option, path, what)->check([kinds = std::vector(kinds)](const std::string& given) {
    return io::wrong_picture_ending(given, kinds);
  });
}

void add_picture(CLI::App& command, std::string& path, int& size, const std::string& what) {
  add_picture_option(command, "--picture", path, what, {".svg", ".png"});
  command.add_option("--size", size, "Its size in pixels")->check(CLI::Range(50, 10000));
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void check_finite(const char* option, double value) {
  if (!std::isfinite(value)) fail_argument(std::string(option) + " is " + std::to_string(value));
}

namespace {

int run(int argc, char** argv) {
  CLI::App app{"Ball trees, sliding hulls, hitting sets and epsilon-nets for disks, face clusters on deforming meshes"};
  app.name("lumicut-geometry");
  app.require_subcommand(1);
  std::vector<std::pair<CLI::App*, Command>> commands;
  for (const auto add :
       {add_balltree, add_hitting_set, add_hull, add_independent_set, add_instance, add_net, add_recluster}) {
    Command command = add(app);
    commands.emplace_back(app.get_subcommands({}).back(), std::move(command));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // --help is an error of code 0
  }
  try {
    for (const auto& [parsed, command] : commands)
      if (*parsed) return command();
    return 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "lumicut-geometry: %s\n", e.what());
    return 1;
  }
}

}  // namespace
}  // namespace lumicut

int main(int argc, char** argv) {
  lumicut::io::open_standard_streams();
  return lumicut::io::close_standard_output("lumicut-geometry", lumicut::run(argc, argv), 1);
}
