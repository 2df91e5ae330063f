#include "geometry/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <istream>

#include "core/error.h"
#include "core/short_text.h"

namespace lumicut {
namespace {

// `fields`: names of the columns; none: as many as the first row of numbers has.
// row(values, bad): bad(field, what) throws.
template <typename Fn>
void read_rows(std::istream& in, const std::string& name, std::vector<std::string> fields, double most, Fn&& row) {
  std::string line;
  std::vector<double> values(fields.size());
  for (size_t number = 1, rows = 0; std::getline(in, line); ++number) {
    const char *at = line.data(), *end = at + line.size();
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) at += 3;  // byte-order mark
    const auto skip = [&] {
      while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    };
    skip();
    if (at == end || *at == '#') continue;
    const auto bad = [&](size_t k, const std::string& what) {
      fail_argument(name + ", line " + std::to_string(number) + ": " + fields[k] + " " + what);
    };
    const auto is_number = [&] {
      double first;
      const auto r = std::from_chars(*at == '+' ? at + 1 : at, end, first);
      return r.ec != std::errc::invalid_argument;
    };
    if (rows++ == 0 && !is_number()) continue;  // a heading
    if (fields.empty()) {
      const auto columns = static_cast<size_t>(std::count(at, end, ',') + 1);
      for (size_t k = 0; k < columns; ++k) fields.push_back("column " + std::to_string(k + 1));
      values.resize(columns);
    }
    for (size_t k = 0; k < fields.size(); ++k) {
      skip();
      if (at < end && *at == '+') ++at;
      const auto r = std::from_chars(at, end, values[k]);
      if (r.ec == std::errc::result_out_of_range) bad(k, "is " + std::string(at, r.ptr) + ", out of range");
      if (r.ec != std::errc()) bad(k, "is missing or not a number");
      if (!std::isfinite(values[k])) bad(k, "is " + std::string(at, r.ptr) + ", not a finite number");
      if (std::fabs(values[k]) > most) bad(k, "is " + std::string(at, r.ptr) + ", beyond " + short_text(most));
      at = r.ptr;
      skip();
      if (k + 1 < fields.size()) {
        if (at == end || *at != ',') bad(k + 1, "is missing");
        ++at;
      }
    }
    if (at != end)
      fail_argument(name + ", line " + std::to_string(number) + ": more than " + std::to_string(fields.size()) +
                    " fields");
    row(values, bad);
  }
}

void check_not_negative(double value, size_t field, const auto& bad) {
  if (value < 0) bad(field, "is " + short_text(value) + ", below 0");
}

}  // namespace

std::vector<Point2> read_points_csv(std::istream& in, const std::string& name, double most) {
  std::vector<Point2> points;
  read_rows(in, name, {"x", "y"}, most, [&](const std::vector<double>& v, const auto&) {
    points.push_back({v[0], v[1]});
  });
  return points;
}

std::vector<Disk> read_disks_csv(std::istream& in, const std::string& name, double most) {
  std::vector<Disk> disks;
  read_rows(in, name, {"x", "y", "radius"}, most, [&](const std::vector<double>& v, const auto& bad) {
    check_not_negative(v[2], 2, bad);
    disks.push_back({{v[0], v[1]}, v[2]});
  });
  return disks;
}

std::vector<double> read_weights_csv(std::istream& in, const std::string& name, double most) {
  std::vector<double> weights;
  read_rows(in, name, {"weight"}, most, [&](const std::vector<double>& v, const auto& bad) {
    check_not_negative(v[0], 0, bad);
    weights.push_back(v[0]);
  });
  return weights;
}

std::vector<double> read_table_csv(std::istream& in, const std::string& name, size_t& columns, double most,
                                   bool radii) {
  std::vector<double> table;
  columns = 0;
  read_rows(in, name, {}, most, [&](const std::vector<double>& v, const auto& bad) {
    columns = v.size();
    if (radii) check_not_negative(v.back(), columns - 1, bad);
    table.insert(table.end(), v.begin(), v.end());
  });
  return table;
}

std::vector<uint32_t> read_indices_csv(std::istream& in, const std::string& name, size_t below, const std::string& of) {
  std::vector<uint32_t> indices;
  read_rows(in, name, {}, kAnyNumber, [&](const std::vector<double>& v, const auto& bad) {
    if (!(v[0] >= 0 && v[0] < static_cast<double>(below)) || v[0] != std::floor(v[0]))
      bad(0, "is " + short_text(v[0]) + ", which is none of " + std::to_string(below) + " " + of);
    indices.push_back(static_cast<uint32_t>(v[0]));
  });
  return indices;
}

std::vector<std::vector<uint32_t>> read_index_rows_csv(std::istream& in, const std::string& name, size_t below) {
  std::vector<std::vector<uint32_t>> rows;
  std::string line;
  for (size_t number = 1; std::getline(in, line); ++number) {
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    const char *at = line.data(), *const end = at + line.size();
    const auto skip = [&] {
      while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    };
    skip();
    if (at == end || *at == '#') continue;
    std::vector<uint32_t> row;
    while (true) {
      skip();
      uint32_t index = 0;
      const auto r = std::from_chars(at, end, index);
      if (r.ec != std::errc() || index >= below)
        fail_argument(name + ", line " + std::to_string(number) + ": field " + std::to_string(row.size() + 1) +
                      " is no index below " + std::to_string(below));
      row.push_back(index);
      at = r.ptr;
      skip();
      if (at == end) break;
      if (*at++ != ',')
        fail_argument(name + ", line " + std::to_string(number) + ": a comma is wanted after field " +
                      std::to_string(row.size()));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace lumicut
