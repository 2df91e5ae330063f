#include "tools/report_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "film/metrics.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "tools/bench_table.h"
#include "tools/heat_map.h"

namespace lumicut::tools {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

std::string base64(const std::string& bytes) {
  static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    for (size_t k = 0; k < 3; ++k) word = word << 8 | (i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : 0);
    for (size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : kDigits[word >> (18 - 6 * k) & 63];
  }
  return out;
}

// Means over squares of `factor` pixels; what is not finite is left out, and stays where nothing else is.
std::vector<float> shrink(const std::vector<float>& values, int width, int height, int components, int factor) {
  if (factor == 1) return values;
  const int w = (width + factor - 1) / factor, h = (height + factor - 1) / factor;
  std::vector<float> out(static_cast<size_t>(w) * static_cast<size_t>(h) * static_cast<size_t>(components));
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (int c = 0; c < components; ++c) {
        double sum = 0, count = 0;
        for (int v = y * factor; v < std::min(height, (y + 1) * factor); ++v)
          for (int u = x * factor; u < std::min(width, (x + 1) * factor); ++u) {
            const float value = values[static_cast<size_t>((v * width + u) * components + c)];
            if (std::isfinite(value)) sum += double{value}, ++count;
          }
        out[static_cast<size_t>((y * w + x) * components + c)] =
            count > 0 ? static_cast<float>(sum / count) : std::numeric_limits<float>::quiet_NaN();
      }
  return out;
}

// The images of one group.
class GroupBuilder {
 public:
  GroupBuilder(std::string folder, int most) : folder_(std::move(folder)), most_(most) {}

  ReportGroup build(const std::string& name, const std::vector<const ordered_json*>& rows) {
    group_.name = name;
    group_.scene = (*rows[0]).at("scene").get<std::string>();
    const ordered_json& first = *rows[0];
    if (first.contains("reference")) load(first.at("reference").get<std::string>(), reference_);
    for (const ordered_json* row : rows) {
      if (!row->contains("image")) continue;
      io::Image image;
      if (load((*row).at("image").get<std::string>(), image))
        runs_.emplace_back((*row).at("run").get<std::string>(), image);
    }
    if (runs_.empty()) return group_;
    show_radiance();
    show_errors();
    for (const CountLayer& layer : kCountLayers) show_counts(layer);
    return group_;
  }

 private:
  bool load(const std::string& file, io::Image& image) {
    const fs::path path = fs::path(file).is_absolute() ? fs::path(file) : fs::path(folder_) / file;
    std::error_code code;
    if (!fs::is_regular_file(path, code)) {
      group_.missing.push_back(path.string());
      return false;
    }
    image = io::read_image(path.string());
    const io::ImageLayer* radiance = image.find("radiance");
    if (radiance == nullptr || radiance->components != 3) throw io::FileError(path.string(), "has no radiance");
    return true;
  }

  int factor() const {
    return std::max(1, (std::max(runs_[0].second.width, runs_[0].second.height) + most_ - 1) / most_);
  }

  void add(const std::string& run, const std::string& kind, const std::string& what, const ColorImage& picture) {
    const std::string label = what.empty() ? run : run + ": " + what;
    group_.pictures.push_back(
        {label, run, kind,
         "data:image/png;base64," + base64(io::encode_png(label, picture.pixels, picture.width, picture.height, 3)),
         picture.width, picture.height});
  }

  ColorImage exposed(const io::Image& image, float& exposure) const {
    const int f = factor();
    const std::vector<float> small = shrink(image.find("radiance")->pixels, image.width, image.height, 3, f);
    ColorImage out{(image.width + f - 1) / f, (image.height + f - 1) / f, {}};
    const RgbImage rgb{small, static_cast<uint32_t>(out.width), static_cast<uint32_t>(out.height)};
    if (!(exposure > 0)) exposure = auto_exposure(rgb);
    out.pixels = to_srgb8(rgb, exposure);
    return out;
  }

  // Squares alone are no picture: then the reference is not shown.
  bool reference_is_whole() const {
    if (reference_.layers.empty()) return false;
    const auto& pixels = reference_.find("radiance")->pixels;
    return std::all_of(pixels.begin(), pixels.end(), [](float v) { return std::isfinite(v); });
  }

  void show_radiance() {
    float exposure = 0;
    if (reference_is_whole()) add("reference", "image", "", exposed(reference_, exposure));
    for (const auto& [run, image] : runs_) add(run, "image", "", exposed(image, exposure));
  }

  void show_errors() {
    if (reference_.layers.empty()) return;
    FalseColor relative, with_sign;
    relative.percent = with_sign.percent = true;
    relative.low = 1e-3, relative.high = 1;
    with_sign.scale = ColorScale::diverging, with_sign.high = 0.1;
    bool any = false;
    for (const auto& [run, image] : runs_) {
      if (image.width != reference_.width || image.height != reference_.height) continue;
      const auto w = static_cast<uint32_t>(image.width), h = static_cast<uint32_t>(image.height);
      const std::vector<float> errors =
          relative_error_image({image.find("radiance")->pixels, w, h}, {reference_.find("radiance")->pixels, w, h});
      std::vector<float> sizes = errors;
      for (float& e : sizes) e = std::abs(e);
      add(run, "error", "relative error", colored(sizes, image, relative));
      add(run, "signed", "signed error", colored(errors, image, with_sign));
      any = true;
    }
    if (!any) return;
    group_.scales.emplace_back("relative error, of the pixel's own radiance", relative);
    group_.scales.emplace_back("signed error (red: too bright)", with_sign);
  }

  // One scale for all runs, or their maps could not be compared.
  void show_counts(const CountLayer& layer) {
    std::vector<float> all;
    for (const auto& [run, image] : runs_)
      if (const io::ImageLayer* counts = image.find(layer.name))
        all.insert(all.end(), counts->pixels.begin(), counts->pixels.end());
    if (std::none_of(all.begin(), all.end(), [](float v) { return v > 0; })) return;
    FalseColor scale;
    const auto range = decade_range(all, 0.1);
    scale.low = range[0], scale.high = range[1];
    for (const auto& [run, image] : runs_) {
      const io::ImageLayer* counts = image.find(layer.name);
      if (counts && std::any_of(counts->pixels.begin(), counts->pixels.end(), [](float v) { return v > 0; }))
        add(run, layer.name, layer.title, colored(counts->pixels, image, scale));
    }
    group_.scales.emplace_back(layer.title, scale);
  }

  ColorImage colored(const std::vector<float>& values, const io::Image& image, const FalseColor& scale) const {
    const int f = factor();
    return false_color(shrink(values, image.width, image.height, 1, f), (image.width + f - 1) / f,
                       (image.height + f - 1) / f, scale);
  }

  std::string folder_;
  int most_;
  ReportGroup group_;
  io::Image reference_;
  std::vector<std::pair<std::string, io::Image>> runs_;
};

}  // namespace

std::vector<ReportGroup> report_groups(const ordered_json& results, const std::string& results_file, int most) {
  std::vector<ReportGroup> groups;
  std::vector<std::string> done;
  const auto rows = complete_rows(results);
  for (const ordered_json* row : rows) {
    const std::string name = (*row).at("group").get<std::string>();
    if (std::find(done.begin(), done.end(), name) != done.end()) continue;
    done.push_back(name);
    std::vector<const ordered_json*> mine;
    for (const ordered_json* other : rows)
      if ((*other).at("group") == name) mine.push_back(other);
    ReportGroup group = GroupBuilder(fs::path(results_file).parent_path().string(), most).build(name, mine);
    if (!group.pictures.empty() || !group.missing.empty()) groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace lumicut::tools
