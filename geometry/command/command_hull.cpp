// lumicut-geometry hull: the convex hull of a sliding window, from a stream of insertions and deletions.
#include <charconv>
#include <cmath>
#include <cstdio>
#include <deque>
#include <iostream>
#include <memory>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/dynamic_hull.h"
#include "io/atomic_file.h"

namespace lumicut {
namespace {

struct Arguments {
  std::string stream = "-", picture;
  size_t window = 0;
  int size = 1000;
  bool check_simple = false, summary = false;
};

struct Output {
  bool summary;
  size_t hulls = 0;
  void hull(const DynamicHull& hull) {
    ++hulls;
    if (summary) {
      std::printf("%zu points, %zu hull vertices\n", hull.size(), hull.hull_size());
    } else {
      std::printf("hull of %zu points\n", hull.size());
      hull.for_each_hull_vertex([](const Point2& p) { std::printf("%.17g,%.17g\n", p.x, p.y); });
    }
    std::fflush(stdout);
  }
};

Point2 point_of(const std::string& line, const std::string& where) {
  Point2 p{};
  const char *at = line.data(), *const end = at + line.size();
  for (double* const value : {&p.x, &p.y}) {
    const char* const name = value == &p.x ? "x" : "y";
    while (at < end && (*at == ' ' || *at == '\t')) ++at;
    if (value == &p.y) {
      if (at == end || *at != ',')
        fail_argument(where + "y is missing (x,y inserts, - deletes the oldest, ? tells the hull)");
      ++at;
      while (at < end && (*at == ' ' || *at == '\t')) ++at;
    }
    const auto r = std::from_chars(at, end, *value);
    if (r.ec != std::errc() || !std::isfinite(*value))
      fail_argument(where + name +
                    " is missing or not a finite number (x,y inserts, - deletes the oldest, ? tells the hull)");
    at = r.ptr;
  }
  while (at < end && (*at == ' ' || *at == '\t')) ++at;
  if (at != end) fail_argument(where + "more than x and y");
  return p;
}

std::string draw(const Arguments& a, const std::deque<Point2>& window, const DynamicHull& hull) {
  std::vector<Point2> corners;
  hull.for_each_hull_vertex([&](const Point2& p) { corners.push_back(p); });
  const std::vector<Point2> chain(window.begin(), window.end());
  return draw_circles(as_svg(a.picture), {}, {}, {}, a.size, chain, corners);
}

int run(const Arguments& a) {
  check_output(a.picture);
  io::check_distinct({a.picture}, {a.stream == "-" ? "" : a.stream});
  std::istringstream file;
  if (a.stream != "-") file = open_text(a.stream);
  std::istream& in = a.stream == "-" ? std::cin : file;
  const std::string name = a.stream == "-" ? "standard input" : a.stream;
  DynamicHull hull({.check_simple = a.check_simple});
  std::deque<Point2> window;  // of a picture
  Output output{a.summary};
  std::string line;
  size_t number = 0, inserted = 0, deleted = 0;
  bool told = false;
  while (std::getline(in, line)) {
    const std::string where = name + ", line " + std::to_string(++number) + ": ";
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    told = line == "?";
    try {
      if (told) {
        output.hull(hull);
      } else if (line == "-") {
        hull.pop_back();
        ++deleted;
      } else {
        const Point2 p = point_of(line, where);
        hull.push_front(p);
        ++inserted;
        if (!a.picture.empty()) window.push_back(p);
        if (a.window != 0 && hull.size() > a.window) hull.pop_back(), ++deleted;
      }
    } catch (const Error& e) {
      const std::string text = e.what();
      throw Error(e.code(), text.starts_with(name) ? text : where + text);
    }
  }
  if (in.bad()) fail_argument(name + ": cannot be read to its end");
  if (!told) output.hull(hull);
  while (window.size() > hull.size()) window.pop_front();
  if (!a.picture.empty()) write_text(a.picture, draw(a, window, hull));
  std::fprintf(stderr, "%zu insertions, %zu deletions, %zu hulls\n", inserted, deleted, output.hulls);
  return 0;
}

}  // namespace

Command add_hull(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand("hull",
                                     "Convex hull of a sliding window on a simple chain: reads x,y (inserts), - "
                                     "(deletes the oldest) and ? (tells the hull), a line each");
  command->add_option("stream", a->stream, "File (-: standard input, answered line by line)");
  command->add_option("--window", a->window, "Most points: older ones leave by themselves (0: no limit)")
      ->check(CLI::NonNegativeNumber);
  add_picture(*command, a->picture, a->size, "Picture of the last window and its hull, .svg or .png");
  command->add_flag("--summary", a->summary, "Numbers of points and hull vertices alone");
  command->add_flag("--check-simple", a->check_simple,
                    "Refuse a point whose segment crosses the window's chain (slow)");
  return [a] { return run(*a); };
}

}  // namespace lumicut
