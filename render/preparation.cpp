#include "render/preparation.h"

#include <algorithm>

#include "core/error.h"
#include "render/identity.h"
#include "render/limited_lights.h"

namespace lumicut {

std::string tracing_key(const VplOptions& options) {
  Identity key;
  key.add_fields(options);
  return key.text();
}

namespace {

// Importance depends on the camera, which the scene's version does not tell.
std::string key_of_importance(const Scene& scene, const VplOptions& options, FrameSize frame) {
  Identity key;
  key.add_fields(options);
  key.add("width", frame.width);
  key.add("height", frame.height);
  key.add("camera", scene.camera());
  return key.text();
}

}  // namespace

void Prepared::place_lights(LightSource source, const Progress& progress) {
  const CommonParams& common = params->common();
  clamp = std::make_unique<const Clamp>(*vpls, common, *scene, progress);
  standing_off = off_surfaces(*vpls, *scene);
  clamp->set_on(standing_off, progress);
  standing_off.profiles.prefer(scene->profiles());
  // One distance for all, without compensation, clamps direct light too, as in the papers.
  const double within = clamp->lights_on_emitters(vpls->extended);
  if (source != LightSource::virtual_lights || vpls->extended == 0 || !(within > 0.0 || common.compensate)) return;
  if (emitters == nullptr) emitters = std::make_shared<const LightSampler>(*scene, &progress);
  near = std::make_unique<const NearLights>(*emitters, vpls->extended, within, clamp->distance(), progress,
                                            importance != nullptr ? &importance->direct() : nullptr);
  if (!near->empty()) nearby = std::make_unique<const NearbyLights>(*scene, *near, common.seed);
}

void Preparation::prepare(const Scene& scene, std::shared_ptr<const void> scene_owner, const Params& with,
                          Progress& progress, Stats& into, std::optional<FrameSize> frame) {
  if (host_lights != nullptr && sphere_scale(with.common()) > 0.0f &&
      std::none_of(host_lights->lights.begin(), host_lights->lights.end(),
                   [](const Vpl& v) { return v.kind == VplKind::sphere; }))
    fail_argument(
        "parameter virtual_lights: spheres are made of lights that the library traced; the host set its own, and none "
        "is a sphere");
  const std::string all = with.all_texts();
  const VplOptions options = vpl_options(with.common());
  const VplOptions pilot = vpl_options(params.common());  // one for all iterations
  const bool important =
      with.common().importance && frame && host_lights == nullptr && entry.light_source == LightSource::virtual_lights;
  const std::string importance_key = important ? key_of_importance(scene, pilot, *frame) : "";
  const std::string tracing = tracing_key(options) + importance_key;
  const bool same_scene =
      prepared != nullptr && prepared->scene == &scene && prepared->scene_version == scene.version();
  const bool same_source = same_scene && prepared->host_lights == host_lights_id;
  if (same_source && prepared->params_key == all && prepared->importance_key == importance_key) {
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
  next->importance_key = importance_key;
  next->host_lights = host_lights_id;
  next->params = with;
  if (host_lights != nullptr) {
    next->vpls = host_lights;
  } else if (same_source && prepared->vpls_key == tracing) {
    next->vpls = prepared->vpls;
    next->emitters = prepared->emitters;
    next->importance = prepared->importance;
  } else if (entry.light_source == LightSource::emitters) {
    next->vpls = std::make_shared<VplSet>();
  } else {
    const PhaseTimer timer(into, "light paths");
    next->emitters = same_scene && prepared->emitters != nullptr
                         ? prepared->emitters
                         : std::make_shared<const LightSampler>(scene, &progress);
    if (important && same_scene && prepared->importance_key == importance_key) {
      next->importance = prepared->importance;
    } else if (important && !next->emitters->empty()) {
      next->importance = std::make_shared<const CameraImportance>(scene, *next->emitters, pilot, *frame, progress);
    }
    next->vpls =
        std::make_shared<VplSet>(trace_vpls(scene, *next->emitters, options, next->importance.get(), progress));
  }
  progress.check();
  into.set_value("vpls", static_cast<double>(next->vpls->lights.size()));
  into.set_value("light_paths", static_cast<double>(next->vpls->light_paths));
  next->place_lights(entry.light_source, progress);
  next->method = create_method(entry, next->standing_off);
  next->method->prepare(scene, next->standing_off, *next->params, {progress, into});
  progress.check();
  prepared = std::move(next);
}

}  // namespace lumicut
