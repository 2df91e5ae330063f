// Where and with what a benchmark ran.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "io/library.h"

namespace lumicut::tools {

// {"processor", "threads", "memory_bytes", "system", "load": of the last minute when it began}
nlohmann::ordered_json describe_machine();

// `git describe` of the tree that this command was built from; "unknown" when it was no git tree.
std::string git_description();

// The yardstick: shadow rays between a million random pairs of area-uniform surface points of a scene, through
// lumicut_accel_occluded, so that seconds of one machine can be told in those of another.
// {"call", "accel", "rays", "mray_per_second": best of five, "occluded": share}
nlohmann::ordered_json measure_yardstick(const io::Api& api, const std::string& scene, int threads);

}  // namespace lumicut::tools
