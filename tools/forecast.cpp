#include "tools/forecast.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>

#include "io/physical_memory.h"
#include "tools/commands.h"

namespace lumicut::tools {

namespace {

constexpr double kProbeSeconds = 4;  // rendering ends when it took so long
constexpr size_t kMostSquares = 64, kLeastSquares = 6;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

double cpu_now() {
  rusage u{};
  getrusage(RUSAGE_SELF, &u);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(u.ru_utime) + seconds(u.ru_stime);
}

// Of a render, from one of one pixel that is cancelled at once: it is known when it starts.
double bytes_of_library(const io::Api& api, lumicut_scene scene, lumicut_integrator integrator,
                        const lumicut_render_desc& desc) {
  lumicut_render_desc one = desc;
  one.crop[0] = one.crop[1] = 0, one.crop[2] = one.crop[3] = 1;
  io::Handle<lumicut_render> render(api);
  io::check(api, api.render_start(integrator, scene, &one, render.out()), "render");
  api.cancel(render.get());
  api.render_wait(render.get(), LUMICUT_FOREVER, nullptr);  // done or cancelled
  const auto stats = nlohmann::json::parse(api.stats_json(render.get()));
  return stats["values"].value("estimated_bytes", 0.0) * desc.width * desc.height;
}

}  // namespace

Forecast forecast(const io::Api& api, const RenderSetup& setup, lumicut_scene scene, lumicut_integrator integrator,
                  const lumicut_render_desc& desc, double held_bytes, const std::function<void(void*)>& watch) {
  const auto guarded = [&](void* handle, const auto& call, const char* doing) {
    watch(handle);
    const lumicut_result result = call();
    watch(nullptr);
    stop_if_interrupted();
    io::check(api, result, doing);
  };
  Forecast f;
  f.pixels = static_cast<double>(desc.width) * desc.height;
  const double start = now(), cpu_start = cpu_now();
  guarded(
      integrator, [&] { return api.integrator_prepare(integrator, scene); }, "preparation");
  f.prepare_seconds = now() - start;
  const double prepare_cpu = cpu_now() - cpu_start;
  const lumicut_vpl* lights = nullptr;
  uint64_t light_count = 0;
  io::check(api, api.integrator_get_lights(integrator, &lights, &light_count), "virtual lights");
  f.vpls = static_cast<double>(light_count);

  f.passes = std::max(1u, desc.passes);
  struct Cost {
    double cpu, seconds;
  };
  const auto probe = [&](const lumicut_tile& part, uint32_t flags, const std::function<void(lumicut_render)>& look) {
    lumicut_render_desc one = desc;
    one.passes = 1, one.flags = flags;
    one.crop[0] = part.x0, one.crop[1] = part.y0, one.crop[2] = part.x1, one.crop[3] = part.y1;
    const double wall = now(), before = cpu_now();
    io::Handle<lumicut_render> render(api);
    io::check(api, api.render_start(integrator, scene, &one, render.out()), "render");
    guarded(
        render.get(), [&] { return api.render_wait(render.get(), LUMICUT_FOREVER, nullptr); }, "render");
    look(render.get());
    return Cost{cpu_now() - before, now() - wall};
  };
  // What a render takes whatever its size: trees of its own for each light group, in every pass; the name of the scene
  // in a checkpoint, once. One pixel shows it. The first is left out, which wakes threads.
  const uint32_t groups_alone = desc.flags & LUMICUT_GROUPS;
  const auto whatever_its_size = [&](uint32_t flags) {
    Cost least{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    for (int i = 0; i < 4; ++i) {
      const Cost cost = probe({sizeof(lumicut_tile), 0, 0, 1, 1}, flags, [&](lumicut_render render) {
        const uint32_t* groups = nullptr;
        uint64_t count = 0;
        io::check(api, api.render_groups(render, &groups, &count), "light groups");
        f.groups = static_cast<double>(count);
      });
      if (i > 0) least = {std::min(least.cpu, cost.cpu), std::min(least.seconds, cost.seconds)};
    }
    return least;
  };
  Cost each_pass{}, once{}, each_probe{};
  if (groups_alone != 0) each_probe = each_pass = whatever_its_size(groups_alone);
  if (desc.flags != groups_alone) {
    each_probe = whatever_its_size(desc.flags);
    once = {std::max(0.0, each_probe.cpu - each_pass.cpu), std::max(0.0, each_probe.seconds - each_pass.seconds)};
  }

  double cpu = 0, rays = 0;
  const double begun = now();
  size_t done = 0;
  // Where each square costs that, they are larger and fewer.
  const uint32_t scale = desc.flags != 0 ? 4 : 1;
  const auto part_of = [&](uint32_t side) { return (side + scale - 1) / scale; };
  for (const lumicut_tile& square : choose_squares(part_of(desc.width), part_of(desc.height), kMostSquares)) {
    if (done >= kLeastSquares / scale && now() - begun > kProbeSeconds) break;
    const lumicut_tile part = {sizeof(part), scale * square.x0, scale * square.y0,
                               std::min(scale * square.x1, desc.width), std::min(scale * square.y1, desc.height)};
    const Cost cost = probe(part, desc.flags, [&](lumicut_render render) {
      rays += nlohmann::json::parse(api.stats_json(render))["counters"].value("rays", 0.0);
    });
    cpu += std::max(0.0, cost.cpu - each_probe.cpu);
    f.probed_pixels += static_cast<double>(part.x1 - part.x0) * (part.y1 - part.y0);
    ++done;
  }
  const double threads = setup.threads > 0 ? setup.threads : std::max(1u, std::thread::hardware_concurrency());
  const double render_cpu = cpu * f.pixels / f.probed_pixels;
  f.prepare_seconds = f.passes * (f.prepare_seconds + each_pass.seconds);
  f.cpu_seconds = f.passes * (prepare_cpu + each_pass.cpu + render_cpu) + once.cpu;
  f.seconds = f.prepare_seconds + f.passes * render_cpu / threads + once.seconds;
  f.rays_per_pixel = f.passes * rays / f.probed_pixels;
  double components = 3 * f.groups;
  const bool denoise = (desc.flags & LUMICUT_DENOISE) != 0;
  for (const auto& channel : api::channels(api))
    if (denoise || !of_denoising(channel.name)) components += channel.components;
  const double state = static_cast<double>(checkpoint_pixel_bytes(api, static_cast<size_t>(f.groups), denoise));
  const double film = sizeof(float) * components, kept = (desc.flags & LUMICUT_CHECKPOINTS) != 0 ? state : 0.0;
  f.checkpoint_bytes = f.pixels * kept;
  // While it renders, what the library says of its films, means and checkpoints; then the film, the last checkpoint, the
  // copies of the film that are written, and those that the file formats make.
  f.peak_bytes = std::max(0.0, static_cast<double>(io::peak_memory()) - held_bytes) +
                 std::max(bytes_of_library(api, scene, integrator, desc), f.pixels * (kept + 3 * film));
  return f;
}

void add_shadows(Forecast& whole, const Forecast& beside) {
  ++whole.shadow_scenes;
  whole.seconds += beside.seconds, whole.prepare_seconds += beside.prepare_seconds;
  whole.cpu_seconds += beside.cpu_seconds, whole.rays_per_pixel += beside.rays_per_pixel;
  // One is rendered at a time; of those before, radiance, alpha and what is denoised stay.
  const double kept = whole.pixels * 7 * sizeof(float) * whole.shadow_scenes;
  whole.peak_bytes = std::max(whole.peak_bytes, beside.peak_bytes + kept);
}

std::string forecast_line(const Forecast& f) {
  const std::string passes = f.passes > 1 ? fmt::format("{:.0f} passes, ", f.passes) : "";
  const std::string disk =
      f.checkpoint_bytes > 0 ? fmt::format(", a checkpoint of {:.3g} MB", f.checkpoint_bytes / 1e6) : "";
  const std::string shadows =
      f.shadow_scenes > 0 ? fmt::format("with {:.0f} scenes more for shadow catchers, ", f.shadow_scenes) : "";
  return fmt::format(
      "forecast: {}{}about {:.3g} s ({:.3g} s of them for {:.0f} virtual lights and their tree), {:.3g} CPU seconds, "
      "{:.0f} shadow rays a pixel, {:.0f} MB{}; from {:.0f} of {:.0f} pixels",
      passes, shadows, f.seconds, f.prepare_seconds, f.vpls, f.cpu_seconds, f.rays_per_pixel, f.peak_bytes / 1e6, disk,
      f.probed_pixels, f.pixels);
}

nlohmann::ordered_json forecast_json(const Forecast& f) {
  return {{"seconds", f.seconds},
          {"prepare_seconds", f.prepare_seconds},
          {"cpu_seconds", f.cpu_seconds},
          {"rays_per_pixel", f.rays_per_pixel},
          {"peak_bytes", f.peak_bytes},
          {"checkpoint_bytes", f.checkpoint_bytes},
          {"passes", f.passes},
          {"shadow_scenes", f.shadow_scenes},
          {"vpls", f.vpls},
          {"probed_pixels", f.probed_pixels},
          {"pixels", f.pixels}};
}

}  // namespace lumicut::tools
