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
#include <set>
#include <tuple>

#include "io/curves.h"
#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/loop_subdivision.h"
#include "io/pbrt_tokens.h"
#include "io/scene_builder.h"
#include "io/scene_defaults.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

constexpr size_t kDeepest = 1024;  // of attributes
constexpr size_t kMostInstances = 1 << 24;

struct Parameters : PbrtParameters {
  std::set<std::string> given;  // by Attribute
};

struct State {
  Affine ctm;
  bool reversed = false, nothing = false;  // nothing: a border between media
  bool still = true;                       // transforms are those at the beginning of the frame
  uint32_t material = 0;
  std::optional<Parameters> area_light;
  std::string inside;                           // the medium
  std::map<std::string, PbrtParameters> given;  // by Attribute to shapes, lights, materials ...
};

// What AttributeBegin, TransformBegin or ObjectBegin kept.
struct Opened {
  State state;
  std::string word, file;
  int line;
};

// Curves that follow each other under one state: one mesh.
struct Curves {
  std::vector<Strand> strands;
  std::string name;
  Affine place;
  uint32_t material = 0;
  bool reversed = false;
};

// A shape of an object that is placed later.
struct Part {
  std::string name, key;
  std::shared_ptr<const Geometry> geometry;
  Affine place;
  uint32_t material;
  bool flipped;
  uint32_t mask;
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
    if (!stack_.empty()) tokens_.fail(fmt::format("the file ends, and {} has no end", opened(stack_.back())));
    put_curves();
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
  std::vector<double> numbers(size_t count, const char* what) {
    std::vector<double> out;
    const bool bracket = tokens_.peek() && tokens_.peek()->text == "[" && !tokens_.peek()->quoted;
    if (bracket) tokens_.next();
    for (size_t i = 0; i < count; ++i) {
      const auto token = tokens_.next();
      if (!token) tokens_.fail(fmt::format("{} needs {} numbers", what, count));
      out.push_back(pbrt_number(tokens_, *token, what));
    }
    if (bracket && tokens_.next().value_or(PbrtToken{}).text != "]")
      tokens_.fail(fmt::format("{} has more than {} numbers", what, count));
    return out;
  }
  // With those that Attribute gives to all statements of that kind.
  Parameters parameters(const char* target = "") {
    Parameters out{pbrt_parameters(tokens_), {}};
    std::set<std::string> names;
    for (const PbrtParameter& p : out.list)
      if (!names.insert(p.name).second)
        build_.scene.warnings.add("repeated parameters", *p.file, p.line,
                                  fmt::format("\"{}\" is given twice; the first counts", shown(p.name)));
    if (const auto given = state_.given.find(target); given != state_.given.end())
      for (const PbrtParameter& p : given->second.list) {
        out.list.push_back(p);
        out.given.insert(p.name);
      }
    return out;
  }
  // What nothing here asks for.
  void tell_unread(const std::string& what, const Parameters& p) {
    for (const std::string& name : p.unread())
      if (p.given.count(name) == 0) build_.leave_out(fmt::format("\"{}\" of {}", name, what));
  }

  // For warnings of values that are cut.
  ValuePlace at(const std::string& what, const std::string& key) const {
    return {tokens_.file(), tokens_.line(), what + ": " + key};
  }
  ValuePlace of_material(const std::string& name, const std::string& key) const {
    return at(fmt::format("material \"{}\"", shown(name)), key);
  }

  // ---- Statements

  void push(const std::string& word) {
    if (stack_.size() >= kDeepest) tokens_.fail("attributes lie in each other without end");
    stack_.push_back({state_, word, tokens_.file(), tokens_.line()});
  }
  static std::string opened(const Opened& o) { return fmt::format("the {} of line {} of {}", o.word, o.line, o.file); }
  // What `end` closes: of an object or not.
  State pop(const std::string& end) {
    if (stack_.empty()) tokens_.fail(fmt::format("{} without its beginning", end));
    if ((stack_.back().word == "ObjectBegin") != (end == "ObjectEnd"))
      tokens_.fail(fmt::format("{} where {} has no end yet", end, opened(stack_.back())));
    State out = std::move(stack_.back().state);
    stack_.pop_back();
    return out;
  }

  void statement(const std::string& word) {
    const auto times = [&](const Affine& m) {
      if (state_.still) state_.ctm = state_.ctm * m;
    };
    if (word == "Identity") {
      if (state_.still) state_.ctm = {};
    } else if (word == "Translate") {
      const auto n = numbers(3, "Translate");
      times(translation({n[0], n[1], n[2]}));
    } else if (word == "Scale") {
      const auto n = numbers(3, "Scale");
      times(scaling({n[0], n[1], n[2]}));
    } else if (word == "Rotate") {
      const auto n = numbers(4, "Rotate");
      if (n[0] != 0 && !(length(Vec{n[1], n[2], n[3]}) > 0)) tokens_.fail("Rotate turns about no axis");
      times(rotation({n[1], n[2], n[3]}, radians(n[0])));
    } else if (word == "LookAt") {
      look_at();
    } else if (word == "Transform" || word == "ConcatTransform") {
      const auto n = numbers(16, word.c_str());
      if (n[3] != 0 || n[7] != 0 || n[11] != 0 || n[15] != 1) tokens_.fail(fmt::format("{} is not affine", word));
      Affine m;
      for (size_t r = 0; r < 3; ++r)
        for (size_t c = 0; c < 4; ++c) m.m[4 * r + c] = n[4 * c + r];
      if (word == "Transform" && state_.still) state_.ctm = {};
      times(m);
    } else if (word == "CoordinateSystem") {
      systems_[quoted("CoordinateSystem")] = state_.ctm;
    } else if (word == "CoordSysTransform") {
      const std::string name = quoted("CoordSysTransform");
      const auto found = systems_.find(name);
      if (found == systems_.end()) tokens_.fail(fmt::format("there is no coordinate system \"{}\"", shown(name)));
      if (state_.still) state_.ctm = found->second;
    } else if (word == "ReverseOrientation") {
      state_.reversed = !state_.reversed;
    } else if (word == "AttributeBegin" || word == "TransformBegin") {
      push(word);
    } else if (word == "AttributeEnd" || word == "TransformEnd") {
      State before = pop(word);
      if (word == "TransformEnd")
        state_.ctm = before.ctm;
      else
        state_ = std::move(before);
    } else if (word == "Attribute") {
      const std::string target = quoted("Attribute");
      static const std::set<std::string> kTargets = {"shape", "light", "material", "medium", "texture"};
      if (kTargets.count(target) == 0) tokens_.fail(fmt::format("Attribute is for \"{}\"", shown(target)));
      PbrtParameters& given = state_.given[target];
      for (PbrtParameter& p : pbrt_parameters(tokens_).list) {
        std::erase_if(given.list, [&](const PbrtParameter& old) { return old.name == p.name; });
        given.list.push_back(std::move(p));
      }
    } else if (word == "WorldBegin") {
      state_.ctm = {};
      systems_["world"] = state_.ctm;
    } else if (word == "WorldEnd") {
    } else if (word == "Include" || word == "Import") {
      const std::string name = quoted(word.c_str());
      const FoundFile file = find_beside(build_.path(), name);
      if (file.path.empty()) tokens_.fail(missing_file("file", build_.path(), name));
      include(file.path);
    } else if (word == "ObjectBegin") {
      if (object_) tokens_.fail("ObjectBegin inside of an object");
      push(word);
      put_curves();
      object_ = quoted("ObjectBegin");
      objects_[*object_].clear();
    } else if (word == "ObjectEnd") {
      State before = pop(word);
      put_curves();
      object_.reset();
      state_ = std::move(before);
    } else if (word == "ObjectInstance") {
      instance(quoted("ObjectInstance"));
    } else if (word == "ActiveTransform") {
      const std::string which = tokens_.next().value_or(PbrtToken{}).text;
      state_.still = which != "EndTime";
      if (which != "All") build_.leave_out("motion");
    } else if (word == "TransformTimes") {
      numbers(2, "TransformTimes");
    } else if (word == "NamedMaterial") {
      const std::string name = quoted("NamedMaterial");
      std::tie(state_.material, state_.nothing) = named(name);
    } else {
      with_parameters(word);
    }
  }

  void with_parameters(const std::string& word) {
    if (word == "Option") {
      parameters();
      return;
    }
    static const std::set<std::string> kPassed = {"Sampler", "Integrator", "PixelFilter", "Accelerator", "ColorSpace"};
    if (word == "Texture") {
      const std::string name = quoted("Texture"), type = quoted("Texture"), kind = quoted("Texture");
      if (type != "float" && type != "spectrum" && type != "color")
        tokens_.fail(
            fmt::format("the texture \"{}\" is of the type \"{}\", not float or spectrum", shown(name), shown(type)));
      const Parameters p = parameters("texture");
      texture(name, type, kind, p);
      tell_unread(fmt::format("textures of the kind {}", kind), p);
    } else if (word == "MediumInterface") {
      state_.inside = quoted(word.c_str());
      bool outside = false;
      while (tokens_.peek() && tokens_.peek()->quoted) outside = !tokens_.next()->text.empty() || outside;
      if (outside) build_.leave_out("media");
    } else if (word == "MakeNamedMedium") {
      const std::string name = quoted(word.c_str());
      const Parameters p = parameters("medium");
      medium(name, p);
    } else if (kPassed.count(word) != 0) {
      const std::string kind = quoted(word.c_str());
      parameters();
      if (word == "ColorSpace" && kind != "srgb")
        build_.approximate(fmt::format("the colour space {} is taken as sRGB's", kind));
    } else if (word == "Film") {
      quoted("Film");
      const Parameters p = parameters();
      film(p);
      tell_unread("Film", p);
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
      const Parameters p = parameters("material");
      state_.material = material(kind, kind, p);
      state_.nothing = kind.empty() || kind == "interface" || kind == "none";
    } else if (word == "MakeNamedMaterial") {
      const std::string name = quoted("MakeNamedMaterial");
      const Parameters p = parameters("material");
      const std::string kind = p.word("type", "diffuse");
      materials_[name] = {material(name, kind, p), kind.empty() || kind == "interface" || kind == "none"};
    } else if (word == "AreaLightSource") {
      const std::string kind = quoted("AreaLightSource");
      state_.area_light = parameters("light");
      if (kind != "diffuse") build_.approximate(fmt::format("area lights of the kind {} are taken as diffuse", kind));
    } else if (word == "LightSource") {
      const std::string kind = quoted("LightSource");
      const Parameters p = parameters("light");
      light(kind, p);
      tell_unread(fmt::format("lights of the kind {}", kind), p);
    } else if (word == "Shape") {
      const std::string kind = quoted("Shape");
      const Parameters p = parameters("shape");
      shape(kind, p);
      tell_unread(fmt::format("shapes of the kind {}", kind), p);
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
    if (state_.still) state_.ctm = state_.ctm * *inverse(m);
  }

  void instance(const std::string& name) {
    const auto found = objects_.find(name);
    if (found == objects_.end()) tokens_.fail(fmt::format("there is no object \"{}\"", shown(name)));
    if (object_) tokens_.fail("ObjectInstance inside of an object");
    for (const Part& part : found->second) {
      if (++instances_ > kMostInstances) tokens_.fail("there are too many instances");
      build_.add(part.name, *part.geometry, state_.ctm * part.place, part.material, part.flipped, part.key, part.mask);
    }
  }

  // ---- Camera

  void film(const Parameters& p) {
    const double width = p.number("xresolution", 1280), height = p.number("yresolution", 720);
    if (!(width >= 1 && width <= 65536 && height >= 1 && height <= 65536))
      tokens_.fail(fmt::format("a film of {} by {} pixels", width, height));
    build_.scene.width = static_cast<uint32_t>(width), build_.scene.height = static_cast<uint32_t>(height);
    if (p.word("sensor", "cie1931") != "cie1931") build_.approximate("the film's sensor is taken as \"cie1931\"");
    const double exposure = p.number("exposuretime", 1) * p.number("iso", 100) / 100;
    if (!(exposure > 0 && exposure < 1e15)) tokens_.fail(fmt::format("a film that is exposed {} times", exposure));
    build_.exposure = exposure;
    if (p.number("whitebalance", 0) > 0) build_.leave_out("the film's white balance");
    if (p.find("cropwindow") != nullptr || p.find("pixelbounds") != nullptr) build_.leave_out("the film's crop");
    for (const char* name : {"filename", "savefp16", "diagonal", "maxcomponentvalue"}) p.ignore(name);
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
    if (!(aspect > 0)) build_.fail("Camera", fmt::format("its frameaspectratio is {:g}", aspect));
    double window[4] = {-1, 1, -1, 1};
    if (aspect > 1)
      window[0] = -aspect, window[1] = aspect;
    else
      window[2] = -1 / aspect, window[3] = 1 / aspect;
    if (const PbrtParameter* p = camera_.find("screenwindow"); p != nullptr) {
      if (p->numbers.size() != 4) p->fail(fmt::format("has {} numbers instead of 4", p->numbers.size()));
      std::copy(p->numbers.begin(), p->numbers.end(), window);
    }
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
    if (!(lens >= 0)) build_.fail("Camera", fmt::format("its lensradius is {:g}", lens));
    if (lens > 0 && !(focus > 0)) build_.fail("Camera", fmt::format("its focaldistance is {:g}", focus));
    if (lens > 0) c.lens_radius = static_cast<float>(lens), c.focus_distance = static_cast<float>(focus);
    for (const char* name : {"shutteropen", "shutterclose"}) camera_.ignore(name);
    tell_unread(fmt::format("Camera \"{}\"", camera_kind_), camera_);
  }

  // ---- Colours and textures

  enum class Use { reflectance, light, number };

  Spectrum samples(const PbrtParameter& p) {
    Spectrum out;
    std::vector<double> values = p.numbers;
    if (!p.words.empty()) {
      const FoundFile file = find_beside(build_.path(), p.words[0]);
      if (file.path.empty()) return out;
      PbrtTokens words(file.path);
      while (const auto token = words.next()) values.push_back(pbrt_number(words, *token, "a spectrum's file"));
    }
    if (values.size() % 2 != 0) p.fail(fmt::format("has {} numbers, not pairs", values.size()));
    for (size_t i = 0; i + 1 < values.size(); i += 2) out.emplace_back(values[i], values[i + 1]);
    if (const auto below = below_zero(out))
      p.fail(fmt::format("has the value {:g} at {:g} nm", below->second, below->first));
    std::sort(out.begin(), out.end());
    return out;
  }
  // Light has luminance 1 but for "rgb", whose numbers are what they are.
  Vec colour(const PbrtParameter* p, const Vec& otherwise, Use use) {
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
    if (p->type == "float") {
      const double value = one_number(*p);
      return {value, value, value};
    }
    if (p->type != "spectrum") p->fail("is no colour");
    if (!p->words.empty()) {
      const std::string& name = p->words[0];
      if (name == "stdillum-A") return blackbody(2856);
      if (name.starts_with("stdillum-") || name.starts_with("illum-")) {
        if (name != "stdillum-D65") build_.approximate(fmt::format("the light {} is white", name));
        return {1, 1, 1};
      }
      if (const auto glass = named_glass(name)) return {*glass, *glass, *glass};
    }
    const auto spectrum = samples(*p);
    if (spectrum.empty()) {
      build_.approximate(
          fmt::format("the spectrum {} is not known; grey stands in", p->words.empty() ? "" : p->words[0]));
      return otherwise;
    }
    if (use == Use::light) {
      const Vec rgb = rgb_of_spectrum(spectrum);
      const double white = luminance(rgb);
      return white > 0 ? rgb * (1 / white) : rgb;
    }
    return rgb_of_reflectance(spectrum);
  }
  static double one_number(const PbrtParameter& p) {
    if (p.numbers.size() != 1) p.fail(fmt::format("has {} numbers instead of one", p.numbers.size()));
    return p.numbers[0];
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
  // Of numbers and of colours there may be textures of one name.
  PaintRef paint(const Parameters& p, const char* name, double otherwise, bool of_numbers = false) {
    const PbrtParameter* given = p.find(name);
    if (given == nullptr) return constant_paint(otherwise);
    if (given->type == "texture") {
      for (const bool numbers : {of_numbers, !of_numbers}) {
        const auto found = given->words.empty() ? textures_.end() : textures_.find({given->words[0], numbers});
        if (found != textures_.end()) return found->second;
      }
      build_.scene.warnings.add("unknown textures", build_.path(),
                                fmt::format("there is no texture \"{}\"; {} stands in",
                                            given->words.empty() ? "" : shown(given->words[0]), otherwise));
      return constant_paint(otherwise);
    }
    return constant_paint(colour(given, {otherwise, otherwise, otherwise}, Use::reflectance));
  }
  // Of a material, 0 to 1.
  PaintRef share(const std::string& material, const Parameters& p, const std::string& name, double otherwise,
                 bool of_numbers = false) {
    return build_.cut(paint(p, name.c_str(), otherwise, of_numbers), 0, 1, of_material(material, name));
  }
  // Of a material; what pbrt may have as a texture, and is even here.
  double even_number(const std::string& material, const Parameters& p, const char* name, double otherwise, double low,
                     double high) {
    const PbrtParameter* given = p.find(name);
    if (given == nullptr || given->type != "texture")
      return build_.cut(p.number(name, otherwise), low, high, of_material(material, name));
    build_.approximate(fmt::format("textures of {} are their mean", name));
    return build_.cut(build_.mean_of(paint(p, name, otherwise, true))[0], low, high, of_material(material, name));
  }

  void texture(const std::string& name, const std::string& type, const std::string& kind, const Parameters& p) {
    const bool numbers = type == "float";
    const auto part = [&](const char* key, double otherwise) { return paint(p, key, otherwise, numbers); };
    Paint out;
    PaintRef result;
    if (kind == "constant") {
      result = part("value", 1);
    } else if (kind == "scale") {
      result = build_.product(part("tex", 1), paint(p, "scale", 1, true));
    } else if (kind == "mix") {
      result = build_.mixed(part("tex1", 0), part("tex2", 1), paint(p, "amount", 0.5, true));
    } else if (kind == "directionmix") {
      Paint along;
      along.kind = Paint::Kind::along;
      along.value = unit(state_.ctm.vector(p.vector("dir", {0, 1, 0})));
      result = build_.mixed(part("tex2", 1), part("tex1", 0), build_.made(along));
    } else if (kind == "bilerp") {
      const auto axis = [&](uint32_t which) {
        Paint coordinate;
        coordinate.kind = Paint::Kind::axis, coordinate.mode = which, coordinate.place = place_of(p, kind);
        return build_.made(coordinate);
      };
      const PaintRef t = axis(1);
      result = build_.mixed(build_.mixed(part("v00", 0), part("v01", 1), t),
                            build_.mixed(part("v10", 0), part("v11", 1), t), axis(0));
    } else if (kind == "checkerboard") {
      out.kind = Paint::Kind::checker, out.a = part("tex1", 1), out.b = part("tex2", 0);
      out.place =
          p.number("dimension", 2) == 3 ? TexturePlace{inverse_place(), TexturePlace::Kind::point} : place_of(p, kind);
      result = build_.made(out);
    } else if (kind == "imagemap") {
      const std::string encoding = p.word("encoding", "sRGB"), wrap = p.word("wrap", "repeat");
      if (encoding != "sRGB" && encoding != "linear")
        build_.approximate(fmt::format("textures of the encoding \"{}\" are taken as sRGB", encoding));
      uint32_t flags = wrap == "clamp" ? uint32_t{LUMICUT_CLAMP} : 0u;
      if (wrap == "black") out.mode = 1;
      if (wrap == "octahedralsphere") build_.approximate("textures wrapped \"octahedralsphere\" repeat");
      if (p.word("filter", "bilinear") == "point") flags |= LUMICUT_NEAREST;
      p.ignore("maxanisotropy");
      out.kind = Paint::Kind::image, out.place = place_of(p, kind);
      out.texture =
          build_.image(p.word("filename", ""), encoding == "linear" ? TextureUse::numbers : TextureUse::colour, flags);
      const double scale = p.number("scale", 1);
      const bool invert = p.truth("invert", false);
      if (out.texture == 0) {
        result = constant_paint(0.5);
      } else {
        result = build_.made(out);
        if (scale != 1) result = build_.product(result, constant_paint(scale));
        if (invert) {
          Paint inverted;
          inverted.kind = Paint::Kind::invert, inverted.a = result;
          result = build_.made(inverted);
        }
      }
    } else {
      build_.approximate(fmt::format("the texture \"{}\" of the kind {} is grey", name, kind));
      result = constant_paint(0.5);
      for (const PbrtParameter& q : p.list) p.ignore(q.name);
    }
    textures_[{name, numbers}] = result;
  }
  Affine inverse_place() const {
    const auto back = inverse(state_.ctm);
    if (!back) tokens_.fail("the texture's transform flattens space");
    return *back;
  }
  TexturePlace place_of(const Parameters& p, const std::string& kind) {
    TexturePlace out;
    const std::string mapping = p.word("mapping", "uv");
    const double du = p.number("udelta", 0), dv = p.number("vdelta", 0);
    if (mapping == "planar") {
      const Affine back = inverse_place();
      const Vec axes[2] = {p.vector("v1", {1, 0, 0}), p.vector("v2", {0, 1, 0})};
      out.kind = TexturePlace::Kind::point;
      for (size_t r = 0; r < 2; ++r) {
        for (size_t c = 0; c < 3; ++c) out.to.m[4 * r + c] = dot(axes[r], back.column(c));
        out.to.m[4 * r + 3] = dot(axes[r], back.column(3)) + (r == 0 ? du : dv);
      }
      out.to.m[8] = out.to.m[9] = out.to.m[10] = out.to.m[11] = 0;
      return out;
    }
    if (mapping == "spherical" || mapping == "cylindrical") {
      out.kind = mapping == "spherical" ? TexturePlace::Kind::sphere : TexturePlace::Kind::cylinder;
      out.to = inverse_place();
      return out;
    }
    if (mapping != "uv") build_.approximate(fmt::format("{}s mapped \"{}\" are taken as by uv", kind, mapping));
    out.to.m[0] = p.number("uscale", 1), out.to.m[5] = p.number("vscale", 1);
    out.to.m[3] = du, out.to.m[7] = dv;
    return out;
  }

  // ---- Materials

  // The library's roughness is the root of GGX's alpha, which is the root of pbrt's roughness where that is remapped.
  PaintRef roughness(const std::string& name, const Parameters& p, const std::string& prefix) {
    PaintRef rough = share(name, p, prefix + "roughness", 0, true);
    const bool u = p.find(prefix + "uroughness") != nullptr, v = p.find(prefix + "vroughness") != nullptr;
    if (u || v) {
      const PaintRef along_v = share(name, p, prefix + (v ? "vroughness" : "uroughness"), 0, true);
      rough = u == v ? share(name, p, prefix + "uroughness", 0, true) : along_v;
      if (rough != along_v && (!constant_of(rough) || constant_of(rough) != constant_of(along_v)))
        build_.approximate("roughness that differs along u and v is taken as that along u");
    }
    return power_paint(rough, p.truth("remaproughness", true) ? 0.25 : 0.5);
  }
  void set_roughness(const std::string& name, const Parameters& p, const std::string& prefix, lumicut_material& m) {
    build_.set_number(roughness(name, p, prefix), m.roughness, m.roughness_texture);
  }
  double index(const std::string& material, const Parameters& p, const char* name, double otherwise) {
    const Vec eta = colour(p.find(name), {otherwise, otherwise, otherwise}, Use::number);
    return build_.cut(eta[1], 0.1, 10, of_material(material, name));
  }
  Vec cut(Vec values, double low, double high, const ValuePlace& place) {
    return *constant_of(build_.cut(constant_paint(values), low, high, place));
  }
  // `outside`: index of what it lies in.
  void set_metal(const std::string& name, const Parameters& p, const std::string& prefix, double outside,
                 lumicut_material& m) {
    m.metallic = 1;
    if (p.find("reflectance") != nullptr) {
      build_.set_colour(share(name, p, "reflectance", 0.5), m.diffuse, m.diffuse_texture);
      return;
    }
    const PbrtParameter *eta = p.find(prefix + "eta"), *k = p.find(prefix + "k");
    std::pair<Vec, Vec> both = *named_metal("Cu");
    const auto one = [&](const PbrtParameter* given, Vec& out, bool absorbing) {
      if (given == nullptr) return;
      if (given->type == "spectrum" && !given->words.empty() && given->words[0].starts_with("metal-")) {
        const std::string metal = given->words[0].substr(6, given->words[0].rfind('-') - 6);
        if (const auto known = named_metal(metal)) {
          out = absorbing ? known->second : known->first;
          return;
        }
      }
      out = cut(colour(given, out, Use::number), 0, 1e6, of_material(name, given->name));
    };
    one(eta, both.first, false), one(k, both.second, true);
    const Metal metal = metal_of(both.first * (1 / outside), both.second * (1 / outside));
    store(m.diffuse, metal.colour), store(m.specular_tint, metal.tint);
  }

  uint32_t material(const std::string& name, const std::string& kind, const Parameters& p) {
    lumicut_material m = default_material();
    const auto ggx = [&] {
      m.flags |= LUMICUT_GGX;
      for (float& c : m.specular) c = 1;
      for (float& c : m.diffuse) c = 1;
    };
    const auto cut_share = [&](const char* key, double otherwise) { return share(name, p, key, otherwise); };
    if (kind == "diffuse") {
      build_.set_colour(cut_share("reflectance", 0.5), m.diffuse, m.diffuse_texture);
    } else if (kind == "coateddiffuse") {
      ggx();
      m.ior = static_cast<float>(index(name, p, "eta", 1.5));
      build_.set_colour(coated_paint(cut_share("reflectance", 0.5), m.ior), m.diffuse, m.diffuse_texture);
      set_roughness(name, p, "", m);
    } else if (kind == "conductor") {
      ggx();
      set_metal(name, p, "", 1, m);
      set_roughness(name, p, "", m);
    } else if (kind == "coatedconductor") {
      ggx();
      m.coat = 1, m.coat_ior = static_cast<float>(std::max(1.0, index(name, p, "interface.eta", 1.5)));
      set_metal(name, p, "conductor.", m.coat_ior, m);
      set_roughness(name, p, "conductor.", m);
      const PaintRef rough = roughness(name, p, "interface.");
      if (!constant_of(rough)) build_.approximate("textures of interface.roughness are their mean");
      m.coat_roughness = static_cast<float>(std::clamp(build_.mean_of(rough)[0], 0.0, 1.0));
    } else if (kind == "dielectric" || kind == "thindielectric") {
      ggx();
      m.transmission = 1, m.ior = static_cast<float>(index(name, p, "eta", 1.5));
      if (kind == "dielectric")
        set_roughness(name, p, "", m);
      else
        m.roughness = 0, m.flags |= LUMICUT_SHADOWS_PASS;
    } else if (kind == "diffusetransmission") {
      build_.set_colour(cut_share("reflectance", 0.25), m.diffuse, m.diffuse_texture);
      build_.set_colour(cut_share("transmittance", 0.25), m.translucency, m.translucency_texture);
      const auto scale = static_cast<float>(build_.cut(p.number("scale", 1), 0, 1e6, of_material(name, "scale")));
      const auto scaled = [&](float* colour, int32_t texture, const char* key) {
        for (size_t k = 0; k < 3; ++k) colour[k] *= scale;
        if (texture != 0 || std::max({colour[0], colour[1], colour[2]}) <= 1) return;
        store(colour,
              cut(Vec{colour[0], colour[1], colour[2]}, 0, 1, of_material(name, fmt::format("scale times {}", key))));
      };
      if (scale != 1)
        scaled(m.diffuse, m.diffuse_texture, "reflectance"),
            scaled(m.translucency, m.translucency_texture, "transmittance");
    } else if (kind == "mix") {
      const PbrtParameter* both = p.find("materials");
      if (both == nullptr || both->words.size() != 2)
        tokens_.fail(
            fmt::format("the material \"{}\", a mix, names {} materials", shown(name), both ? both->words.size() : 0));
      const PaintRef amount = share(name, p, "amount", 0.5, true);
      const uint32_t first = named(both->words[0]).first, second = named(both->words[1]).first;
      finish_material(kind, p);
      return build_.mix_materials(name, first, second, amount);
    } else if (kind.empty() || kind == "interface" || kind == "none") {
      m.opacity = kHole;  // in mixes; shapes of it alone are not there
    } else if (kind == "hair") {
      build_.approximate("hair is diffuse, of its colour");
      set_hair(name, p, m);
    } else {
      build_.approximate(fmt::format("the material \"{}\" of the kind {} is diffuse", name, kind));
      build_.set_colour(cut_share("reflectance", 0.5), m.diffuse, m.diffuse_texture);
      for (const PbrtParameter& q : p.list) p.ignore(q.name);
    }
    if (const std::string map = p.word("normalmap", ""); !map.empty()) {
      m.normal_texture = build_.image(map, TextureUse::vectors, 0, "the surface stays smooth");
      if (m.normal_texture != 0) m.normal_strength = 1;
      if (p.find("displacement") != nullptr) build_.leave_out("displacement beside a normal map");
    } else {
      build_.set_bump(paint(p, "displacement", 0, true), 1, m);
    }
    finish_material(kind, p);
    return build_.add_material(name, m);
  }
  void set_hair(const std::string& material, const Parameters& p, lumicut_material& m) {
    const char* name = p.find("reflectance") != nullptr ? "reflectance" : "color";
    const PbrtParameter* absorption = p.find("sigma_a");
    for (const char* ignored : {"beta_m", "alpha", "eta"}) p.ignore(ignored);
    const double azimuthal = even_number(material, p, "beta_n", 0.3, 0, 1);
    const bool melanin = p.find("eumelanin") != nullptr || p.find("pheomelanin") != nullptr;
    if (absorption == nullptr && p.find(name) != nullptr) {
      if (melanin) build_.leave_out("melanin of hair that has a colour");
      return build_.set_colour(share(material, p, name, 0.5), m.diffuse, m.diffuse_texture);
    }
    if (absorption != nullptr && (melanin || p.find(name) != nullptr))
      build_.leave_out("melanin and colour of hair that has a sigma_a");
    Vec sigma;
    if (absorption == nullptr) {
      const auto amount = [&](const char* key, double otherwise) {
        return even_number(material, p, key, otherwise, 0, 1e6);
      };
      sigma = hair_absorption(amount("eumelanin", melanin ? 0 : 1.3), amount("pheomelanin", 0));
    } else if (absorption->type == "texture") {
      build_.approximate("textures of sigma_a are their mean");
      sigma = build_.mean_of(paint(p, "sigma_a", 1));
    } else {
      sigma = colour(absorption, {1, 1, 1}, Use::number);
    }
    store(m.diffuse, hair_colour(cut(sigma, 0, 1e9, of_material(material, "sigma_a")), azimuthal));
  }
  void finish_material(const std::string& kind, const Parameters& p) {
    p.ignore("type"), p.ignore("maxdepth"), p.ignore("nsamples");
    const auto is_albedo = [](const PbrtParameter& q) { return q.name == "albedo"; };
    if (std::none_of(p.list.begin(), p.list.end(), is_albedo))
      p.ignore("thickness"), p.ignore("g");  // nothing is in the coat
    tell_unread(fmt::format("materials of the kind {}", kind), p);
  }
  // The material of that name, and whether it is nothing.
  std::pair<uint32_t, bool> named(const std::string& name) {
    const auto found = materials_.find(name);
    if (found != materials_.end()) return found->second;
    build_.scene.warnings.add("unknown materials", build_.path(),
                              fmt::format("there is no material \"{}\"; grey stands in", shown(name)));
    return {0, false};
  }

  // ---- Lights

  // What counts for nothing, as pbrt has it. -1 is its "not given".
  void tell_powers(const Parameters& p, const std::string& name) {
    for (const PbrtParameter& q : p.list)
      if ((q.name == "power" || q.name == "illuminance") && q.numbers.size() == 1 && !(q.numbers[0] > 0) &&
          q.numbers[0] != -1)
        build_.scene.warnings.add("values out of range", *q.file, q.line,
                                  fmt::format("{}: {} is {:g}, which counts for nothing", name, q.name, q.numbers[0]));
  }
  void light(const std::string& kind, const Parameters& p) {
    const std::string name = fmt::format("LightSource \"{}\" ({})", kind, tokens_.where());
    lumicut_light l{};
    double scale = p.number("scale", 1);
    tell_powers(p, name);
    const Vec from = p.vector("from", {0, 0, 0}), to = p.vector("to", {0, 0, 1});
    if ((kind == "spot" || kind == "distant") && !(length(state_.ctm.vector(to - from)) > 0))
      tokens_.fail(fmt::format("{} shines in no direction", name));
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
    } else if (kind == "goniometric") {
      goniometric(p, scale, name);
    } else {
      build_.leave_out(fmt::format("lights of the kind {}", kind));
      for (const PbrtParameter& q : p.list) p.ignore(q.name);
    }
  }
  // Its picture lies on the octahedron about the light's y, in coordinates whose y and z have changed places.
  void goniometric(const Parameters& p, double scale, const std::string& name) {
    const Vec intensity = colour(p.find("I"), {1, 1, 1}, Use::light);
    const double power = p.number("power", -1);
    const std::string file = p.word("filename", "");
    if (file.empty()) return build_.leave_out("goniometric lights without a picture");
    const int32_t number = build_.image(file, TextureUse::radiance, 0, "the light is left out");
    if (number == 0) return;
    const Texture& picture = build_.scene.textures.at(static_cast<size_t>(number) - 1);
    if (picture.width != picture.height)
      tokens_.fail(fmt::format("{} has a picture of {} by {} texels", name, picture.width, picture.height));
    double mean = 0;
    for (const float x : picture.floats) {
      if (!(x <= 1e15f)) tokens_.fail(fmt::format("{}: {} has a texel of {:g}; at most 1e15", name, shown(file), x));
      mean += x;
    }
    mean /= double(picture.floats.size());
    if (mean == 0) return build_.leave_out("goniometric lights whose picture is black");
    if (power > 0 && mean > 0) scale *= power / (4 * kPi * mean);
    const Vec x = unit(state_.ctm.column(0)), y = unit(state_.ctm.column(2)), z = unit(state_.ctm.column(1));
    const double turn = dot(cross(x, z), y) < 0 ? -1 : 1;
    const uint32_t steps = std::clamp(picture.width, 16u, 256u);
    Profile profile;
    for (uint32_t i = 0; i <= steps; ++i) profile.vertical.push_back(static_cast<float>(kPi * i / steps));
    for (uint32_t i = 0; i <= 2 * steps; ++i) {
      profile.horizontal.push_back(static_cast<float>(kPi * i / steps));
      for (const float down : profile.vertical) {
        const double around = kPi * i / steps;
        const Vec direction{std::sin(down) * std::cos(around), turn * std::sin(down) * std::sin(around),
                            std::cos(down)};
        double sum = 0;
        for (size_t k = 0; k < picture.channels; ++k) sum += octahedral(picture, direction, k);
        profile.values.push_back(static_cast<float>(std::max(0.0, sum / picture.channels)));
      }
    }
    check_value(intensity, scale, name);
    check_value(intensity * scale, 1, name);
    build_.add_profile_light(state_.ctm.column(3), z, x, intensity * scale, std::move(profile), name);
  }
  void check_value(const Vec& rgb, double scale, const std::string& name) {
    for (const double c : rgb)
      if (!(c >= 0 && c <= 1e15)) tokens_.fail(fmt::format("{} has a colour of {:g}", name, c));
    if (!(scale >= 0 && scale < 1e20)) tokens_.fail(fmt::format("{} has a scale of {:g}", name, scale));
  }
  void set_value(lumicut_light& l, const Vec& rgb, double scale, const std::string& name) {
    check_value(rgb, scale, name);
    store(l.color, rgb);
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
      const int32_t square = build_.image(file, TextureUse::radiance, 0, "white stands in");
      if (square != 0) e.texture = unrolled(square);
      if (const double now = e.texture != 0 ? illuminance_of(e.texture) : 0; lux > 0 && now > 0) scale *= lux / now;
    }
    if (p.find("portal") != nullptr) build_.approximate("infinite lights shine from all around, whatever their portal");
    if (!(scale >= 0 && scale < 1e15)) tokens_.fail(fmt::format("{} has a scale of {}", name, scale));
    check_value(rgb, scale, name);
    for (size_t k = 0; k < 3; ++k) e.color[k] = static_cast<float>(rgb[k] * scale);
    // Axes of the light in the world, z up; what mirrors is taken into the map.
    const Vec x = unit(state_.ctm.column(0)), y = unit(state_.ctm.column(1)), z = unit(state_.ctm.column(2));
    const bool mirrored = state_.ctm.determinant() < 0;
    if (mirrored && e.texture != 0) mirror(e.texture);
    const Vec rows[3] = {x, mirrored ? y * -1.0 : y, z};
    for (size_t r = 0; r < 3; ++r)
      for (size_t c = 0; c < 3; ++c) e.world_to_map[3 * r + c] = static_cast<float>(rows[r][c]);
    build_.scene.environment = e;
  }
  // Of a plane that faces the map's z.
  double illuminance_of(int32_t number) const {
    const Texture& t = build_.scene.textures.at(static_cast<size_t>(number) - 1);
    double sum = 0;
    for (size_t row = 0; row < t.height / 2; ++row) {
      const double latitude = kPi * (0.5 - (double(row) + 0.5) / t.height);
      const double weight = std::sin(latitude) * std::cos(latitude) * kPi / t.height * 2 * kPi / t.width;
      for (size_t c = 0; c < t.width; ++c) {
        const float* x = &t.floats[(row * t.width + c) * t.channels];
        sum += weight * (t.channels == 3 ? luminance({x[0], x[1], x[2]}) : x[0]);
      }
    }
    return sum;
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
  // Bilinear inside of the square; at its border the nearest texel.
  static double octahedral(const Texture& from, const Vec& direction, size_t channel) {
    const auto [x, y, z] = direction;
    const size_t size = from.width;
    const double radius = std::sqrt(std::max(0.0, 1 - std::abs(z)));
    const double high = std::max(std::abs(x), std::abs(y)), low = std::min(std::abs(x), std::abs(y));
    double part = high > 0 ? std::atan(low / high) * 2 / kPi : 0;
    if (std::abs(x) < std::abs(y)) part = 1 - part;
    double v = part * radius, u = radius - v;
    if (z < 0) std::swap(u, v), u = 1 - u, v = 1 - v;
    u = std::copysign(u, x), v = std::copysign(v, y);
    const double px = std::clamp((u + 1) / 2 * double(size) - 0.5, 0.0, double(size - 1)),
                 py = std::clamp((v + 1) / 2 * double(size) - 0.5, 0.0, double(size - 1));
    const auto x0 = static_cast<size_t>(px), y0 = static_cast<size_t>(py);
    const size_t x1 = std::min(x0 + 1, size - 1), y1 = std::min(y0 + 1, size - 1);
    const double fx = px - double(x0), fy = py - double(y0);
    const auto at = [&](size_t ix, size_t iy) {
      return double{from.floats[(iy * size + ix) * from.channels + channel]};
    };
    return (at(x0, y0) * (1 - fx) + at(x1, y0) * fx) * (1 - fy) + (at(x0, y1) * (1 - fx) + at(x1, y1) * fx) * fy;
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
    for (size_t row = 0; row < out.height; ++row)
      for (size_t col = 0; col < out.width; ++col) {
        const double latitude = kPi * (0.5 - (double(row) + 0.5) / out.height),
                     longitude = 2 * kPi * (0.5 - (double(col) + 0.5) / out.width);
        const Vec direction{std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                            std::sin(latitude)};
        for (size_t k = 0; k < from.channels; ++k)
          out.floats[(row * out.width + col) * from.channels + k] = static_cast<float>(octahedral(from, direction, k));
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
    const double radius = p.number("radius", 1),
                 sweep = radians(build_.cut(p.number("phimax", 360), 0.1, 360, at(name, "phimax")));
    if (radius < 0) tokens_.fail(fmt::format("{} has a radius of {:g}", name, radius));
    if (kind == "sphere") {
      const double z0 = radius != 0 ? p.number("zmin", -radius) / radius : -1,
                   z1 = radius != 0 ? p.number("zmax", radius) / radius : 1;
      if (z0 <= -1 && z1 >= 1 && sweep > 2 * kPi - 1e-6)
        g = sphere(), key = "sphere";
      else
        g = sphere_part_geometry(std::min(z0, z1), std::max(z0, z1), sweep),
        key = fmt::format("sphere {} {} {}", z0, z1, sweep);
      place = place * scaling({radius, radius, radius});
    } else if (kind == "disk") {
      const double height = p.number("height", 0),
                   inner = build_.cut(p.number("innerradius", 0), 0, radius, at(name, "innerradius"));
      g = disk_geometry(height, radius, inner, sweep);
      key = fmt::format("disk {} {} {} {}", height, radius, inner, sweep);
    } else if (kind == "cylinder") {
      const double z0 = p.number("zmin", -1), z1 = p.number("zmax", 1);
      g = cylinder_geometry(radius, z0, z1, sweep);
      key = fmt::format("cylinder {} {} {} {}", radius, z0, z1, sweep);
    } else if (kind == "trianglemesh" || kind == "loopsubdiv" || kind == "bilinearmesh") {
      g = mesh(p, kind == "bilinearmesh" ? 4 : 3, name);
      if (kind == "loopsubdiv") subdivide(p, g, name);
      for (const char* unused : {"S", "faceIndices", "scheme"}) p.ignore(unused);
    } else if (kind == "curve") {
      curve(p, name);
      return;
    } else if (kind == "plymesh") {
      several = build_.read_meshes(p.word("filename", ""));
      for (Geometry& one : several) follow_normals(one);
      if (p.find("displacement") != nullptr) build_.leave_out("displacement");
      p.ignore("edgelength");
    } else {
      build_.leave_out(fmt::format("shapes of the kind {}", kind));
      for (const PbrtParameter& q : p.list) p.ignore(q.name);
      return;
    }
    uint32_t used = state_.material, mask = 0;
    const bool no_alpha = constant_of(paint(p, "alpha", 1, true)).value_or(Vec{1, 1, 1})[0] <= 0;
    if (state_.nothing && !state_.area_light) return build_.leave_out("borders of media");
    if (no_alpha && !state_.area_light) return;
    if (no_alpha) mask = LUMICUT_DIFFUSE_RAYS;  // it lights the scene, and nothing sees it
    if (no_alpha || state_.nothing)
      used = black();
    else
      used = with_alpha(used, p);
    if (!state_.inside.empty()) used = filled(used);
    if (several.empty()) several.push_back(std::move(g));
    // Normals of meshes follow their transform; those of the others are the product of two tangents that do.
    const bool turned = (kind == "sphere" || kind == "disk" || kind == "cylinder") && place.determinant() < 0;
    for (Geometry& one : several) put(name, std::move(one), place, used, state_.reversed != turned, key, mask);
  }
  void curve(const Parameters& p, const std::string& name) {
    const double given = p.number("degree", 3), width = p.number("width", 1);
    const std::string basis = p.word("basis", "bezier"), type = p.word("type", "flat");
    if (given != 2 && given != 3) tokens_.fail(fmt::format("{} has the degree {}", name, given));
    if (basis != "bezier" && basis != "bspline") tokens_.fail(fmt::format("{} has the basis {}", name, shown(basis)));
    if (type != "flat" && type != "cylinder" && type != "ribbon")
      tokens_.fail(fmt::format("{} has the type {}", name, shown(type)));
    const auto degree = static_cast<size_t>(given);
    const PbrtParameter *places = p.find("P"), *normals = p.find("N");
    const size_t count = places == nullptr ? 0 : places->numbers.size() / 3;
    if (count <= degree || places->numbers.size() % 3 != 0 || (basis == "bezier" && (count - 1) % degree != 0))
      tokens_.fail(fmt::format("{} has {} numbers in P", name, places == nullptr ? 0 : places->numbers.size()));
    Strand points(count);
    for (size_t i = 0; i < count; ++i) std::copy_n(&places->numbers[3 * i], 3, points[i].place.begin());
    if (basis == "bspline") points = bezier_of_bspline(points, degree);
    const size_t segments = (points.size() - 1) / degree;
    if (type == "ribbon" && (normals == nullptr || normals->numbers.size() != 3 * (segments + 1)))
      tokens_.fail(fmt::format("{}, a ribbon of {} segments, has {} numbers in N, not {}", name, segments,
                               normals == nullptr ? 0 : normals->numbers.size(), 3 * (segments + 1)));
    if (type == "flat") build_.approximate("flat curves, which turn to whoever sees them, are tubes");
    const double w0 = p.number("width0", width), w1 = p.number("width1", width);
    if (!(w0 >= 0 && w1 >= 0 && w0 <= kLargestCoordinate && w1 <= kLargestCoordinate))
      tokens_.fail(fmt::format("{} has the widths {} and {}", name, w0, w1));
    if (std::all_of(points.begin(), points.end(), [&](const CurvePoint& c) { return c.place == points[0].place; }) ||
        (w0 == 0 && w1 == 0)) {
      for (const char* unused : {"splitdepth", "alpha"}) p.ignore(unused);
      return build_.leave_out("curves without length or width");
    }
    // Widths and normals are linear between the ends of the curve and of its segments.
    for (size_t i = 0; i < points.size(); ++i) {
      points[i].radius = 0.5 * (w0 + (w1 - w0) * double(i) / double(points.size() - 1));
      if (type != "ribbon") continue;
      const size_t segment = std::min(i / degree, segments - 1);
      const double t = double(i - segment * degree) / double(degree);
      Vec a, b;
      std::copy_n(&normals->numbers[3 * segment], 3, a.begin());
      std::copy_n(&normals->numbers[3 * segment + 3], 3, b.begin());
      points[i].normal = unit(a) * (1 - t) + unit(b) * t;
    }
    p.ignore("splitdepth");
    if (state_.nothing && !state_.area_light) return build_.leave_out("borders of media");
    const uint32_t material = with_alpha(state_.material, p);
    if (!curves_.strands.empty() && (curves_.material != material || curves_.reversed != state_.reversed ||
                                     curves_.place.m != state_.ctm.m || state_.area_light))
      put_curves();
    if (curves_.strands.empty()) curves_ = {{}, name, state_.ctm, material, state_.reversed};
    curves_.strands.push_back(bezier_strand(points, degree));
    curve_points_ += curves_.strands.back().size();
    if (curve_points_ > kMostCurvePoints) tokens_.fail("there are too many curves");
    if (state_.area_light) put_curves();
  }
  void put_curves() {
    if (!curves_.strands.empty())
      put(curves_.name, curve_geometry(curves_.strands), curves_.place, curves_.material, curves_.reversed, "", 0);
    curves_ = {};
  }
  // Even media that glass holds: what they absorb.
  void medium(const std::string& name, const Parameters& p) {
    if (p.word("type", "") != "homogeneous" || p.find("preset") != nullptr) return;
    const double scale = p.number("scale", 1);
    const Vec absorbed = colour(p.find("sigma_a"), {0.0011, 0.0024, 0.014}, Use::number) * scale;
    const Vec scattered = colour(p.find("sigma_s"), {2.55, 3.21, 3.77}, Use::number);
    const Vec kept = cut(absorbed, 0, 1e15, at(fmt::format("medium \"{}\"", shown(name)), "sigma_a"));
    media_[name] = {kept, std::max({scattered[0], scattered[1], scattered[2]}) > 0};
    for (const char* ignored : {"type", "g"}) p.ignore(ignored);
    tell_unread("media", p);
  }
  uint32_t filled(uint32_t material) {
    const auto known = media_.find(state_.inside);
    const auto glass = known == media_.end() ? std::nullopt : build_.with_absorption(material, known->second.first);
    if (!glass) {
      build_.leave_out("media");
      return material;
    }
    if (known->second.second) build_.leave_out("scattering inside of glass");
    return *glass;
  }
  void put(const std::string& name, Geometry&& g, const Affine& place, uint32_t material, bool flipped,
           const std::string& key, uint32_t mask) {
    if (state_.area_light) {
      if (object_)
        build_.leave_out("area lights inside of objects");
      else
        material = emitting(*state_.area_light, g, place, material);
    }
    if (!object_) return build_.add(name, g, place, material, flipped, key, mask);
    auto& parts = objects_[*object_];
    const std::string shared = key.empty() ? fmt::format("object \"{}\" {}", *object_, parts.size()) : key;
    parts.push_back({name, shared, std::make_shared<Geometry>(std::move(g)), place, material, flipped, mask});
  }
  void subdivide(const Parameters& p, Geometry& g, const std::string& name) {
    const double levels = p.number("levels", 3);
    if (!(levels >= 0 && levels <= 10 && double(g.indices.size() / 3) * std::pow(4, levels) <= 1e7))
      tokens_.fail(fmt::format("{} has {} triangles and {} levels", name, g.indices.size() / 3, levels));
    g = loop_subdivided(g, static_cast<int>(levels));
  }
  uint32_t black() {
    if (!black_) {
      lumicut_material m = default_material();
      std::fill_n(m.diffuse, 3, 0.0f);
      black_ = build_.add_material("what emits alone", m);
    }
    return *black_;
  }
  const Geometry& sphere() {
    if (!sphere_) sphere_ = sphere_geometry();
    return *sphere_;
  }

  Geometry mesh(const Parameters& p, size_t corners, const std::string& name) {
    Geometry g;
    const auto list = [&](const char* key) {
      const PbrtParameter* found = p.find(key);
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
    if (g.uvs.empty() && (corners == 4 || is_textured(state_.material) || state_.area_light)) add_uvs(g, corners);
    return g;
  }
  bool is_textured(uint32_t material) const {
    const lumicut_material& m = build_.scene.materials[material].values;
    return std::max({m.diffuse_texture, m.specular_texture, m.translucency_texture, m.roughness_texture,
                     m.opacity_texture, m.normal_texture, m.height_texture}) > 0;
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
    const PaintRef alpha = build_.cut(paint(p, "alpha", 1, true), 0, 1, at("Shape", "alpha"));
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
    int32_t picture = 0;
    if (const std::string file = p.word("filename", ""); !file.empty()) {
      picture = build_.image(file, TextureUse::colour, 0, "the light is even");
      radiance = {1, 1, 1};
    }
    tell_powers(p, "the area light");
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
      if (picture != 0) area *= luminance(build_.mean_of(build_.image_paint(picture)));
      if (area > 0) scale *= power / (area * kPi * (both ? 2 : 1));
    }
    check_value(radiance, scale, "the area light");
    check_value(radiance * scale, 1, "the area light, times its scale and power,");
    tell_unread("area lights", p);
    return build_.with_emission(material, radiance * scale, picture, both);
  }

  PbrtTokens tokens_;
  SceneBuilder build_;
  State state_;
  std::vector<Opened> stack_;
  std::map<std::string, Affine> systems_;
  std::map<std::pair<std::string, bool>, PaintRef> textures_;   // by name, and whether of numbers
  std::map<std::string, std::pair<uint32_t, bool>> materials_;  // and whether it is the border of a medium
  std::map<std::string, std::pair<Vec, bool>> media_;           // 1/length that they absorb, and whether they scatter
  std::map<std::string, std::vector<Part>> objects_;
  std::optional<std::string> object_;
  Curves curves_;
  std::optional<Geometry> sphere_;
  std::optional<uint32_t> black_;
  std::string camera_kind_;
  Parameters camera_;
  Affine camera_place_;
  bool has_camera_ = false;
  size_t instances_ = 0, curve_points_ = 0;
};

}  // namespace

bool is_pbrt(const std::string& path) {
  const std::string name = lower(path);
  return name.ends_with(".pbrt") || name.ends_with(".pbrt.gz");
}

SceneData read_pbrt(const std::string& path) {
  check_regular_file(path);
  return Reader(path).read();
}

}  // namespace lumicut::io
