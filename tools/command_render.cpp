// lumicut render: a scene file to an image, through the C ABI alone.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "film/metrics.h"
#include "io/atomic_file.h"
#include "io/image_file.h"
#include "io/library.h"
#include "io/scene_json.h"
#include "io/scene_upload.h"
#include "io/vpl_file.h"
#include "tools/commands.h"
#include "tools/progress_bar.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options {
  std::string scene, integrator = "lightcuts", output, png, stats, vpl_in, vpl_out, size, crop, layers,
                     accel = "embree";
  std::vector<std::string> parameters;
  uint32_t samples = 0;
  int threads = 0, verbosity = 1;
  uint64_t seed = 0, vpls = 0;
  bool has_seed = false, has_vpls = false, quiet = false, half = false;
  float exposure = 0;
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Turns Ctrl-C into lumicut_cancel of the object that works now. The handler itself may only set a flag.
class InterruptWatcher {
 public:
  explicit InterruptWatcher(const io::Api& api)
      : thread_([this, &api] {
          while (!done_) {
            if (void* handle = interrupted ? handle_.load() : nullptr) api.cancel(handle);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
          }
        }) {}
  ~InterruptWatcher() {
    done_ = true;
    thread_.join();
  }
  void watch(void* handle) { handle_ = handle; }

 private:
  std::atomic<void*> handle_{nullptr};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

// "512x384" -> {512, 384}; "a,b,c,d" with ','.
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

struct Channel {
  std::string name;
  int components;
};

// Channels to write: those asked for, or the usual ones.
std::vector<Channel> choose_channels(const io::Api& api, const std::string& asked) {
  std::vector<Channel> known;
  std::string names;
  for (uint32_t i = 0;; ++i) {
    lumicut_channel_info info{};
    info.struct_size = sizeof(info);
    if (api.get_channel_info(i, &info) != LUMICUT_OK) break;
    known.push_back({info.name, static_cast<int>(info.components)});
    names += (names.empty() ? "" : ", ") + known.back().name;
  }
  if (asked == "all") return known;
  std::vector<Channel> chosen;
  std::stringstream words(asked.empty() ? "radiance,depth,normal,albedo,cut_size" : asked);
  for (std::string word; std::getline(words, word, ',');) {
    const auto at = std::find_if(known.begin(), known.end(), [&](const Channel& c) { return c.name == word; });
    if (at == known.end()) throw UsageError(fmt::format("--layers: no layer \"{}\"; there are {}", word, names));
    chosen.push_back(*at);
  }
  return chosen;
}

void log_message(void* user, int32_t level, const char* text) {
  static_cast<ProgressBar*>(user)->wipe();
  static const char* const kNames[] = {"error", "warning", "info", "debug"};
  fmt::print(stderr, "lumicut: {}: {}\n", kNames[std::clamp(level, 0, 3)], text);
}

void set_parameter(const io::Api& api, lumicut_integrator integrator, const std::string& name,
                   const std::string& value) {
  if (api.integrator_set(integrator, name.c_str(), value.c_str()) != LUMICUT_OK) throw UsageError(api.last_error());
}

uint64_t peak_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

// What the renders says of itself, with the command's own phases and figures a pixel.
ordered_json statistics(const ordered_json& own, double pixels, double read_seconds, double commit_seconds) {
  const auto counter = [&](const char* name) {
    return own.contains("counters") ? own["counters"].value(name, 0.0) : 0.0;
  };
  ordered_json stats;
  stats["seconds"] = own.value("seconds", 0.0);
  stats["phases"] = own.value("phases", ordered_json::object());
  stats["phases"]["reading files"] = read_seconds;
  stats["phases"]["acceleration structure"] = commit_seconds;
  stats["rays_per_pixel"] = counter("rays") / pixels;
  stats["bounds_per_pixel"] = counter("bounds") / pixels;
  stats["clusters_per_pixel"] = counter("clusters") / pixels;
  stats["peak_bytes"] = std::max(own.value("peak_bytes", uint64_t{0}), peak_bytes());
  stats["counters"] = own.value("counters", ordered_json::object());
  stats["values"] = own.value("values", ordered_json::object());
  return stats;
}

class RenderCommand {
 public:
  explicit RenderCommand(const Options& options) : o_(options), bar_(options.quiet), watcher_(library_.api()) {}

  void run() {
    check_outputs();
    const auto channels = choose_channels(api(), o_.layers);
    create_device();
    create_integrator();  // a wrong parameter shall not wait for big files
    read_scene();
    commit();
    render();
    write(channels);
  }

 private:
  const io::Api& api() const { return library_.api(); }

  // Before hours of work, not after.
  void check_outputs() {
    for (const auto& path : {o_.output, o_.png, o_.stats, o_.vpl_out})
      if (!path.empty()) io::AtomicFile file(path);
    if (!o_.size.empty()) size_ = numbers(o_.size, 'x', 2, "--size");
    if (!o_.crop.empty()) crop_ = numbers(o_.crop, ',', 4, "--crop");
  }

  void create_device() {
    lumicut_device_desc desc{};
    desc.struct_size = sizeof(desc);
    desc.abi_major = LUMICUT_ABI_MAJOR;
    desc.threads = o_.threads;
    desc.verbosity = o_.verbosity;
    desc.log = log_message;
    desc.user = &bar_;
    io::check(api(), api().device_create(&desc, device_.out()), "device");
    lumicut_scene_desc scene{};
    scene.struct_size = sizeof(scene);
    scene.accel = o_.accel.c_str();
    if (api().scene_create(device_.get(), &scene, scene_.out()) != LUMICUT_OK) throw UsageError(api().last_error());
  }

  void create_integrator() {
    if (api().integrator_create(device_.get(), o_.integrator.c_str(), integrator_.out()) != LUMICUT_OK)
      throw UsageError(api().last_error());
    if (o_.has_vpls) set_parameter(api(), integrator_.get(), "vpls", std::to_string(o_.vpls));
    if (o_.has_seed) set_parameter(api(), integrator_.get(), "seed", std::to_string(o_.seed));
    for (const auto& parameter : o_.parameters) {
      const size_t equals = parameter.find('=');
      if (equals == std::string::npos || equals == 0)
        throw UsageError(fmt::format("-p {}: must be name=value", parameter));
      set_parameter(api(), integrator_.get(), parameter.substr(0, equals), parameter.substr(equals + 1));
    }
    if (o_.vpl_in.empty()) return;
    lights_ = io::read_vpls(o_.vpl_in);
    if (lights_.empty()) throw UsageError(fmt::format("--vpl-in {}: holds no light", o_.vpl_in));
  }

  void read_scene() {
    const double start = now();
    bar_.show("reading files", 0, 0);
    const io::SceneData data = io::read_scene(o_.scene);
    bar_.wipe();
    if (o_.verbosity >= 1)
      for (const auto& warning : data.warnings) fmt::print(stderr, "lumicut: warning: {}\n", warning);
    stop_if_interrupted();
    io::upload_scene(api(), scene_.get(), data);
    triangles_ = data.triangle_count();
    set_lights();
    desc_.struct_size = sizeof(desc_);
    desc_.width = size_.empty() ? data.width : size_[0];
    desc_.height = size_.empty() ? data.height : size_[1];
    desc_.samples = o_.samples > 0 ? o_.samples : data.samples;
    for (size_t i = 0; i < crop_.size(); ++i) desc_.crop[i] = crop_[i];
    if (!crop_.empty() &&
        (crop_[0] >= crop_[2] || crop_[1] >= crop_[3] || crop_[2] > desc_.width || crop_[3] > desc_.height))
      throw UsageError(fmt::format("--crop {}: is not a part of {} x {} pixels", o_.crop, desc_.width, desc_.height));
    read_seconds_ = now() - start;
  }

  void set_lights() {
    if (lights_.empty()) return;
    io::check(api(), api().integrator_set_lights(integrator_.get(), lights_.data(), lights_.size()), o_.vpl_in);
  }

  void commit() {
    const double start = now();
    bar_.show("acceleration structure", 0, 0);
    watcher_.watch(scene_.get());
    const lumicut_result result = api().scene_commit(scene_.get());
    watcher_.watch(nullptr);
    stop_if_interrupted();
    io::check(api(), result, o_.scene);
    commit_seconds_ = now() - start;
  }

  void render() {
    const lumicut_result started = api().render_start(integrator_.get(), scene_.get(), &desc_, render_.out());
    io::check(api(), started, "render");
    watcher_.watch(render_.get());
    lumicut_status status{};
    lumicut_result result;
    do {
      status.struct_size = sizeof(status);
      result = api().render_wait(render_.get(), 100, &status);
      if (result == LUMICUT_OK) bar_.show(status.phase ? status.phase : "", status.fraction, status.seconds);
    } while (result == LUMICUT_OK && (status.state == LUMICUT_RUNNING || status.state == LUMICUT_IDLE));
    watcher_.watch(nullptr);
    bar_.wipe();
    stop_if_interrupted();
    io::check(api(), result, "render");
  }

  void write(const std::vector<Channel>& channels) {
    const uint32_t x0 = desc_.crop[0], y0 = desc_.crop[1];
    const uint32_t width = crop_.empty() ? desc_.width : crop_[2] - x0,
                   height = crop_.empty() ? desc_.height : crop_[3] - y0;
    io::Image image;
    image.width = static_cast<int>(width), image.height = static_cast<int>(height);
    image.x0 = static_cast<int>(x0), image.y0 = static_cast<int>(y0);
    image.frame_width = static_cast<int>(desc_.width), image.frame_height = static_cast<int>(desc_.height);
    const auto read = [&](const Channel& channel) {
      io::ImageLayer layer{channel.name, channel.components, {}};
      layer.pixels.resize(size_t{width} * height * static_cast<size_t>(channel.components));
      io::check(api(), api().render_read(render_.get(), channel.name.c_str(), nullptr, layer.pixels.data()),
                channel.name);
      return layer;
    };
    const ordered_json own = ordered_json::parse(api().stats_json(render_.get()));
    ordered_json stats = statistics(own, double{static_cast<double>(width)} * height, read_seconds_, commit_seconds_);
    const lumicut_vpl* lights = nullptr;
    uint64_t light_count = 0;
    io::check(api(), api().integrator_get_lights(integrator_.get(), &lights, &light_count), "virtual lights");
    describe(stats, light_count);

    if (!o_.output.empty()) {
      for (const auto& channel : channels) image.layers.push_back(read(channel));
      for (const char* key : {"scene", "integrator", "version", "vpls", "seed", "samples"})
        image.attributes[key] = stats[key].is_string() ? stats[key].get<std::string>() : stats[key].dump();
      image.attributes["parameters"] = stats["parameters"].dump();
      image.attributes["seconds"] = stats["seconds"].dump();
    }
    // Computed and read: from here a stop would leave some files and not others.
    stop_if_interrupted();
    if (!o_.output.empty()) io::write_exr(o_.output, image, o_.half);
    if (!o_.png.empty()) {
      const auto radiance = read({"radiance", 3});
      const RgbImage rgb{radiance.pixels, width, height};
      io::write_png(o_.png, to_srgb8(rgb, o_.exposure > 0 ? o_.exposure : auto_exposure(rgb)), image.width,
                    image.height, 3);
    }
    if (!o_.vpl_out.empty()) io::write_vpls(o_.vpl_out, lights, light_count);
    if (!o_.stats.empty()) io::write_whole_file(o_.stats, stats.dump(2) + "\n");
    if (!o_.quiet)
      fmt::print("{}: {} lights, {}x{}, {:.2f} s, {:.0f} rays, {:.0f} bounds, {:.0f} clusters a pixel\n", o_.integrator,
                 light_count, width, height, stats["seconds"].get<double>(), stats["rays_per_pixel"].get<double>(),
                 stats["bounds_per_pixel"].get<double>(), stats["clusters_per_pixel"].get<double>());
  }

  // What was rendered and how, so that it can be rendered again.
  void describe(ordered_json& stats, uint64_t light_count) {
    stats["version"] = api().version(nullptr, nullptr);
    stats["scene"] = o_.scene;
    stats["integrator"] = o_.integrator;
    stats["vpls"] = light_count;
    stats["triangles"] = triangles_;
    stats["width"] = desc_.width, stats["height"] = desc_.height, stats["samples"] = desc_.samples;
    stats["accel"] = o_.accel;
    stats["threads"] = o_.threads;
    ordered_json parameters = ordered_json::object();
    for (uint32_t i = 0;; ++i) {
      lumicut_param_info info{};
      info.struct_size = sizeof(info);
      if (api().get_param_info(o_.integrator.c_str(), i, &info) != LUMICUT_OK) break;
      const char* value = api().integrator_get(integrator_.get(), info.id);
      parameters[info.id] = value ? value : "";
    }
    stats["seed"] = parameters.value("seed", "");
    stats["parameters"] = parameters;
  }

  const Options& o_;
  io::Library library_;
  ProgressBar bar_;
  io::Handle<lumicut_device> device_{library_.api()};
  io::Handle<lumicut_scene> scene_{library_.api()};
  io::Handle<lumicut_integrator> integrator_{library_.api()};
  io::Handle<lumicut_render> render_{library_.api()};
  InterruptWatcher watcher_;         // ends before the handles that it may cancel
  std::vector<lumicut_vpl> lights_;  // of --vpl-in
  std::vector<uint32_t> size_, crop_;
  lumicut_render_desc desc_{};
  uint64_t triangles_ = 0;
  double read_seconds_ = 0, commit_seconds_ = 0;
};

}  // namespace

void add_render(CLI::App& app) {
  auto* command = app.add_subcommand("render", "Render a scene file");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, "Scene, JSON: docs/scene_format.md")->required();
  command->add_option("-i,--integrator", o->integrator, "How to sum the lights; `lumicut info` lists them")
      ->capture_default_str();
  command->add_option("-p,--parameter", o->parameters, "name=value, as `lumicut info` lists them; may be repeated")
      ->allow_extra_args(false);
  command->add_option("-o,--output", o->output, "EXR to write");
  command->add_option("--png", o->png, "PNG to write too: exposed, cut to [0,1], sRGB");
  command
      ->add_option("--exposure", o->exposure,
                   "Factor from radiance to [0,1] for the PNG (default: 0.18 / geometric mean)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--layers", o->layers,
                      "Layers of the EXR, with commas, or `all` (default: radiance,depth,normal,albedo,cut_size)");
  command->add_flag("--half", o->half, "16 bits a number in the EXR instead of 32");
  command->add_option("--vpls", o->vpls, "Number of virtual lights; as -p vpls=N");
  command->add_option("--seed", o->seed, "Seed of all randomness; as -p seed=N");
  command->add_option("--size", o->size, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--spp", o->samples, "Samples a pixel (default: the scene's)")->check(CLI::Range(1, 65536));
  command->add_option("--crop", o->crop, "x0,y0,x1,y1: the part of the image to render, row 0 on top");
  command->add_option("--threads", o->threads, "Threads; 0: all")->capture_default_str()->check(CLI::Range(0, 4096));
  command->add_option("--accel", o->accel, "How rays are traced: embree or agglomerative")->capture_default_str();
  command->add_option("--vpl-in", o->vpl_in, "Take the virtual lights from this file");
  command->add_option("--vpl-out", o->vpl_out, "Write the virtual lights to this file");
  command->add_option("--stats", o->stats, "JSON file of seconds, counts and memory to write");
  command->add_flag("-q,--quiet", o->quiet, "No progress bar and no closing line");
  command->add_option("--verbosity", o->verbosity, "0 errors, 1 warnings, 2 information, 3 debugging")
      ->capture_default_str()
      ->check(CLI::Range(0, 3));
  command->footer(
      "Example: lumicut render bench/scenes/conference.json -i lightcuts -p error=0.02 --vpls 60000 -o out.exr --png "
      "out.png");
  command->callback([o, command] {
    o->has_seed = command->count("--seed") > 0;
    o->has_vpls = command->count("--vpls") > 0;
    if (o->output.empty() && o->png.empty() && o->stats.empty() && o->vpl_out.empty())
      throw UsageError("render: nothing to write; give -o out.exr, --png, --stats or --vpl-out");
    catch_interrupts();
    RenderCommand(*o).run();
  });
}

}  // namespace lumicut::tools
