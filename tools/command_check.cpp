// lumicut check: what a scene holds, what is approximated or looks wrong in it, and what rendering it will cost.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "io/json_reader.h"
#include "io/library.h"
#include "io/scene_upload.h"
#include "tools/commands.h"
#include "tools/forecast.h"
#include "tools/interrupt_watcher.h"
#include "tools/preflight.h"
#include "tools/progress_bar.h"
#include "tools/render_setup.h"
#include "tools/shadow_catcher.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options : FrameSetup {
  std::string scene, size, checkpoint;
  bool groups = false, json = false, no_forecast = false, quiet = false;
};

double bytes_of(const io::SceneData& data) {
  double bytes = 0;
  for (const auto& t : data.textures) bytes += static_cast<double>(t.bytes.size() + 4 * t.floats.size());
  for (const auto& m : data.meshes)
    bytes += 4.0 * static_cast<double>(m.positions.size() + m.normals.size() + m.uvs.size() + m.indices.size() +
                                       m.materials.size() + m.transforms.size());
  return bytes;
}

void check_scene(Options o) {
  const io::Library library;
  const io::Api& api = library.api();
  apply_preset(api, o, false);
  const bool denoised = o.denoise.value_or(false);
  ProgressBar bar(o.quiet || o.json);
  io::Handle<lumicut_device> device(api);
  io::Handle<lumicut_scene> scene(api);
  io::Handle<lumicut_integrator> integrator(api);
  InterruptWatcher watcher(api);  // ends before the handles that it may cancel
  create_device(api, o, device);
  create_scene(api, o, device.get(), scene);
  create_integrator(api, o, device.get(), integrator);
  check_groups(api, o, o.groups);
  const auto size = o.size.empty() ? std::vector<uint32_t>{} : image_size(o.size);

  bar.show("reading files", 0, 0);
  const io::SceneData data = read_scene_file(o.scene);
  stop_if_interrupted();
  if (o.groups && has_catchers(data)) throw UsageError("--groups: not with shadow catchers: " + o.scene);
  io::upload_scene(api, scene.get(), data);
  lumicut_render_desc desc{};
  desc.struct_size = sizeof(desc);
  desc.width = size.empty() ? data.width : size[0];
  desc.height = size.empty() ? data.height : size[1];
  desc.samples = o.samples > 0 ? o.samples : data.samples;
  desc.filter = data.filter, desc.filter_width = data.filter_width;
  desc.passes = o.passes.value_or(1);
  if (o.groups) desc.flags |= LUMICUT_GROUPS;
  if (denoised) desc.flags |= LUMICUT_DENOISE;
  if (!o.checkpoint.empty()) {
    desc.flags |= LUMICUT_CHECKPOINTS;
    check_room_for_checkpoint(api, o.checkpoint, uint64_t{desc.width} * desc.height,
                              o.groups ? data.light_groups().size() : 0, denoised);
  }
  bar.show("acceleration structure", 0, 0);
  commit_scene(api, watcher, scene.get(), o.scene);
  // Before the examination, whose own memory is not the render's.
  std::optional<Forecast> cost;
  if (!o.no_forecast) {
    bar.show("probe", 0, 0);
    cost = forecast(api, o, scene.get(), integrator.get(), desc, bytes_of(data), [&](void* h) { watcher.watch(h); });
  }
  // Shadow catchers need as many passes of other scenes, which are all held.
  std::vector<io::Handle<lumicut_scene>> beside;
  if (cost && has_catchers(data)) {
    lumicut_render_desc of_beside = desc;
    of_beside.flags &= LUMICUT_DENOISE;
    for_each_beside(data, [&](const io::SceneData& other) {
      beside.emplace_back(api);
      create_scene(api, o, device.get(), beside.back());
      io::upload_scene(api, beside.back().get(), other);
    });
    for (const auto& other : beside) {
      bar.show("probe of shadows", 0, 0);
      commit_scene(api, watcher, other.get(), o.scene);
      io::Handle<lumicut_integrator> of_other(api);
      create_integrator(api, o, device.get(), of_other);
      add_shadows(*cost, forecast(api, o, other.get(), of_other.get(), of_beside, bytes_of(data),
                                  [&](void* h) { watcher.watch(h); }));
    }
  }
  bar.show("examination", 0, 0);
  const NothingToLose examining;
  const Preflight found =
      preflight(api, device.get(), data, preflight_options(api, integrator.get(), desc.width, desc.height));
  stop_if_interrupted();
  bar.wipe();
  if (o.json) {
    ordered_json all = {{"scene", o.scene}, {"version", api.version(nullptr, nullptr)}};
    all.update(preflight_json(found));
    all["forecast"] = nullptr;
    if (cost) {
      all["forecast"] = forecast_json(*cost);
      all["forecast"]["integrator"] = o.integrator, all["forecast"]["width"] = desc.width;
      all["forecast"]["height"] = desc.height, all["forecast"]["samples"] = desc.samples;
    }
    fmt::print("{}\n", io::json_text(all, 2));
  } else {
    fmt::print("{}\n", o.scene);
    for (const auto& line : preflight_lines(found)) fmt::print("  {}\n", line);
    if (cost)
      fmt::print("  {}x{}, {} samples, {}: {}\n", desc.width, desc.height, desc.samples, o.integrator,
                 forecast_line(*cost));
    if (found.suspicious.empty()) fmt::print("  nothing {}suspicious\n", found.approximated.empty() ? "" : "else ");
  }
  if (o.strict && !(found.suspicious.empty() && found.approximated.empty())) throw SilentExit(kFailed);
}

}  // namespace

void add_check(CLI::App& app) {
  auto* command =
      app.add_subcommand("check", "What a scene holds, what looks wrong in it, what rendering it will cost");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, kSceneHelp)->required();
  add_frame_options(*command, *o);
  command->add_option("--size", o->size, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--passes", o->passes, "Passes that are averaged")->check(CLI::Range(1u, 1u << 30));
  command->add_option("--checkpoint", o->checkpoint,
                      "File that `render` will keep its passes in: is there room for it?");
  command->add_flag("--groups", o->groups, "One image for each light group too");
  command->add_flag("--no-forecast", o->no_forecast, "Render nothing: no forecast of time and memory");
  command->add_flag("--json", o->json, "Print JSON instead of text");
  command->add_flag("-q,--quiet", o->quiet, "No progress bar");
  command->callback([o] {
    catch_interrupts();
    check_scene(*o);
  });
}

}  // namespace lumicut::tools
