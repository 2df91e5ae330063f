#include "render/render_loop.h"

#include <algorithm>
#include <chrono>

#include "core/current_work.h"
#include "film/denoise.h"
#include "render/checkpoint.h"
#include "render/compensation_rays.h"
#include "render/limited_lights.h"
#include "render/traced_gloss.h"

namespace lumicut {

RenderLoop::RenderLoop(Preparation& preparation, const Scene& scene, std::shared_ptr<const void> scene_owner,
                       const FrameOptions& options, IterationOptions iterations, std::vector<uint32_t> groups)
    : preparation_(preparation),
      scene_(scene),
      scene_owner_(std::move(scene_owner)),
      options_(options),
      iterations_(std::move(iterations)),
      progressive_(iterations_.progressive()),
      film_(options.crop, std::move(groups), options.denoise) {}

RenderLoop::State RenderLoop::state() const {
  const std::lock_guard lock(state_mutex_);
  return state_;
}

FrameOptions RenderLoop::frame_options(const Prepared& prepared) const {
  FrameOptions frame = options_;
  frame.seed = prepared.params->common().seed;
  return frame;
}

FrameLight RenderLoop::frame_light(const Prepared& prepared) const {
  FrameLight light;
  light.nearby = prepared.nearby.get();
  if (prepared.params->common().compensate && preparation_.entry.light_source == LightSource::virtual_lights)
    light.compensated = prepared.clamp.get();
  light.trace_gloss = light.compensated != nullptr && prepared.params->common().trace_gloss &&
                      prepared.vpls->light_paths > 0 && may_trace_gloss(scene_);
  if (light.trace_gloss && sky_ && prepared.vpls->of_sky > 0) light.sky = &*sky_;
  light.spheres = sphere_scale(prepared.params->common()) > 0.0f;
  return light;
}

std::vector<GroupMethod> RenderLoop::methods(const Prepared& prepared, std::vector<OfGroup>& of_groups,
                                             Progress& progress, Stats& stats) const {
  const FrameLight rays = frame_light(prepared);
  const bool by_group = !film_.groups().empty(), trace_gloss = rays.trace_gloss;
  const std::vector<uint32_t> all_light{0}, &groups = by_group ? film_.groups() : all_light;
  const bool direct = options_.direct && prepared.vpls->light_paths > 0, as_prepared = !by_group && !direct;
  if (as_prepared && !trace_gloss) return {{0, prepared.method.get()}};
  of_groups.clear();
  of_groups.resize(groups.size());
  const VplSet& set = prepared.standing_off;
  for (OfGroup& of : of_groups)
    of.lights.profiles = of.traced_lights.profiles = of.other_lights.profiles = set.profiles;
  const auto traced = [&](size_t i) {
    if (i >= set.direct) return true;
    return rays.sky != nullptr && i - set.first_of_sky < set.of_sky && rays.sky->has(-set.lights[i].normal);
  };
  for (size_t i = 0; i < (direct ? set.direct : set.lights.size()); ++i) {
    auto at = groups.begin();
    if (by_group) at = std::lower_bound(groups.begin(), groups.end(), set.lights[i].group);
    if (at == groups.end() || (by_group && *at != set.lights[i].group)) continue;
    OfGroup& of = of_groups[static_cast<size_t>(at - groups.begin())];
    if (!as_prepared) of.lights.lights.push_back(set.lights[i]);
    if (trace_gloss) (traced(i) ? of.traced_lights : of.other_lights).lights.push_back(set.lights[i]);
  }
  const auto prepare = [&](const VplSet& lights, std::unique_ptr<Integrator>& method) {
    progress.check();
    if (lights.lights.empty()) return;
    method = create_method(preparation_.entry, lights);
    method->prepare(scene_, lights, *prepared.params, {progress, stats});
  };
  std::vector<GroupMethod> all;
  for (size_t g = 0; g < of_groups.size(); ++g) {
    OfGroup& of = of_groups[g];
    if (!as_prepared) prepare(of.lights, of.method);
    prepare(of.traced_lights, of.traced);
    if (of.traced) prepare(of.other_lights, of.others);
    all.push_back({groups[g], as_prepared ? prepared.method.get() : of.method.get(), of.traced.get(), of.others.get()});
  }
  return all;
}

// Paths that end where they meet what emits, where direct light alone is asked for.
Params RenderLoop::as_wanted(Params params) const {
  if (options_.direct && preparation_.entry.light_source == LightSource::emitters) params.set("max_depth", "0");
  return params;
}

void RenderLoop::run(Progress& progress, Stats& stats, const std::function<void(const Rect&)>& tile_done) {
  const CurrentWork current(&progress);
  progress.check();
  if (preparation_.params.common().trace_gloss && !scene_.environment().black()) sky_.emplace(scene_);
  if (progressive_) return render_iterations(progress, stats, tile_done);
  preparation_.prepare(scene_, scene_owner_, as_wanted(preparation_.params), progress, stats, whole_frame());
  const Prepared& prepared = *preparation_.prepared;
  {
    const PhaseTimer timer(stats, "render");
    std::vector<OfGroup> of_groups;
    render_frame(scene_, methods(prepared, of_groups, progress, stats), frame_options(prepared), frame_light(prepared),
                 film_, {progress, stats}, tile_done);
  }
  progress.check();
  const std::lock_guard lock(state_mutex_);
  state_.iterations = 1;
}

void RenderLoop::render_iterations(Progress& progress, Stats& stats,
                                   const std::function<void(const Rect&)>& tile_done) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  IterationMean mean(options_.crop, iterations_.confidence, options_.denoise);
  const std::string key = checkpoint_key(scene_, preparation_.entry.id, preparation_.params,
                                         preparation_.host_lights.get(), options_, iterations_);
  uint32_t done = 0;
  double error = std::numeric_limits<double>::infinity(), last_seconds = 0.0;
  const auto finish_iteration = [&] {
    {
      const std::lock_guard lock(film_mutex_);
      mean.write_error(done, film_);
    }
    error = mean.error(film_, done);
    stats.set_value("passes", done);
    if (done >= 2) stats.set_value("error", error);
    std::shared_ptr<const std::vector<uint8_t>> bytes;
    if (iterations_.checkpoints)
      bytes = std::make_shared<const std::vector<uint8_t>>(save_checkpoint(key, done, mean, film_));
    const std::lock_guard lock(state_mutex_);
    state_ = {done, error, std::move(bytes)};
  };
  const auto prepare = [&](uint32_t iteration) {
    preparation_.prepare(scene_, scene_owner_, as_wanted(params_of_iteration(preparation_.params, iteration, scene_)),
                         progress, stats, whole_frame());
  };
  if (!iterations_.resume.empty()) {
    done = load_checkpoint(iterations_.resume, key, mean, film_);
    iterations_.resume = std::vector<uint8_t>();  // frees it, which "= {}" does not
    finish_iteration();
    for (const Rect& tile : frame_tiles(options_)) tile_done(tile);
  }
  const auto denoise_film = [&] {
    if (!options_.denoise) return;
    const PhaseTimer timer(stats, "denoising");
    progress.begin("denoising", 1);
    const std::lock_guard lock(film_mutex_);
    denoise({done, iterations_.confidence, iterations_.keep_fireflies}, mean.residuals(), progress, film_);
  };
  const auto enough = [&] { return done > 0 && enough_iterations(iterations_, done, seconds(), last_seconds, error); };
  if (enough()) {
    // All was in the checkpoint. The integrator has the lights of the last iteration, as after any render.
    prepare(done - 1);
    denoise_film();
    return;
  }
  auto frame_film = std::make_unique<Film>(options_.crop, film_.groups(), options_.denoise);
  std::vector<OfGroup> of_groups;
  do {
    const double start = seconds();
    prepare(done);
    const Prepared& prepared = *preparation_.prepared;
    FrameOptions frame = frame_options(prepared);
    frame.camera_samples = {preparation_.params.common().seed, uint64_t{done} * frame.samples};
    FrameLight light = frame_light(prepared);
    std::vector<uint8_t> rays;
    std::optional<GlintGuide> glints;
    if (light.compensated != nullptr) {
      light.rays = rays = compensation_rays(mean, film_, done, progress);
      if (!prepared.vpls->glints.empty()) light.glints = &glints.emplace(prepared.vpls->glints, &progress);
    }
    {
      const PhaseTimer timer(stats, "render");
      render_frame(scene_, methods(prepared, of_groups, progress, stats), frame, light, *frame_film, {progress, stats},
                   [&](const Rect& tile) {
                     {
                       const std::lock_guard lock(film_mutex_);
                       mean.add(*frame_film, tile, uint64_t{done} + 1, film_);
                     }
                     tile_done(tile);
                   });
    }
    progress.check();
    ++done;
    last_seconds = seconds() - start;
    finish_iteration();
  } while (!enough());
  frame_film.reset();
  denoise_film();
}

}  // namespace lumicut
