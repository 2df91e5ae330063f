#include "io/scene_mitsuba.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <utility>

#include "io/curves.h"
#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/mitsuba_upgrade.h"
#include "io/scene_builder.h"
#include "io/scene_defaults.h"
#include "io/serialized_mesh.h"
#include "io/srgb.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

using Node = pugi::xml_node;

constexpr int kDeepest = 64;                        // of elements and files inside of each other
constexpr uint64_t kMostBytes = uint64_t{1} << 30;  // of one file
constexpr size_t kMostFiles = 1000;

class Reader {
 public:
  explicit Reader(const std::string& path) : build_(path) {}

  SceneData read() {
    build_.scene.width = 768, build_.scene.height = 576;
    grey_ = build_.add_material("no bsdf", default_material());
    read_file(build_.path());
    for (const Node& node : scene_) element(node);
    return build_.finish(has_camera_);
  }

 private:
  [[noreturn]] void fail(const Node& node, const std::string& text) const {
    std::string where = fmt::format("<{}", node.name());
    for (const char* key : {"type", "name", "id"})
      if (node.attribute(key)) where += fmt::format(" {}=\"{}\"", key, shown(node.attribute(key).value()));
    const ValuePlace at = place(node, "");
    const std::string line = at.line > 0 ? fmt::format("line {}: ", at.line) : "";
    throw FileError(at.file, fmt::format("{}{}>: {}", line, where, text));
  }
  // Where it stands, and what a warning calls a value there.
  ValuePlace place(const Node& node, const std::string& name) const {
    const auto file = files_.find(node.root().hash_value());
    if (file == files_.end()) return {build_.path(), 0, name};
    const auto& [path, ends] = file->second;
    const ptrdiff_t at = node.offset_debug();  // below 0: not known
    const auto line = std::lower_bound(ends.begin(), ends.end(), static_cast<size_t>(std::max<ptrdiff_t>(at, 0)));
    return {path, at < 0 ? 0 : static_cast<int>(line - ends.begin()) + 1, name};
  }
  // Of a material: <bsdf type="plastic">'s.
  ValuePlace value_place(const Node& node, const std::string& name) const {
    const Node c = child(node, name);
    return place(c ? c : node, fmt::format("{} of <bsdf type=\"{}\">", name, shown(text(node, "type"))));
  }
  double cut(const Node& node, const char* name, double value, double low, double high) {
    return build_.cut(value, low, high, value_place(node, name));
  }
  Vec cut(const Node& node, const char* name, const Vec& value, double low, double high) {
    return *constant_of(build_.cut(constant_paint(value), low, high, value_place(node, name)));
  }
  // A material's value from 0 to 1.
  PaintRef share(const Node& node, const char* name, double otherwise, bool numbers_alone = false) {
    return build_.cut(paint(node, name, otherwise, numbers_alone), 0, 1, value_place(node, name));
  }

  // ---- Files

  void read_file(const std::string& path) {
    if (++depth_ > kDeepest || documents_.size() >= kMostFiles)
      throw FileError(path, "files include each other without end");
    check_regular_file(path);
    opened_.push_back(path);
    const std::string text = read_whole_file(path, kMostBytes);
    documents_.emplace_back();
    const auto result = documents_.back().load_buffer(text.data(), text.size());
    if (const size_t zero = text.find('\0'); result.encoding == pugi::encoding_utf8 && zero != std::string::npos)
      throw FileError(path,
                      fmt::format("line {}: a zero byte",
                                  1 + std::count(text.begin(), text.begin() + static_cast<ptrdiff_t>(zero), '\n')));
    if (!result) {
      const auto end = text.begin() + std::clamp<ptrdiff_t>(result.offset, 0, static_cast<ptrdiff_t>(text.size()));
      throw FileError(path, fmt::format("line {}: {}", 1 + std::count(text.begin(), end, '\n'), result.description()));
    }
    auto& [name, ends] = files_[documents_.back().hash_value()];
    name = path;
    if (result.encoding == pugi::encoding_utf8)  // else offsets are of other bytes
      for (size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1)) ends.push_back(at);
    const Node root = documents_.back().document_element();
    if (std::string(root.name()) != "scene")
      throw FileError(path, fmt::format("its first element is <{}>, not <scene>", shown(root.name())));
    for (Node next = root.next_sibling(); next; next = next.next_sibling())
      if (next.type() == pugi::node_element) fail(next, "stands after the end of the <scene>");
    upgrade_mitsuba(root);
    const std::string folder = std::filesystem::path(path).parent_path().string();
    for (const Node& child : root.children()) gather(child, folder);
    opened_.pop_back();
    --depth_;
  }
  // Names first: what refers to them may stand before them. `folder`: that of the file.
  void gather(const Node& node, const std::string& folder) {
    const std::string name = node.name();
    if (node.type() != pugi::node_element) return;
    if (name == "default") {
      defaults_.emplace(text(node, "name"), text(node, "value"));
    } else if (name == "include") {
      const std::string file = found_file(node, "file", text(node, "filename"));
      const auto is_this = [&](const std::string& open) { return same_file(open, file); };
      if (std::any_of(opened_.begin(), opened_.end(), is_this))
        fail(node,
             fmt::format("{} includes itself{}", shown(file), is_this(opened_.back()) ? "" : ", by way of others"));
      read_file(file);
    } else if (name == "path") {
      const std::string value = text(node, "value");
      if (value.empty()) fail(node, "names no folder");
      const auto path = std::filesystem::path(folder) / value;
      std::error_code code;
      if (!std::filesystem::is_directory(path, code)) fail(node, fmt::format("{} is no folder", shown(value)));
      build_.search_in(path.string());
    } else if (name == "alias") {
      const auto known = ids_.find(text(node, "id"));
      if (known == ids_.end()) fail(node, "there is no such id");
      ids_[text(node, "as")] = known->second;
    } else {
      remember(node);
      scene_.push_back(node);
    }
  }
  // Its id and those of what it holds.
  void remember(const Node& node) {
    if (++depth_ > kDeepest) fail(node, "elements lie in each other without end");
    if (node.attribute("id") && std::string(node.name()) != "ref")
      if (const auto [known, fresh] = ids_.emplace(text(node, "id"), node); !fresh) {
        const ValuePlace other = place(known->second, "");
        fail(node, fmt::format("line {} of {} has an element of that id, too", other.line, other.file));
      }
    for (const Node& c : node.children())
      if (c.type() == pugi::node_element) remember(c);
    --depth_;
  }

  void element(const Node& node) {
    const std::string name = node.name();
    if (name == "integrator") {
      integrator(node);
    } else if (name == "medium" || name == "sampler" || name == "bsdf" || name == "texture" || name == "spectrum") {
      // read where they are used
    } else if (name == "emitter") {
      emitter(node);
    } else if (name == "sensor") {
      sensor(node);
    } else if (name == "shape") {
      if (text(node, "type") != "shapegroup") shape(node, {}, {});
    } else {
      build_.leave_out(fmt::format("<{}>", name));
    }
  }
  // What hides lamps may lie in an integrator that the outer one holds.
  void integrator(const Node& node) {
    if (++depth_ > kDeepest) fail(node, "integrators lie in each other without end");
    if (truth(node, "hide_emitters", false)) build_.emitters_seen = false;
    for (const Node& c : node.children("integrator")) integrator(c);
    --depth_;
  }

  // ---- Values

  // An attribute, with $NAME replaced by what <default> says.
  std::string text(const Node& node, const char* key) const {
    std::string value = node.attribute(key).value();
    size_t begin = 0;
    for (int times = 0; times < 100 && (begin = value.find('$', begin)) != std::string::npos; ++times) {
      size_t end = begin + 1;
      while (end < value.size() && (std::isalnum(static_cast<unsigned char>(value[end])) || value[end] == '_')) ++end;
      const auto known = defaults_.find(value.substr(begin + 1, end - begin - 1));
      if (known == defaults_.end())
        fail(node, fmt::format("${} has no <default>", shown(value.substr(begin + 1, end - begin - 1))));
      if (known->second.size() > 10000) fail(node, "a <default> is too long");
      value.replace(begin, end - begin, known->second);
      begin += known->second.size();
    }
    return value;
  }
  std::vector<double> numbers(const Node& node, const std::string& from) const {
    return numbers_in(from, [&](const std::string& bad) { fail(node, bad); });
  }
  // `fail` throws.
  template <typename Fail>
  static std::vector<double> numbers_in(const std::string& from, Fail&& fail) {
    std::vector<double> out;
    for (size_t at = 0; at < from.size();) {
      if (from[at] == ' ' || from[at] == ',' || from[at] == '\t' || from[at] == '\n' || from[at] == '\r') {
        ++at;
        continue;
      }
      if (from[at] == '+') ++at;
      double value = 0;
      const auto [end, error] = std::from_chars(from.data() + at, from.data() + from.size(), value);
      if (error != std::errc() || !std::isfinite(value))
        fail(fmt::format("\"{}\" is no finite number", shown(from.substr(at))));
      out.push_back(value);
      at = static_cast<size_t>(end - from.data());
    }
    return out;
  }
  double number_in(const Node& node, const char* key, double otherwise) const {
    if (!node.attribute(key)) return otherwise;
    const auto list = numbers(node, text(node, key));
    if (list.size() != 1) fail(node, fmt::format("\"{}\" is {} numbers, not one", key, list.size()));
    return list[0];
  }
  // The child that is called so; references are followed.
  Node child(const Node& node, const std::string& name) const {
    asked_[node.hash_value()].insert(name);
    Node out;
    for (const Node& c : node.children())
      if (c.attribute("name") && text(c, "name") == name) {
        if (out) fail(c, "is given twice");
        out = c;
      }
    return std::string(out.name()) == "ref" ? referred(out) : out;
  }
  // Of a file that `what` (a noun) is read from.
  std::string found_file(const Node& node, const char* what, const std::string& name) const {
    const FoundFile file = build_.find(name);
    if (file.path.empty()) fail(node, missing_file(what, build_.path(), name));
    return file.path;
  }
  // What nothing here asked for.
  void tell_unread(const Node& node, std::initializer_list<const char*> ignored = {}) {
    std::set<std::string>& asked = asked_[node.hash_value()];
    asked.insert(ignored.begin(), ignored.end());
    for (const Node& c : node.children()) {
      const std::string kind = c.name();
      if (kind == "medium" || (kind == "ref" && std::string(referred(c).name()) == "medium")) {
        if (asked.count(text(c, "name")) == 0) build_.leave_out("media");
        continue;
      }
      const bool value = kind != "bsdf" && kind != "ref" && kind != "emitter" && kind != "shape" && kind != "sampler" &&
                         kind != "film";
      if (value && c.attribute("name") && asked.count(text(c, "name")) == 0)
        build_.leave_out(fmt::format("{} of {}", text(c, "name"), text(node, "type")));
    }
  }
  Node referred(const Node& ref) const {
    const auto known = ids_.find(text(ref, "id"));
    if (known == ids_.end()) fail(ref, "there is no such id");
    return known->second;
  }
  double number(const Node& node, const char* name, double otherwise) const {
    const Node c = child(node, name);
    if (!c || std::string(c.name()) == "texture") return otherwise;
    if (!c.attribute("value")) fail(c, "has no value");
    return number_in(c, "value", otherwise);
  }
  // The same of a material, where a texture may stand.
  double even_number(const Node& node, const char* name, double otherwise) {
    if (const Node c = child(node, name); c && std::string(c.name()) == "texture")
      build_.leave_out(fmt::format("textures of {}", name));
    return number(node, name, otherwise);
  }
  std::string word(const Node& node, const char* name, const std::string& otherwise) const {
    const Node c = child(node, name);
    return c ? text(c, "value") : otherwise;
  }
  bool truth(const Node& node, const char* name, bool otherwise) const {
    const std::string value = lower(word(node, name, otherwise ? "true" : "false"));
    if (value != "true" && value != "false")
      fail(child(node, name), fmt::format("is \"{}\", not true or false", shown(value)));
    return value == "true";
  }
  Vec vector_of(const Node& node, const Vec& otherwise) const {
    if (!node) return otherwise;
    if (node.attribute("value")) {
      const auto list = numbers(node, text(node, "value"));
      if (list.size() == 1) return {list[0], list[0], list[0]};
      if (list.size() != 3) fail(node, fmt::format("has {} numbers instead of 3", list.size()));
      return {list[0], list[1], list[2]};
    }
    return {number_in(node, "x", otherwise[0]), number_in(node, "y", otherwise[1]), number_in(node, "z", otherwise[2])};
  }
  Vec point_at(const Node& node, const char* key) const {
    const auto list = numbers(node, text(node, key));
    if (list.size() != 3) fail(node, fmt::format("\"{}\" has {} numbers instead of 3", key, list.size()));
    return {list[0], list[1], list[2]};
  }

  // Steps are applied in their order.
  Affine transform(const Node& node) const {
    Affine out;
    for (const Node& step : node.children()) {
      if (step.type() != pugi::node_element) continue;
      const std::string kind = step.name();
      Affine m;
      if (kind == "translate") {
        m = translation(vector_of(step, {0, 0, 0}));
      } else if (kind == "scale") {
        m = scaling(vector_of(step, {1, 1, 1}));
      } else if (kind == "rotate") {
        const Vec axis = vector_of(step, {0, 0, 0});
        if (!(length(axis) > 0)) fail(step, "turns about no axis");
        m = rotation(axis, radians(number_in(step, "angle", 0)));
      } else if (kind == "matrix") {
        const auto list = numbers(step, text(step, "value"));
        if (list.size() == 16) {
          if (list[12] != 0 || list[13] != 0 || list[14] != 0 || list[15] != 1) fail(step, "is not affine");
          std::copy_n(list.begin(), 12, m.m.begin());
        } else if (list.size() == 9) {
          for (size_t r = 0; r < 3; ++r)
            for (size_t c = 0; c < 3; ++c) m.m[4 * r + c] = list[3 * r + c];
        } else {
          fail(step, fmt::format("has {} numbers instead of 16 or 9", list.size()));
        }
      } else if (kind == "lookat") {
        const Vec eye = point_at(step, "origin"), at = point_at(step, "target");
        const Vec up = step.attribute("up") ? point_at(step, "up") : Vec{0, 1, 0};
        if (!(length(at - eye) > 0)) fail(step, "looks at its own place");
        const Vec z = unit(at - eye);
        Vec x = cross(unit(up), z);
        if (!(length(x) > 1e-9)) fail(step, "looks along its own up");
        x = unit(x);
        const Vec y = cross(z, x);
        for (size_t r = 0; r < 3; ++r)
          m.m[4 * r] = x[r], m.m[4 * r + 1] = y[r], m.m[4 * r + 2] = z[r], m.m[4 * r + 3] = eye[r];
      } else {
        fail(step, "is no step of a transform");
      }
      out = m * out;
    }
    return out;
  }
  Affine place_of(const Node& node) const {
    const Node c = child(node, "to_world");
    return c ? transform(c) : Affine{};
  }

  // ---- Colours

  static Vec in_rgb(const Spectrum& spectrum, bool light) {
    return light ? rgb_of_spectrum(spectrum) : rgb_of_reflectance(spectrum);
  }
  Spectrum pairs(const Node& node, const std::string& from) const {
    const auto list = numbers(node, from);
    if (list.size() < 2 || list.size() % 2 != 0) fail(node, fmt::format("has {} numbers, not pairs", list.size()));
    Spectrum out;
    for (size_t i = 0; i + 1 < list.size(); i += 2) out.emplace_back(list[i], list[i + 1]);
    check_spectrum(node, out);
    std::sort(out.begin(), out.end());
    return out;
  }
  void check_spectrum(const Node& node, const Spectrum& spectrum) const {
    if (const auto below = below_zero(spectrum))
      fail(node, fmt::format("has the value {:g} at {:g} nm", below->second, below->first));
  }
  static std::string without_comments(std::string from) {
    for (size_t at = 0; (at = from.find('#', at)) != std::string::npos;)
      from.erase(at, std::min(from.find('\n', at), from.size()) - at);
    return from;
  }
  Spectrum spectrum_of(const Node& node, const std::string& type) const {
    const auto values = numbers(node, word(node, "values", ""));
    std::vector<double> lengths = numbers(node, word(node, "wavelengths", ""));
    if (type == "regular") {
      lengths.clear();
      const double first = number(node, "wavelength_min", 360), last = number(node, "wavelength_max", 830);
      for (size_t i = 0; i < values.size(); ++i)
        lengths.push_back(first + (last - first) * double(i) / std::max<double>(1, double(values.size()) - 1));
    }
    if (values.empty() || lengths.size() != values.size())
      fail(node, fmt::format("has {} values at {} wavelengths", values.size(), lengths.size()));
    Spectrum out;
    for (size_t i = 0; i < values.size(); ++i) out.emplace_back(lengths[i], values[i]);
    check_spectrum(node, out);
    std::sort(out.begin(), out.end());
    return out;
  }
  Vec colour(const Node& node, bool light) {
    const std::string kind = node.name();
    const std::string value = text(node, "value");
    if ((kind == "rgb" || kind == "srgb") && value.starts_with('#')) {
      if (value.size() != 7) fail(node, "is no colour of six digits");
      Vec out;
      for (size_t k = 0; k < 3; ++k) {
        int byte = 0;
        const auto [end, error] = std::from_chars(&value[1 + 2 * k], &value[3 + 2 * k], byte, 16);
        if (error != std::errc() || end != &value[3 + 2 * k]) fail(node, "is no colour of six digits");
        out[k] = linear_of_srgb(byte / 255.0);
      }
      return out;
    }
    if (kind == "spectrum" && node.attribute("type")) {
      const std::string type = text(node, "type");
      if (type == "blackbody") {
        const double kelvin = number(node, "temperature", 5000);
        if (!(kelvin >= 100 && kelvin <= 1e6)) fail(node, fmt::format("is a black body of {:g} K", kelvin));
        return blackbody_radiance(kelvin) * number(node, "scale", 1);
      }
      if (type == "d65" || type == "uniform") {
        const double scale = number(node, type == "d65" ? "scale" : "value", 1);
        return {scale, scale, scale};
      }
      if (type == "irregular" || type == "regular") return in_rgb(spectrum_of(node, type), light);
      build_.approximate(fmt::format("spectra of the kind {} are grey", type));
      return {0.5, 0.5, 0.5};
    }
    if (kind == "spectrum" && node.attribute("filename")) {
      const std::string file = found_file(node, "file", text(node, "filename"));
      return in_rgb(pairs(node, without_comments(read_whole_file(file, kMostBytes))), light);
    }
    if (kind == "spectrum" && value.find(':') != std::string::npos) {
      std::string plain = value;
      std::replace(plain.begin(), plain.end(), ':', ' ');
      return in_rgb(pairs(node, plain), light);
    }
    if (kind == "srgb") {
      Vec out = vector_of(node, {0, 0, 0});
      for (double& c : out) c = linear_of_srgb(c);
      return out;
    }
    const auto list = numbers(node, value);
    if (list.size() == 1) return {list[0], list[0], list[0]};
    if (list.size() != 3) fail(node, fmt::format("has {} numbers instead of 3", list.size()));
    return {list[0], list[1], list[2]};
  }
  // v counts from the top there.
  PaintRef paint(const Node& node, const char* name, const Vec& otherwise, bool numbers_alone = false) {
    const Node c = child(node, name);
    return c ? paint_of(c, numbers_alone) : constant_paint(otherwise);
  }
  PaintRef paint(const Node& node, const char* name, double otherwise, bool numbers_alone = false) {
    return paint(node, name, Vec{otherwise, otherwise, otherwise}, numbers_alone);
  }
  PaintRef paint_of(const Node& node, bool numbers_alone) {
    if (std::string(node.name()) != "texture") return constant_paint(colour(node, false));
    const auto key = std::pair(node.hash_value(), numbers_alone);
    const auto known = paints_.find(key);
    if (known != paints_.end()) return known->second;
    if (++depth_ > kDeepest) fail(node, "textures lie in each other without end");
    Paint out;
    PaintRef result;
    const std::string kind = text(node, "type");
    if (const Node to_uv = child(node, "to_uv")) {
      const Affine m = transform(to_uv);
      // In coordinates whose v counts from below.
      out.place.to.m = {m.m[0], -m.m[1], 0, m.m[3] + m.m[1], -m.m[4], m.m[5], 0, 1 - m.m[5] - m.m[7], 0, 0, 1, 0};
    }
    if (kind == "bitmap") {
      const std::string wrap = word(node, "wrap_mode", "repeat");
      uint32_t flags = wrap == "clamp" ? uint32_t{LUMICUT_CLAMP} : 0u;
      if (wrap == "mirror") out.mode = 2;
      if (wrap != "repeat" && wrap != "clamp" && wrap != "mirror")
        fail(child(node, "wrap_mode"), fmt::format("is \"{}\", not repeat, mirror or clamp", shown(wrap)));
      if (word(node, "filter_type", "bilinear") == "nearest") flags |= LUMICUT_NEAREST;
      const bool raw = truth(node, "raw", false) || numbers_alone;
      out.kind = Paint::Kind::image;
      out.texture = build_.image(word(node, "filename", ""), raw ? TextureUse::numbers : TextureUse::colour, flags);
      result = out.texture != 0 ? build_.made(out) : constant_paint(0.5);
    } else if (kind == "checkerboard") {
      out.kind = Paint::Kind::checker;
      out.a = paint(node, "color0", 0.4), out.b = paint(node, "color1", 0.2);
      // Two squares a unit; the first lies where u and v are 0, which is above.
      for (double& x : out.place.to.m) x *= 2;
      result = build_.made(out);
    } else if (kind == "mesh_attribute" && word(node, "name", "") == "vertex_color") {
      result = build_.product(build_.vertex_paint(), constant_paint(number(node, "scale", 1)));
    } else {
      build_.approximate(fmt::format("textures of the kind {} are grey", kind));
      result = constant_paint(0.5);
      for (const Node& c : node.children()) child(node, text(c, "name"));
    }
    tell_unread(node, {"to_uv", "format", "accel"});
    --depth_;
    return paints_[key] = result;
  }
  // ---- Materials

  double index(const Node& node, const char* name, const std::string& otherwise) const {
    static const std::map<std::string, double> kNamed = {
        {"vacuum", 1.0},      {"helium", 1.000036},        {"hydrogen", 1.000132},
        {"air", 1.000277},    {"carbon dioxide", 1.00045}, {"water", 1.333},
        {"acetone", 1.36},    {"ethanol", 1.361},          {"carbon tetrachloride", 1.461},
        {"glycerol", 1.4729}, {"benzene", 1.501},          {"silicone oil", 1.52045},
        {"bromine", 1.661},   {"water ice", 1.31},         {"fused quartz", 1.458},
        {"pyrex", 1.47},      {"acrylic glass", 1.49},     {"polypropylene", 1.49},
        {"bk7", 1.5046},      {"sodium chloride", 1.544},  {"amber", 1.55},
        {"pet", 1.575},       {"diamond", 2.419}};
    const Node c = child(node, name);
    if (c && std::string(c.name()) == "float") return number_in(c, "value", 1.5);
    const auto found = kNamed.find(c ? text(c, "value") : otherwise);
    if (found == kNamed.end())
      fail(c ? c : node,
           fmt::format("{}: \"{}\" is no material that is known", name, shown(c ? text(c, "value") : otherwise)));
    return found->second;
  }
  float relative_index(const Node& node, const std::string& inside) {
    const double value = index(node, "int_ior", inside) / index(node, "ext_ior", "air");
    return static_cast<float>(build_.cut(
        value, 0.1, 10, place(node, fmt::format("int_ior over ext_ior of <bsdf type=\"{}\">", text(node, "type")))));
  }
  // GGX's alpha is the square of the library's roughness.
  void set_alpha(const Node& node, lumicut_material& m, double usual) {
    if (word(node, "distribution", "beckmann") != "ggx") build_.approximate("Beckmann's distribution is taken as GGX");
    const char* name = "alpha";
    if (child(node, "alpha_u")) {
      name = "alpha_u", child(node, "alpha_v");
      build_.approximate("roughness that differs along u and v is taken as that along u");
    }
    build_.set_number(power_paint(share(node, name, usual, true), 0.5), m.roughness, m.roughness_texture);
  }

  uint32_t bsdf(const Node& node) {
    const auto known = materials_.find(node.hash_value());
    if (known != materials_.end()) return known->second;
    if (++depth_ > kDeepest) fail(node, "bsdfs lie in each other without end");
    const uint32_t number = make_bsdf(node);
    --depth_;
    return materials_[node.hash_value()] = number;
  }
  // The bsdf inside of another; the first, or where there are several the `which`th.
  Node inner(const Node& node, int which = 0) const {
    for (const Node& c : node.children()) {
      const std::string name = c.name();
      const Node found = name == "ref" ? referred(c) : c;
      if (std::string(found.name()) == "bsdf" && which-- == 0) return found;
    }
    return {};
  }

  uint32_t make_bsdf(const Node& node) {
    const std::string kind = text(node, "type");
    const std::string name = node.attribute("id") ? text(node, "id") : kind;
    if (kind == "twosided") {
      const Node front = inner(node), back = inner(node, 1);
      if (!front) fail(node, "holds no bsdf");
      return back ? build_.mix_materials(name, bsdf(front), bsdf(back), behind_paint()) : bsdf(front);
    }
    if (kind == "mask" || kind == "bumpmap" || kind == "normalmap" || kind == "blendbsdf")
      return wrapped(node, kind, name);
    lumicut_material m = default_material();
    m.flags = LUMICUT_GGX;
    m.roughness = 0;
    for (float& c : m.specular) c = 1;
    for (float& c : m.diffuse) c = 1;
    const auto unread = [&](const char* key) {
      if (const Node c = child(node, key); c && constant_of(paint_of(c, false)).value_or(Vec{0, 0, 0}) != Vec{1, 1, 1})
        build_.leave_out(fmt::format("{} of {}", key, kind));
    };
    if (kind == "diffuse") {
      m = default_material();
      build_.set_colour(share(node, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
    } else if (kind == "plastic" || kind == "roughplastic" || kind == "pplastic") {
      m.ior = relative_index(node, "polypropylene");
      const PaintRef base = share(node, "diffuse_reflectance", 0.5);
      const bool nonlinear = truth(node, "nonlinear", false);
      build_.set_colour(nonlinear ? coated_paint(base, m.ior) : base, m.diffuse, m.diffuse_texture);
      if (const auto value = constant_of(share(node, "specular_reflectance", 1))) store(m.specular, *value);
      if (kind != "plastic") set_alpha(node, m, 0.1);
    } else if (kind == "dielectric" || kind == "roughdielectric" || kind == "thindielectric") {
      m.transmission = 1;
      m.ior = relative_index(node, "bk7");
      if (kind == "roughdielectric") set_alpha(node, m, 0.1);
      if (kind == "thindielectric") m.flags |= LUMICUT_SHADOWS_PASS;
      unread("specular_reflectance"), unread("specular_transmittance");
    } else if (kind == "conductor" || kind == "roughconductor") {
      m.metallic = 1;
      conductor(node, m);
      if (kind == "roughconductor") set_alpha(node, m, 0.1);
    } else if (kind == "principled" || kind == "principledthin") {
      const auto even = [&](const char* key, double otherwise, double most) {
        return cut(node, key, even_number(node, key, otherwise), 0, most);
      };
      build_.set_colour(share(node, "base_color", 0.5), m.diffuse, m.diffuse_texture);
      build_.set_number(share(node, "roughness", 0.5, true), m.roughness, m.roughness_texture);
      build_.set_number(share(node, "metallic", 0.0, true), m.metallic, m.metallic_texture);
      if (child(node, "specular")) {
        const double root = std::sqrt(0.08 * cut(node, "specular", number(node, "specular", 0.5), 0, 1));
        m.ior = static_cast<float>((1 + root) / (1 - root));
      } else {
        m.ior = static_cast<float>(cut(node, "eta", number(node, "eta", 1.5), 0.1, 10));
      }
      m.transmission = static_cast<float>(even("spec_trans", 0, 1));
      if (kind == "principledthin") {
        if (m.transmission > 0) m.flags |= LUMICUT_SHADOWS_PASS;
        const double through = even("diff_trans", 0, 2) / 2;
        const PaintRef base = share(node, "base_color", 0.5);
        build_.set_colour(build_.product(base, constant_paint(1 - through)), m.diffuse, m.diffuse_texture);
        if (through > 0)
          build_.set_colour(build_.product(base, constant_paint(through)), m.translucency, m.translucency_texture);
      }
      m.coat = static_cast<float>(even("clearcoat", 0, 4) / 4);
      // Its alpha is .1 without gloss, .001 with all of it.
      m.coat_roughness = static_cast<float>(std::sqrt(0.1 + (0.001 - 0.1) * even("clearcoat_gloss", 0, 1)));
      m.flags |= LUMICUT_BURLEY;
      for (const char* key : {"anisotropic", "sheen", "sheen_tint", "flatness", "spec_tint"})
        if (even_number(node, key, 0) > 0) build_.leave_out(fmt::format("{} of {}", key, kind));
    } else if (kind == "null") {
      m = default_material();
      m.opacity = kHole;
    } else if (kind == "hair") {
      m = default_material();
      build_.approximate("hair is diffuse, of its colour");
      const Node absorption = child(node, "sigma_a");
      const auto amount = [&](const char* key, double otherwise, double most) {
        return cut(node, key, number(node, key, otherwise), 0, most);
      };
      const double scale = amount("scale", 1, 1e6);
      const Vec sigma = absorption ? cut(node, "sigma_a", build_.mean_of(paint_of(absorption, true)), 0, 1e9)
                                   : hair_absorption(amount("eumelanin", 1.3, 1e6), amount("pheomelanin", 0.2, 1e6));
      store(m.diffuse, hair_colour(sigma * scale, amount("azimuthal_roughness", 0.3, 1)));
      for (const char* key : {"longitudinal_roughness", "scale_tilt", "int_ior", "ext_ior"}) child(node, key);
    } else {
      build_.approximate(fmt::format("bsdfs of the kind {} are diffuse", kind));
      m = default_material();
      for (const Node& c : node.children()) child(node, text(c, "name"));
    }
    tell_unread(node);
    return build_.add_material(name, m);
  }

  void conductor(const Node& node, lumicut_material& m) {
    const std::string material = word(node, "material", child(node, "eta") ? "" : "Cu");
    if (material == "none") {
      build_.set_colour(share(node, "specular_reflectance", 1.0), m.diffuse, m.diffuse_texture);
      return;
    }
    std::pair<Vec, Vec> both = *named_metal("Cu");
    if (!material.empty()) {
      if (const auto known = named_metal(material))
        both = *known;
      else
        build_.approximate(fmt::format("the metal {} is copper", material));
    }
    if (const Node c = child(node, "eta")) both.first = cut(node, "eta", colour(c, false), 0, 1e6);
    if (const Node c = child(node, "k")) both.second = cut(node, "k", colour(c, false), 0, 1e6);
    const Metal metal = metal_of(both.first, both.second);
    const Vec tint = constant_of(share(node, "specular_reflectance", 1.0)).value_or(Vec{1, 1, 1});
    for (size_t k = 0; k < 3; ++k) {
      m.diffuse[k] = static_cast<float>(std::clamp(metal.colour[k] * tint[k], 0.0, 1.0));
      m.specular_tint[k] = static_cast<float>(metal.tint[k]);
    }
  }

  uint32_t wrapped(const Node& node, const std::string& kind, const std::string& name) {
    const Node c = inner(node);
    if (!c) fail(node, "holds no bsdf");
    const uint32_t of = bsdf(c);
    lumicut_material m = build_.scene.materials[of].values;
    if (kind == "mask") {
      const PaintRef opacity = share(node, "opacity", 0.5, true);
      if (const auto value = constant_of(opacity))
        m.opacity = std::max(kHole, static_cast<float>((*value)[0]));
      else
        m.opacity_texture = build_.number_texture(opacity);
    } else if (kind == "normalmap") {
      const Node map = texture_in(node);
      if (map)
        m.normal_texture = build_.image(word(map, "filename", ""), TextureUse::vectors, 0, "the surface stays smooth");
    } else if (kind == "bumpmap") {
      const Node map = texture_in(node);
      if (map) build_.set_bump(paint_of(map, true), cut(node, "scale", number(node, "scale", 1), -1e6, 1e6), m);
    } else {
      const Node second = inner(node, 1);
      if (!second) fail(node, "holds one bsdf alone");
      return build_.mix_materials(name, of, bsdf(second), share(node, "weight", 0.5, true));
    }
    return build_.add_material(name, m);
  }
  Node texture_in(const Node& node) const {
    for (const Node& c : node.children()) {
      const Node found = std::string(c.name()) == "ref" ? referred(c) : c;
      if (std::string(found.name()) == "texture") return found;
    }
    return {};
  }

  // ---- Shapes

  struct Part {
    std::vector<Geometry> geometry;
    Affine place;
    uint32_t material;
    bool flipped;
    std::string name;
  };

  // v counts from the top there, from below here.
  static Geometry upside_down(Geometry g) {
    for (size_t i = 1; i < g.uvs.size(); i += 2) g.uvs[i] = 1 - g.uvs[i];
    return g;
  }

  // `group`: where the parts of a shapegroup go.
  void shape(const Node& node, const std::string& group, const std::optional<Affine>& above) {
    if (++depth_ > kDeepest) fail(node, "shapes lie in each other without end");
    const std::string kind = text(node, "type");
    Affine place = place_of(node);
    if (above) place = *above * place;
    std::string key;
    std::vector<Geometry> all;
    const bool flipped = truth(node, "flip_normals", false);
    if (kind == "instance") {
      instance(node, place);
      --depth_;
      return;
    }
    if (kind == "merge") {
      for (const Node& c : node.children("shape")) shape(c, group, above);
      --depth_;
      return;
    }
    if (kind == "sphere") {
      if (!sphere_) sphere_ = sphere_geometry();
      const double radius = number(node, "radius", 1);
      if (!(radius > 0)) fail(node, fmt::format("its radius is {}", radius));
      place = place * translation(vector_of(child(node, "center"), {0, 0, 0})) * scaling({radius, radius, radius});
      all.push_back(*sphere_), key = "sphere";
    } else if (kind == "rectangle") {
      all.push_back(upside_down(rectangle_geometry())), key = kind;
    } else if (kind == "cube") {
      all.push_back(upside_down(cube_geometry())), key = kind;
    } else if (kind == "disk") {
      all.push_back(disk_geometry(0, 1, 0, 2 * kPi)), key = kind;
      // u goes from the middle outwards, v around.
      for (size_t i = 0; i + 1 < all[0].uvs.size(); i += 2) {
        const float around = all[0].uvs[i];
        all[0].uvs[i] = 1 - all[0].uvs[i + 1], all[0].uvs[i + 1] = 1 - around;
      }
    } else if (kind == "cylinder") {
      const Vec p0 = vector_of(child(node, "p0"), {0, 0, 0}), p1 = vector_of(child(node, "p1"), {0, 0, 1});
      const double radius = number(node, "radius", 1);
      if (!(radius > 0)) fail(node, fmt::format("its radius is {:g}", radius));
      if (!(length(p1 - p0) > 0)) fail(node, "its p0 and p1 are one");
      const Vec z = unit(p1 - p0), x = unit(cross(std::abs(z[0]) > 0.9 ? Vec{0, 1, 0} : Vec{1, 0, 0}, z)),
                y = cross(z, x);
      Affine stand = translation(p0);
      for (size_t r = 0; r < 3; ++r) stand.m[4 * r] = x[r], stand.m[4 * r + 1] = y[r], stand.m[4 * r + 2] = z[r];
      place = place * stand;
      all.push_back(upside_down(cylinder_geometry(radius, 0, length(p1 - p0), 2 * kPi)));
    } else if (kind == "obj" || kind == "ply" || kind == "serialized") {
      found_file(node, "mesh", word(node, "filename", ""));
      all = kind == "serialized" ? serialized(node) : build_.read_meshes(word(node, "filename", ""));
      const bool turn = truth(node, "flip_tex_coords", kind == "obj") != (kind == "obj");
      const bool flat = truth(node, "face_normals", false);
      for (Geometry& g : all) {
        if (flat) g.normals.clear();
        if (turn != (kind != "obj")) g = upside_down(std::move(g));
      }
    } else if (kind == "bsplinecurve" || kind == "linearcurve") {
      all.push_back(curves(node, place, kind == "linearcurve"));
      place = {};
      if (all[0].indices.empty()) build_.leave_out("curves without length or width");
    } else {
      build_.leave_out(fmt::format("shapes of the kind {}", kind));
      --depth_;
      return;
    }
    uint32_t material = grey_;
    if (const Node c = inner(node)) material = bsdf(c);
    if (const Node second = inner(node, 1)) fail(second, "is the second bsdf of a shape");
    bool emits = false;
    for (const Node& inside : node.children()) {
      const Node c = std::string(inside.name()) == "ref" ? referred(inside) : inside;
      if (std::string(c.name()) == "emitter") {
        if (std::exchange(emits, true)) fail(inside, "is the second emitter of a shape");
        if (text(c, "type") != "area") {
          build_.leave_out(fmt::format("emitters of the kind {} on shapes", text(c, "type")));
          continue;
        }
        if (!group.empty()) {
          build_.leave_out("emitters inside of shape groups");
          continue;
        }
        const Node radiance = child(c, "radiance");
        if (radiance && std::string(radiance.name()) == "texture") {
          material = build_.with_emission(material, {1, 1, 1}, build_.colour_texture(paint_of(radiance, false)), false);
        } else {
          material = build_.with_emission(material, light_colour(c, "radiance"), 0, false);
        }
        tell_unread(c);
        key.clear();
      }
    }
    if (const Node inside = child(node, "interior")) material = filled(inside, material);
    tell_unread(node, {"to_world"});
    const std::string name = node.attribute("id") ? text(node, "id") : fmt::format("shape \"{}\"", kind);
    if (group.empty()) {
      for (const Geometry& g : all) build_.add(name, g, place, material, flipped, key);
    } else {
      groups_[group].push_back({std::move(all), place, material, flipped, name});
    }
    --depth_;
  }
  // Points and radii a line, curves apart by empty lines. Their places are moved by to_world, their radii are not.
  Geometry curves(const Node& node, const Affine& place, bool straight) {
    const std::string path = found_file(node, "file of curves", word(node, "filename", ""));
    check_regular_file(path);
    const std::string all = plain_text(read_whole_file(path, kMostBytes), path);
    std::vector<Strand> strands(1);
    size_t line = 1, points = 0;
    const auto bad = [&](const std::string& what) { throw FileError(path, fmt::format("line {}: {}", line, what)); };
    const auto finish = [&](Strand& strand) {
      if (strand.empty()) return;
      const size_t least = straight ? 2 : 4;
      if (strand.size() < least)
        bad(fmt::format("a curve of {} points ends here; a {} has at least {}", strand.size(), text(node, "type"),
                        least));
      const auto is_first = [&](const CurvePoint& p) { return p.place == strand[0].place; };
      const auto is_thin = [](const CurvePoint& p) { return !(p.radius > 0); };
      points += strand.size();
      if (std::all_of(strand.begin(), strand.end(), is_first) || std::all_of(strand.begin(), strand.end(), is_thin)) {
        build_.leave_out("curves without length or width");
        return strand.clear();
      }
      if (!straight) strand = bezier_strand(bezier_of_bspline(strand, 3), 3);
      curve_points_ += strand.size();
      if (curve_points_ > kMostCurvePoints) bad(fmt::format("more than {} points of curves", kMostCurvePoints));
      strands.emplace_back();
    };
    for (size_t at = 0; at < all.size(); ++line) {
      const size_t end = std::min(all.find('\n', at), all.size());
      const auto list = numbers_in(all.substr(at, end - at), bad);
      at = end + 1;
      if (list.empty()) {
        finish(strands.back());
        continue;
      }
      if (list.size() != 4) bad(fmt::format("has {} numbers, not the four of a point and its radius", list.size()));
      if (!(list[3] >= 0 && list[3] <= kLargestCoordinate)) bad(fmt::format("has a radius of {:g}", list[3]));
      const Vec at_world = place.point({list[0], list[1], list[2]});
      for (const double x : at_world)
        if (!(std::abs(x) < kLargestCoordinate)) bad(fmt::format("has a coordinate of {:g} in the world", x));
      strands.back().push_back({at_world, list[3], {0, 0, 0}});
    }
    finish(strands.back());
    if (points == 0) throw FileError(path, "has no points");
    return curve_geometry(strands);
  }
  // Even media that glass holds: what they absorb.
  uint32_t filled(const Node& medium, uint32_t material) {
    std::optional<uint32_t> glass;
    if (text(medium, "type") == "homogeneous") {
      const Node extinction = child(medium, "sigma_t"), albedo = child(medium, "albedo");
      const Vec all = extinction ? colour(extinction, false) : Vec{1, 1, 1};
      const Vec scattered = albedo ? colour(albedo, false) : Vec{0.75, 0.75, 0.75};
      Vec absorbed = all * number(medium, "scale", 1);
      const auto at = [&](const char* name) { return place(medium, fmt::format("{} of a medium", name)); };
      const auto kept = *constant_of(build_.cut(constant_paint(scattered), 0, 1, at("albedo")));
      for (size_t k = 0; k < 3; ++k) absorbed[k] *= 1 - kept[k];
      absorbed = *constant_of(build_.cut(constant_paint(absorbed), 0, 1e15, at("sigma_t less what is scattered")));
      glass = build_.with_absorption(material, absorbed);
      if (glass && std::max({scattered[0], scattered[1], scattered[2]}) > 0)
        build_.leave_out("scattering inside of glass");
    }
    if (!glass) build_.leave_out("media");
    return glass.value_or(material);
  }
  std::vector<Geometry> serialized(const Node& node) {
    const std::string path = found_file(node, "mesh", word(node, "filename", ""));
    const double index = number(node, "shape_index", 0);
    if (!(index >= 0 && index < 1e9)) fail(node, fmt::format("its shape_index is {}", index));
    return {read_serialized_mesh(path, static_cast<size_t>(index))};
  }
  void instance(const Node& node, const Affine& place) {
    bool has_group = false;
    for (const Node& c : node.children()) {
      const Node found = std::string(c.name()) == "ref" ? referred(c) : c;
      if (std::string(found.name()) != "shape") continue;
      if (text(found, "type") != "shapegroup") fail(node, "is of no shapegroup");
      has_group = true;
      const std::string id = fmt::format("group {}", found.hash_value());
      if (groups_.count(id) == 0) {
        groups_[id];
        for (const Node& part : found.children("shape")) shape(part, id, {});
      }
      size_t number = 0;
      for (const Part& part : groups_[id])
        for (const Geometry& g : part.geometry)
          build_.add(part.name, g, place * part.place, part.material, part.flipped, fmt::format("{} {}", id, number++));
    }
    if (!has_group) fail(node, "is of no shapegroup");
  }

  // ---- Camera and lights

  void sensor(const Node& node) {
    if (has_camera_) return build_.leave_out("all sensors but the first");
    const std::string kind = text(node, "type");
    for (const Node& film : node.children("film")) {
      const double width = number(film, "width", 768), height = number(film, "height", 576);
      if (!(width >= 1 && width <= 65536 && height >= 1 && height <= 65536))
        fail(film, fmt::format("has {} by {} pixels", width, height));
      if (width != std::floor(width) || height != std::floor(height))
        fail(film, fmt::format("has {} by {} pixels, which are no whole numbers", width, height));
      build_.scene.width = static_cast<uint32_t>(width), build_.scene.height = static_cast<uint32_t>(height);
      if (child(film, "crop_width")) build_.leave_out("the film's crop");
    }
    for (const char* key : {"near_clip", "far_clip"}) {
      const double clip = number(node, key, 0);
      if (!(clip >= 0 && clip < 1e17)) fail(node, fmt::format("its {} is {}", key, clip));
      (key[0] == 'n' ? build_.scene.camera.near_clip : build_.scene.camera.far_clip) = static_cast<float>(clip);
    }
    const Affine world = place_of(node);
    if (!(std::abs(world.determinant()) > 0)) fail(node, "its to_world flattens space");
    lumicut_camera& c = build_.scene.camera;
    c.struct_size = sizeof(c);
    // It looks along z, and x goes to the left.
    const Vec x = unit(world.column(0)) * -1.0, y = unit(world.column(1)), z = unit(world.column(2)) * -1.0;
    for (size_t r = 0; r < 3; ++r) {
      const double row[4] = {x[r], y[r], z[r], world.column(3)[r]};
      for (size_t k = 0; k < 4; ++k) c.to_world[4 * r + k] = static_cast<float>(row[k]);
    }
    const double aspect = double(build_.scene.width) / build_.scene.height;
    if (kind == "orthographic") {
      c.orthographic = 1;
      c.height = static_cast<float>(2 * length(world.column(1)) / aspect);
    } else {
      if (kind != "perspective" && kind != "thinlens")
        build_.approximate(fmt::format("sensors of the kind {} are perspective", kind));
      c.fov_y = static_cast<float>(field_of_view(node, aspect));
    }
    c.shift[0] = static_cast<float>(number(node, "principal_point_offset_x", 0) * -aspect);
    c.shift[1] = static_cast<float>(number(node, "principal_point_offset_y", 0));
    if (kind == "thinlens") {
      const double lens = number(node, "aperture_radius", 0), focus = number(node, "focus_distance", 1);
      if (!(lens >= 0)) fail(node, fmt::format("its aperture_radius is {:g}", lens));
      if (!(focus > 0)) fail(node, fmt::format("its focus_distance is {:g}", focus));
      c.lens_radius = static_cast<float>(lens), c.focus_distance = static_cast<float>(focus);
    }
    has_camera_ = true;
    tell_unread(node,
                {"to_world", "shutter_open", "shutter_close", "focal_length", "fov", "fov_axis", "focus_distance"});
  }
  double field_of_view(const Node& node, double aspect) const {
    std::string axis = word(node, "fov_axis", "x");
    double fov = radians(number(node, "fov", 0));
    if (const Node c = child(node, "focal_length"); c && fov == 0) {
      // Of a film of 36 by 24 mm.
      const auto list = numbers(c, text(c, "value").substr(0, text(c, "value").find("mm")));
      if (list.size() != 1 || !(list[0] > 0)) fail(c, "is no length in mm");
      fov = 2 * std::atan(std::hypot(36.0, 24.0) / 2 / list[0]);
      axis = "diagonal";
    }
    if (!(fov > 1e-3 && fov < radians(179))) fail(node, fmt::format("its fov is {} degrees", fov * 180 / kPi));
    const double tangent = std::tan(fov / 2);
    if (axis == "y" || (axis == "smaller" && aspect >= 1) || (axis == "larger" && aspect < 1)) return fov;
    if (axis == "diagonal") return 2 * std::atan(tangent / std::hypot(aspect, 1.0));
    if (axis != "x" && axis != "smaller" && axis != "larger")
      fail(node, fmt::format("its fov_axis is \"{}\"", shown(axis)));
    return 2 * std::atan(tangent / aspect);
  }

  Vec light_colour(const Node& node, const char* name) {
    const Node c = child(node, name);
    if (!c) return {1, 1, 1};
    if (std::string(c.name()) == "texture") {
      build_.leave_out(fmt::format("textures of {}", name));
      return {1, 1, 1};
    }
    const Vec out = colour(c, true);
    for (const double v : out)
      if (!(v >= 0 && v <= 1e15)) fail(c, fmt::format("has the value {}", v));
    return out;
  }
  void emitter(const Node& node) {
    const std::string kind = text(node, "type");
    const std::string name = node.attribute("id") ? text(node, "id") : fmt::format("emitter \"{}\"", kind);
    const Affine place = place_of(node);
    lumicut_light l{};
    l.value = 1;
    if (kind == "point") {
      l.type = LUMICUT_POINT;
      store(l.position, child(node, "position") ? vector_of(child(node, "position"), {0, 0, 0}) : place.column(3));
      store(l.color, light_colour(node, "intensity"));
      build_.add_light(l, name);
    } else if (kind == "spot") {
      const double cutoff = number(node, "cutoff_angle", 20), beam = number(node, "beam_width", cutoff * 3 / 4);
      if (!(cutoff > 0 && cutoff <= 90 && beam >= 0 && beam <= cutoff))
        fail(node, fmt::format("its angles are {} and {} degrees", beam, cutoff));
      // Even to the beam's edge, then linear in the angle.
      Profile profile{"", {0}, {0}, {1}};
      const auto at = [&](double angle, float value) {
        profile.vertical.push_back(static_cast<float>(radians(angle))), profile.values.push_back(value);
      };
      if (beam > 0) at(beam, 1);
      if (cutoff > beam + 1e-3) at(cutoff, 0);
      if (child(node, "texture")) build_.leave_out("textures of spots");
      build_.add_profile_light(place.column(3), place.column(2), {0, 0, 0}, light_colour(node, "intensity"),
                               std::move(profile), name);
    } else if (kind == "directional") {
      l.type = LUMICUT_SUN;
      const Vec direction = child(node, "direction") ? vector_of(child(node, "direction"), {0, 0, 1}) : place.column(2);
      if (!(length(direction) > 0)) fail(node, "has no direction");
      store(l.direction, unit(direction));
      store(l.color, light_colour(node, "irradiance"));
      build_.add_light(l, name);
    } else if (kind == "constant" || kind == "envmap") {
      if (build_.scene.environment) build_.leave_out("all environments but the last");
      lumicut_environment e{};
      e.struct_size = sizeof(e);
      Vec rgb{1, 1, 1};
      if (kind == "constant") {
        rgb = light_colour(node, "radiance");
      } else {
        const double scale = number(node, "scale", 1);
        if (!(scale >= 0 && scale <= 1e15)) fail(node, fmt::format("its scale is {}", scale));
        rgb = {scale, scale, scale};
        e.texture = build_.image(word(node, "filename", ""), TextureUse::radiance, 0, "white stands in");
        if (place.determinant() < 0) build_.approximate("mirrored environments are not mirrored");
        // Its local y is up, and the picture's middle lies along z.
        const Vec rows[3] = {unit(place.column(2)), unit(place.column(0)), unit(place.column(1))};
        for (size_t r = 0; r < 3; ++r)
          for (size_t c = 0; c < 3; ++c) e.world_to_map[3 * r + c] = static_cast<float>(rows[r][c]);
      }
      store(e.color, rgb);
      build_.scene.environment = e;
    } else {
      build_.leave_out(fmt::format("emitters of the kind {}", kind));
      return;
    }
    tell_unread(node, {"to_world", "sampling_weight", "position", "direction"});
  }

  SceneBuilder build_;
  std::list<pugi::xml_document> documents_;
  std::map<size_t, std::pair<std::string, std::vector<size_t>>> files_;  // by document: path, and where lines end
  std::vector<std::string> opened_;                                      // files that include the one that is read
  std::map<std::string, std::string> defaults_;
  std::map<std::string, Node> ids_;
  std::vector<Node> scene_;  // in the order of the files
  std::map<std::pair<size_t, bool>, PaintRef> paints_;
  std::map<size_t, uint32_t> materials_;
  std::map<std::string, std::vector<Part>> groups_;
  mutable std::map<size_t, std::set<std::string>> asked_;  // names, by node
  std::optional<Geometry> sphere_;
  uint32_t grey_ = 0;
  size_t curve_points_ = 0;
  int depth_ = 0;
  bool has_camera_ = false;
};

}  // namespace

bool is_mitsuba(const std::string& path) { return lower(std::filesystem::path(path).extension().string()) == ".xml"; }

SceneData read_mitsuba(const std::string& path) { return Reader(path).read(); }

}  // namespace lumicut::io
