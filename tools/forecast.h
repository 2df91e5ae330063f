// How long a render will take and how much memory: prepared at the true settings, rendered in a few squares, scaled.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "io/library.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

struct Forecast {
  double seconds = 0;  // all passes of `lumicut render`: lights, trees and image, with the threads of the device
  double prepare_seconds = 0;   // of these: lights and trees, as measured, for each pass
  double cpu_seconds = 0;       // of all threads together
  double rays_per_pixel = 0;    // shadow rays, of all passes together
  double peak_bytes = 0;        // of the whole process
  double checkpoint_bytes = 0;  // of a checkpoint's file; while it is replaced, two are on the disk
  double probed_pixels = 0, pixels = 0, vpls = 0, passes = 1, groups = 0;
  double shadow_scenes = 0;  // scenes beside the whole one that shadow catchers take, counted in
};

// `watch` is told what works now, nullptr at the end: for Ctrl-C. `held_bytes`: what the caller keeps in memory and
// `lumicut render` does not.
Forecast forecast(const io::Api& api, const RenderSetup& setup, lumicut_scene scene, lumicut_integrator integrator,
                  const lumicut_render_desc& desc, double held_bytes, const std::function<void(void*)>& watch);

// Takes in that of a scene beside the whole one.
void add_shadows(Forecast& whole, const Forecast& beside);

std::string forecast_line(const Forecast& f);
nlohmann::ordered_json forecast_json(const Forecast& f);

}  // namespace lumicut::tools
