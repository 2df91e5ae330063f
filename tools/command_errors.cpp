// lumicut errors: where the error of an image comes from. Four images at the same points of the same surfaces:
//   A  the method itself
//   B  the exhaustive sum over the same virtual lights        A − B: clustering
//   C  its mean over other sets of virtual lights              B − C: sampling of the virtual lights
//   D  the path tracer                                         C − D: clamping, and gloss that virtual lights lack
// What of C and D is noise is known from their parts, and taken off in quadrature.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "film/metrics.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "io/library.h"
#include "io/scene_upload.h"
#include "tools/commands.h"
#include "tools/heat_map.h"
#include "tools/interrupt_watcher.h"
#include "tools/progress_bar.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options : RenderSetup {
  Options() { integrator = kUsualIntegrator; }
  std::string scene, size, folder;
  uint32_t sets = 16, paths = 1024;
  float ignore_above = std::numeric_limits<float>::infinity();
  bool json = false, quiet = false;
};

constexpr uint32_t kPathParts = 8;  // of the path tracer: their differences are its noise

using Pixels = std::vector<float>;  // RGB

// Mean of images, and the variance of one of them about it.
class Parts {
 public:
  void add(const Pixels& image) {
    if (sum_.empty()) sum_.resize(image.size()), squares_.resize(image.size());
    for (size_t i = 0; i < image.size(); ++i) {
      const double x = image[i];
      sum_[i] += x, squares_[i] += x * x;
    }
    ++count_;
  }
  double count() const { return count_; }
  Pixels mean() const {
    Pixels mean(sum_.size());
    for (size_t i = 0; i < mean.size(); ++i) mean[i] = static_cast<float>(sum_[i] / count_);
    return mean;
  }
  // Of value i. Unbiased; at least 0 against rounding.
  double variance(size_t i) const { return std::max(0.0, (squares_[i] - sum_[i] * sum_[i] / count_) / (count_ - 1)); }

 private:
  std::vector<double> sum_, squares_;
  double count_ = 0;
};

// As shares of the truth's mean.
struct Share {
  const char *name, *meaning;
  double rmse = 0, bias = 0;
  double noise = 0;  // RMS of what of the difference is noise of C and D, which `rmse` is without
};

class ErrorsCommand {
 public:
  explicit ErrorsCommand(const Options& options) : o_(options), bar_(options.quiet || options.json) {}

  void run() {
    if (!o_.size.empty()) size_ = image_size(o_.size);
    if (!o_.folder.empty()) {
      std::error_code code;
      std::filesystem::create_directory(o_.folder, code);
      if (!std::filesystem::is_directory(o_.folder, code))
        throw io::FileError(o_.folder, "is no folder, and cannot be made one");
      for (const char* name : kFiles) io::check_writable(path(name));
    }
    create();
    render_all();
    bar_.wipe();
    const ordered_json result = split();
    if (!o_.folder.empty()) write(result);
    if (o_.json) fmt::print("{}\n", io::json_text(result, 2));
  }

 private:
  static constexpr const char* kFiles[] = {"errors.json",  "errors.exr",   "clustering.png",
                                           "sampling.png", "clamping.png", "total.png"};
  static constexpr const char* kLayers[] = {"radiance", "exhaustive", "expected", "truth"};

  const io::Api& api() const { return library_.api(); }
  std::string path(const std::string& name) const { return (std::filesystem::path(o_.folder) / name).string(); }

  void create() {
    create_device(api(), o_, device_);
    create_scene(api(), o_, device_.get(), scene_);
    create_integrator(api(), o_, device_.get(), method_);  // a wrong parameter shall not wait for big files
    if (lacks(integrator_info(api(), o_.integrator), LUMICUT_VIRTUAL_LIGHTS))
      throw UsageError(
          fmt::format("errors: {} has no virtual lights; what is taken apart is the error of methods that have them",
                      o_.integrator));
    bar_.show("reading files", 0, 0);
    io::SceneData data = read_scene_file(o_.scene);
    warn_of_catchers(data, "errors");
    bar_.wipe();
    tell_warnings(data.warnings, o_.scene, o_.strict);
    stop_if_interrupted();
    io::upload_scene(api(), scene_.get(), data);
    bar_.show("acceleration structure", 0, 0);
    commit_scene(api(), watcher_, scene_.get(), o_.scene);
    frame_.struct_size = sizeof(frame_);
    frame_.width = size_.empty() ? data.width : size_[0];
    frame_.height = size_.empty() ? data.height : size_[1];
    frame_.samples = 1;  // the pixels' centres: all images show the same points
  }

  // Another integrator with the method's values of the parameters that both have.
  io::Handle<lumicut_integrator> like_method(const char* id) const {
    io::Handle<lumicut_integrator> other(api());
    io::check(api(), api().integrator_create(device_.get(), id, other.out()), id);
    for (const auto& info : api::params(id, api()))
      if (const char* value = api().integrator_get(method_.get(), info.id)) set(other, info.id, value);
    return other;
  }

  void set(const io::Handle<lumicut_integrator>& integrator, const char* name, const std::string& value) const {
    io::check(api(), api().integrator_set(integrator.get(), name, value.c_str()), name);
  }

  Pixels render(const io::Handle<lumicut_integrator>& integrator, const std::string& what) {
    io::Handle<lumicut_render> render(api());
    io::check(api(), api().render_start(integrator.get(), scene_.get(), &frame_, render.out()), what);
    watcher_.watch(render.get());
    lumicut_status status{};
    lumicut_result result;
    do {
      status.struct_size = sizeof(status);
      result = api().render_wait(render.get(), 100, &status);
      if (result == LUMICUT_OK)
        bar_.show(fmt::format("image {}/{}, {}: {}", done_ + 1, 2 + o_.sets + kPathParts, what,
                              status.phase ? status.phase : ""),
                  status.fraction, status.seconds);
    } while (result == LUMICUT_OK && (status.state == LUMICUT_RUNNING || status.state == LUMICUT_IDLE));
    watcher_.watch(nullptr);
    stop_if_interrupted();
    io::check(api(), result, what);
    ++done_;
    Pixels pixels(size_t{3} * frame_.width * frame_.height);
    io::check(api(), api().render_read(render.get(), "radiance", nullptr, pixels.data()), what);
    return pixels;
  }

  void render_all() {
    image_ = render(method_, o_.integrator);
    const auto exhaustive = like_method("exhaustive");
    sum_ = render(exhaustive, "its lights summed");
    const uint64_t seed = std::stoull(api().integrator_get(method_.get(), "seed"));
    const auto other_seed = [&](uint64_t i) { return std::to_string((seed + 0x9e3779b9u * (i + 1)) & 0xffffffffu); };
    for (uint32_t i = 0; i < o_.sets; ++i) {
      set(exhaustive, "seed", other_seed(i));
      sets_.add(render(exhaustive, "other lights"));
    }
    const auto truth = like_method("path_tracer");
    set(truth, "samples", std::to_string((o_.paths + kPathParts - 1) / kPathParts));
    for (uint32_t i = 0; i < kPathParts; ++i) {
      set(truth, "seed", other_seed(o_.sets + i));
      paths_.add(render(truth, "path tracer"));
    }
  }

  ordered_json split() {
    expected_ = sets_.mean(), truth_ = paths_.mean();
    const size_t pixel_count = truth_.size() / 3;
    uint64_t counted = 0, bad = 0;
    double reference = 0, of_set = 0, of_expected = 0, of_truth = 0;  // sums of squares of noise
    std::vector<bool> counts(pixel_count);
    for (size_t p = 0; p < pixel_count; ++p) {
      bool finite = true;
      for (const Pixels* image : {&image_, &sum_, &expected_, &truth_})
        for (size_t k = 0; k < 3; ++k) finite = finite && std::isfinite((*image)[3 * p + k]);
      const float y = 0.2126f * truth_[3 * p] + 0.7152f * truth_[3 * p + 1] + 0.0722f * truth_[3 * p + 2];
      if (!finite) ++bad;
      if (!finite || y >= o_.ignore_above) continue;
      counts[p] = true, ++counted;
      for (size_t i = 3 * p; i < 3 * p + 3; ++i) {
        reference += truth_[i];
        of_set += sets_.variance(i);
        of_expected += sets_.variance(i) / sets_.count();
        of_truth += paths_.variance(i) / paths_.count();
      }
    }
    if (counted == 0) throw std::runtime_error("no pixel can be compared");
    if (!(reference > 0)) throw std::runtime_error("the image is black: there is no error to take apart");
    const double values = 3.0 * static_cast<double>(counted), mean = reference / values;
    const auto share = [&](const char* name, const char* meaning, const Pixels& a, const Pixels& b, double noise) {
      double squares = 0, sum = 0;
      for (size_t i = 0; i < a.size(); ++i)
        if (counts[i / 3]) {
          const double d = static_cast<double>(a[i]) - b[i];
          squares += d * d, sum += d;
        }
      return Share{name, meaning, std::sqrt(std::max(0.0, squares - noise) / values) / mean, sum / values / mean,
                   std::sqrt(noise / values) / mean};
    };
    const std::vector<Share> shares = {
        share("clustering", "the method against the sum over its own lights", image_, sum_, 0),
        share("sampling", "these virtual lights against the mean of all such sets", sum_, expected_, of_expected),
        share("clamping", "that mean against the path tracer: the clamp, and gloss that virtual lights lack", expected_,
              truth_, of_expected + of_truth),
        share("total", "the method against the path tracer", image_, truth_, of_truth)};
    const double usual = std::sqrt(of_set / values) / mean;
    ordered_json result;
    result["scene"] = o_.scene, result["integrator"] = o_.integrator;
    for (const Share& s : shares)
      result[s.name] = {{"rmse", s.rmse}, {"bias", s.bias}, {"noise", s.noise}, {"meaning", s.meaning}};
    result["sampling"]["expected_rmse"] = usual;
    result["reference_mean"] = mean;
    result["width"] = frame_.width, result["height"] = frame_.height;
    result["sets"] = o_.sets, result["paths"] = (o_.paths + kPathParts - 1) / kPathParts * kPathParts;
    result["pixels"] = counted, result["bad_pixels"] = bad;
    result["version"] = api().version(nullptr, nullptr);
    if (o_.json) return result;
    fmt::print("{}, {}, {}x{}; shares of the mean radiance, {:.5g}\n", o_.scene, o_.integrator, frame_.width,
               frame_.height, mean);
    fmt::print("             RMSE       mean       noise of the references\n");
    for (const Share& s : shares)
      fmt::print("{:<11} {:7.3f} %  {:+7.3f} %  {:6.3f} %   {}\n", s.name, 100 * s.rmse, 100 * s.bias, 100 * s.noise,
                 s.meaning);
    fmt::print("sets of virtual lights differ from their mean by {:.3f} % (RMSE): N passes divide that by √N\n",
               100 * usual);
    if (bad > 0) fmt::print("{} pixels NOT FINITE\n", bad);
    return result;
  }

  // Signed maps on one scale: what the parts have in the total shows at a glance.
  void write(const ordered_json& result) const {
    const int width = static_cast<int>(frame_.width), height = static_cast<int>(frame_.height);
    const auto relative = [&](const Pixels& a, const Pixels& b) {
      Pixels shifted(truth_);
      for (size_t i = 0; i < a.size(); ++i) shifted[i] += a[i] - b[i];
      return relative_error_image({shifted, frame_.width, frame_.height}, {truth_, frame_.width, frame_.height});
    };
    const std::pair<const char*, std::vector<float>> maps[] = {{"clustering.png", relative(image_, sum_)},
                                                               {"sampling.png", relative(sum_, expected_)},
                                                               {"clamping.png", relative(expected_, truth_)},
                                                               {"total.png", relative(image_, truth_)}};
    std::vector<float> sizes;
    for (const float e : maps[3].second)
      if (std::isfinite(e)) sizes.push_back(std::abs(e));
    const auto near_top = sizes.begin() + static_cast<ptrdiff_t>(sizes.size() * 95 / 100);
    std::nth_element(sizes.begin(), near_top, sizes.end());
    const double top = round_up_125(std::max(1e-4, static_cast<double>(*near_top)));
    for (const auto& [name, errors] : maps) {
      const ColorImage picture = error_color_map(errors, width, height, true, top);
      io::write_png(path(name), picture.pixels, picture.width, picture.height, 3);
    }
    io::Image image;
    image.width = image.frame_width = width, image.height = image.frame_height = height;
    const Pixels* const images[] = {&image_, &sum_, &expected_, &truth_};
    for (size_t i = 0; i < 4; ++i) image.layers.push_back({kLayers[i], 3, *images[i]});
    io::write_exr(path("errors.exr"), image, false);
    io::write_whole_file(path("errors.json"), io::json_text(result, 2) + "\n");
  }

  const Options& o_;
  io::Library library_;
  ProgressBar bar_;
  io::Handle<lumicut_device> device_{library_.api()};
  io::Handle<lumicut_scene> scene_{library_.api()};
  io::Handle<lumicut_integrator> method_{library_.api()};
  InterruptWatcher watcher_{library_.api()};  // ends before the handles that it may cancel
  std::vector<uint32_t> size_;
  lumicut_render_desc frame_{};
  uint32_t done_ = 0;
  Pixels image_, sum_, expected_, truth_;
  Parts sets_, paths_;
};

}  // namespace

void add_errors(CLI::App& app) {
  auto* command = app.add_subcommand(
      "errors", "Where an image's error comes from: clustering, sampling of the virtual lights, clamping");
  const auto o = std::make_shared<Options>();
  command->add_option("scene", o->scene, kSceneHelp)->required();
  add_setup_options(*command, *o);
  command->add_option("--size", o->size, "WIDTHxHEIGHT in pixels (default: the scene's)");
  command->add_option("--sets", o->sets, "Further sets of virtual lights, whose mean is their expectation")
      ->capture_default_str()
      ->check(CLI::Range(2, 65536));
  command->add_option("--paths", o->paths, "Paths a pixel of the path traced truth")
      ->capture_default_str()
      ->check(CLI::Range(8, 1 << 24));
  command->add_option("--ignore-above", o->ignore_above,
                      "Leave out pixels whose true luminance is at least this (visible lights)");
  command->add_option("-o,--output", o->folder,
                      "Folder for signed maps of each part (PNG), the four images (EXR) and the figures (JSON)");
  command->add_flag("--json", o->json, "Print JSON instead of text");
  command->add_flag("-q,--quiet", o->quiet, "No progress bar");
  command->footer("Example: lumicut errors room.json -i lightcuts --vpls 10000 --size 160x120 -o errors");
  command->callback([o] {
    catch_interrupts();
    ErrorsCommand(*o).run();
  });
}

}  // namespace lumicut::tools
