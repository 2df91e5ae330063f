// lumicut render: a scene file to an image, through the C ABI alone.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "io/library.h"
#include "io/physical_memory.h"
#include "io/scene_upload.h"
#include "io/vpl_file.h"
#include "tools/commands.h"
#include "tools/exposed_png.h"
#include "tools/heat_map.h"
#include "tools/interrupt_watcher.h"
#include "tools/preflight.h"
#include "tools/progress_bar.h"
#include "tools/render_setup.h"
#include "tools/shadow_catcher.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options : FrameSetup {
  std::string scene, output, png, stats, vpl_in, vpl_out, size, crop, layers, heat_maps, checkpoint;
  uint32_t squares = 0;
  double confidence = 0;
  int verbosity = 1;
  bool quiet = false, half = false, resume = false, groups = false, keep_fireflies = false;
  float exposure = 0;
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

struct Channel {
  std::string name;
  int components;
};

// Channels to write: those asked for, or the usual ones.
std::vector<Channel> choose_channels(const io::Api& api, const std::string& asked, bool denoise) {
  std::vector<Channel> known;
  std::string names;
  for (const auto& info : api::channels(api)) {
    known.push_back({info.name, static_cast<int>(info.components)});
    names += (names.empty() ? "" : ", ") + known.back().name;
  }
  if (asked == "all") {
    std::erase_if(known, [&](const Channel& c) { return !denoise && of_denoising(c.name); });
    return known;
  }
  std::vector<Channel> chosen;
  const std::string usual = "radiance,depth,normal,albedo,cut_size,rays,bounds";
  const std::string of_denoised = ",denoised,denoised_error,denoising_color,denoising_albedo,denoising_normal";
  std::stringstream words(!asked.empty() ? asked : denoise ? usual + of_denoised : usual);
  for (std::string word; std::getline(words, word, ',');) {
    const auto at = std::find_if(known.begin(), known.end(), [&](const Channel& c) { return c.name == word; });
    if (at == known.end()) throw UsageError(fmt::format("--layers: no layer \"{}\"; there are {}", word, names));
    if (std::any_of(chosen.begin(), chosen.end(), [&](const Channel& c) { return c.name == word; }))
      throw UsageError(fmt::format("--layers: {} stands there twice", word));
    chosen.push_back(*at);
  }
  return chosen;
}

void log_message(void* user, int32_t level, const char* text) {
  if (std::string_view(text).starts_with("render failed: ")) return;  // which the command says itself
  static_cast<ProgressBar*>(user)->wipe();
  static const char* const kNames[] = {"error", "warning", "info", "debug"};
  print_error("lumicut: {}: {}\n", kNames[std::clamp(level, 0, 3)], text);
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
  stats["peak_bytes"] = std::max(own.value("peak_bytes", uint64_t{0}), io::peak_memory());
  stats["counters"] = own.value("counters", ordered_json::object());
  stats["values"] = own.value("values", ordered_json::object());
  return stats;
}

// The option that sets what a checkpoint's text names so; else a parameter's.
std::string option_of(std::string_view name) {
  constexpr std::pair<std::string_view, std::string_view> kOptions[] = {{"integrator", "-i"},
                                                                        {"vpls", "--vpls"},
                                                                        {"seed", "--seed"},
                                                                        {"width", "--size: width"},
                                                                        {"height", "--size: height"},
                                                                        {"samples", "--spp"},
                                                                        {"crop", "--crop"},
                                                                        {"denoise", "--denoise"},
                                                                        {"groups", "--groups"},
                                                                        {"confidence", "--confidence"},
                                                                        {"illuminance", "--layers: illuminance"},
                                                                        {"virtual lights", "--vpl-in"},
                                                                        {"accel", "--accel, --builder or --rays"}};
  for (const auto& [known, option] : kOptions)
    if (known == name) return std::string(option);
  return {};
}

// What the library says against a checkpoint, in the command's words.
std::string refusal_of_checkpoint(std::string text) {
  const auto cut = [&](std::string_view start) {
    const bool found = text.starts_with(start);
    if (found) text.erase(0, start.size());
    return found;
  };
  if (!cut("lumicut_render_desc.checkpoint: ")) return text;
  if (!cut("it was made for another scene, size, integrator or parameters: ")) return text;
  constexpr std::string_view kEnd = ". Give what it was made with, or begin anew without --resume";
  if (cut("other ")) {
    const std::string option = option_of(text);
    return option.empty() ? fmt::format("it was made for a scene with another {}{}", text, kEnd)
                          : fmt::format("it was made with another {}{}", option, kEnd);
  }
  const size_t end = text.find('=');
  const std::string name = text.substr(0, end), option = option_of(name), values = text.substr(end + 1);
  if (name == "version") return fmt::format("it was made by version {} of lumicut{}", values, kEnd);
  if (name == "denoise" || name == "groups" || name == "illuminance")
    return fmt::format("it was made {} {}{}", values.starts_with('0') ? "without" : "with", option, kEnd);
  return fmt::format("it was made with {}{}{}", option.empty() ? "-p " + name + "=" : option + " ", values, kEnd);
}

class RenderCommand {
 public:
  explicit RenderCommand(const Options& options) : o_(options), bar_(options.quiet), watcher_(library_.api()) {}

  void run() {
    check_outputs();
    // One image, of lights that are kept or known.
    apply_preset(api(), o_, o_.squares > 0 || !o_.vpl_in.empty() || !o_.vpl_out.empty());
    auto channels = choose_channels(api(), o_.layers, denoised());
    create_device();
    create_integrator();  // a wrong parameter shall not wait for big files
    read_scene();
    if (!beside_.empty() && o_.layers.empty())
      channels.push_back({"alpha", 1});  // shadows on clear ground are there alone
    commit();
    tell();
    check_memory(channels);
    render();
    catch_shadows();
    write(channels);
    if (checkpoint_error_) throw *checkpoint_error_;  // the last state is not on the disk
  }

 private:
  const io::Api& api() const { return library_.api(); }

  // Before hours of work, not after.
  void check_outputs() {
    std::vector<std::string> outputs = {o_.output, o_.png, o_.stats, o_.vpl_out, o_.checkpoint};
    if (!o_.heat_maps.empty())
      for (const CountLayer& layer : kCountLayers) outputs.push_back(heat_map_path(layer));
    io::check_distinct(outputs, {o_.scene, o_.vpl_in});
    for (const auto& path : {o_.output, o_.png, o_.stats, o_.vpl_out})
      if (!path.empty()) io::check_writable(path);
    if (!o_.heat_maps.empty()) {
      const std::filesystem::path folder(o_.heat_maps);
      std::error_code code;
      std::filesystem::create_directory(folder, code);
      if (!std::filesystem::is_directory(folder, code))
        throw io::FileError(o_.heat_maps, "is no folder, and cannot be made one");
      for (const CountLayer& layer : kCountLayers) io::check_writable(heat_map_path(layer));
    }
    if (!o_.size.empty()) size_ = image_size(o_.size);
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
    create_scene(api(), o_, device_.get(), scene_);
  }

  void create_integrator(io::Handle<lumicut_integrator>& integrator) {
    tools::create_integrator(api(), o_, device_.get(), integrator);
  }

  void create_integrator() {
    create_integrator(integrator_);
    check_groups(api(), o_, o_.groups);
    check_lights_out();
    if (o_.vpl_in.empty()) return;
    const NothingToLose reading;
    lights_ = io::read_vpls(o_.vpl_in);
    if (lights_.lights.empty()) throw UsageError(fmt::format("--vpl-in {}: holds no light", o_.vpl_in));
  }

  void check_lights_out() const {
    if (o_.vpl_out.empty()) return;
    if (lacks(integrator_info(api(), o_.integrator), LUMICUT_VIRTUAL_LIGHTS))
      throw UsageError(fmt::format("--vpl-out: {} has no virtual lights", o_.integrator));
    const char* importance = api().integrator_get(integrator_.get(), "importance");
    if (importance != nullptr && std::string(importance) == "1")
      throw UsageError("--vpl-out: not with importance, whose lights are for one camera (-p importance=false)");
  }

  void read_scene() {
    const double start = now();
    bar_.show("reading files", 0, 0);
    io::SceneData data = read_scene_file(o_.scene);
    bar_.wipe();
    if (o_.verbosity == 1 || o_.strict)  // above that they are told with all else
      tell_warnings(data.warnings, o_.scene, o_.strict);
    stop_if_interrupted();
    io::upload_scene(api(), scene_.get(), data);
    triangles_ = data.triangle_count();
    set_lights();
    desc_.struct_size = sizeof(desc_);
    desc_.width = size_.empty() ? data.width : size_[0];
    desc_.height = size_.empty() ? data.height : size_[1];
    desc_.samples = o_.samples > 0 ? o_.samples : data.samples;
    desc_.filter = data.filter, desc_.filter_width = data.filter_width;
    for (size_t i = 0; i < crop_.size(); ++i) desc_.crop[i] = crop_[i];
    desc_.passes = o_.passes.value_or(0);
    desc_.max_seconds = static_cast<float>(o_.seconds);
    desc_.target_error = static_cast<float>(o_.target_error);
    desc_.confidence = static_cast<float>(o_.confidence);
    if (!o_.checkpoint.empty()) desc_.flags |= LUMICUT_CHECKPOINTS;
    if (o_.groups) desc_.flags |= LUMICUT_GROUPS;
    if (denoised()) desc_.flags |= LUMICUT_DENOISE;
    for (const auto& channel : choose_channels(api(), o_.layers, denoised())) {
      if (channel.name == "illuminance" && o_.layers != "all") desc_.flags |= LUMICUT_ILLUMINANCE;
      if (of_denoising(channel.name)) desc_.flags |= LUMICUT_DENOISE;
    }
    if (o_.keep_fireflies) desc_.flags |= LUMICUT_KEEP_FIREFLIES;
    if (std::error_code code; o_.resume && std::filesystem::exists(o_.checkpoint, code)) {
      const NothingToLose reading;
      resumed_ = io::read_whole_file(o_.checkpoint);
      if (resumed_.empty()) throw io::FileError(o_.checkpoint, "is empty: no checkpoint");
      desc_.checkpoint = resumed_.data(), desc_.checkpoint_size = resumed_.size();
    }
    if (!crop_.empty() &&
        (crop_[0] >= crop_[2] || crop_[1] >= crop_[3] || crop_[2] > desc_.width || crop_[3] > desc_.height))
      throw UsageError(fmt::format("--crop {}: is not a part of {} x {} pixels", o_.crop, desc_.width, desc_.height));
    // What would fail after the first pass fails before it.
    if (!o_.checkpoint.empty())
      check_room_for_checkpoint(api(), o_.checkpoint, pixel_count(), o_.groups ? data.light_groups().size() : 0,
                                (desc_.flags & LUMICUT_DENOISE) != 0);
    prepare_catchers(data);
    read_seconds_ = now() - start;
    if (o_.verbosity >= 2) told_ = std::make_unique<io::SceneData>(std::move(data));
  }

  // Scenes beside the whole one [shadow_catcher.h]. Takes `data`, unless it is to be told of.
  void prepare_catchers(io::SceneData& data) {
    if (!has_catchers(data)) return;
    const auto refuse = [&](bool given, const char* option) {
      if (given)
        throw UsageError(fmt::format("{}: not with shadow catchers, which take several scenes: {}", option, o_.scene));
    };
    refuse(o_.squares > 0, "--squares"), refuse(!o_.vpl_in.empty(), "--vpl-in");
    refuse(o_.groups, "--groups");
    if (!o_.checkpoint.empty() && o_.verbosity >= 1)
      print_error("lumicut: warning: {}: keeps the passes of the whole scene; --resume renders the shadows anew\n",
                  o_.checkpoint);
    clear_behind_ = !shows_world(data);
    for_each_beside(o_.verbosity >= 2 ? data : std::move(data), [&](const io::SceneData& scene) {
      beside_.emplace_back(api());
      create_scene(api(), o_, device_.get(), beside_.back());
      io::upload_scene(api(), beside_.back().get(), scene);
    });
  }

  // Frames of those, of as many passes as the whole one has.
  void catch_shadows() {
    if (beside_.empty()) return;
    lumicut_status status{};
    status.struct_size = sizeof(status);
    io::check(api(), api().get_status(parts_[0].second.get(), &status), "render");
    lumicut_render_desc desc = desc_;
    desc.passes = std::max(1u, status.passes_done);
    desc.max_seconds = desc.target_error = 0;
    desc.checkpoint = nullptr, desc.checkpoint_size = 0;
    desc.flags &= LUMICUT_DENOISE | LUMICUT_KEEP_FIREFLIES;
    std::vector<Caught> frames;
    for (const auto& scene : beside_) {
      commit_scene(api(), watcher_, scene.get(), o_.scene);
      io::Handle<lumicut_integrator> integrator(api());
      create_integrator(integrator);
      io::Handle<lumicut_render> render(api());
      io::check(api(), api().render_start(integrator.get(), scene.get(), &desc, render.out()), "render of shadows");
      const lumicut_result result = finish(render.get(), status, [&](bool known) {
        if (known)
          bar_.show(fmt::format("shadows {}/{}", frames.size() + 1, beside_.size()), status.fraction, status.seconds);
      });
      io::check(api(), result, "render of shadows");
      frames.push_back(read_caught(render.get()));
    }
    caught_ = read_caught(parts_[0].second.get());
    lay_shadows(frames, *caught_);
    bar_.wipe();
  }

  Caught read_caught(lumicut_render render) const {
    const auto read = [&](const char* channel, size_t components) {
      std::vector<float> pixels(components * pixel_count());
      io::check(api(), api().render_read(render, channel, nullptr, pixels.data()), channel);
      return pixels;
    };
    Caught out{read("radiance", 3), read("alpha", 1), {}};
    if ((desc_.flags & LUMICUT_DENOISE) != 0) out.denoised = read("denoised", 3);
    return out;
  }

  uint64_t pixel_count() const {
    return crop_.empty() ? uint64_t{desc_.width} * desc_.height : uint64_t{crop_[2] - crop_[0]} * (crop_[3] - crop_[1]);
  }

  // What `lumicut check` says, without its forecast.
  void tell() {
    if (!told_) return;
    for (const auto& line : preflight_lines(preflight(
             api(), device_.get(), *told_, preflight_options(api(), integrator_.get(), desc_.width, desc_.height))))
      print_error("lumicut: {}\n", line);
    told_.reset();
    stop_if_interrupted();
  }

  void set_lights() {
    if (!o_.vpl_in.empty()) io::upload_vpls(api(), integrator_.get(), lights_, o_.vpl_in);
  }

  void commit() {
    const double start = now();
    bar_.show("acceleration structure", 0, 0);
    commit_scene(api(), watcher_, scene_.get(), o_.scene);
    commit_seconds_ = now() - start;
  }

  // The library refuses a render beyond the memory; on top come the layers as they are written, and the file's bytes.
  void check_memory(const std::vector<Channel>& channels) const {
    const auto pixels = static_cast<double>(pixel_count());
    double components = 3;  // of the PNG
    if (!o_.output.empty())
      for (const Channel& channel : channels) components += 2.0 * channel.components;
    const double bytes = components * sizeof(float) * pixels;
    const auto memory = static_cast<double>(io::physical_memory());
    if (bytes > memory)
      throw UsageError(fmt::format("{} of {:.0f} pixels take {:.1f} GB, more than the {:.1f} GB of memory here",
                                   o_.output, pixels, bytes / 1e9, memory / 1e9));
  }

  // The whole, the crop, or the squares: each is a render of its own.
  void render() {
    std::vector<lumicut_tile> parts;
    if (o_.squares > 0) {
      parts = choose_squares(desc_.width, desc_.height, o_.squares);
    } else {
      parts.push_back({sizeof(lumicut_tile), desc_.crop[0], desc_.crop[1], crop_.empty() ? desc_.width : desc_.crop[2],
                       crop_.empty() ? desc_.height : desc_.crop[3]});
    }
    start_part(parts[0], integrator_);
    wait_for(0, parts.size());
    if (parts.size() > 1) render_squares(parts);
    bar_.wipe();
  }

  // A square is less than the threads can share, and an integrator renders one at a time: so there are several of it,
  // on the same lights.
  void render_squares(const std::vector<lumicut_tile>& parts) {
    const api::VplSet lights = api::get_vpls(integrator_.get(), api(), "virtual lights");
    const size_t threads = o_.threads > 0 ? static_cast<size_t>(o_.threads) : std::thread::hardware_concurrency();
    std::vector<io::Handle<lumicut_integrator>> others;
    while (others.size() + 2 < std::min(parts.size(), threads + 2)) {
      others.emplace_back(api());
      create_integrator(others.back());
      api::set_vpls(others.back().get(), lights, api(), "virtual lights");
      watcher_.watch(others.back().get());
      const lumicut_result prepared = api().integrator_prepare(others.back().get(), scene_.get());
      watcher_.watch(nullptr);
      stop_if_interrupted();
      io::check(api(), prepared, "preparation");
    }
    const double start = now();
    while (parts_.size() < parts.size()) {
      const size_t first = parts_.size(), last = std::min(parts.size(), first + others.size() + 1);
      for (size_t i = first; i < last; ++i) start_part(parts[i], i == first ? integrator_ : others[i - first - 1]);
      for (size_t i = first; i < last; ++i) wait_for(i, parts.size());
    }
    squares_seconds_ = now() - start;
  }

  void start_part(const lumicut_tile& rect, const io::Handle<lumicut_integrator>& integrator) {
    lumicut_render_desc desc = desc_;
    if (o_.squares > 0) desc.crop[0] = rect.x0, desc.crop[1] = rect.y0, desc.crop[2] = rect.x1, desc.crop[3] = rect.y1;
    parts_.emplace_back(rect, io::Handle<lumicut_render>(api()));
    check_render(api().render_start(integrator.get(), scene_.get(), &desc, parts_.back().second.out()));
    resumed_.clear(), resumed_.shrink_to_fit();  // the render has its own
  }

  // What the library says against a checkpoint is the file's fault.
  void check_render(lumicut_result result) const {
    if (desc_.checkpoint == nullptr ||
        (result != LUMICUT_INVALID_ARGUMENT && result != LUMICUT_INVALID_STATE && result != LUMICUT_UNSUPPORTED))
      return io::check(api(), result, "render");
    throw io::FileError(o_.checkpoint, refusal_of_checkpoint(api().last_error()));
  }

  // Waits for the end of a render, which Ctrl-C may hasten. `tell(whether the status is known)` ten times a second.
  template <typename Fn>
  lumicut_result finish(lumicut_render render, lumicut_status& status, const Fn& tell) {
    watcher_.watch(render);
    lumicut_result result;
    do {
      status.struct_size = sizeof(status);
      result = api().render_wait(render, 100, &status);
      tell(result == LUMICUT_OK);
    } while (result == LUMICUT_OK && (status.state == LUMICUT_RUNNING || status.state == LUMICUT_IDLE));
    watcher_.watch(nullptr);
    stop_if_interrupted();
    return result;
  }

  void wait_for(size_t index, size_t count) {
    const lumicut_render render = parts_[index].second.get();
    lumicut_status status{};
    const lumicut_result result = finish(render, status, [&](bool known) {
      keep_checkpoint(render, status);
      if (known)
        bar_.show(
            phase_text(status),
            count == 1 ? status.fraction : (static_cast<double>(index) + status.fraction) / static_cast<double>(count),
            status.seconds);
    });
    check_render(result);
    if (desc_.checkpoint == nullptr || o_.seconds > 0 || o_.target_error > 0 ||
        status.passes_done <= std::max(1u, desc_.passes))
      return;
    bar_.wipe();
    if (o_.verbosity >= 1)
      print_error("lumicut: warning: {} holds more passes than were asked for: the image is of all {}\n", o_.checkpoint,
                  status.passes_done);
  }

  std::string phase_text(const lumicut_status& status) const {
    std::string phase = status.phase ? status.phase : "";
    if (!progressive()) return phase;
    const std::string error = std::isfinite(status.error) ? fmt::format(", error {:.2g} %", 100 * status.error) : "";
    return status.passes_total > 0
               ? fmt::format("pass {}/{}{}, {}", status.passes_done + 1, status.passes_total, error, phase)
               : fmt::format("pass {}{}, {}", status.passes_done + 1, error, phase);
  }

  bool denoised() const { return o_.denoise.value_or(false); }
  bool progressive() const {
    return desc_.passes > 1 || o_.seconds > 0 || o_.target_error > 0 || !o_.checkpoint.empty();
  }

  // What a killed render goes on from: after each pass (on the disk at most every few seconds), and after the last. Where
  // that fails the image goes on; it is tried again, and the command fails in the end if the last one did.
  void keep_checkpoint(lumicut_render render, const lumicut_status& status) {
    if (o_.checkpoint.empty() || status.passes_done == kept_passes_) return;
    const bool over = status.state != LUMICUT_RUNNING;
    if (!over && kept_time_ > 0 && now() - kept_time_ < 2.0) return;
    const void* data = nullptr;
    uint64_t size = 0;
    io::check(api(), api().render_checkpoint(render, &data, &size), o_.checkpoint);
    if (size == 0) return;
    kept_time_ = now();
    try {
      io::write_whole_file(o_.checkpoint, {static_cast<const char*>(data), size});
      kept_passes_ = status.passes_done;
      checkpoint_error_.reset();
    } catch (const io::FileError& error) {
      if (!checkpoint_error_) {
        bar_.wipe();
        print_error("lumicut: warning: {}; the image will be written all the same\n", error.what());
      }
      checkpoint_error_ = error;
    }
  }

  // The part's own statistics; of squares the sums, and seconds by the wall.
  ordered_json own_statistics() const {
    ordered_json all = ordered_json::parse(api().stats_json(parts_[0].second.get()));
    if (parts_.size() == 1) return all;
    for (size_t i = 1; i < parts_.size(); ++i) {
      const auto part = ordered_json::parse(api().stats_json(parts_[i].second.get()));
      for (const auto& [name, count] : part["counters"].items())
        all["counters"][name] = all["counters"].value(name, uint64_t{0}) + count.get<uint64_t>();
    }
    all["seconds"] = all["seconds"].get<double>() + squares_seconds_;
    all["phases"]["render"] = all["phases"].value("render", 0.0) + squares_seconds_;
    return all;
  }

  void write(const std::vector<Channel>& channels) {
    const uint32_t x0 = desc_.crop[0], y0 = desc_.crop[1];
    const uint32_t width = crop_.empty() ? desc_.width : crop_[2] - x0,
                   height = crop_.empty() ? desc_.height : crop_[3] - y0;
    io::Image image;
    image.width = static_cast<int>(width), image.height = static_cast<int>(height);
    image.x0 = static_cast<int>(x0), image.y0 = static_cast<int>(y0);
    image.frame_width = static_cast<int>(desc_.width), image.frame_height = static_cast<int>(desc_.height);
    // Where no part is, not a number: comparisons leave those pixels out.
    const auto read = [&](const Channel& channel) {
      const auto components = static_cast<size_t>(channel.components);
      io::ImageLayer layer{channel.name, channel.components, {}};
      if (caught_ && channel.name == "radiance") layer.pixels = caught_->radiance;
      if (caught_ && channel.name == "alpha") layer.pixels = caught_->alpha;
      if (caught_ && channel.name == "denoised") layer.pixels = caught_->denoised;
      if (!layer.pixels.empty()) return layer;
      layer.pixels.assign(size_t{width} * height * components, std::numeric_limits<float>::quiet_NaN());
      std::vector<float> rows;
      for (const auto& [rect, render] : parts_) {
        const size_t row = (rect.x1 - rect.x0) * components;
        rows.resize(row * (rect.y1 - rect.y0));
        io::check(api(), api().render_read(render.get(), channel.name.c_str(), nullptr, rows.data()), channel.name);
        for (size_t y = rect.y0; y < rect.y1; ++y)
          std::copy_n(
              rows.begin() + static_cast<std::ptrdiff_t>((y - rect.y0) * row), row,
              layer.pixels.begin() + static_cast<std::ptrdiff_t>(((y - y0) * width + (rect.x0 - x0)) * components));
      }
      return layer;
    };
    double pixels = 0;
    for (const auto& [rect, render] : parts_)
      pixels += static_cast<double>(rect.x1 - rect.x0) * static_cast<double>(rect.y1 - rect.y0);
    ordered_json stats = statistics(own_statistics(), pixels, read_seconds_, commit_seconds_);
    stats["rendered_pixels"] = pixels;
    const lumicut_vpl* lights = nullptr;
    uint64_t light_count = 0;
    io::check(api(), api().integrator_get_lights(integrator_.get(), &lights, &light_count), "virtual lights");
    describe(stats, light_count);

    if (!o_.output.empty()) {
      for (const auto& channel : channels) image.layers.push_back(read(channel));
      const uint32_t* groups = nullptr;
      uint64_t group_count = 0;
      io::check(api(), api().render_groups(parts_[0].second.get(), &groups, &group_count), "light groups");
      for (uint64_t g = 0; g < group_count; ++g)
        image.layers.push_back(read({fmt::format("radiance.{}", groups[g]), 3}));
      for (const char* key : {"scene", "integrator", "version", "vpls", "seed", "samples"})
        image.attributes[key] = stats[key].is_string() ? stats[key].get<std::string>() : stats[key].dump();
      image.attributes["parameters"] = stats["parameters"].dump();
      image.attributes["seconds"] = stats["seconds"].dump();
    }
    // Computed and read: from here a stop would leave some files and not others.
    stop_if_interrupted();
    if (!o_.output.empty()) io::write_exr(o_.output, image, o_.half);
    if (!o_.png.empty()) {
      const auto radiance = read({denoised() ? "denoised" : "radiance", 3});
      write_exposed_png(o_.png, {radiance.pixels, width, height}, o_.exposure,
                        clear_behind_ ? caught_->alpha : std::vector<float>{});
    }
    if (!o_.heat_maps.empty())
      for (const CountLayer& counts : kCountLayers) {
        const ColorImage map = heat_map(read({counts.name, 1}).pixels, image.width, image.height, counts.title);
        io::write_png(heat_map_path(counts), map.pixels, map.width, map.height, 3);
      }
    if (!o_.vpl_out.empty()) io::write_vpls(o_.vpl_out, api::get_vpls(integrator_.get(), api(), "virtual lights"));
    if (!o_.stats.empty()) io::write_whole_file(o_.stats, io::json_text(stats, 2) + "\n");
    if (!o_.quiet)
      fmt::print("{}: {} lights, {}x{}, {:.2f} s, {:.0f} rays, {:.0f} bounds, {:.0f} clusters a pixel\n", o_.integrator,
                 light_count, width, height, stats["seconds"].get<double>(), stats["rays_per_pixel"].get<double>(),
                 stats["bounds_per_pixel"].get<double>(), stats["clusters_per_pixel"].get<double>());
  }

  std::string heat_map_path(const CountLayer& layer) const {
    return (std::filesystem::path(o_.heat_maps) / (std::string(layer.name) + ".png")).string();
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
    if (!o_.builder.empty()) stats["builder"] = o_.builder;
    stats["robust"] = o_.rays == "robust";
    stats["threads"] = o_.threads;
    ordered_json parameters = ordered_json::object();
    for (const auto& info : api::params(o_.integrator, api())) {
      const char* value = api().integrator_get(integrator_.get(), info.id);
      parameters[info.id] = value ? value : "";
    }
    stats["seed"] = parameters.value("seed", "");
    stats["parameters"] = parameters;
  }

  Options o_;
  io::Library library_;
  ProgressBar bar_;
  io::Handle<lumicut_device> device_{library_.api()};
  io::Handle<lumicut_scene> scene_{library_.api()};
  io::Handle<lumicut_integrator> integrator_{library_.api()};
  std::vector<std::pair<lumicut_tile, io::Handle<lumicut_render>>> parts_;
  std::vector<io::Handle<lumicut_scene>> beside_;  // that shadow catchers need
  bool clear_behind_ = false;                      // with them, and no world that the camera sees
  std::optional<Caught> caught_;
  InterruptWatcher watcher_;             // ends before the handles that it may cancel
  api::VplSet lights_;                   // of --vpl-in
  std::unique_ptr<io::SceneData> told_;  // at high verbosity, until it is told of
  std::vector<uint32_t> size_, crop_;
  lumicut_render_desc desc_{};
  uint64_t triangles_ = 0;
  std::string resumed_;  // bytes of --checkpoint
  uint32_t kept_passes_ = 0;
  double kept_time_ = 0;
  std::optional<io::FileError> checkpoint_error_;  // of the last that was to be written
  double read_seconds_ = 0, commit_seconds_ = 0, squares_seconds_ = 0;
};

}  // namespace

void add_render(CLI::App& app) {
  auto* command = app.add_subcommand("render", "Render a scene file");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, kSceneHelp)->required();
  add_frame_options(*command, *o);
  command->add_option("-o,--output", o->output, "EXR to write")->check(picture_of({".exr"}));
  add_png_options(*command, o->png, o->exposure);
  command->add_option(
      "--layers", o->layers,
      "Layers of the EXR, with commas, or `all` (default: radiance,depth,normal,albedo,cut_size,rays,bounds, what "
      "--denoise gives, and alpha where there are shadow catchers)");
  command->add_flag("--half", o->half, "16 bits a number in the EXR instead of 32");
  command->add_option("--size", o->size, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--crop", o->crop, "x0,y0,x1,y1: the part of the image to render, row 0 on top");
  command
      ->add_option(
          "--squares", o->squares,
          "Render only so many squares of 32 pixels, spread over the image; others are not numbers (EXR alone)")
      ->check(CLI::Range(1, 1 << 24))
      ->excludes("--crop")
      ->excludes("--preset");
  command
      ->add_option("--passes", o->passes,
                   "Average so many images, each with virtual lights of its own (0: until --seconds or --target-error)")
      ->check(CLI::Range(0u, 1u << 30));
  command->add_option("--seconds", o->seconds, "Stop after the pass that ends nearest to this")
      ->check(number_in(0, 1e9));
  command
      ->add_option("--target-error", o->target_error,
                   "Stop when the error is known to this share, such as 0.02: of --confidence of the pixels, at "
                   "--confidence (after at least 8 passes)")
      ->check(number_in(0, 1e9));
  command->add_option("--confidence", o->confidence, "Of the intervals in the layer `error` (default: 0.95)")
      ->check(number_in(0.5, 0.999));
  auto* checkpoint =
      command->add_option("--checkpoint", o->checkpoint, "File that a stopped or killed render goes on from");
  command->add_flag("--resume", o->resume, "Go on from --checkpoint, if it is there")->needs(checkpoint);
  command->add_flag(
      "--groups", o->groups,
      "One image for each light group too, as layers radiance.GROUP: `lumicut mix` puts them together anew");
  command->add_flag("--keep-fireflies", o->keep_fireflies,
                    "With --denoise: rare bright samples stay where they fell, instead of being spread");
  command->add_option("--heat-map", o->heat_maps,
                      "Folder for false-colour PNGs of what a point cost: bounds, cut_size, rays");
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
  command->callback([o] {
    if (o->output.empty() && o->png.empty() && o->stats.empty() && o->vpl_out.empty() && o->heat_maps.empty())
      throw UsageError("render: nothing to write; give -o out.exr, --png, --stats, --heat-map or --vpl-out");
    if (o->squares > 0 &&
        (o->passes.value_or(1) > 1 || o->seconds > 0 || o->target_error > 0 || !o->checkpoint.empty()))
      throw UsageError("render: --squares renders one pass");
    if (o->passes == 0u && o->seconds == 0 && o->target_error == 0)
      throw UsageError("--passes 0: until --seconds or --target-error, of which neither is given");
    catch_interrupts();
    try {
      RenderCommand(*o).run();
    } catch (const Interrupted&) {
      std::error_code code;
      if (o->checkpoint.empty() || !std::filesystem::is_regular_file(o->checkpoint, code)) throw;
      throw Interrupted(
          fmt::format("interrupted; {} holds the passes that were done, and --resume goes on", o->checkpoint));
    }
  });
}

}  // namespace lumicut::tools
