// What a scene holds and what in it looks wrong, said before anything is rendered: `lumicut check`, and `lumicut
// render` at high verbosity.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/library.h"
#include "io/scene_data.h"

namespace lumicut::tools {

// Something that is legal and seldom meant. Kinds are listed in docs/command_line.md.
struct Suspicion {
  std::string kind, text;
};

struct Preflight {                       // NOLINT(bugprone-exception-escape): nlohmann declares its moves noexcept
  nlohmann::ordered_json counts, power;  // power: W of luminance
  double radius = 1;                     // half the diagonal of the scene's bounds
  double clamp = 0;                      // no light is taken to be nearer
  std::vector<std::string> approximated;
  std::vector<Suspicion> suspicious;
};

struct PreflightOptions {
  uint32_t width = 0, height = 0;  // of the image
  double clamp_distance = 0, clamp_relative = 0;
};

// The integrator's clamp.
PreflightOptions preflight_options(const io::Api& api, lumicut_integrator integrator, uint32_t width, uint32_t height);

// Traces rays through the library's tracer; up to 2^25 triangles.
Preflight preflight(const io::Api& api, lumicut_device device, const io::SceneData& scene,
                    const PreflightOptions& options);

// Lines of text, without the forecast.
std::vector<std::string> preflight_lines(const Preflight& p);
nlohmann::ordered_json preflight_json(const Preflight& p);

}  // namespace lumicut::tools
