// What the runs of one group are compared with: the exhaustive sum over the same virtual lights, rendered once.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/bench_plan.h"

namespace lumicut::tools {

// The runs of a plan that share scene, samples, lights and seed.
struct BenchGroup {
  const BenchPlan* plan;
  const BenchScene* scene;
  int64_t samples = 0;  // 0: the scene's
  int64_t vpls = 0;     // 0: of the scene's file
  int64_t seed = 0;

  // A name for files: "sponza.9spp.200000vpls.seed1".
  std::string name() const;
  // Of `lumicut render`: all but the integrator with its parameters, and the outputs.
  std::vector<std::string> arguments() const;
};

// Runs `lumicut render` with the arguments; returns the statistics that it wrote. Throws FileError (exit code 3) or
// std::runtime_error with the command's own message.
using RenderStats = nlohmann::ordered_json;
RenderStats render_in_child(const std::vector<std::string>& arguments, const std::string& stats_file,
                            const std::function<void()>& waiting);

struct BenchReference {         // NOLINT(bugprone-exception-escape): nlohmann declares its moves noexcept
  nlohmann::ordered_json info;  // as in the results' "references"
  uint32_t width = 0, height = 0;
  std::vector<float> pixels;  // RGB
};

// Takes the plan's own file, or renders into `folder` unless a reference of the same lights lies there. `lights_hash`
// names the group's lights. Throws FileError.
BenchReference get_reference(const BenchGroup& group, const std::string& folder, const std::string& lights_hash,
                             const std::function<void(const std::string&)>& say, const std::function<void()>& waiting);

// Of a file, 64 bits as hexadecimal digits. [FNV-1a]
std::string file_hash(const std::string& path);

// Text without what file names should not have.
std::string file_name_of(const std::string& text);

}  // namespace lumicut::tools
