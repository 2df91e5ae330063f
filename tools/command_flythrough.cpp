// lumicut flythrough: many cameras in one scene, prepared once. Methods that do not depend on the view (wspd) pay for
// their preparation once, or never again: it is saved and loaded.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "io/library.h"
#include "io/scene_upload.h"
#include "io/vpl_file.h"
#include "lumicut/lumicut_state.h"
#include "tools/commands.h"
#include "tools/exposed_png.h"
#include "tools/interrupt_watcher.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options : RenderSetup {
  Options() { integrator = "wspd"; }
  std::string scene, cameras, output, png, stats, vpl_in, size, save_state, load_state;
  uint32_t samples = 0;
  bool quiet = false;
  float exposure = 0;
};

using Point = std::array<double, 3>;

// A camera as the file has it.
struct View {
  Point eye{}, at{}, up{};
  double fov_y = 0;  // degrees
};

Point mix(const Point& a, const Point& b, double t) {
  return {a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t};
}
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
// 0 stays 0.
Point unit(const Point& a) {
  const double length = std::sqrt(dot(a, a));
  return length > 0 ? Point{a[0] / length, a[1] / length, a[2] / length} : Point{};
}

// {"unit_scale", "z_up", "frames", "cameras": [{"eye", "at", "up", "fov_y"}, ...]}: docs/command_line.md. With "frames"
// the cameras are stations of a path of that many views.
std::vector<lumicut_camera> read_cameras(const std::string& path, const lumicut_camera& usual) {
  const nlohmann::json json = io::parse_json(io::read_whole_file(path), path);
  io::JsonObject file(io::JsonValue(json, path, ""));
  constexpr double kLargest = 1e15, kDegree = 3.14159265358979323846 / 180;
  const double scale = file.number("unit_scale", 1, 1e-9, 1e9);
  const bool z_up = file.has("z_up") && file.need("z_up").boolean();
  std::vector<View> views;
  const io::JsonValue list = file.need("cameras");
  for (const io::JsonValue& value : list.elements()) {
    io::JsonObject object(value);
    View v;
    v.eye = object.need("eye").vector3(-kLargest, kLargest), v.at = object.need("at").vector3(-kLargest, kLargest);
    v.up = object.has("up") ? object.need("up").vector3(-kLargest, kLargest) : (z_up ? Point{0, 0, 1} : Point{0, 1, 0});
    v.fov_y = object.number("fov_y", usual.fov_y > 0 ? usual.fov_y / kDegree : 50, 0.001, 179);
    const Point back = unit({v.eye[0] - v.at[0], v.eye[1] - v.at[1], v.eye[2] - v.at[2]});
    const Point side = cross(unit(v.up), back);
    if (!(dot(side, side) > 1e-12)) value.fail("looks along its own \"up\", or \"at\" is the same point as \"eye\"");
    object.finish();
    views.push_back(v);
  }
  if (views.empty()) list.fail("holds no camera");
  const auto frames = static_cast<size_t>(file.integer("frames", static_cast<int64_t>(views.size()), 1, 100000));
  file.finish();
  std::vector<lumicut_camera> cameras;
  for (size_t f = 0; f < frames; ++f) {
    const double at =
        frames == views.size() || frames == 1
            ? static_cast<double>(f)
            : static_cast<double>(f) * static_cast<double>(views.size() - 1) / static_cast<double>(frames - 1);
    const size_t a = std::min(static_cast<size_t>(at), views.size() - 1), b = std::min(a + 1, views.size() - 1);
    const double t = at - static_cast<double>(a);
    const Point eye = mix(views[a].eye, views[b].eye, t), target = mix(views[a].at, views[b].at, t);
    const Point z = unit({eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]});
    const Point x = unit(cross(mix(views[a].up, views[b].up, t), z)), y = cross(z, x);
    if (!(dot(x, x) > 0)) list.fail(fmt::format("view {} between two cameras looks nowhere", f));
    lumicut_camera c = usual;
    c.orthographic = 0;
    for (size_t k = 0; k < 3; ++k) {
      c.to_world[4 * k] = static_cast<float>(x[k]), c.to_world[4 * k + 1] = static_cast<float>(y[k]);
      c.to_world[4 * k + 2] = static_cast<float>(z[k]), c.to_world[4 * k + 3] = static_cast<float>(eye[k] * scale);
    }
    c.fov_y = static_cast<float>((views[a].fov_y + (views[b].fov_y - views[a].fov_y) * t) * kDegree);
    cameras.push_back(c);
  }
  return cameras;
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// "a.exr", 7 -> "a.0007.exr".
std::string numbered(const std::string& path, size_t index) {
  const size_t dot_at = path.rfind('.'), slash = path.rfind('/');
  const bool extension = dot_at != std::string::npos && (slash == std::string::npos || dot_at > slash);
  return fmt::format("{}.{:04}{}", extension ? path.substr(0, dot_at) : path, index,
                     extension ? path.substr(dot_at) : "");
}

class FlythroughCommand {
 public:
  explicit FlythroughCommand(const Options& options) : o_(options) {}

  void run() {
    const std::vector<uint32_t> size = o_.size.empty() ? std::vector<uint32_t>{} : image_size(o_.size);
    io::check_distinct({o_.output, o_.png, o_.stats, o_.save_state}, {o_.scene, o_.cameras, o_.vpl_in, o_.load_state});
    for (const auto& path : {o_.output, o_.png, o_.stats, o_.save_state})
      if (!path.empty()) io::check_writable(path);
    create();
    io::SceneData data = read_scene_file(o_.scene);
    warn_of_catchers(data, "flythrough");
    tell_warnings(data.warnings, o_.scene, o_.strict);
    const auto cameras = read_cameras(o_.cameras, data.camera);
    io::upload_scene(api(), scene_.get(), data);
    set_host_lights();
    io::check(api(), api().scene_set_camera(scene_.get(), cameras.data()), o_.cameras);
    commit_scene(api(), watcher_, scene_.get(), o_.scene);
    prepare();
    frame_.struct_size = sizeof(frame_);
    frame_.width = data.width, frame_.height = data.height;
    if (!size.empty()) frame_.width = size[0], frame_.height = size[1];
    frame_.samples = o_.samples > 0 ? o_.samples : data.samples;
    frame_.filter = data.filter, frame_.filter_width = data.filter_width;
    for (size_t i = 0; i < cameras.size(); ++i) try {
        render(cameras[i], i);
      } catch (const Interrupted&) {
        if (i == 0) throw;
        throw Interrupted(fmt::format("interrupted; {} of {} views are written", i, cameras.size()));
      }
    report(cameras.size());
  }

 private:
  const io::Api& api() const { return library_.api(); }

  void create() {
    create_device(api(), o_, device_);
    create_scene(api(), o_, device_.get(), scene_);
    create_integrator(api(), o_, device_.get(), integrator_);
    state_ = api::extension<lumicut_state_extension>(LUMICUT_STATE_EXTENSION, api());
    if (state_ == nullptr && !(o_.save_state.empty() && o_.load_state.empty()))
      throw UsageError("--save-state, --load-state: this library has no extension " LUMICUT_STATE_EXTENSION);
    const std::string& state = o_.save_state.empty() ? o_.load_state : o_.save_state;
    if (!state.empty() && lacks(integrator_info(api(), o_.integrator), LUMICUT_SAVED_STATE))
      throw UsageError(fmt::format("{} of {}: this integrator has no state to save",
                                   o_.save_state.empty() ? "--load-state" : "--save-state", o_.integrator));
  }

  void set_host_lights() {
    if (o_.vpl_in.empty()) return;
    const api::VplSet lights = io::read_vpls(o_.vpl_in);
    if (lights.lights.empty()) throw UsageError(fmt::format("--vpl-in {}: holds no light", o_.vpl_in));
    io::upload_vpls(api(), integrator_.get(), lights, o_.vpl_in);
  }

  void prepare() {
    const double start = now();
    if (!o_.load_state.empty()) {
      const std::string bytes = io::read_whole_file(o_.load_state);
      if (state_->load(integrator_.get(), scene_.get(), bytes.data(), bytes.size()) != LUMICUT_OK)
        throw io::FileError(o_.load_state, api().last_error());
    } else {
      watcher_.watch(integrator_.get());
      const lumicut_result prepared = api().integrator_prepare(integrator_.get(), scene_.get());
      watcher_.watch(nullptr);
      stop_if_interrupted();
      io::check(api(), prepared, "preparation");
    }
    prepare_seconds_ = now() - start;
    prepared_ = ordered_json::parse(api().stats_json(integrator_.get()));
    if (!o_.quiet)
      fmt::print("{}: {:.2f} s\n", o_.load_state.empty() ? "prepared" : "loaded " + o_.load_state, prepare_seconds_);
    if (o_.save_state.empty()) return;
    uint64_t size = 0;
    io::check(api(), state_->save(integrator_.get(), nullptr, &size), fmt::format("--save-state of {}", o_.integrator));
    std::string bytes(size, '\0');
    io::check(api(), state_->save(integrator_.get(), bytes.data(), &size),
              fmt::format("--save-state of {}", o_.integrator));
    io::write_whole_file(o_.save_state, bytes);
  }

  void render(const lumicut_camera& camera, size_t index) {
    const double start = now();
    io::check(api(), api().scene_set_camera(scene_.get(), &camera), o_.cameras);
    io::check(api(), api().scene_commit(scene_.get()), o_.scene);
    io::Handle<lumicut_render> handle(api());
    io::check(api(), api().render_start(integrator_.get(), scene_.get(), &frame_, handle.out()), "render");
    lumicut_status status{};
    lumicut_result result;
    do {
      status.struct_size = sizeof(status);
      result = api().render_wait(handle.get(), 100, &status);
      if (interrupted) api().cancel(handle.get());
    } while (result == LUMICUT_OK && (status.state == LUMICUT_RUNNING || status.state == LUMICUT_IDLE));
    stop_if_interrupted();
    io::check(api(), result, "render");
    const double seconds = now() - start;
    const auto own = ordered_json::parse(api().stats_json(handle.get()));
    ordered_json view;
    view["seconds"] = seconds;
    view["prepare_reused"] = own["values"].contains("prepare_reused");
    view["counters"] = own["counters"];
    views_.push_back(view);
    total_seconds_ += seconds;
    const double pixels = static_cast<double>(frame_.width) * frame_.height;
    if (!o_.quiet)
      fmt::print("view {}: {:.2f} s, {:.0f} rays, {:.0f} clusters a pixel\n", index, seconds,
                 own["counters"].value("rays", 0.0) / pixels, own["counters"].value("clusters", 0.0) / pixels);
    write(handle.get(), index);
  }

  void write(lumicut_render handle, size_t index) const {
    if (o_.output.empty() && o_.png.empty()) return;
    io::Image image;
    image.width = image.frame_width = static_cast<int>(frame_.width);
    image.height = image.frame_height = static_cast<int>(frame_.height);
    io::ImageLayer layer{"radiance", 3, {}};
    layer.pixels.resize(size_t{frame_.width} * frame_.height * 3);
    io::check(api(), api().render_read(handle, "radiance", nullptr, layer.pixels.data()), "radiance");
    if (!o_.png.empty())
      write_exposed_png(numbered(o_.png, index), {layer.pixels, frame_.width, frame_.height}, o_.exposure);
    if (o_.output.empty()) return;
    image.layers.push_back(std::move(layer));
    io::write_exr(numbered(o_.output, index), image, false);
  }

  void report(size_t views) const {
    const auto n = static_cast<double>(views);
    const double amortised = (prepare_seconds_ + total_seconds_) / n;
    if (!o_.quiet)
      fmt::print("{} views: {:.2f} s each, and {:.2f} s with the preparation shared among them\n", views,
                 total_seconds_ / n, amortised);
    if (o_.stats.empty()) return;
    ordered_json stats;
    stats["scene"] = o_.scene, stats["cameras"] = o_.cameras, stats["integrator"] = o_.integrator;
    stats["width"] = frame_.width, stats["height"] = frame_.height, stats["samples"] = frame_.samples;
    stats["loaded"] = !o_.load_state.empty();
    stats["prepare_seconds"] = prepare_seconds_;
    stats["seconds_per_view"] = total_seconds_ / n;
    stats["amortised_seconds_per_view"] = amortised;
    stats["prepare"] = prepared_;
    stats["views"] = views_;
    io::write_whole_file(o_.stats, io::json_text(stats, 2) + "\n");
  }

  const Options& o_;
  io::Library library_;
  io::Handle<lumicut_device> device_{library_.api()};
  io::Handle<lumicut_scene> scene_{library_.api()};
  io::Handle<lumicut_integrator> integrator_{library_.api()};
  const lumicut_state_extension* state_ = nullptr;
  lumicut_render_desc frame_{};
  double prepare_seconds_ = 0, total_seconds_ = 0;
  ordered_json prepared_, views_ = ordered_json::array();
  InterruptWatcher watcher_{library_.api()};  // ends before the handles that it may cancel
};

}  // namespace

void add_flythrough(CLI::App& app) {
  auto* command = app.add_subcommand("flythrough", "Render many cameras in one scene, prepared once");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, kSceneHelp)->required();
  command->add_option("cameras", o->cameras, "Cameras, JSON: docs/command_line.md")->required();
  add_setup_options(*command, *o);
  command->add_option("-o,--output", o->output, "EXR to write for each view: a.exr becomes a.0000.exr, ...")
      ->check(picture_of({".exr"}));
  command->add_option("--png", o->png, "PNG to write for each view")->check(picture_of({".png"}));
  command->add_option("--exposure", o->exposure, "Factor from radiance to [0,1] for the PNGs (default: each its own)")
      ->check(number_in(0, 1e30));
  command->add_option("--save-state", o->save_state, "File for what was prepared, to be loaded in later runs");
  command->add_option("--load-state", o->load_state, "Take what a run with the same scene and parameters has saved")
      ->excludes("--save-state");
  command->add_option("--size", o->size, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--spp", o->samples, "Samples a pixel (default: the scene's)")->check(CLI::Range(1, 65536));
  command->add_option("--vpl-in", o->vpl_in, "Take the virtual lights from this file");
  command->add_option("--stats", o->stats, "JSON file of seconds and counts to write");
  command->add_flag("-q,--quiet", o->quiet, "Nothing on the terminal");
  command->footer(
      "Example: lumicut flythrough room.json path.json --vpls 200000 --save-state room.state --png fly.png");
  command->callback([o] {
    catch_interrupts();
    FlythroughCommand(*o).run();
  });
}

}  // namespace lumicut::tools
