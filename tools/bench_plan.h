// What `lumicut bench` shall run: docs/benchmarking.md.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/library.h"
#include "io/path_variables.h"

namespace lumicut::tools {

using Parameters = std::map<std::string, std::string>;

// Varies one parameter until a measure of the run is what it shall be: equal error, equal time.
struct BenchMatch {
  std::string measure;  // a key of a row: "rmse", "mean_relative_error", ..., "render_seconds", "total_seconds"
  std::string run;      // whose value is the target, or
  double target = 0;    // the target itself
  std::string vary;     // the parameter
  bool integer = false;
  double low = 0, high = 0, start = 0;
  bool finer_is_larger = false;  // more columns are finer, a smaller error is
  double tolerance = 0.03;       // of the target
  int steps = 10;
  bool of_time() const { return measure.find("seconds") != std::string::npos; }
};

struct BenchRun {
  std::string name, integrator;
  Parameters parameters;
  std::optional<BenchMatch> match;
};

struct BenchScene {
  std::string name, file, vpl_file, reference;  // reference: an EXR; empty: the exhaustive sum is rendered
  std::string absent;                           // why it cannot be run: an environment variable that is not set
  bool optional = false;
  std::vector<uint32_t> size;  // {width, height}; empty: the scene's
  uint32_t squares = 0;        // of the reference; 0: all of it
  double ignore_above = 0;     // 0: nothing is ignored
  std::vector<int64_t> samples, vpls, seeds;
  Parameters parameters;  // of all runs and of the reference
};

struct BenchPlan {
  std::string file, name, description, accel = "bvh", rays = "robust", baseline;
  int threads = 0, repeat = 1, amortise_views = 10;
  bool keep_images = true, yardstick = false;
  bool strict = false;  // of the command alone: warnings of scenes are errors
  std::vector<BenchScene> scenes;
  std::vector<BenchRun> runs;
  io::PathVariables variables;
};

// Reads a plan; relative paths start at its folder. Throws FileError naming file, key and value: also for integrators,
// parameters and values that the library does not take.
BenchPlan read_bench_plan(const std::string& path, const io::Api& api);
// The same of text in place of a file; relative paths start at `folder`.
BenchPlan parse_bench_plan(const std::string& text, const std::string& name, const std::string& folder,
                           const io::Api& api);

}  // namespace lumicut::tools
