// Points, disks and tables of the geometry command.
#include "geometry/csv.h"

#include <cstdlib>
#include <sstream>

#include "core/error.h"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(fuzz::text_of(data, size));
  for (const bool disks : {false, true}) {
    std::istringstream in(text);
    try {
      if (disks)
        read_disks_csv(in, "disks.csv");
      else
        read_points_csv(in, "points.csv");
    } catch (const Error&) {
    }
  }
  std::istringstream in(text);
  size_t columns = 0;
  try {
    const std::vector<double> table = read_table_csv(in, "table.csv", columns);
    if (columns == 0 ? !table.empty() : table.size() % columns != 0) std::abort();
  } catch (const Error&) {
  }
  std::istringstream rows(text);
  try {
    for (const auto& row : read_index_rows_csv(rows, "ranges.csv", 1000))
      for (const uint32_t i : row)
        if (i >= 1000) std::abort();
  } catch (const Error&) {
  }
  return 0;
}
