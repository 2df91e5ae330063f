#include "tools/render_setup.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>
#include <sstream>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/picture_ending.h"
#include "io/scene_file.h"
#include "lumicut/lumicut_presets.h"
#include "tools/commands.h"
#include "tools/interrupt_watcher.h"

namespace lumicut::tools {

void add_setup_options(CLI::App& command, RenderSetup& setup) {
  command.add_option("-i,--integrator", setup.integrator, "How to sum the lights; `lumicut info` lists them")
      ->capture_default_str();
  command.add_option("-p,--parameter", setup.parameters, "name=value, as `lumicut info` lists them; may be repeated")
      ->allow_extra_args(false);
  command.add_option("--vpls", setup.vpls, "Number of virtual lights; as -p vpls=N")->check(number_in(1, 1e8));
  command.add_option("--seed", setup.seed, "Seed of all randomness; as -p seed=N")->check(number_in(0, 4294967295.0));
  command.add_option("--threads", setup.threads, "Threads; 0: all")->capture_default_str()->check(CLI::Range(0, 4096));
  command.add_option("--accel", setup.accel, "What traces rays: bvh, the library's own, or embree")
      ->capture_default_str();
  command.add_option("--builder", setup.builder, "How bvh builds its tree; docs/embree_dropin.md lists them");
  command.add_option("--rays", setup.rays, "robust: none slips between two triangles; fast: some may, in less time")
      ->check(CLI::IsMember({"robust", "fast"}))
      ->capture_default_str();
  command.add_flag("--strict", setup.strict, "Take what is only warned of in files as an error");
}

void add_frame_options(CLI::App& command, FrameSetup& setup) {
  add_setup_options(command, setup);
  command
      .add_option(
          "--preset", setup.preset,
          "draft, good, final or reference: integrator, parameters, samples, passes and denoising at once, where "
          "other options do not say otherwise (default: good, unless -i, -p or --vpls is given)")
      ->excludes("--integrator")
      ->check([](const std::string& name) { return name.empty() ? "no preset has an empty name" : std::string(); });
  command.add_option("--spp", setup.samples, "Samples a pixel in each pass (default: the preset's, else the scene's)")
      ->check(CLI::Range(1, 65536));
  // Neither: as the preset has it.
  auto* on = command.add_flag_callback(
      "--denoise", [&setup] { setup.denoise = true; },
      "Filter noise by what the passes tell of it: layers denoised, denoised_error and denoising_*; the PNG is "
      "denoised. From two passes on");
  command
      .add_flag_callback(
          "--no-denoise", [&setup] { setup.denoise = false; }, "Leave the filter out, where the preset has it")
      ->excludes(on);
}

void apply_preset(const io::Api& api, FrameSetup& setup, bool plain) {
  const auto* table = api::extension<lumicut_presets_extension>(LUMICUT_PRESETS_EXTENSION, api);
  const bool chosen = plain || !setup.integrator.empty() || !setup.parameters.empty() || setup.vpls;
  if (setup.preset.empty() && (chosen || table == nullptr)) {
    if (setup.integrator.empty()) setup.integrator = kUsualIntegrator;
    return;
  }
  if (table == nullptr) throw UsageError("--preset: this library has none");
  const std::span presets(table->presets, table->count);
  const auto found = setup.preset.empty() ? presets.begin() + table->usual
                                          : std::ranges::find(presets, setup.preset, &lumicut_preset::id);
  if (found == presets.end()) {
    std::string known;
    for (const auto& preset : presets) known += (known.empty() ? "" : ", ") + std::string(preset.id);
    throw UsageError(fmt::format("--preset {}: there are {}", setup.preset, known));
  }
  setup.integrator = found->integrator;
  std::stringstream words(found->parameters);  // what the command line says comes after them
  setup.parameters.insert(setup.parameters.begin(), std::istream_iterator<std::string>(words), {});
  if (setup.samples == 0) setup.samples = found->samples;
  if (!setup.passes && setup.seconds == 0 && setup.target_error == 0)
    setup.passes = found->passes, setup.target_error = double{found->target_error};
  if (!setup.denoise) setup.denoise = (found->flags & LUMICUT_DENOISE) != 0 && setup.passes != 1u;
}

io::SceneData read_scene_file(const std::string& path) {
  const NothingToLose reading;
  return io::read_scene_file(path);
}

void warn_of_catchers(io::SceneData& data, const std::string& command) {
  for (const io::Mesh& mesh : data.meshes)
    if (mesh.shadow_catcher)
      data.warnings.add(
          "shadow catchers", data.file,
          fmt::format("{}: a shadow catcher, which is an ordinary object to `lumicut {}`", mesh.name, command));
}

void tell_warnings(const io::Warnings& warnings, const std::string& file, bool strict) {
  for (const auto& warning : warnings.lines()) print_error("lumicut: warning: {}\n", warning);
  if (strict && !warnings.empty()) throw io::FileError(file, "has warnings, which --strict takes as errors");
}

void create_device(const io::Api& api, const RenderSetup& setup, io::Handle<lumicut_device>& device) {
  device = api::Device(api, setup.threads);
}

void commit_scene(const io::Api& api, InterruptWatcher& watcher, lumicut_scene scene, const std::string& file) {
  watcher.watch(scene);
  const lumicut_result committed = api.scene_commit(scene);
  watcher.watch(nullptr);
  stop_if_interrupted();
  io::check(api, committed, file);
}

void create_scene(const io::Api& api, const RenderSetup& setup, lumicut_device device,
                  io::Handle<lumicut_scene>& scene) {
  lumicut_scene_desc desc{};
  desc.struct_size = sizeof(desc);
  desc.accel = setup.accel.c_str();
  desc.robust = setup.rays == "robust" ? LUMICUT_ROBUST : LUMICUT_FAST;
  desc.builder = setup.builder.empty() ? nullptr : setup.builder.c_str();
  if (api.scene_create(device, &desc, scene.out()) != LUMICUT_OK) throw UsageError(api.last_error());
}

void create_integrator(const io::Api& api, const RenderSetup& setup, lumicut_device device,
                       io::Handle<lumicut_integrator>& integrator) {
  if (api.integrator_create(device, setup.integrator.c_str(), integrator.out()) != LUMICUT_OK)
    throw UsageError(api.last_error());
  const auto set = [&](const std::string& name, const std::string& value) {
    if (api.integrator_set(integrator.get(), name.c_str(), value.c_str()) != LUMICUT_OK)
      throw UsageError(api.last_error());
  };
  for (const auto& parameter : setup.parameters) {
    const size_t equals = parameter.find('=');
    if (equals == std::string::npos || equals == 0)
      throw UsageError(fmt::format("-p {}: must be name=value", parameter));
    set(parameter.substr(0, equals), parameter.substr(equals + 1));
  }
  if (setup.vpls) set("vpls", std::to_string(*setup.vpls));
  if (setup.seed) set("seed", std::to_string(*setup.seed));
}

lumicut_integrator_info integrator_info(const io::Api& api, const std::string& id) {
  for (const auto& info : api::integrators(api))
    if (id == info.id) return info;
  throw UsageError(fmt::format("the library has no integrator \"{}\"", id));
}

void check_groups(const io::Api& api, const RenderSetup& setup, bool groups) {
  if (groups && lacks(integrator_info(api, setup.integrator), LUMICUT_LIGHT_GROUPS))
    throw UsageError(fmt::format("--groups: {} cannot tell light groups apart", setup.integrator));
}

CLI::Validator number_in(double low, double high) {
  return {[low, high](std::string& text) {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
            return fmt::format("{} is no number from {:g} to {:g}", text, low, high);
          },
          fmt::format("FLOAT in [{:g} - {:g}]", low, high)};
}

CLI::Validator picture_of(std::initializer_list<std::string_view> kinds) {
  return {[kinds = std::vector(kinds)](std::string& path) { return io::wrong_picture_ending(path, kinds); }, ""};
}

std::vector<uint32_t> image_size(const std::string& text) {
  auto size = numbers(text, 'x', 2, "--size");
  for (const uint32_t side : size)
    if (side < 1 || side > 65536) throw UsageError(fmt::format("--size {}: {} is not 1 to 65536", text, side));
  return size;
}

std::vector<uint32_t> numbers(const std::string& text, char separator, size_t count, const char* option) {
  std::vector<uint32_t> result;
  size_t start = 0;
  while (start <= text.size()) {
    const size_t end = std::min(text.find(separator, start), text.size());
    const std::string word = text.substr(start, end - start);
    if (word.empty() || word.size() > 6 || word.find_first_not_of("0123456789") != std::string::npos)
      throw UsageError(fmt::format("{} {}: \"{}\" is not a whole number", option, text, word));
    result.push_back(static_cast<uint32_t>(std::stoul(word)));
    start = end + 1;
  }
  if (result.size() != count)
    throw UsageError(fmt::format("{} {}: {} numbers instead of {}", option, text, result.size(), count));
  return result;
}

bool of_denoising(const std::string& channel) { return channel.starts_with("denois") || channel == "residual"; }

uint64_t checkpoint_pixel_bytes(const io::Api& api, size_t groups, bool denoise) {
  const uint64_t kSums = denoise ? 40 + 68 : 40;  // of the mean, and of what denoising knows of the noise
  uint64_t components = 3 * groups;
  for (const auto& channel : api::channels(api))
    if (denoise || !of_denoising(channel.name)) components += channel.components;
  return kSums + sizeof(float) * components;
}

void check_room_for_checkpoint(const io::Api& api, const std::string& path, uint64_t pixels, size_t groups,
                               bool denoise) try {
  io::check_writable(path, pixels * checkpoint_pixel_bytes(api, groups, denoise));
} catch (const io::FileError& error) {
  throw io::FileError(path, fmt::format("there is no place for a checkpoint: {}", error.what()));
}

std::vector<lumicut_tile> choose_squares(uint32_t width, uint32_t height, uint32_t count) {
  constexpr uint32_t kSquare = 32;
  const uint32_t across = (width + kSquare - 1) / kSquare, down = (height + kSquare - 1) / kSquare;
  count = std::min(count, across * down);
  std::vector<bool> taken(size_t{across} * down);
  std::vector<lumicut_tile> squares;
  for (uint64_t i = 0; squares.size() < count; ++i) {
    const auto place = [&](double step, uint32_t cells) {
      const double x = 0.5 + static_cast<double>(i) * step;
      return std::min(static_cast<uint32_t>((x - std::floor(x)) * cells), cells - 1);
    };
    const uint32_t x = place(0.7548776662466927, across), y = place(0.5698402909980532, down);
    if (taken[size_t{y} * across + x]) continue;
    taken[size_t{y} * across + x] = true;
    squares.push_back({sizeof(lumicut_tile), x * kSquare, y * kSquare, std::min(width, (x + 1) * kSquare),
                       std::min(height, (y + 1) * kSquare)});
  }
  return squares;
}

}  // namespace lumicut::tools
