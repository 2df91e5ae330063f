#include "render/preparation.h"

#include <algorithm>

#include "core/error.h"
#include "render/identity.h"

namespace lumicut {

std::string tracing_key(const VplOptions& options) {
  Identity key;
  key.add_fields(options);
  return key.text();
}

void Preparation::prepare(const Scene& scene, std::shared_ptr<const void> scene_owner, const Params& with,
                          Progress& progress, Stats& into) {
  if (host_lights != nullptr && sphere_scale(with.common()) > 0.0f &&
      std::none_of(host_lights->lights.begin(), host_lights->lights.end(),
                   [](const Vpl& v) { return v.kind == VplKind::sphere; }))
    fail_argument(
        "parameter virtual_lights: spheres are made of lights that the library traced; the host set its own, and none "
        "is a sphere");
  const std::string all = with.all_texts();
  const VplOptions options = vpl_options(with.common());
  const std::string tracing = tracing_key(options);
  const bool same_scene =
      prepared != nullptr && prepared->scene == &scene && prepared->scene_version == scene.version();
  const bool same_source = same_scene && prepared->host_lights == host_lights_id;
  if (same_source && prepared->params_key == all) {
    into.set_value("vpls", static_cast<double>(prepared->vpls->lights.size()));
    into.set_value("prepare_reused", 1);
    return;
  }
  auto next = std::make_unique<Prepared>();
  next->scene = &scene;
  next->scene_owner = std::move(scene_owner);
  next->scene_version = scene.version();
  next->params_key = all;
  next->vpls_key = tracing;
  next->host_lights = host_lights_id;
  next->params = with;
  if (host_lights != nullptr) {
    next->vpls = host_lights;
  } else if (same_source && prepared->vpls_key == tracing) {
    next->vpls = prepared->vpls;
  } else if (entry.light_source == LightSource::emitters) {
    next->vpls = std::make_shared<VplSet>();
  } else {
    const PhaseTimer timer(into, "light paths");
    next->vpls = std::make_shared<VplSet>(trace_vpls(scene, options, progress));
  }
  progress.check();
  into.set_value("vpls", static_cast<double>(next->vpls->lights.size()));
  into.set_value("light_paths", static_cast<double>(next->vpls->light_paths));
  next->method = entry.create();
  next->standing_off = off_surfaces(*next->vpls, scene);
  next->standing_off.profiles.prefer(scene.profiles());
  next->method->prepare(scene, next->standing_off, *next->params, {progress, into});
  progress.check();
  prepared = std::move(next);
}

}  // namespace lumicut
