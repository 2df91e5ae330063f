#include "tools/forecast.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <thread>

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

double peak_now() {
  rusage u{};
  getrusage(RUSAGE_SELF, &u);
  return static_cast<double>(u.ru_maxrss) * 1024;
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

  double cpu = 0, rays = 0;
  const double begun = now();
  size_t done = 0;
  for (const lumicut_tile& square : choose_squares(desc.width, desc.height, kMostSquares)) {
    if (done >= kLeastSquares && now() - begun > kProbeSeconds) break;
    lumicut_render_desc part = desc;
    part.crop[0] = square.x0, part.crop[1] = square.y0, part.crop[2] = square.x1, part.crop[3] = square.y1;
    const double before = cpu_now();
    io::Handle<lumicut_render> render(api);
    io::check(api, api.render_start(integrator, scene, &part, render.out()), "render");
    guarded(
        render.get(), [&] { return api.render_wait(render.get(), LUMICUT_FOREVER, nullptr); }, "render");
    cpu += cpu_now() - before;
    const auto stats = nlohmann::json::parse(api.stats_json(render.get()));
    rays += stats["counters"].value("rays", 0.0);
    f.probed_pixels += static_cast<double>(square.x1 - square.x0) * (square.y1 - square.y0);
    ++done;
  }
  const double threads = setup.threads > 0 ? setup.threads : std::max(1u, std::thread::hardware_concurrency());
  const double render_cpu = cpu * f.pixels / f.probed_pixels;
  f.cpu_seconds = prepare_cpu + render_cpu;
  f.seconds = f.prepare_seconds + render_cpu / threads;
  f.rays_per_pixel = rays / f.probed_pixels;
  double components = 0;
  for (const auto& channel : api::channels(api)) components += channel.components;
  // The film, the copies of it that are written, and those that the file formats make.
  f.peak_bytes = std::max(0.0, peak_now() - held_bytes) + 3 * sizeof(float) * components * f.pixels;
  return f;
}

std::string forecast_line(const Forecast& f) {
  return fmt::format(
      "forecast: about {:.3g} s ({:.3g} s of them for {:.0f} virtual lights and their tree), {:.3g} CPU seconds, "
      "{:.0f} "
      "shadow rays a pixel, {:.0f} MB; from {:.0f} of {:.0f} pixels",
      f.seconds, f.prepare_seconds, f.vpls, f.cpu_seconds, f.rays_per_pixel, f.peak_bytes / 1e6, f.probed_pixels,
      f.pixels);
}

nlohmann::ordered_json forecast_json(const Forecast& f) {
  return {{"seconds", f.seconds},
          {"prepare_seconds", f.prepare_seconds},
          {"cpu_seconds", f.cpu_seconds},
          {"rays_per_pixel", f.rays_per_pixel},
          {"peak_bytes", f.peak_bytes},
          {"vpls", f.vpls},
          {"probed_pixels", f.probed_pixels},
          {"pixels", f.pixels}};
}

}  // namespace lumicut::tools
