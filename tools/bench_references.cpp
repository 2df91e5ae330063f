#include "tools/bench_references.h"

#include <fmt/format.h>

#include <filesystem>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "tools/child_process.h"
#include "tools/commands.h"

namespace lumicut::tools {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

std::string file_name_of(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
                       c == '-' || c == '=' || c == '_';
    if (static_cast<unsigned char>(c) >= 0x80)
      out += fmt::format("{:02x}", static_cast<unsigned char>(c));  // names of other scripts stay apart
    else if (plain || (!out.empty() && out.back() != '_'))
      out += plain ? c : '_';
  }
  return out;
}

std::string BenchGroup::name() const {
  std::string text = file_name_of(scene->name);
  if (samples > 0) text += fmt::format(".{}spp", samples);
  if (vpls > 0) text += fmt::format(".{}vpls", vpls);
  return text + fmt::format(".seed{}", seed);
}

std::vector<std::string> BenchGroup::arguments() const {
  std::vector<std::string> all = {"render",
                                  scene->file,
                                  "-q",
                                  "--verbosity",
                                  "0",
                                  "--accel",
                                  plan->accel,
                                  "--rays",
                                  plan->rays,
                                  "--threads",
                                  std::to_string(plan->threads)};
  if (plan->strict) all.emplace_back("--strict");
  const auto add = [&](const std::string& option, const std::string& value) {
    all.push_back(option);
    all.push_back(value);
  };
  if (!scene->size.empty()) add("--size", fmt::format("{}x{}", scene->size[0], scene->size[1]));
  if (samples > 0) add("--spp", std::to_string(samples));
  if (!scene->vpl_file.empty()) add("--vpl-in", scene->vpl_file);
  if (vpls > 0) add("--vpls", std::to_string(vpls));
  add("--seed", std::to_string(seed));
  for (const auto& [name, value] : scene->parameters) add("-p", name + "=" + value);
  return all;
}

std::string file_hash(const std::string& path) {
  uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : io::read_whole_file(path)) hash = (hash ^ static_cast<uint8_t>(c)) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

RenderStats render_in_child(const std::vector<std::string>& arguments, const std::string& stats_file,
                            const std::function<void()>& waiting) {
  std::vector<std::string> all = arguments;
  all.push_back("--stats");
  all.push_back(stats_file);
  const ChildResult child = run_self(all, waiting);
  if (child.exit_code != kOk) {
    std::string text = child.messages;
    while (!text.empty() && text.back() == '\n') text.pop_back();
    const std::string prefix = "lumicut: ";
    if (const size_t line = text.rfind('\n'); line != std::string::npos) text = text.substr(line + 1);
    if (text.rfind(prefix, 0) == 0) text = text.substr(prefix.size());
    if (text.empty()) text = fmt::format("ended with code {}", child.exit_code);
    if (child.exit_code == kBadFile) {
      // The message begins with the file's name.
      const size_t colon = text.find(": ");
      if (colon != std::string::npos) throw io::FileError(text.substr(0, colon), text.substr(colon + 2));
    }
    throw std::runtime_error(text);
  }
  auto stats = io::parse_json<ordered_json>(io::read_whole_file(stats_file), stats_file);
  std::error_code code;
  fs::remove(stats_file, code);
  return stats;
}

namespace {

// {"preprocess", "render"} of a whole frame: what squares took, times what they leave out.
void describe_times(const RenderStats& stats, ordered_json& info) {
  const double render = stats["phases"].value("render", 0.0), total = stats["seconds"].get<double>();
  const double pixels = stats["width"].get<double>() * stats["height"].get<double>(),
               rendered = stats["rendered_pixels"].get<double>();
  info["preprocess_seconds"] = total - render;
  info["render_seconds"] = render * pixels / rendered;
  info["render_seconds_estimated"] = rendered < pixels;
  info["rendered_pixels"] = rendered;
  for (const char* key : {"rays_per_pixel", "clusters_per_pixel", "peak_bytes", "vpls", "version"})
    info[key] = stats[key];
}

BenchReference load(const std::string& path, ordered_json info) {
  const io::Image image = io::read_image(path);
  const io::ImageLayer* radiance = image.find("radiance");
  if (radiance == nullptr || radiance->components != 3) throw io::FileError(path, "has no radiance");
  BenchReference r;
  r.info = std::move(info);
  r.width = static_cast<uint32_t>(image.width), r.height = static_cast<uint32_t>(image.height);
  r.pixels = radiance->pixels;
  return r;
}

}  // namespace

BenchReference get_reference(const BenchGroup& group, const std::string& folder, const std::string& lights_hash,
                             const std::function<void(const std::string&)>& say, const std::function<void()>& waiting) {
  ordered_json info;
  info["group"] = group.name();
  if (!group.scene->reference.empty()) {
    info["file"] = group.scene->reference;
    return load(group.scene->reference, info);
  }
  const std::string base = (fs::path(folder) / "references" / group.name()).string();
  const std::string image = base + ".exr", notes = base + ".json";
  std::vector<std::string> arguments = group.arguments();
  arguments.insert(arguments.end(), {"-i", "exhaustive", "--layers", "radiance"});
  if (group.scene->squares > 0) arguments.insert(arguments.end(), {"--squares", std::to_string(group.scene->squares)});
  // How rays are traced and on how many threads changes the time alone; yet a time must be of the same.
  ordered_json key = {{"arguments", arguments}, {"lights", lights_hash}};
  std::error_code code;
  if (fs::is_regular_file(image, code) && fs::is_regular_file(notes, code)) {
    ordered_json old;
    try {
      old = io::parse_json<ordered_json>(io::read_whole_file(notes), notes);
    } catch (const io::FileError&) {  // broken: rendered anew
    }
    if (old.is_object() && old.contains("key") && old["key"] == key && old.contains("info")) {
      info = old["info"];
      info["cached"] = true;
      return load(image, info);
    }
  }
  say(fmt::format("reference of {}", group.name()));
  info["file"] = fs::path("references") / (group.name() + ".exr");
  arguments.insert(arguments.end(), {"-o", image});
  describe_times(render_in_child(arguments, base + ".stats.json", waiting), info);
  io::write_whole_file(notes, io::json_text(ordered_json{{"key", key}, {"info", info}}, 2) + "\n");
  info["cached"] = false;
  return load(image, info);
}

}  // namespace lumicut::tools
