// lumicut compare: measures of an image against its reference. What each is: film/metrics.h and docs/command_line.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "film/metrics.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "io/text_lines.h"
#include "tools/commands.h"
#include "tools/heat_map.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

namespace {

struct Options {
  std::string image, reference, error_image, flip_image, hdr_flip_image, error_map, signed_error_map;
  std::string layer = "radiance", reference_layer;
  bool json = false, no_flip = false, hdr_flip = false;
  float scale = 32, ignore_above = std::numeric_limits<float>::infinity(), exposure = 0, error_map_top = 0;
};

// The layer of that name, or the only one whose name ends so: "Combined" of "ViewLayer.Combined". "radiance", which other
// programs do not write, is also their only "Combined", only layer of three components or only layer.
const io::ImageLayer* find_layer(const io::Image& image, const std::string& name) {
  if (const auto* found = image.find(name)) return found;
  const auto only = [&](const auto& fits) {
    const io::ImageLayer* found = nullptr;
    int count = 0;
    for (const auto& layer : image.layers)
      if (fits(layer)) found = &layer, ++count;
    return count == 1 ? found : nullptr;
  };
  const auto ending = [&](const std::string& end) {
    return only(
        [&](const io::ImageLayer& layer) { return io::lower("." + layer.name).ends_with("." + io::lower(end)); });
  };
  if (const auto* found = ending(name)) return found;
  if (name != "radiance") return nullptr;
  if (const auto* found = ending("combined")) return found;
  if (const auto* found = only([](const io::ImageLayer& layer) { return layer.components == 3; })) return found;
  return only([](const io::ImageLayer&) { return true; });
}

// The layer as RGB; one component is repeated.
std::vector<float> load(const std::string& path, const std::string& layer, io::Image& image) {
  image = io::read_image(path);
  const io::ImageLayer* found = find_layer(image, layer);
  if (!found) {
    std::string names;
    for (const auto& l : image.layers) names += (names.empty() ? "" : ", ") + l.name;
    throw io::FileError(path, fmt::format("has no layer \"{}\"; it has {}", layer, names));
  }
  if (found->components == 3) return found->pixels;
  std::vector<float> rgb;
  for (const float v : found->pixels) rgb.insert(rgb.end(), {v, v, v});
  return rgb;
}

// Writes what is computed already.
using Writer = std::function<void()>;

Writer grey_writer(const std::string& path, const std::vector<float>& values, const io::Image& image) {
  std::vector<uint8_t> bytes;
  for (const float v : values) bytes.push_back(static_cast<uint8_t>(v * 255.0f + 0.5f));
  return [path, bytes = std::move(bytes), width = image.width, height = image.height] {
    io::write_png(path, bytes, width, height, 1);
  };
}

bool is_exr(const std::string& path) { return path.size() > 4 && path.substr(path.size() - 4) == ".exr"; }

// The relative error of every pixel: false colour in a PNG, or the numbers in an EXR.
Writer error_map_writer(const std::string& path, std::vector<float> errors, const io::Image& frame, bool with_sign,
                        double top) {
  if (!with_sign)
    for (float& e : errors) e = std::abs(e);
  if (is_exr(path)) {
    io::Image out;
    out.width = frame.width, out.height = frame.height, out.x0 = frame.x0, out.y0 = frame.y0;
    out.frame_width = frame.frame_width, out.frame_height = frame.frame_height;
    out.layers.push_back({with_sign ? "signed_relative_error" : "relative_error", 1, std::move(errors)});
    return [path, out = std::move(out)] { io::write_exr(path, out, false); };
  }
  return [path, picture = error_color_map(errors, frame.width, frame.height, with_sign, top)] {
    io::write_png(path, picture.pixels, picture.width, picture.height, 3);
  };
}

void compare(const Options& options) {
  const std::vector<std::string> outputs = {options.error_image, options.flip_image, options.hdr_flip_image,
                                            options.error_map, options.signed_error_map};
  io::check_distinct(outputs, {options.image, options.reference});
  for (const auto& path : outputs)
    if (!path.empty()) io::check_writable(path);
  auto computing = std::make_unique<NothingToLose>();
  std::vector<Writer> writers;
  io::Image a, b;
  const auto image_pixels = load(options.image, options.layer, a);
  const auto reference_pixels =
      load(options.reference, options.reference_layer.empty() ? options.layer : options.reference_layer, b);
  if (a.width != b.width || a.height != b.height || a.x0 != b.x0 || a.y0 != b.y0)
    throw io::FileError(options.image,
                        fmt::format("shows {} x {} pixels from ({}, {}), but {} shows {} x {} from ({}, {})", a.width,
                                    a.height, a.x0, a.y0, options.reference, b.width, b.height, b.x0, b.y0));
  const RgbImage image{image_pixels, static_cast<uint32_t>(a.width), static_cast<uint32_t>(a.height)};
  const RgbImage reference{reference_pixels, image.width, image.height};
  MetricOptions metric_options;
  metric_options.ignore_above = options.ignore_above;
  metric_options.exposure = options.exposure;
  metric_options.flip = !options.no_flip;
  metric_options.hdr_flip = options.hdr_flip;
  const Metrics m = compare_images(image, reference, metric_options);
  nlohmann::ordered_json json = {
      {"rmse", m.rmse},
      {"lmse", m.lmse},
      {"mean_relative_error", m.mean_relative_error},
      {"p95_relative_error", m.p95_relative_error},
      {"p99_relative_error", m.p99_relative_error},
      {"max_relative_error", m.max_relative_error},
      {"mean_relative_error_channels", m.mean_relative_error_channels},
      {"rmse_absolute", m.rmse_absolute},
      {"rmse_display", m.rmse_display},
      {"mrse", m.mrse},
      {"smape", m.smape},
      {"bias", m.bias},
      {"flip", nullptr},
      {"hdr_flip", nullptr},
      {"reference_mean", m.reference_mean},
      {"exposure", m.exposure},
      {"pixels", m.pixels},
      {"ignored_pixels", m.ignored},
      {"bad_pixels", m.bad_pixels},
  };
  if (!options.no_flip) json["flip"] = m.flip;
  if (options.hdr_flip) json["hdr_flip"] = m.hdr_flip;
  const auto exposure = static_cast<float>(m.exposure);
  if (!options.error_image.empty())
    writers.push_back(grey_writer(options.error_image, error_image(image, reference, exposure, options.scale), a));
  if (!options.error_map.empty() || !options.signed_error_map.empty()) {
    const std::vector<float> errors = relative_error_image(image, reference);
    const auto top = static_cast<double>(options.error_map_top);
    if (!options.error_map.empty()) writers.push_back(error_map_writer(options.error_map, errors, a, false, top));
    if (!options.signed_error_map.empty())
      writers.push_back(error_map_writer(options.signed_error_map, errors, a, true, top));
  }
  if (!options.flip_image.empty()) {
    std::vector<float> x(image_pixels), y(reference_pixels);
    for (float& v : x) v *= exposure;
    for (float& v : y) v *= exposure;
    writers.push_back(grey_writer(
        options.flip_image,
        flip_image({x, image.width, image.height}, {y, image.width, image.height}, metric_options.pixels_per_degree),
        a));
  }
  if (!options.hdr_flip_image.empty())
    writers.push_back(grey_writer(options.hdr_flip_image,
                                  hdr_flip_image(image, reference, metric_options.pixels_per_degree).image, a));
  // From here a stop would leave some files and not others.
  computing.reset();
  stop_if_interrupted();
  for (const Writer& write : writers) write();
  if (options.json) {
    fmt::print("{}\n", io::json_text(json, 2));
    return;
  }
  fmt::print("RMSE                 {:.5f}  of the reference's mean, {:.5g}\n", m.rmse, m.reference_mean);
  fmt::print("LMSE                 {:.5g}\n", m.lmse);
  fmt::print("mean relative error  {:.3f} %   p95 {:.2f} %   p99 {:.2f} %\n", 100 * m.mean_relative_error,
             100 * m.p95_relative_error, 100 * m.p99_relative_error);
  fmt::print("MRSE {:.5g}   SMAPE {:.5g}   bias {:+.3f} %", m.mrse, m.smape, 100 * m.bias);
  if (!options.no_flip) fmt::print("   FLIP {:.5f}", m.flip);
  if (options.hdr_flip) fmt::print("   HDR-FLIP {:.5f}", m.hdr_flip);
  fmt::print("\n{} pixels compared", m.pixels);
  if (m.ignored > 0) fmt::print(", {} ignored (luminance of at least {})", m.ignored, options.ignore_above);
  if (m.bad_pixels > 0) fmt::print(", {} NOT FINITE", m.bad_pixels);
  fmt::print("\n");
}

}  // namespace

void add_compare(CLI::App& app) {
  auto* command = app.add_subcommand("compare", "Measure an image against its reference");
  const auto o = std::make_shared<Options>();
  command->add_option("image", o->image, "The image to judge: any format that OpenImageIO reads")->required();
  command->add_option("reference", o->reference, "The image that counts as right")->required();
  command->add_flag("--json", o->json, "Print JSON instead of text");
  command->add_option("--error-image", o->error_image, "Write a grey PNG of the differences")
      ->check(picture_of({".png"}));
  command->add_option("--scale", o->scale, "Factor of the differences in that image")
      ->capture_default_str()
      ->check(number_in(1e-30, 1e30));
  command->add_option("--flip-image", o->flip_image, "Write a grey PNG of FLIP")->check(picture_of({".png"}));
  command
      ->add_option("--error-map", o->error_map,
                   "Write each pixel's relative error: false colour with a log colour bar (PNG), or the numbers (EXR)")
      ->check(picture_of({".png", ".exr"}));
  command
      ->add_option("--signed-error-map", o->signed_error_map,
                   "The same with its sign: red is too bright, blue too dark")
      ->check(picture_of({".png", ".exr"}));
  command
      ->add_option("--error-map-top", o->error_map_top,
                   "Relative error at the colour bar's top (default: 1; of signed maps the 99th percentile, rounded)")
      ->check(number_in(1e-4, 1e4));
  command
      ->add_option("--ignore-above", o->ignore_above,
                   "Leave out pixels whose reference luminance is at least this (visible lights)")
      ->check(number_in(0, 1e38));
  command
      ->add_option("--exposure", o->exposure,
                   "Factor from radiance to [0,1] for display measures (default: 0.18 / geometric mean)")
      ->check(number_in(0, 1e30));
  command->add_option("--layer", o->layer, "Layer to compare, of both images")->capture_default_str();
  command->add_option("--reference-layer", o->reference_layer, "Layer of the reference, where it has another name");
  command->add_flag("--no-flip", o->no_flip, "Do without FLIP, the slowest measure");
  command->add_flag("--hdr-flip", o->hdr_flip,
                    "HDR-FLIP too: FLIP's greatest over all exposures; takes several times as long");
  command->add_option("--hdr-flip-image", o->hdr_flip_image, "Write a grey PNG of HDR-FLIP")
      ->check(picture_of({".png"}));
  command->callback([o] {
    catch_interrupts();
    compare(*o);
  });
}

}  // namespace lumicut::tools
