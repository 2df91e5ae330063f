#include "render/preparation.h"

#include <algorithm>

#include "core/error.h"
#include "lights/trace_vpls.h"

namespace lumicut {

namespace {

VplOptions vpl_options(const Params& params) {
  VplOptions o;
  o.count = static_cast<uint32_t>(params.integer("vpls"));
  o.direct_share = static_cast<float>(params.real("direct_share"));
  o.environment_count = static_cast<uint32_t>(params.integer("environment_vpls"));
  o.max_depth = static_cast<uint32_t>(params.integer("max_depth"));
  o.seed = static_cast<uint64_t>(params.integer("seed"));
  o.sphere_scale = sphere_scale(params);
  return o;
}

}  // namespace

std::string params_text(const Params& params) {
  std::string out;
  for (const ParamInfo& p : params.table()) out += std::string(p.id) + "=" + *params.text(p.id) + "\n";
  return out;
}

std::string tracing_key(const Params& params) {
  std::string out;
  for (const char* name :
       {"vpls", "direct_share", "environment_vpls", "max_depth", "seed", "virtual_lights", "sphere_scale"})
    out += std::string(name) + "=" + *params.text(name) + "\n";
  return out;
}

void Preparation::prepare(const Scene& scene, std::shared_ptr<const void> scene_owner, const Params& with,
                          Progress& progress, Stats& into) {
  if (host_lights != nullptr && sphere_scale(with) > 0.0f &&
      std::none_of(host_lights->lights.begin(), host_lights->lights.end(),
                   [](const Vpl& v) { return v.kind == VplKind::sphere; }))
    fail_argument(
        "parameter virtual_lights: spheres are made of lights that the library traced; the host set its own, and none "
        "is a sphere");
  const std::string all = params_text(with);
  const std::string tracing = tracing_key(with);
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
    next->vpls = std::make_shared<VplSet>(trace_vpls(scene, vpl_options(with), progress));
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
