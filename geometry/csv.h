// Points and disks as comma-separated text: "x,y" and "x,y,radius" a line. Empty lines and lines from '#' are skipped,
// and a first line that does not begin like a number (a heading).
#pragma once

#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

// Throw invalid_argument naming `name`, the line and the field on what is not a finite number.
std::vector<Point2> read_points_csv(std::istream& in, const std::string& name);
std::vector<Disk> read_disks_csv(std::istream& in, const std::string& name);
std::vector<double> read_numbers_csv(std::istream& in, const std::string& name, const std::string& field);
// Rows of as many numbers as the first one has: `columns` (0: there is none), row by row.
std::vector<double> read_table_csv(std::istream& in, const std::string& name, size_t& columns);
// Rows of any length: indices below `below`.
std::vector<std::vector<uint32_t>> read_index_rows_csv(std::istream& in, const std::string& name, size_t below);

}  // namespace lumicut
