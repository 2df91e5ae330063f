// lumicut mix: the images of light groups, put together anew: brighter, dimmer, coloured or out, without a render.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "tools/commands.h"
#include "tools/exposed_png.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

namespace {

constexpr char kPrefix[] = "radiance.";

struct Options {
  std::string input, output, png;
  std::vector<std::string> gains;
  float others = 1.0f, exposure = 0.0f;
  bool half = false;
};

struct Gain {
  float rgb[3];
};

float number(const std::string& word, const std::string& option) {
  float value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value))
    throw UsageError(fmt::format("--gain {}: \"{}\" is not a number", option, word));
  if (value < 0) throw UsageError(fmt::format("--gain {}: {} is below 0", option, word));
  return value;
}

// "3=0.5" or "3=1,0.8,0.6".
std::pair<std::string, Gain> parse_gain(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw UsageError(fmt::format("--gain {}: is not GROUP=FACTOR or GROUP=R,G,B", text));
  std::vector<float> values;
  std::stringstream words(text.substr(equals + 1));
  for (std::string word; std::getline(words, word, ',');) values.push_back(number(word, text));
  if (values.size() == 1) values.resize(3, values[0]);
  if (values.size() != 3) throw UsageError(fmt::format("--gain {}: takes one number or three", text));
  return {text.substr(0, equals), {{values[0], values[1], values[2]}}};
}

void mix(const Options& o) {
  std::map<std::string, Gain> gains;
  for (const auto& text : o.gains)
    if (const auto [group, gain] = parse_gain(text); !gains.emplace(group, gain).second)
      throw UsageError(fmt::format("--gain {}: group {} is given twice", text, group));
  auto computing = std::make_unique<NothingToLose>();
  const io::Image image = io::read_image(o.input);
  io::Image out = image;
  out.layers = {{"radiance", 3, std::vector<float>(size_t{3} * image.width * image.height, 0.0f)}};
  std::vector<float>& sum = out.layers[0].pixels;
  std::string names;
  for (const auto& layer : image.layers) {
    if (layer.components != 3 || layer.name.rfind(kPrefix, 0) != 0) continue;
    const std::string group = layer.name.substr(sizeof(kPrefix) - 1);
    names += (names.empty() ? "" : ", ") + group;
    const auto found = gains.find(group);
    const Gain gain = found == gains.end() ? Gain{{o.others, o.others, o.others}} : found->second;
    if (found != gains.end()) gains.erase(found);
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += layer.pixels[i] * gain.rgb[i % 3];
  }
  if (names.empty())
    throw io::FileError(o.input, "has no layers radiance.GROUP; `lumicut render --groups` writes them");
  if (!gains.empty())
    throw UsageError(
        fmt::format("--gain: {} has no light group {}; there are {}", o.input, gains.begin()->first, names));
  // Layers that light does not change stay: alpha, depth, normal ...
  for (const auto& layer : image.layers)
    if (layer.name == "alpha" || layer.name == "depth" || layer.name == "normal" || layer.name == "albedo" ||
        layer.name == "position")
      out.layers.push_back(layer);
  computing.reset();
  stop_if_interrupted();
  if (!o.output.empty()) io::write_exr(o.output, out, o.half);
  if (!o.png.empty())
    write_exposed_png(o.png, {sum, static_cast<uint32_t>(out.width), static_cast<uint32_t>(out.height)}, o.exposure);
}

}  // namespace

void add_mix(CLI::App& app) {
  auto* command = app.add_subcommand("mix", "Put the images of light groups together anew, without a render");
  const auto o = std::make_shared<Options>();
  command->add_option("image", o->input, "EXR that `lumicut render --groups` wrote")->required();
  command->add_option("--gain", o->gains, "GROUP=FACTOR or GROUP=R,G,B: how bright a group is; may be repeated");
  command->add_option("--others", o->others, "Factor of the groups that --gain does not name")
      ->capture_default_str()
      ->check(number_in(0, 1e30));
  command->add_option("-o,--output", o->output, "EXR to write")->check(picture_of({".exr"}));
  add_png_options(*command, o->png, o->exposure);
  command->add_flag("--half", o->half, "16 bits a number in the EXR instead of 32");
  command->footer("Example: lumicut mix room.exr --gain 1=0 --gain 2=1,0.8,0.6 -o evening.exr --png evening.png");
  command->callback([o] {
    if (o->output.empty() && o->png.empty()) throw UsageError("mix: nothing to write; give -o out.exr or --png");
    io::check_distinct({o->output, o->png}, {o->input});
    for (const auto& path : {o->output, o->png})
      if (!path.empty()) io::check_writable(path);
    catch_interrupts();
    mix(*o);
  });
}

}  // namespace lumicut::tools
