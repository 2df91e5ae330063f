#include "geometry/csv.h"

#include <charconv>
#include <cmath>
#include <istream>

#include "core/error.h"

namespace lumicut {
namespace {

template <size_t N, typename Fn>
void read_rows(std::istream& in, const std::string& name, const char* const (&fields)[N], Fn&& row) {
  std::string line;
  for (size_t number = 1, rows = 0; std::getline(in, line); ++number) {
    const char *at = line.data(), *end = at + line.size();
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) at += 3;  // byte-order mark
    const auto skip = [&] {
      while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    };
    skip();
    if (at == end || *at == '#') continue;
    double values[N];
    const auto bad = [&](size_t k, const std::string& what) {
      fail_argument(name + ", line " + std::to_string(number) + ": " + fields[k] + " " + what);
    };
    bool heading = false;
    for (size_t k = 0; k < N; ++k) {
      skip();
      if (at < end && *at == '+') ++at;
      const auto r = std::from_chars(at, end, values[k]);
      if (r.ec == std::errc::result_out_of_range) bad(k, "is " + std::string(at, r.ptr) + ", out of range");
      if (r.ec != std::errc()) {
        if (rows == 0 && k == 0) {
          heading = true;
          break;
        }
        bad(k, "is missing or not a number");
      }
      if (!std::isfinite(values[k])) bad(k, "is " + std::string(at, r.ptr) + ", not a finite number");
      at = r.ptr;
      skip();
      if (k + 1 < N) {
        if (at == end || *at != ',') bad(k + 1, "is missing");
        ++at;
      }
    }
    ++rows;
    if (heading) continue;
    if (at != end)
      fail_argument(name + ", line " + std::to_string(number) + ": more than " + std::to_string(N) + " fields");
    row(values);
  }
}

}  // namespace

std::vector<Point2> read_points_csv(std::istream& in, const std::string& name) {
  std::vector<Point2> points;
  read_rows(in, name, {"x", "y"}, [&](const double* v) { points.push_back({v[0], v[1]}); });
  return points;
}

std::vector<Disk> read_disks_csv(std::istream& in, const std::string& name) {
  std::vector<Disk> disks;
  read_rows(in, name, {"x", "y", "radius"}, [&](const double* v) { disks.push_back({{v[0], v[1]}, v[2]}); });
  return disks;
}

}  // namespace lumicut
