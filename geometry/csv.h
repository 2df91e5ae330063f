// Points and disks as comma-separated text: "x,y" and "x,y,radius" a line. Empty lines and lines from '#' are skipped,
// and a first line that does not begin like a number (a heading).
#pragma once

#include <cstdint>
#include <iosfwd>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

inline constexpr double kAnyNumber = std::numeric_limits<double>::max();

// Throw invalid_argument naming `name`, the line and the field on what is not a finite number or beyond `most`, and on
// radii below 0.
std::vector<Point2> read_points_csv(std::istream& in, const std::string& name, double most = kAnyNumber);
std::vector<Disk> read_disks_csv(std::istream& in, const std::string& name, double most = kAnyNumber);
// One a line, from 0 to `most`.
std::vector<double> read_weights_csv(std::istream& in, const std::string& name, double most = kAnyNumber);
// Rows of as many numbers as the first one has: `columns` (0: there is none), row by row. `radii`: the last number of a
// row is not below 0.
std::vector<double> read_table_csv(std::istream& in, const std::string& name, size_t& columns, double most = kAnyNumber,
                                   bool radii = false);
// The first number of each row: indices below `below`; `of` names what they count.
std::vector<uint32_t> read_indices_csv(std::istream& in, const std::string& name, size_t below, const std::string& of);
// Rows of any length: indices below `below`.
std::vector<std::vector<uint32_t>> read_index_rows_csv(std::istream& in, const std::string& name, size_t below);

}  // namespace lumicut
