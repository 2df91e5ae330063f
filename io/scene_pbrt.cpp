#include "io/scene_pbrt.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/scene_builder.h"
#include "io/scene_defaults.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

constexpr size_t kDeepest = 64;                     // of files that include each other, and of attributes
constexpr uint64_t kMostBytes = uint64_t{4} << 30;  // of all files together
constexpr size_t kMostInstances = 1 << 24;

struct Token {
  std::string text;
  bool quoted = false;
  int line = 0;
};

// The words of a file and of those that it includes.
class Tokens {
 public:
  explicit Tokens(const std::string& path) { open(path); }

  void open(const std::string& path) {
    if (files_.size() >= kDeepest) throw FileError(path, "files include each other without end");
    Source source{path, plain_text(read_whole_file(path, kMostBytes), path), 0, 1};
    bytes_ += source.text.size();
    if (bytes_ > kMostBytes) throw FileError(path, "the scene's files are too long together");
    files_.push_back(std::move(source));
  }
  std::string where() const { return fmt::format("line {}", line_); }  // of the last word
  const std::string& file() const { return files_.empty() ? last_ : files_.back().path; }

  std::optional<Token> next() {
    auto token = ahead_ ? std::exchange(ahead_, std::nullopt) : find();
    if (token) line_ = token->line;
    return token;
  }
  const std::optional<Token>& peek() {
    if (!ahead_) ahead_ = find();
    return ahead_;
  }
  [[noreturn]] void fail(const std::string& text) const {
    throw FileError(file(), fmt::format("{}: {}", where(), text));
  }

 private:
  struct Source {
    std::string path, text;
    size_t at;
    int line;
  };

  std::optional<Token> find() {
    while (!files_.empty()) {
      if (auto token = read(files_.back())) return token;
      last_ = files_.back().path;
      files_.pop_back();
    }
    return std::nullopt;
  }
  std::optional<Token> read(Source& s) {
    const std::string& t = s.text;
    while (s.at < t.size()) {
      const char c = t[s.at];
      if (c == '#') {
        while (s.at < t.size() && t[s.at] != '\n') ++s.at;
      } else if (c == ' ' || c == '\t' || c == '\n' || c == '\r') {
        s.line += c == '\n';
        ++s.at;
      } else {
        break;
      }
    }
    if (s.at >= t.size()) return std::nullopt;
    Token token;
    token.line = s.line;
    if (t[s.at] == '"') {
      token.quoted = true;
      for (++s.at; s.at < t.size() && t[s.at] != '"'; ++s.at) {
        if (t[s.at] == '\n') fail("a text does not end in its line");
        if (t[s.at] == '\\' && s.at + 1 < t.size()) ++s.at;
        token.text += t[s.at];
      }
      if (s.at >= t.size()) fail("a text does not end");
      ++s.at;
    } else if (t[s.at] == '[' || t[s.at] == ']') {
      token.text = t[s.at++];
    } else {
      while (s.at < t.size() && std::strchr(" \t\n\r\"[]#", t[s.at]) == nullptr) token.text += t[s.at++];
    }
    return token;
  }

  std::vector<Source> files_;
  std::optional<Token> ahead_;
  std::string last_;
  int line_ = 1;
  uint64_t bytes_ = 0;
};

struct Parameter {
  std::string type, name;
  std::vector<double> numbers;
  std::vector<std::string> words;
};

class Parameters {
 public:
  std::vector<Parameter> list;

  const Parameter* find(const std::string& name) const {
    for (const Parameter& p : list)
      if (p.name == name) return &p;
    return nullptr;
  }
  double number(const std::string& name, double otherwise) const {
    const Parameter* p = find(name);
    return p != nullptr && !p->numbers.empty() ? p->numbers[0] : otherwise;
  }
  Vec vector(const std::string& name, const Vec& otherwise) const {
    const Parameter* p = find(name);
    return p != nullptr && p->numbers.size() >= 3 ? Vec{p->numbers[0], p->numbers[1], p->numbers[2]} : otherwise;
  }
  std::string word(const std::string& name, const std::string& otherwise) const {
    const Parameter* p = find(name);
    return p != nullptr && !p->words.empty() ? p->words[0] : otherwise;
  }
  bool truth(const std::string& name, bool otherwise) const {
    return word(name, otherwise ? "true" : "false") == "true";
  }
};

struct State {
  Affine ctm;
  bool reversed = false, nothing = false;  // nothing: a border between media
  uint32_t material = 0;
  std::optional<Parameters> area_light;
};

// A shape of an object that is placed later.
struct Part {
  std::string name, key;
  std::shared_ptr<const Geometry> geometry;
  Affine place;
  uint32_t material;
  bool flipped;
};

class Reader {
 public:
  explicit Reader(const std::string& path) : tokens_(path), build_(path) {}

  SceneData read() {
    build_.scene.width = 1280, build_.scene.height = 720;
    lumicut_material plain = default_material();
    state_.material = build_.add_material("no material", plain);
    while (const auto token = tokens_.next()) {
      if (token->quoted) tokens_.fail(fmt::format("\"{}\" stands where a statement begins", shown(token->text)));
      statement(token->text);
    }
    if (!stack_.empty()) tokens_.fail("an AttributeBegin has no end");
    if (has_camera_) finish_camera();
    return build_.finish(has_camera_);
  }

 private:
  // ---- Words and numbers

  std::string quoted(const char* what) {
    const auto token = tokens_.next();
    if (!token || !token->quoted) tokens_.fail(fmt::format("{} needs a text in quotes", what));
    return token->text;
  }
  double number_of(const Token& token, const char* what) {
    double value = 0;
    const char* begin = token.text.data() + (token.text.starts_with('+') ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, token.text.data() + token.text.size(), value);
    if (token.quoted || error != std::errc() || end != token.text.data() + token.text.size() || !std::isfinite(value))
      tokens_.fail(fmt::format("{}: \"{}\" is no finite number", what, shown(token.text)));
    return value;
  }
  std::vector<double> numbers(size_t count, const char* what) {
    std::vector<double> out;
    const bool bracket = tokens_.peek() && tokens_.peek()->text == "[" && !tokens_.peek()->quoted;
    if (bracket) tokens_.next();
    for (size_t i = 0; i < count; ++i) {
      const auto token = tokens_.next();
      if (!token) tokens_.fail(fmt::format("{} needs {} numbers", what, count));
      out.push_back(number_of(*token, what));
    }
    if (bracket && tokens_.next().value_or(Token{}).text != "]")
      tokens_.fail(fmt::format("{} has more than {} numbers", what, count));
    return out;
  }
  Parameters parameters() {
    Parameters out;
    while (tokens_.peek() && tokens_.peek()->quoted) {
      const std::string head = tokens_.next()->text;
      Parameter p;
      const size_t begin = std::min(head.find_first_not_of(" \t"), head.size()), gap = head.find_first_of(" \t", begin);
      if (gap == std::string::npos) tokens_.fail(fmt::format("\"{}\" is no type and name of a parameter", shown(head)));
      p.type = head.substr(begin, gap - begin);
      const size_t name = std::min(head.find_first_not_of(" \t", gap), head.size());
      p.name = head.substr(name, head.find_last_not_of(" \t") + 1 - name);
      const auto add = [&](const Token& token) {
        if (token.quoted || token.text == "true" || token.text == "false")
          p.words.push_back(token.text);
        else
          p.numbers.push_back(number_of(token, p.name.c_str()));
      };
      auto token = tokens_.next();
      if (token && token->text == "[" && !token->quoted) {
        for (token = tokens_.next(); token && (token->quoted || token->text != "]"); token = tokens_.next())
          add(*token);
        if (!token) tokens_.fail(fmt::format("the values of \"{}\" do not end", shown(p.name)));
      } else if (token) {
        add(*token);
      } else {
        tokens_.fail(fmt::format("\"{}\" has no value", shown(p.name)));
      }
      if (p.numbers.empty() && p.words.empty()) tokens_.fail(fmt::format("\"{}\" has no value", shown(p.name)));
      out.list.push_back(std::move(p));
    }
    return out;
  }

  // ---- Statements

  void statement(const std::string& word) {
    const auto times = [&](const Affine& m) { state_.ctm = state_.ctm * m; };
    if (word == "Identity") {
      state_.ctm = {};
    } else if (word == "Translate") {
      const auto n = numbers(3, "Translate");
      times(translation({n[0], n[1], n[2]}));
    } else if (word == "Scale") {
      const auto n = numbers(3, "Scale");
      times(scaling({n[0], n[1], n[2]}));
    } else if (word == "Rotate") {
      const auto n = numbers(4, "Rotate");
      times(rotation({n[1], n[2], n[3]}, radians(n[0])));
    } else if (word == "LookAt") {
      look_at();
    } else if (word == "Transform" || word == "ConcatTransform") {
      const auto n = numbers(16, word.c_str());
      if (n[3] != 0 || n[7] != 0 || n[11] != 0 || n[15] != 1) tokens_.fail(fmt::format("{} is not affine", word));
      Affine m;
      for (size_t r = 0; r < 3; ++r)
        for (size_t c = 0; c < 4; ++c) m.m[4 * r + c] = n[4 * c + r];
      state_.ctm = word == "Transform" ? m : state_.ctm * m;
    } else if (word == "CoordinateSystem") {
      systems_[quoted("CoordinateSystem")] = state_.ctm;
    } else if (word == "CoordSysTransform") {
      const std::string name = quoted("CoordSysTransform");
      const auto found = systems_.find(name);
      if (found == systems_.end()) tokens_.fail(fmt::format("there is no coordinate system \"{}\"", shown(name)));
      state_.ctm = found->second;
    } else if (word == "ReverseOrientation") {
      state_.reversed = !state_.reversed;
    } else if (word == "AttributeBegin" || word == "TransformBegin") {
      if (stack_.size() >= kDeepest * 16) tokens_.fail("attributes lie in each other without end");
      stack_.push_back(state_);
    } else if (word == "AttributeEnd" || word == "TransformEnd") {
      if (stack_.empty()) tokens_.fail(fmt::format("{} without its beginning", word));
      const Affine ctm = stack_.back().ctm;
      if (word == "TransformEnd")
        state_.ctm = ctm;
      else
        state_ = std::move(stack_.back());
      stack_.pop_back();
    } else if (word == "Attribute") {
      quoted("Attribute"), parameters();
      build_.leave_out("Attribute, which gives parameters to statements that follow");
    } else if (word == "WorldBegin") {
      state_.ctm = {};
      systems_["world"] = state_.ctm;
    } else if (word == "WorldEnd") {
    } else if (word == "Include" || word == "Import") {
      const std::string name = quoted(word.c_str());
      const FoundFile file = find_beside(build_.path(), name);
      if (file.path.empty()) tokens_.fail(fmt::format("the file {} does not exist", shown(name)));
      include(file.path);
    } else if (word == "ObjectBegin") {
      if (object_) tokens_.fail("ObjectBegin inside of an object");
      stack_.push_back(state_);
      object_ = quoted("ObjectBegin");
      objects_[*object_].clear();
    } else if (word == "ObjectEnd") {
      if (!object_ || stack_.empty()) tokens_.fail("ObjectEnd without its beginning");
      object_.reset();
      state_ = std::move(stack_.back());
      stack_.pop_back();
    } else if (word == "ObjectInstance") {
      instance(quoted("ObjectInstance"));
    } else if (word == "ActiveTransform") {
      if (tokens_.next()) build_.leave_out("ActiveTransform: motion");
    } else if (word == "TransformTimes") {
      numbers(2, "TransformTimes");
    } else if (word == "NamedMaterial") {
      const std::string name = quoted("NamedMaterial");
      const auto found = materials_.find(name);
      if (found == materials_.end()) {
        build_.scene.warnings.add("unknown materials", build_.path(),
                                  fmt::format("there is no material \"{}\"; grey stands in", shown(name)));
        state_.material = 0, state_.nothing = false;
      } else {
        state_.material = found->second.first, state_.nothing = found->second.second;
      }
    } else {
      with_parameters(word);
    }
  }

  void with_parameters(const std::string& word) {
    if (word == "Option") {
      parameters();
      return;
    }
    static const std::map<std::string, bool> kPassed = {
        {"Sampler", false},    {"Integrator", false},     {"PixelFilter", false},   {"Accelerator", false},
        {"ColorSpace", false}, {"MakeNamedMedium", true}, {"MediumInterface", true}};
    const auto passed = kPassed.find(word);
    if (word == "Texture") {
      const std::string name = quoted("Texture"), type = quoted("Texture"), kind = quoted("Texture");
      texture(name, kind, parameters());
    } else if (word == "MediumInterface") {
      quoted(word.c_str());
      while (tokens_.peek() && tokens_.peek()->quoted) tokens_.next();
      build_.leave_out("media");
    } else if (passed != kPassed.end()) {
      const std::string kind = quoted(word.c_str());
      parameters();
      if (passed->second) build_.leave_out("media");
      if (word == "ColorSpace" && kind != "srgb")
        build_.approximate(fmt::format("the colour space {} is taken as sRGB's", kind));
    } else if (word == "Film") {
      quoted("Film");
      film(parameters());
    } else if (word == "Camera") {
      camera_kind_ = quoted("Camera");
      camera_ = parameters();
      camera_place_ = state_.ctm;
      const auto back = inverse(state_.ctm);
      if (!back) tokens_.fail("the camera's transform flattens space");
      systems_["camera"] = *back;
      has_camera_ = true;
    } else if (word == "Material") {
      const std::string kind = quoted("Material");
      state_.material = material(kind, kind, parameters());
      state_.nothing = kind.empty() || kind == "interface" || kind == "none";
    } else if (word == "MakeNamedMaterial") {
      const std::string name = quoted("MakeNamedMaterial");
      const Parameters p = parameters();
      const std::string kind = p.word("type", "diffuse");
      materials_[name] = {material(name, kind, p), kind.empty() || kind == "interface" || kind == "none"};
    } else if (word == "AreaLightSource") {
      const std::string kind = quoted("AreaLightSource");
      state_.area_light = parameters();
      if (kind != "diffuse") build_.approximate(fmt::format("area lights of the kind {} are taken as diffuse", kind));
    } else if (word == "LightSource") {
      const std::string kind = quoted("LightSource");
      light(kind, parameters());
    } else if (word == "Shape") {
      const std::string kind = quoted("Shape");
      shape(kind, parameters());
    } else {
      tokens_.fail(fmt::format("\"{}\" is no statement", shown(word)));
    }
  }

  void include(const std::string& path) {
    check_regular_file(path);
    tokens_.open(path);
  }

  void look_at() {
    const auto n = numbers(9, "LookAt");
    const Vec eye{n[0], n[1], n[2]}, at{n[3], n[4], n[5]}, up{n[6], n[7], n[8]};
    if (!(length(at - eye) > 0)) tokens_.fail("LookAt looks at its own place");
    const Vec z = unit(at - eye), side = cross(unit(up), z);
    if (!(length(side) > 1e-9)) tokens_.fail("LookAt looks along its own up");
    const Vec x = unit(side), y = cross(z, x);
    Affine m;
    for (size_t r = 0; r < 3; ++r)
      m.m[4 * r] = x[r], m.m[4 * r + 1] = y[r], m.m[4 * r + 2] = z[r], m.m[4 * r + 3] = eye[r];
    state_.ctm = state_.ctm * *inverse(m);
  }

  void instance(const std::string& name) {
    const auto found = objects_.find(name);
    if (found == objects_.end()) tokens_.fail(fmt::format("there is no object \"{}\"", shown(name)));
    if (object_) tokens_.fail("ObjectInstance inside of an object");
    for (const Part& part : found->second) {
      if (++instances_ > kMostInstances) tokens_.fail("there are too many instances");
      build_.add(part.name, *part.geometry, state_.ctm * part.place, part.material, part.flipped, part.key);
    }
  }

  // ---- Camera

  void film(const Parameters& p) {
    const double width = p.number("xresolution", 1280), height = p.number("yresolution", 720);
    if (!(width >= 1 && width <= 65536 && height >= 1 && height <= 65536))
      tokens_.fail(fmt::format("a film of {} by {} pixels", width, height));
    build_.scene.width = static_cast<uint32_t>(width), build_.scene.height = static_cast<uint32_t>(height);
    if (p.word("sensor", "cie1931") != "cie1931") build_.approximate("the film's sensor is taken as \"cie1931\"");
  }
  // When the film is known.
  void finish_camera() {
    const auto world = inverse(camera_place_);
    if (!world) tokens_.fail("the camera's transform flattens space");
    lumicut_camera& c = build_.scene.camera;
    c.struct_size = sizeof(c);
    const Vec x = unit(world->column(0)), y = unit(world->column(1)), z = unit(world->column(2)) * -1.0;
    for (size_t r = 0; r < 3; ++r) {
      const double row[4] = {x[r], y[r], z[r], world->column(3)[r]};
      for (size_t k = 0; k < 4; ++k) c.to_world[4 * r + k] = static_cast<float>(row[k]);
    }
    const double aspect = camera_.number("frameaspectratio", double(build_.scene.width) / build_.scene.height);
    double window[4] = {-1, 1, -1, 1};
    if (aspect > 1)
      window[0] = -aspect, window[1] = aspect;
    else
      window[2] = -1 / aspect, window[3] = 1 / aspect;
    if (const Parameter* p = camera_.find("screenwindow"); p != nullptr && p->numbers.size() == 4)
      std::copy(p->numbers.begin(), p->numbers.end(), window);
    const double height = window[3] - window[2];
    if (!(height > 0 && window[1] > window[0])) build_.fail("Camera", "its screenwindow is empty");
    c.shift[0] = static_cast<float>((window[0] + window[1]) / 2 / height);
    c.shift[1] = static_cast<float>((window[2] + window[3]) / 2 / height);
    if (camera_kind_ == "orthographic") {
      c.orthographic = 1;
      c.height = static_cast<float>(height * length(world->column(1)));
    } else {
      if (camera_kind_ != "perspective")
        build_.approximate(fmt::format("the camera {} is taken as perspective", camera_kind_));
      const double fov = camera_.number("fov", 90);
      if (!(fov > 0.01 && fov < 179)) build_.fail("Camera", fmt::format("its fov is {}", fov));
      c.fov_y = static_cast<float>(2 * std::atan(std::tan(radians(fov) / 2) * height / 2));
    }
    const double lens = camera_.number("lensradius", 0), focus = camera_.number("focaldistance", 1e6);
    if (lens > 0 && focus > 0) c.lens_radius = static_cast<float>(lens), c.focus_distance = static_cast<float>(focus);
  }

  // ---- Colours and textures

  enum class Use { reflectance, light, number };

  std::vector<std::pair<double, double>> samples(const Parameter& p) {
    std::vector<std::pair<double, double>> out;
    std::vector<double> values = p.numbers;
    if (!p.words.empty()) {
      const FoundFile file = find_beside(build_.path(), p.words[0]);
      if (file.path.empty()) return out;
      Tokens words(file.path);
      while (const auto token = words.next()) values.push_back(number_of(*token, "a spectrum's file"));
    }
    for (size_t i = 0; i + 1 < values.size(); i += 2) out.emplace_back(values[i], values[i + 1]);
    std::sort(out.begin(), out.end());
    return out;
  }
  // Light has luminance 1 but for "rgb", whose numbers are what they are.
  Vec colour(const Parameter* p, const Vec& otherwise, Use use) {
    if (p == nullptr) return otherwise;
    if (p->type == "rgb" || p->type == "color") {
      if (p->numbers.size() != 3)
        tokens_.fail(fmt::format("\"{}\" has {} numbers instead of 3", p->name, p->numbers.size()));
      return {p->numbers[0], p->numbers[1], p->numbers[2]};
    }
    if (p->type == "blackbody" && !p->numbers.empty()) {
      if (!(p->numbers[0] > 100 && p->numbers[0] < 1e6))
        tokens_.fail(fmt::format("a black body of {} K", p->numbers[0]));
      return blackbody(p->numbers[0]);
    }
    if (p->type == "float" && !p->numbers.empty()) return {p->numbers[0], p->numbers[0], p->numbers[0]};
    if (p->type != "spectrum") return otherwise;
    if (!p->words.empty()) {
      const std::string& name = p->words[0];
      if (name == "stdillum-A") return blackbody(2856);
      if (name.starts_with("stdillum-")) return {1, 1, 1};
      if (const auto glass = named_glass(name)) return {*glass, *glass, *glass};
    }
    const auto spectrum = samples(*p);
    if (spectrum.empty()) {
      build_.approximate(
          fmt::format("the spectrum {} is not known; grey stands in", p->words.empty() ? "" : p->words[0]));
      return otherwise;
    }
    Vec rgb = rgb_of_spectrum(spectrum);
    if (use == Use::light) {
      const double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
      return luminance > 0 ? rgb * (1 / luminance) : rgb;
    }
    const Vec flat = rgb_of_spectrum({{300, 1}, {900, 1}});
    for (size_t k = 0; k < 3; ++k) rgb[k] /= flat[k];
    return rgb;
  }
  static std::optional<double> named_glass(const std::string& name) {
    static const std::map<std::string, double> kGlasses = {
        {"glass-BK7", 1.5168}, {"glass-BAF10", 1.6700}, {"glass-FK51A", 1.4866}, {"glass-LASF9", 1.8503},
        {"glass-F5", 1.6727},  {"glass-SF5", 1.6727},   {"glass-F10", 1.7283},   {"glass-SF10", 1.7283},
        {"glass-F11", 1.7847}, {"glass-SF11", 1.7847}};
    const auto found = kGlasses.find(name);
    if (found == kGlasses.end()) return std::nullopt;
    return found->second;
  }
  PaintRef paint(const Parameters& p, const char* name, double otherwise) {
    const Parameter* given = p.find(name);
    if (given == nullptr) return constant_paint(otherwise);
    if (given->type == "texture") {
      const auto found = given->words.empty() ? textures_.end() : textures_.find(given->words[0]);
      if (found != textures_.end()) return found->second;
      build_.scene.warnings.add("unknown textures", build_.path(),
                                fmt::format("there is no texture \"{}\"; {} stands in",
                                            given->words.empty() ? "" : shown(given->words[0]), otherwise));
      return constant_paint(otherwise);
    }
    return constant_paint(colour(given, {otherwise, otherwise, otherwise}, Use::reflectance));
  }

  void texture(const std::string& name, const std::string& kind, const Parameters& p) {
    Paint out;
    out.uv[0] = p.number("uscale", 1), out.uv[1] = p.number("vscale", 1);
    out.uv[2] = p.number("udelta", 0), out.uv[3] = p.number("vdelta", 0);
    if (p.word("mapping", "uv") != "uv")
      build_.approximate(fmt::format("textures mapped {} are taken as by uv", p.word("mapping", "uv")));
    PaintRef result;
    if (kind == "constant") {
      result = paint(p, "value", 1);
    } else if (kind == "scale") {
      out.kind = Paint::Kind::product, out.a = paint(p, "tex", 1), out.b = paint(p, "scale", 1);
      result = build_.made(out);
    } else if (kind == "mix") {
      out.kind = Paint::Kind::mix, out.a = paint(p, "tex1", 0), out.b = paint(p, "tex2", 1),
      out.share = paint(p, "amount", 0.5);
      result = build_.made(out);
    } else if (kind == "checkerboard" && p.number("dimension", 2) == 2) {
      out.kind = Paint::Kind::checker, out.a = paint(p, "tex1", 1), out.b = paint(p, "tex2", 0);
      result = build_.made(out);
    } else if (kind == "imagemap") {
      const std::string encoding = p.word("encoding", "sRGB"), wrap = p.word("wrap", "repeat");
      if (encoding != "sRGB" && encoding != "linear")
        build_.approximate(fmt::format("textures of the encoding \"{}\" are taken as sRGB", encoding));
      uint32_t flags = wrap == "clamp" ? uint32_t{LUMICUT_CLAMP} : 0u;
      if (wrap != "clamp" && wrap != "repeat") build_.approximate(fmt::format("textures wrapped \"{}\" repeat", wrap));
      if (p.word("filter", "bilinear") == "point") flags |= LUMICUT_NEAREST;
      out.kind = Paint::Kind::image;
      out.texture =
          build_.image(p.word("filename", ""), encoding == "linear" ? TextureUse::numbers : TextureUse::colour, flags);
      if (out.texture == 0) {
        result = constant_paint(0.5);
      } else {
        result = build_.made(out);
        if (const double scale = p.number("scale", 1); scale != 1) result = product(result, constant_paint(scale));
        if (p.truth("invert", false)) {
          Paint inverted;
          inverted.kind = Paint::Kind::invert, inverted.a = result;
          result = build_.made(inverted);
        }
      }
    } else {
      build_.approximate(fmt::format("the texture \"{}\" of the kind {} is grey", name, kind));
      result = constant_paint(0.5);
    }
    textures_[name] = result;
  }
  PaintRef product(const PaintRef& a, const PaintRef& b) const {
    Paint out;
    out.kind = Paint::Kind::product, out.a = a, out.b = b;
    return build_.made(out);
  }

  // ---- Materials

  // The library's roughness is the root of GGX's alpha, which is the root of pbrt's roughness where that is remapped.
  void set_roughness(const Parameters& p, const std::string& prefix, lumicut_material& m) {
    PaintRef rough = paint(p, (prefix + "roughness").c_str(), 0);
    if (p.find(prefix + "uroughness") != nullptr || p.find(prefix + "vroughness") != nullptr) {
      rough = paint(p, (prefix + (p.find(prefix + "uroughness") != nullptr ? "uroughness" : "vroughness")).c_str(), 0);
      build_.approximate("roughness that differs along u and v is taken as that along u");
    }
    build_.set_number(power_paint(rough, p.truth("remaproughness", true) ? 0.25 : 0.5), m.roughness,
                      m.roughness_texture);
  }
  double index(const Parameters& p, const char* name, double otherwise) {
    const Vec eta = colour(p.find(name), {otherwise, otherwise, otherwise}, Use::number);
    return std::clamp(eta[1], 0.1, 10.0);
  }
  void set_metal(const Parameters& p, const std::string& prefix, lumicut_material& m) {
    m.metallic = 1;
    if (p.find("reflectance") != nullptr) {
      build_.set_colour(paint(p, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
      return;
    }
    const Parameter *eta = p.find(prefix + "eta"), *k = p.find(prefix + "k");
    std::pair<Vec, Vec> both = *named_metal("Cu");
    const auto one = [&](const Parameter* given, Vec& out, bool absorbing) {
      if (given == nullptr) return;
      if (given->type == "spectrum" && !given->words.empty() && given->words[0].starts_with("metal-")) {
        const std::string name = given->words[0].substr(6, given->words[0].rfind('-') - 6);
        if (const auto known = named_metal(name)) {
          out = absorbing ? known->second : known->first;
          return;
        }
      }
      out = colour(given, out, Use::number);
    };
    one(eta, both.first, false), one(k, both.second, true);
    const Metal metal = metal_of(both.first, both.second);
    store(m.diffuse, metal.colour), store(m.specular_tint, metal.tint);
  }

  uint32_t material(const std::string& name, const std::string& kind, const Parameters& p) {
    lumicut_material m = default_material();
    const auto ggx = [&] {
      m.flags |= LUMICUT_GGX;
      for (float& c : m.specular) c = 1;
      for (float& c : m.diffuse) c = 1;
    };
    if (kind == "diffuse") {
      build_.set_colour(paint(p, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
    } else if (kind == "coateddiffuse") {
      ggx();
      build_.set_colour(paint(p, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
      m.ior = static_cast<float>(index(p, "eta", 1.5));
      set_roughness(p, "", m);
    } else if (kind == "conductor") {
      ggx();
      set_metal(p, "", m);
      set_roughness(p, "", m);
    } else if (kind == "coatedconductor") {
      ggx();
      set_metal(p, "conductor.", m);
      set_roughness(p, "conductor.", m);
      m.coat = 1, m.coat_ior = static_cast<float>(std::max(1.0, index(p, "interface.eta", 1.5)));
      lumicut_material coat{};
      set_roughness(p, "interface.", coat);
      m.coat_roughness = coat.roughness;
    } else if (kind == "dielectric" || kind == "thindielectric") {
      ggx();
      m.transmission = 1, m.ior = static_cast<float>(index(p, "eta", 1.5));
      if (kind == "dielectric")
        set_roughness(p, "", m);
      else
        m.roughness = 0, m.flags |= LUMICUT_SHADOWS_PASS;
    } else if (kind == "diffusetransmission") {
      build_.set_colour(paint(p, "reflectance", 0.25), m.diffuse, m.diffuse_texture);
      build_.set_colour(paint(p, "transmittance", 0.25), m.translucency, m.translucency_texture);
      if (p.number("scale", 1) != 1)
        for (size_t k = 0; k < 3; ++k) {
          const auto scale = static_cast<float>(std::clamp(p.number("scale", 1), 0.0, 1e6));
          m.diffuse[k] *= scale, m.translucency[k] *= scale;
          if (m.diffuse_texture == 0) m.diffuse[k] = std::min(m.diffuse[k], 1.0f);
          if (m.translucency_texture == 0) m.translucency[k] = std::min(m.translucency[k], 1.0f);
        }
    } else if (kind == "mix") {
      const Parameter* both = p.find("materials");
      if (both != nullptr && both->words.size() == 2) {
        const bool second = constant_of(paint(p, "amount", 0.5)).value_or(Vec{0.5, 0.5, 0.5})[0] > 0.5;
        build_.approximate(fmt::format("the material \"{}\", a mix, is the one that it has more of", name));
        const auto found = materials_.find(both->words[second ? 1 : 0]);
        if (found != materials_.end()) return found->second.first;
      }
    } else if (!(kind.empty() || kind == "interface" || kind == "none")) {
      build_.approximate(fmt::format("the material \"{}\" of the kind {} is diffuse", name, kind));
      build_.set_colour(paint(p, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
    }
    if (const std::string map = p.word("normalmap", ""); !map.empty()) {
      m.normal_texture = build_.image(map, TextureUse::vectors, 0);
      if (m.normal_texture != 0) m.normal_strength = 1;
    }
    if (p.find("displacement") != nullptr) build_.leave_out("displacement");
    return build_.add_material(name, m);
  }

  // ---- Lights

  void light(const std::string& kind, const Parameters& p) {
    const std::string name = fmt::format("LightSource \"{}\" ({})", kind, tokens_.where());
    lumicut_light l{};
    double scale = p.number("scale", 1);
    const Vec from = p.vector("from", {0, 0, 0}), to = p.vector("to", {0, 0, 1});
    if (kind == "point" || kind == "spot") {
      Vec intensity = colour(p.find("I"), {1, 1, 1}, Use::light);
      const Vec place = state_.ctm.point(from);
      const double power = p.number("power", -1);
      if (kind == "point") {
        if (power > 0) scale *= power / (4 * kPi);
        l.type = LUMICUT_POINT;
      } else {
        const double outer = radians(p.number("coneangle", 30)), start = outer - radians(p.number("conedeltaangle", 5));
        if (!(outer > 1e-3 && outer <= kPi / 2 && start >= 0 && start <= outer))
          tokens_.fail(
              fmt::format("a spot of {} and {} degrees", p.number("coneangle", 30), p.number("conedeltaangle", 5)));
        const double c0 = std::cos(start), c1 = std::cos(outer);
        if (power > 0) scale *= power / (2 * kPi * ((1 - c0) + (c0 - c1) / 2));
        l.type = LUMICUT_SPOT;
        l.angle = static_cast<float>(2 * outer);
        l.blend = static_cast<float>(std::clamp((c0 - c1) / (1 - c1), 0.0, 1.0));
        store(l.direction, unit(state_.ctm.vector(to - from)));
      }
      store(l.position, place);
      set_value(l, intensity, scale, name);
    } else if (kind == "distant") {
      const Vec radiance = colour(p.find("L"), {1, 1, 1}, Use::light);
      if (const double lux = p.number("illuminance", -1); lux > 0) scale *= lux;
      l.type = LUMICUT_SUN;
      store(l.direction, unit(state_.ctm.vector(to - from)));
      set_value(l, radiance, scale, name);
    } else if (kind == "infinite") {
      infinite(p, scale, name);
    } else {
      build_.leave_out(fmt::format("lights of the kind {}", kind));
    }
  }
  void set_value(lumicut_light& l, const Vec& rgb, double scale, const std::string& name) {
    for (size_t k = 0; k < 3; ++k) {
      if (!(rgb[k] >= 0 && rgb[k] <= 1e15)) tokens_.fail(fmt::format("{} has a colour of {}", name, rgb[k]));
      l.color[k] = static_cast<float>(rgb[k]);
    }
    if (!(scale >= 0 && scale < 1e20)) tokens_.fail(fmt::format("{} has a scale of {}", name, scale));
    l.value = static_cast<float>(scale);
    build_.add_light(l, name);
  }

  void infinite(const Parameters& p, double scale, const std::string& name) {
    if (build_.scene.environment) build_.leave_out("all infinite lights but the last");
    lumicut_environment e{};
    e.struct_size = sizeof(e);
    const std::string file = p.word("filename", "");
    const double lux = p.number("illuminance", -1);
    Vec rgb{1, 1, 1};
    if (file.empty()) {
      rgb = colour(p.find("L"), {1, 1, 1}, Use::light);
      if (lux > 0) scale *= lux / kPi;
    } else {
      if (lux > 0) build_.leave_out("the illuminance of infinite lights with a picture");
      const int32_t square = build_.image(file, TextureUse::radiance, 0);
      if (square != 0) e.texture = unrolled(square);
    }
    if (!(scale >= 0 && scale < 1e15)) tokens_.fail(fmt::format("{} has a scale of {}", name, scale));
    for (size_t k = 0; k < 3; ++k) e.color[k] = static_cast<float>(std::clamp(rgb[k], 0.0, 1e15) * scale);
    // Axes of the light in the world, z up; what mirrors is taken into the map.
    const Vec x = unit(state_.ctm.column(0)), y = unit(state_.ctm.column(1)), z = unit(state_.ctm.column(2));
    const bool mirrored = state_.ctm.determinant() < 0;
    if (mirrored && e.texture != 0) mirror(e.texture);
    const Vec rows[3] = {x, mirrored ? y * -1.0 : y, z};
    for (size_t r = 0; r < 3; ++r)
      for (size_t c = 0; c < 3; ++c) e.world_to_map[3 * r + c] = static_cast<float>(rows[r][c]);
    build_.scene.environment = e;
  }
  // y and -y change places: in the map, the columns about x.
  void mirror(int32_t number) {
    Texture& t = build_.scene.textures.at(static_cast<size_t>(number) - 1);
    const std::vector<float> before = t.floats;
    const size_t n = t.channels;
    for (size_t row = 0; row < t.height; ++row)
      for (size_t c = 0; c < t.width; ++c)
        for (size_t k = 0; k < n; ++k)
          t.floats[(row * t.width + c) * n + k] = before[(row * t.width + (t.width - 1 - c)) * n + k];
  }
  // A map by latitude and longitude of one on pbrt's equal-area octahedron. [Clarberg 2008]
  int32_t unrolled(int32_t square) {
    const Texture from = build_.scene.textures.at(static_cast<size_t>(square) - 1);
    if (from.width != from.height) {
      build_.approximate("a picture of an infinite light that is not square is taken as latitude and longitude");
      return square;
    }
    Texture out;
    out.file = from.file;
    out.height = std::clamp(from.width, 16u, 4096u), out.width = 2 * out.height, out.channels = from.channels;
    out.floats.resize(size_t{out.width} * out.height * out.channels);
    const size_t n = from.channels, size = from.width;
    for (size_t row = 0; row < out.height; ++row)
      for (size_t col = 0; col < out.width; ++col) {
        const double latitude = kPi * (0.5 - (double(row) + 0.5) / out.height),
                     longitude = 2 * kPi * (0.5 - (double(col) + 0.5) / out.width);
        const double x = std::cos(latitude) * std::cos(longitude), y = std::cos(latitude) * std::sin(longitude),
                     z = std::sin(latitude);
        const double radius = std::sqrt(std::max(0.0, 1 - std::abs(z)));
        const double high = std::max(std::abs(x), std::abs(y)), low = std::min(std::abs(x), std::abs(y));
        double part = high > 0 ? std::atan(low / high) * 2 / kPi : 0;
        if (std::abs(x) < std::abs(y)) part = 1 - part;
        double v = part * radius, u = radius - v;
        if (z < 0) std::swap(u, v), u = 1 - u, v = 1 - v;
        u = std::copysign(u, x), v = std::copysign(v, y);
        // Bilinear inside of the square; at its border the nearest texel.
        const double px = std::clamp((u + 1) / 2 * double(size) - 0.5, 0.0, double(size - 1)),
                     py = std::clamp((v + 1) / 2 * double(size) - 0.5, 0.0, double(size - 1));
        const auto x0 = static_cast<size_t>(px), y0 = static_cast<size_t>(py);
        const size_t x1 = std::min(x0 + 1, size - 1), y1 = std::min(y0 + 1, size - 1);
        const double fx = px - double(x0), fy = py - double(y0);
        for (size_t k = 0; k < n; ++k) {
          const auto at = [&](size_t ix, size_t iy) { return double{from.floats[(iy * size + ix) * n + k]}; };
          out.floats[(row * out.width + col) * n + k] = static_cast<float>(
              (at(x0, y0) * (1 - fx) + at(x1, y0) * fx) * (1 - fy) + (at(x0, y1) * (1 - fx) + at(x1, y1) * fx) * fy);
        }
      }
    build_.scene.textures.push_back(std::move(out));
    return static_cast<int32_t>(build_.scene.textures.size());
  }

  // ---- Shapes

  void shape(const std::string& kind, const Parameters& p) {
    const std::string name = fmt::format("Shape \"{}\" ({})", kind, tokens_.where());
    Affine place = state_.ctm;
    Geometry g;
    std::string key;
    std::vector<Geometry> several;
    const double radius = p.number("radius", 1), sweep = radians(std::clamp(p.number("phimax", 360), 0.1, 360.0));
    if (kind == "sphere") {
      if (p.find("zmin") != nullptr || p.find("zmax") != nullptr || p.find("phimax") != nullptr)
        build_.approximate("parts of spheres are whole");
      g = sphere(), key = "sphere";
      place = place * scaling({radius, radius, radius});
    } else if (kind == "disk") {
      g = disk_geometry(p.number("height", 0), radius, p.number("innerradius", 0), sweep);
    } else if (kind == "cylinder") {
      g = cylinder_geometry(radius, p.number("zmin", -1), p.number("zmax", 1), sweep);
    } else if (kind == "trianglemesh" || kind == "loopsubdiv" || kind == "bilinearmesh") {
      if (kind == "loopsubdiv") build_.approximate("subdivision surfaces are their control meshes");
      g = mesh(p, kind == "bilinearmesh" ? 4 : 3, name);
    } else if (kind == "plymesh") {
      several = build_.read_meshes(p.word("filename", ""));
      for (Geometry& one : several) follow_normals(one);
      if (p.find("displacement") != nullptr) build_.leave_out("displacement");
    } else {
      build_.leave_out(fmt::format("shapes of the kind {}", kind));
      return;
    }
    uint32_t used = state_.material;
    if (state_.nothing && !state_.area_light) return build_.leave_out("borders of media");
    if (p.find("alpha") != nullptr) used = with_alpha(used, p);
    if (several.empty()) several.push_back(std::move(g));
    // Normals of meshes follow their transform; those of the others are the product of two tangents that do.
    const bool turned = (kind == "sphere" || kind == "disk" || kind == "cylinder") && place.determinant() < 0;
    for (Geometry& one : several) put(name, std::move(one), place, used, state_.reversed != turned, key);
  }
  void put(const std::string& name, Geometry&& g, const Affine& place, uint32_t material, bool flipped,
           const std::string& key) {
    if (state_.area_light) {
      if (object_)
        build_.leave_out("area lights inside of objects");
      else
        material = emitting(*state_.area_light, g, place, material);
    }
    if (!object_) return build_.add(name, g, place, material, flipped, key);
    auto& parts = objects_[*object_];
    const std::string own = fmt::format("object \"{}\" {}", *object_, parts.size());
    parts.push_back({name, own, std::make_shared<Geometry>(std::move(g)), place, material, flipped});
  }
  const Geometry& sphere() {
    if (!sphere_) sphere_ = sphere_geometry();
    return *sphere_;
  }

  Geometry mesh(const Parameters& p, size_t corners, const std::string& name) {
    Geometry g;
    const auto list = [&](const char* key) {
      const Parameter* found = p.find(key);
      return found == nullptr ? std::vector<double>{} : found->numbers;
    };
    const auto add = [&](std::vector<float>& to, const std::vector<double>& values) {
      for (const double v : values) to.push_back(static_cast<float>(v));
    };
    add(g.positions, list("P"));
    const size_t vertices = g.positions.size() / 3;
    if (vertices == 0 || g.positions.size() % 3 != 0)
      tokens_.fail(fmt::format("{} has {} numbers in P", name, g.positions.size()));
    add(g.normals, list("N"));
    add(g.uvs, list("uv"));
    if (g.uvs.empty()) add(g.uvs, list("st"));
    if ((!g.normals.empty() && g.normals.size() != 3 * vertices) || (!g.uvs.empty() && g.uvs.size() != 2 * vertices))
      tokens_.fail(fmt::format("{} has {} vertices, but other numbers of N or uv", name, vertices));
    std::vector<double> indices = list("indices");
    if (indices.empty() && vertices == corners)
      for (size_t i = 0; i < corners; ++i) indices.push_back(double(i));
    if (indices.empty() || indices.size() % corners != 0)
      tokens_.fail(fmt::format("{} has {} indices", name, indices.size()));
    std::vector<uint32_t> all;
    for (const double i : indices) {
      if (!(i >= 0 && i < double(vertices) && i == std::floor(i)))
        tokens_.fail(fmt::format("{} has the index {} of {} vertices", name, i, vertices));
      all.push_back(static_cast<uint32_t>(i));
    }
    if (corners == 3) {
      g.indices = std::move(all);
      all.clear();
    }
    for (size_t i = 0; i + 3 < all.size(); i += 4)
      g.indices.insert(g.indices.end(), {all[i], all[i + 1], all[i + 3], all[i], all[i + 3], all[i + 2]});
    for (size_t i = 0; i < g.normals.size(); i += 3)
      if (!(std::hypot(g.normals[i], g.normals[i + 1], g.normals[i + 2]) > 0)) {
        build_.approximate("meshes with a normal of length 0 are flat");
        g.normals.clear();
      }
    follow_normals(g);
    if (g.uvs.empty() && (corners == 4 || build_.scene.materials[state_.material].values.diffuse_texture != 0))
      add_uvs(g, corners);
    return g;
  }
  // Those of meshes that have none: each triangle's or patch's own.
  static void add_uvs(Geometry& g, size_t corners) {
    constexpr float kTriangle[3][2] = {{0, 0}, {1, 0}, {1, 1}},
                    kPatch[6][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
    Geometry out;
    for (size_t i = 0; i < g.indices.size(); ++i) {
      const size_t v = 3 * size_t{g.indices[i]};
      out.positions.insert(out.positions.end(), &g.positions[v], &g.positions[v] + 3);
      if (!g.normals.empty()) out.normals.insert(out.normals.end(), &g.normals[v], &g.normals[v] + 3);
      const auto& uv = corners == 4 ? kPatch[i % 6] : kTriangle[i % 3];
      out.uvs.insert(out.uvs.end(), {uv[0], uv[1]});
      out.indices.push_back(static_cast<uint32_t>(i));
    }
    g = std::move(out);
  }
  // The front is where the given normals point.
  static void follow_normals(Geometry& g) {
    if (g.normals.empty()) return;
    for (size_t i = 0; i + 2 < g.indices.size(); i += 3) {
      Vec p[3], n{0, 0, 0};
      for (size_t k = 0; k < 3; ++k) {
        std::copy_n(&g.positions[3 * size_t{g.indices[i + k]}], 3, p[k].begin());
        for (size_t c = 0; c < 3; ++c) n[c] += g.normals[3 * size_t{g.indices[i + k]} + c];
      }
      if (dot(cross(p[1] - p[0], p[2] - p[0]), n) < 0) std::swap(g.indices[i + 1], g.indices[i + 2]);
    }
  }

  uint32_t with_alpha(uint32_t material, const Parameters& p) {
    lumicut_material m = build_.scene.materials[material].values;
    const PaintRef alpha = paint(p, "alpha", 1);
    if (const auto value = constant_of(alpha)) {
      if ((*value)[0] >= 1) return material;
      m.opacity = std::max(kHole, static_cast<float>((*value)[0]));
    } else {
      m.opacity_texture = build_.number_texture(alpha);
    }
    return build_.add_material(build_.scene.materials[material].name + " with alpha", m);
  }
  uint32_t emitting(const Parameters& p, const Geometry& g, const Affine& place, uint32_t material) {
    Vec radiance = colour(p.find("L"), {1, 1, 1}, Use::light);
    double scale = p.number("scale", 1);
    const bool both = p.truth("twosided", false);
    if (!p.word("filename", "").empty()) build_.leave_out("pictures of area lights");
    if (const double power = p.number("power", -1); power > 0) {
      double area = 0;
      for (size_t i = 0; i + 2 < g.indices.size(); i += 3) {
        Vec q[3];
        for (size_t k = 0; k < 3; ++k) {
          Vec local;
          std::copy_n(&g.positions[3 * size_t{g.indices[i + k]}], 3, local.begin());
          q[k] = place.point(local);
        }
        area += length(cross(q[1] - q[0], q[2] - q[0])) / 2;
      }
      if (area > 0) scale *= power / (area * kPi * (both ? 2 : 1));
    }
    if (!(scale >= 0 && scale < 1e15)) tokens_.fail(fmt::format("an area light has a scale of {}", scale));
    return build_.with_emission(material, radiance * scale, 0, both);
  }

  Tokens tokens_;
  SceneBuilder build_;
  State state_;
  std::vector<State> stack_;
  std::map<std::string, Affine> systems_;
  std::map<std::string, PaintRef> textures_;
  std::map<std::string, std::pair<uint32_t, bool>> materials_;  // and whether it is the border of a medium
  std::map<std::string, std::vector<Part>> objects_;
  std::optional<std::string> object_;
  std::optional<Geometry> sphere_;
  std::string camera_kind_;
  Parameters camera_;
  Affine camera_place_;
  bool has_camera_ = false;
  size_t instances_ = 0;
};

}  // namespace

bool is_pbrt(const std::string& path) { return lower(std::filesystem::path(path).extension().string()) == ".pbrt"; }

SceneData read_pbrt(const std::string& path) {
  check_regular_file(path);
  return Reader(path).read();
}

}  // namespace lumicut::io
