// An integrator with its parameters, and what it made of a scene: lights and trees, kept until something changes that
// they depend on.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "integrators/integrator.h"
#include "lights/camera_importance.h"
#include "render/clamp.h"
#include "render/nearby_lights.h"

namespace lumicut {

// What decides whether virtual lights are traced anew, beside the scene: all fields.
std::string tracing_key(const VplOptions& options);

// Never changes once it is made: shade reads it from many threads.
struct Prepared {
  const Scene* scene = nullptr;
  std::shared_ptr<const void> scene_owner;  // keeps the scene, where a host may release it
  uint64_t scene_version = 0;
  std::string params_key, vpls_key;                    // the parameters it was made with: all, those of light tracing
  std::string importance_key;                          // all that decides it beside the scene; empty: there is none
  uint64_t host_lights = 0;                            // which of the host's sets; 0: traced
  std::shared_ptr<const VplSet> vpls;                  // as traced, or as the host gave them
  std::shared_ptr<const LightSampler> emitters;        // of the scene; null where nothing asks for them
  std::shared_ptr<const CameraImportance> importance;  // null: lights are by power alone
  std::unique_ptr<const Clamp> clamp;                  // of `vpls`
  std::unique_ptr<const NearLights> near;              // null: the clamp takes no direct light that comes back
  std::unique_ptr<const NearbyLights> nearby;          // of `near`
  VplSet standing_off;  // `vpls`, off their surfaces and clamped: what the method shades with
  std::optional<Params> params;
  std::unique_ptr<Integrator> method;

  // All that follows from `vpls` and `params`, beside the method. Throws Error(cancelled).
  void place_lights(LightSource source, const Progress& progress);
};

struct Preparation {
  explicit Preparation(const IntegratorEntry& e) : entry(e), params(all_params(e)) {}

  // Lights and trees for the scene as it stands; nothing where that was done already. On failure what was prepared
  // before stands. `with`: other parameters than its own, those of one iteration. `frame`: of the scene's camera, where
  // lights are for that alone; empty: for points anywhere. Throws Error.
  void prepare(const Scene& scene, std::shared_ptr<const void> scene_owner, const Params& with, Progress& progress,
               Stats& into, std::optional<FrameSize> frame = {});

  const IntegratorEntry& entry;
  Params params;
  std::shared_ptr<const VplSet> host_lights;  // null: traced
  uint64_t host_lights_id = 0;                // rises with each set; 0 where there are none
  uint64_t host_lights_sets = 0;
  std::unique_ptr<Prepared> prepared;
};

}  // namespace lumicut
