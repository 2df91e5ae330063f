// Points and disks of the geometry command.
#include "geometry/csv.h"

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
  return 0;
}
