// lumicut compare: measures of an image against its reference. What each is: film/metrics.h and docs/command_line.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "film/metrics.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "tools/commands.h"

namespace lumicut::tools {

namespace {

struct Options {
  std::string image, reference, error_image, flip_image, layer = "radiance";
  bool json = false, no_flip = false;
  float scale = 32, ignore_above = std::numeric_limits<float>::infinity(), exposure = 0;
};

// The layer as RGB; one component is repeated.
std::vector<float> load(const std::string& path, const std::string& layer, io::Image& image) {
  image = io::read_exr(path);
  const io::ImageLayer* found = image.find(layer);
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

void write_grey(const std::string& path, const std::vector<float>& values, const io::Image& image) {
  std::vector<uint8_t> bytes;
  for (const float v : values) bytes.push_back(static_cast<uint8_t>(v * 255.0f + 0.5f));
  io::write_png(path, bytes, image.width, image.height, 1);
}

void compare(const Options& options) {
  io::Image a, b;
  const auto image_pixels = load(options.image, options.layer, a);
  const auto reference_pixels = load(options.reference, options.layer, b);
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
      {"reference_mean", m.reference_mean},
      {"exposure", m.exposure},
      {"pixels", m.pixels},
      {"ignored_pixels", m.ignored},
      {"bad_pixels", m.bad_pixels},
  };
  if (!options.no_flip) json["flip"] = m.flip;
  const auto exposure = static_cast<float>(m.exposure);
  if (!options.error_image.empty())
    write_grey(options.error_image, error_image(image, reference, exposure, options.scale), a);
  if (!options.flip_image.empty()) {
    std::vector<float> x(image_pixels), y(reference_pixels);
    for (float& v : x) v *= exposure;
    for (float& v : y) v *= exposure;
    write_grey(
        options.flip_image,
        flip_image({x, image.width, image.height}, {y, image.width, image.height}, metric_options.pixels_per_degree),
        a);
  }
  if (options.json) {
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print("RMSE                 {:.5f}  of the reference's mean, {:.5g}\n", m.rmse, m.reference_mean);
  fmt::print("LMSE                 {:.5g}\n", m.lmse);
  fmt::print("mean relative error  {:.3f} %   p95 {:.2f} %   p99 {:.2f} %\n", 100 * m.mean_relative_error,
             100 * m.p95_relative_error, 100 * m.p99_relative_error);
  fmt::print("MRSE {:.5g}   SMAPE {:.5g}   bias {:+.3f} %", m.mrse, m.smape, 100 * m.bias);
  if (!options.no_flip) fmt::print("   FLIP {:.5f}", m.flip);
  fmt::print("\n{} pixels compared", m.pixels);
  if (m.ignored > 0) fmt::print(", {} ignored (luminance of at least {})", m.ignored, options.ignore_above);
  if (m.bad_pixels > 0) fmt::print(", {} NOT FINITE", m.bad_pixels);
  fmt::print("\n");
}

}  // namespace

void add_compare(CLI::App& app) {
  auto* command = app.add_subcommand("compare", "Measure an image against its reference");
  const auto o = std::make_shared<Options>();
  command->add_option("image", o->image, "The EXR to judge")->required();
  command->add_option("reference", o->reference, "The EXR that counts as right")->required();
  command->add_flag("--json", o->json, "Print JSON instead of text");
  command->add_option("--error-image", o->error_image, "Write a grey PNG of the differences");
  command->add_option("--scale", o->scale, "Factor of the differences in that image")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->add_option("--flip-image", o->flip_image, "Write a grey PNG of FLIP");
  command->add_option("--ignore-above", o->ignore_above,
                      "Leave out pixels whose reference luminance is at least this (visible lamps)");
  command
      ->add_option("--exposure", o->exposure,
                   "Factor from radiance to [0,1] for display measures (default: 0.18 / geometric mean)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--layer", o->layer, "Layer to compare")->capture_default_str();
  command->add_flag("--no-flip", o->no_flip, "Do without FLIP, the slowest measure");
  command->callback([o] { compare(*o); });
}

}  // namespace lumicut::tools
