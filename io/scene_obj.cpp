#include "io/scene_obj.h"

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <istream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <streambuf>
#include <string_view>

#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

constexpr size_t kMaxCorners = 1024;  // of one polygon: clipping ears takes quadratic time
constexpr size_t kMaxCount = size_t{1} << 31;

constexpr uint32_t kMaxChain = 64;  // vertices of one position that are searched for the same uv and normal

std::string trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r\n\"");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n\"") - first + 1));
}

// First word of a line, and what follows it.
std::pair<std::string_view, std::string_view> split_key(std::string_view line) {
  const size_t first = std::min(line.find_first_not_of(" \t"), line.size());
  const size_t end = std::min(line.find_first_of(" \t", first), line.size());
  return {line.substr(first, end - first), line.substr(end)};
}

// Memory as a stream that can tell which line was read last: tinyobjloader itself keeps no count.
class LineBuffer : public std::streambuf {
 public:
  explicit LineBuffer(std::string& text) : text_(text) { setg(text.data(), text.data(), text.data() + text.size()); }
  // The line before the read position.
  std::string_view last_line() const {
    const char* end = gptr();
    if (end > eback() && end[-1] == '\n') --end;
    const char* begin = end;
    while (begin > eback() && begin[-1] != '\n') --begin;
    return {begin, static_cast<size_t>(end - begin)};
  }
  size_t offset(std::string_view line) const { return static_cast<size_t>(line.data() - text_.data()); }

 private:
  std::string& text_;
};

// ---- MTL ------------------------------------------------------------------------------------------------------------

constexpr char kUnreadMtl[] = "statements that are not read";

// What one newmtl begins.
struct MtlRecord {
  std::string name;
  int line;
  std::map<std::string, int> lines;  // of its other keys
};

bool is_number(const std::string& word, double& value) {
  char* end = nullptr;
  value = std::strtod(word.c_str(), &end);
  return end != word.c_str() && *end == '\0' && word.find_first_of("xX") == std::string::npos;
}

// An MTL in the form that tinyobjloader reads rightly: it takes a number that is none for 0, a missing one too, and the
// names after options of too few numbers for numbers. Records are named by their index.
class MtlCleaner {
 public:
  MtlCleaner(const std::string& path, std::string text, Warnings& warnings)
      : path_(path), text_(plain_text(std::move(text), path)), counter_(text_), warnings_(warnings) {}

  std::string clean() {
    for (size_t begin = 0; begin < text_.size();) {
      const size_t end = std::min(text_.find('\n', begin), text_.size());
      number_ = counter_.line(begin);
      const auto [key, rest] = split_key(std::string_view(text_).substr(begin, end - begin));
      statement(std::string(key), rest);
      begin = end + 1;
    }
    end_record();
    return std::move(out_);
  }
  const std::vector<MtlRecord>& records() const { return records_; }

 private:
  [[noreturn]] void fail(const std::string& text) const {
    throw FileError(path_, fmt::format("line {}: {}", number_, text));
  }
  void warn(const char* kind, const std::string& text) { warnings_.add(kind, path_, number_, text); }

  void statement(const std::string& key, std::string_view rest) {
    static const std::set<std::string> kColours = {"Kd", "Ks", "Ke", "Ka"};
    static const std::set<std::string> kNumbers = {"Ns", "Ni", "d", "Tr", "illum"};
    static const std::set<std::string> kTextures = {"map_Kd", "map_Ks", "map_Ke", "map_d"};
    // That the format has, and that are not read (docs/scene_format.md).
    static const std::set<std::string> kOthers = {
        "tf",     "sharpness", "pr",     "pm",      "ps",       "pc",       "pcr",     "aniso",      "anisor", "bump",
        "disp",   "decal",     "refl",   "norm",    "map_bump", "map_disp", "map_ka",  "map_ns",     "map_pr", "map_pm",
        "map_ps", "map_refl",  "map_tr", "map_aat", "map_norm", "map_rma",  "map_orm", "map_opacity"};
    if (key == "newmtl") {
      end_record();
      const std::string name = trimmed(rest);
      if (name.empty()) fail("newmtl without a name");
      out_ += fmt::format("newmtl {}\n", records_.size());
      records_.push_back({name, number_, {}});
    } else if (kColours.count(key) || kNumbers.count(key)) {
      numbers(key, rest, kColours.count(key) != 0);
    } else if (kTextures.count(key)) {
      texture(key, rest);
    } else if (!key.empty() && key[0] != '#' && kOthers.count(lower(key)) == 0) {
      warn(kUnreadMtl, fmt::format("\"{}\" is not read", shown(key)));
    }
  }

  void numbers(const std::string& key, std::string_view rest, bool colour) {
    std::istringstream words{std::string(rest)};
    std::string word, line = key;
    size_t count = 0;
    while (words >> word && word[0] != '#') {
      if (word == "-halo") continue;
      if (count == 0 && (word == "spectral" || word == "xyz")) {
        warn(kUnreadMtl, fmt::format("{} {} is not read", key, word));
        return;
      }
      double value = 0;
      if (!is_number(word, value) || !(std::abs(value) < 3.4e38))
        fail(fmt::format("\"{}\" of {} is not a finite number", shown(word), key));
      if (value < 0) {
        if (!colour && key != "Ns") fail(fmt::format("{} is {}, but must not be negative", key, shown(word)));
        warn("negative numbers taken as 0", fmt::format("{} is {}; taken as 0", key, shown(word)));
        word = "0";
      }
      if (key == "Ke" && value > 1e15) fail(fmt::format("Ke is {}, but must be at most 1e15", shown(word)));
      line += " " + word;
      ++count;
    }
    if (count == 0) fail(fmt::format("{} without a number", key));
    if (colour && count == 2) fail(fmt::format("{} has 2 numbers instead of 1 or 3", key));
    if (colour && count == 1) line += " " + line.substr(key.size() + 1) + " " + line.substr(key.size() + 1);
    emit(key, line);
  }

  void texture(const std::string& key, std::string_view rest) {
    // Option -> numbers it may have, and what they are when left out; none: one word.
    static const std::map<std::string_view, std::vector<std::string>> kOptions = {
        {"-o", {"0", "0", "0"}}, {"-s", {"1", "1", "1"}}, {"-t", {"0", "0", "0"}}, {"-mm", {"0", "1"}}, {"-blendu", {}},
        {"-blendv", {}},         {"-clamp", {}},          {"-boost", {}},          {"-bm", {}},         {"-texres", {}},
        {"-imfchan", {}},        {"-type", {}},           {"-colorspace", {}},     {"-cc", {}}};
    std::string line = key;
    for (;;) {
      const auto [word, after] = split_key(rest);
      const auto option = kOptions.find(word);
      if (option == kOptions.end()) break;
      std::string values;
      rest = after;
      for (const std::string& usual : option->second) {
        const auto [value, behind] = split_key(rest);
        double number = 0;
        const bool given = is_number(std::string(value), number);
        values += " " + (given ? std::string(value) : usual);
        if (given) rest = behind;
      }
      if (option->second.empty()) {
        const auto [value, behind] = split_key(rest);
        values = " " + std::string(value);
        rest = behind;
      }
      if (word != "-cc") line += " " + std::string(word) + values;  // unknown to tinyobjloader
    }
    const std::string name = trimmed(rest);
    if (name.empty()) {
      warn(kUnreadMtl, fmt::format("{} names no file", key));
      return;
    }
    emit(key, line + " " + name);
  }

  void emit(const std::string& key, const std::string& line) {
    if (records_.empty()) {
      warn(kUnreadMtl, fmt::format("{} stands before the first newmtl", key));
      return;
    }
    records_.back().lines[key] = number_;
    out_ += line + "\n";
  }

  // tinyobjloader's colour under a texture without Kd depends on the materials before.
  void end_record() {
    if (!records_.empty() && records_.back().lines.count("map_Kd") && !records_.back().lines.count("Kd"))
      out_ += "Kd 1 1 1\n";
  }

  const std::string& path_;
  std::string text_;
  LineCounter counter_;
  Warnings& warnings_;
  std::vector<MtlRecord> records_;
  std::string out_;
  int number_ = 0;
};

uint32_t texture_flags(const tinyobj::texture_option_t& options) {
  return options.clamp ? uint32_t{LUMICUT_CLAMP} : 0u;
}

void read_mtl(const std::string& path, ObjModel& model, std::map<std::string, uint32_t>& by_name,
              TextureStore& textures, Warnings& warnings) {
  MtlCleaner cleaner(path, read_whole_file(path, uint64_t{256} << 20), warnings);
  std::istringstream in(cleaner.clean());
  std::map<std::string, int> indices;
  std::vector<tinyobj::material_t> found;
  std::string warning, error;
  tinyobj::LoadMtl(&indices, &found, &in, &warning, &error);
  if (!error.empty()) throw FileError(path, trimmed(error));
  for (size_t i = 0; i < cleaner.records().size(); ++i) {
    const MtlRecord& record = cleaner.records()[i];
    const auto& mtl = found.at(i);
    const std::string user = fmt::format("material \"{}\"", shown(record.name));
    const auto line_of = [&](const char* key) {
      const auto line = record.lines.find(key);
      return line == record.lines.end() ? record.line : line->second;
    };
    lumicut_material m = default_material();
    bool clipped = false;
    for (int c = 0; c < 3; ++c) {
      m.diffuse[c] = std::min(mtl.diffuse[c], 1.0f);
      m.specular[c] = std::min(mtl.specular[c], 1.0f);
      m.emission[c] = mtl.emission[c];
      clipped |= mtl.diffuse[c] > 1.0f || mtl.specular[c] > 1.0f;
    }
    if (clipped)
      warnings.add("materials that reflect more than they receive", path, record.line,
                   fmt::format("{} reflects more than it receives; Kd and Ks are cut to 1", user));
    if (!(mtl.dissolve >= 0.0f && mtl.dissolve <= 1.0f))
      warnings.add("materials more than opaque or less than clear", path, record.line,
                   fmt::format("{} has an opacity of {}, cut to 0..1", user, mtl.dissolve));
    m.shininess = std::min(mtl.shininess, 1e6f);
    m.opacity = std::clamp(mtl.dissolve, kHole, 1.0f);
    if (mtl.illum == 7) {
      m.opacity = kHole;
      warnings.add("materials of clear glass", path, record.line,
                   fmt::format("{} is clear glass (illum 7): left out, light passes unchanged", user));
    }
    const auto texture = [&](const char* key, const std::string& name, TextureUse use,
                             const tinyobj::texture_option_t& options) -> int32_t {
      if (name.empty()) return 0;
      if (options.scale[0] != 1.0f || options.scale[1] != 1.0f || options.origin_offset[0] != 0.0f ||
          options.origin_offset[1] != 0.0f)
        warnings.add("textures whose options -s and -o are not read", path, line_of(key),
                     fmt::format("{}: the options -s and -o of {} are not read", user, shown(name)));
      const FoundFile file = find_beside(path, name);
      if (file.path.empty()) {
        warnings.add("missing textures", path, line_of(key),
                     fmt::format("{}: {}; {}", user, missing_file("texture", path, name),
                                 use == TextureUse::mask ? "taken as opaque" : "grey stands in"));
        return use == TextureUse::mask ? 0 : textures.grey();
      }
      if (!file.remark.empty())
        warnings.add("names of textures that differ from their files'", path, line_of(key),
                     fmt::format("{}: the texture {} does not exist; {}", user, shown(name), file.remark));
      return textures.get(file.path, use, texture_flags(options), fmt::format("{} ({})", user, path));
    };
    m.diffuse_texture = texture("map_Kd", mtl.diffuse_texname, TextureUse::colour, mtl.diffuse_texopt);
    m.specular_texture = texture("map_Ks", mtl.specular_texname, TextureUse::colour, mtl.specular_texopt);
    m.opacity_texture = texture("map_d", mtl.alpha_texname, TextureUse::mask, mtl.alpha_texopt);
    m.emission_texture = texture("map_Ke", mtl.emissive_texname, TextureUse::colour, mtl.emissive_texopt);
    const auto [known, is_new] = by_name.emplace(record.name, static_cast<uint32_t>(model.materials.size()));
    if (is_new) {
      model.materials.push_back({record.name, m});
    } else {
      warnings.add("materials that are defined again", path, record.line,
                   fmt::format("{} is defined again; this definition counts", user));
      model.materials[known->second].values = m;
    }
  }
}

// ---- OBJ ------------------------------------------------------------------------------------------------------------

struct Corner {
  int64_t position, uv, normal;  // 0-based; -1: none
};

class ObjReader {
 public:
  ObjReader(const std::string& path, const ObjOptions& options, TextureStore& textures, Warnings& warnings)
      : path_(path),
        options_(options),
        textures_(textures),
        warnings_(warnings),
        text_(plain_text(read_whole_file(path), path)),
        counter_(text_),
        buffer_(text_) {}

  ObjModel read() {
    scan();
    tinyobj::callback_t callback;
    callback.vertex_cb = [](void* self, float x, float y, float z, float) {
      get(self).on_vector("v", 3, get(self).positions_, {x, y, z});
    };
    callback.normal_cb = [](void* self, float x, float y, float z) {
      get(self).on_vector("vn", 3, get(self).normals_, {x, y, z});
    };
    callback.texcoord_cb = [](void* self, float x, float y, float) {
      get(self).on_vector("vt", 1, get(self).uvs_, {x, y});
    };
    callback.index_cb = [](void* self, tinyobj::index_t* corners, int count) { get(self).on_face(corners, count); };
    callback.usemtl_cb = [](void* self, const char* name, int) { get(self).on_usemtl(name); };
    std::istream in(&buffer_);
    std::string warning, error;
    tinyobj::LoadObjWithCallback(in, callback, this, nullptr, &warning, &error);
    if (!error.empty()) throw FileError(path_, trimmed(error));
    finish();
    return std::move(model_);
  }

 private:
  static ObjReader& get(void* self) { return *static_cast<ObjReader*>(self); }

  // Corners that share position, uv and normal share a vertex. Chains by position: no hashing, no second copy.
  struct Part {
    Mesh mesh;
    bool smooth = false;
    std::vector<uint32_t> head;  // position -> first vertex
    struct Vertex {
      uint32_t uv, normal, next;
    };
    std::vector<Vertex> vertices;
  };
  static constexpr uint32_t kNone = 0xffffffffu;

  // A face before a vertex of its own.
  struct EarlyFace {
    std::vector<Corner> corners;
    uint32_t material;
    std::string_view line;
  };

  int line_number(std::string_view line) { return counter_.line(buffer_.offset(line)); }
  [[noreturn]] void fail(std::string_view line, const std::string& text) {
    throw FileError(path_, fmt::format("line {}: {} in \"{}\"", line_number(line), text, shown(line)));
  }
  [[noreturn]] void fail(const std::string& text) { fail(buffer_.last_line(), text); }
  void warn(const char* kind, std::string_view line, const std::string& text) {
    warnings_.add(kind, path_, line_number(line), text);
  }

  // What tinyobjloader would pass over in silence; and the materials, which may be used before they are named.
  void scan() {
    // Of no effect on a picture, or read by tinyobjloader.
    static const std::set<std::string_view> kSilent = {"", "v", "vt", "vn", "vp", "f", "g", "o", "s", "mg", "usemtl"};
    for (size_t begin = 0; begin < text_.size();) {
      const size_t end = std::min(text_.find('\n', begin), text_.size());
      const std::string_view line = std::string_view(text_).substr(begin, end - begin);
      const auto [key, rest] = split_key(line);
      const bool bare = rest.find_first_not_of(" \t") == std::string_view::npos;
      begin = end + 1;
      if (key.substr(0, 1) == "#") continue;
      if (key == "f") blank_bare_slashes(buffer_.offset(line), line.size());
      if (bare && (key == "v" || key == "vt" || key == "vn")) fail(line, "no numbers");
      if (bare && (key == "f" || key == "usemtl"))
        warn("statements that are not read", line, fmt::format("{} without anything is passed over", key));
      else if (key == "mtllib")
        on_mtllib(trimmed(rest), line);
      else if (key == "l" || key == "p")
        warn("lines and points", line, "lines and points are not shown");
      else if (!kSilent.count(key))
        warn("statements that are not read", line, fmt::format("\"{}\" is not read", shown(key)));
      else
        continue;
      text_[buffer_.offset(line) + line.find_first_not_of(" \t")] = '#';
    }
    for (const auto& [name, number] : by_name_) in_lower_case_.emplace(lower(name), number);
  }

  // After "1/ 2/" tinyobjloader would take the 2 for the texture coordinate of 1.
  void blank_bare_slashes(size_t begin, size_t size) {
    bool blank = true;
    for (size_t at = begin + size; at-- > begin;) {
      if (blank && text_[at] == '/') text_[at] = ' ';
      blank = text_[at] == ' ' || text_[at] == '\t';
    }
  }

  void on_vector(const char* key, int least, std::vector<float>& list, std::initializer_list<float> values) {
    const auto line = buffer_.last_line();
    size_t at = line.find(key) + std::strlen(key);
    int words = 0;
    bool inside = false;
    for (; at < line.size() && line[at] != '#'; ++at) {
      const char c = line[at];
      if (c == ' ' || c == '\t') {
        inside = false;
        continue;
      }
      if (!((c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+' || c == 'e' || c == 'E'))
        fail("not a finite number");
      if (!inside) ++words, inside = true;
    }
    if (words < least) fail(fmt::format("{} numbers instead of {}", words, least));
    for (const float value : values) {
      if (!std::isfinite(value)) fail("a number beyond the range of float");
      if (*key == 'v' && key[1] == 0 && !(std::abs(value) <= static_cast<float>(kLargestCoordinate)))
        fail(fmt::format("a coordinate beyond {:g}", kLargestCoordinate));
      list.push_back(value);
    }
    if (list.size() > kMaxCount) fail("too many vertices");
  }

  // One name, which may hold spaces, or several.
  void on_mtllib(const std::string& rest, std::string_view line) {
    if (!options_.read_materials) return;
    std::vector<std::string> names = {rest};
    if (find_beside(path_, rest).path.empty()) {
      std::istringstream words(rest);
      std::vector<std::string> several{std::istream_iterator<std::string>(words), {}};
      const auto exists = [&](const std::string& name) { return !find_beside(path_, name).path.empty(); };
      if (std::any_of(several.begin(), several.end(), exists)) names = std::move(several);
    }
    for (const auto& name : names) {
      const FoundFile file = find_beside(path_, name);
      if (file.path.empty())
        warn("missing material files", line, missing_file("material file", path_, name));
      else if (!file.remark.empty())
        warn("names of material files that differ from their files'", line,
             fmt::format("the material file {} does not exist; {}", shown(name), file.remark));
      if (!file.path.empty() && read_mtls_.insert(file.path).second)
        read_mtl(file.path, model_, by_name_, textures_, warnings_);
    }
  }

  void on_usemtl(const char* raw_name) {
    if (!options_.read_materials) return;
    const std::string name = trimmed(raw_name);
    auto found = by_name_.find(name);
    if (found == by_name_.end()) {
      const auto [first, last] = in_lower_case_.equal_range(lower(name));
      const bool one = first != last && std::next(first) == last;
      warn("unknown materials", buffer_.last_line(),
           fmt::format("the material \"{}\" stands in no MTL of this file; {}", shown(name),
                       one ? fmt::format("\"{}\" is taken in its place", shown(model_.materials[first->second].name))
                           : "grey stands in"));
      const auto number = one ? first->second : static_cast<uint32_t>(model_.materials.size());
      if (!one) model_.materials.push_back({name, default_material()});
      found = by_name_.emplace(name, number).first;
    }
    material_ = found->second;
  }

  // tinyobjloader's numbers wrap around, and end at the first strange character.
  void check_face_line() {
    const auto line = buffer_.last_line();
    int digits = 0;
    for (size_t at = line.find('f') + 1; at < line.size() && line[at] != '#'; ++at) {
      const char c = line[at];
      digits = c >= '0' && c <= '9' ? digits + 1 : 0;
      if (digits > 9) fail("an index out of range (more than nine digits)");
      if (digits == 0 && c != ' ' && c != '\t' && c != '/' && c != '-')
        fail(fmt::format("'{}' stands among the indices", shown({&c, 1})));
    }
  }

  // 0-based. Positive ones may name what follows; `early` then.
  int64_t resolve(int index, size_t count, const char* what, bool& early) {
    const auto n = static_cast<int64_t>(count);
    const int64_t resolved = index > 0 ? int64_t{index} - 1 : n + index;
    if (index == 0 || resolved < 0) fail(fmt::format("{} index {} is out of range ({} so far)", what, index, n));
    early |= resolved >= n;
    return resolved;
  }

  void on_face(const tinyobj::index_t* corners, int count) {
    if (static_cast<size_t>(count) > kMaxCorners)
      fail(fmt::format("a face of {} corners; at most {} are read", count, kMaxCorners));
    check_face_line();
    bool early = false;
    std::vector<Corner>& polygon = polygon_;
    polygon.clear();
    for (int i = 0; i < count; ++i) {
      Corner c{resolve(corners[i].vertex_index, positions_.size() / 3, "vertex", early), -1, -1};
      if (corners[i].texcoord_index != 0 && !options_.positions_only)
        c.uv = resolve(corners[i].texcoord_index, uvs_.size() / 2, "texture coordinate", early);
      if (corners[i].normal_index != 0 && !options_.positions_only)
        c.normal = resolve(corners[i].normal_index, normals_.size() / 3, "normal", early);
      polygon.push_back(c);
    }
    if (count < 3) {
      warn("faces of less than three corners", buffer_.last_line(), "a face of less than three corners is left out");
      return;
    }
    if (material_ == kNone) material_ = plain_material();
    if (early) {
      early_faces_.push_back({polygon, material_, buffer_.last_line()});
    } else {
      add_polygon(polygon, material_);
    }
  }

  void add_polygon(const std::vector<Corner>& polygon, uint32_t material) {
    const bool smooth = std::all_of(polygon.begin(), polygon.end(), [&](const Corner& c) {
      return c.normal >= 0 && length2(&normals_[static_cast<size_t>(c.normal) * 3]) > 1e-12f;
    });
    Part& part = parts_[smooth ? 1 : 0];
    part.smooth = smooth;
    if (polygon.size() == 3) {
      add_triangle(part, material, polygon[0], polygon[1], polygon[2]);
      return;
    }
    corner_positions_.clear();
    for (const auto& c : polygon)
      for (size_t k = 0; k < 3; ++k) corner_positions_.push_back(positions_[static_cast<size_t>(c.position) * 3 + k]);
    const auto triangles = triangulate_polygon(corner_positions_);
    for (size_t t = 0; t < triangles.size(); t += 3)
      add_triangle(part, material, polygon[triangles[t]], polygon[triangles[t + 1]], polygon[triangles[t + 2]]);
  }

  static float length2(const float* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

  void add_triangle(Part& part, uint32_t material, const Corner& a, const Corner& b, const Corner& c) {
    for (const Corner* corner : {&a, &b, &c}) part.mesh.indices.push_back(vertex(part, *corner));
    part.mesh.materials.push_back(material);
  }

  uint32_t vertex(Part& part, const Corner& corner) {
    const auto position = static_cast<size_t>(corner.position);
    const auto uv = static_cast<uint32_t>(corner.uv);
    const auto normal = part.smooth ? static_cast<uint32_t>(corner.normal) : kNone;
    if (part.head.size() <= position) part.head.resize(std::max(positions_.size() / 3, position + 1), kNone);
    uint32_t length = 0;
    for (uint32_t i = part.head[position]; i != kNone && length < kMaxChain; i = part.vertices[i].next, ++length)
      if (part.vertices[i].uv == uv && part.vertices[i].normal == normal) return i;
    const auto index = static_cast<uint32_t>(part.vertices.size());
    part.vertices.push_back({uv, normal, part.head[position]});
    part.head[position] = index;
    auto& mesh = part.mesh;
    const float* p = &positions_[position * 3];
    mesh.positions.insert(mesh.positions.end(), p, p + 3);
    mesh.uvs.push_back(corner.uv >= 0 ? uvs_[static_cast<size_t>(corner.uv) * 2] : 0.0f);
    mesh.uvs.push_back(corner.uv >= 0 ? uvs_[static_cast<size_t>(corner.uv) * 2 + 1] : 0.0f);
    if (part.smooth) {
      const float* n = &normals_[static_cast<size_t>(normal) * 3];
      const float scale = 1.0f / std::sqrt(length2(n));
      for (size_t k = 0; k < 3; ++k) mesh.normals.push_back(n[k] * scale);
    }
    return index;
  }

  // Faces before the first usemtl.
  uint32_t plain_material() {
    if (!options_.read_materials) return 0;
    model_.materials.push_back({"", default_material()});
    return static_cast<uint32_t>(model_.materials.size() - 1);
  }

  void finish() {
    for (const EarlyFace& face : early_faces_) {
      const auto check = [&](int64_t index, size_t count, const char* what) {
        if (index >= static_cast<int64_t>(count))
          fail(face.line, fmt::format("{} index {} is out of range ({} in the file)", what, index + 1, count));
      };
      for (const Corner& c : face.corners) {
        check(c.position, positions_.size() / 3, "vertex");
        check(c.uv, uvs_.size() / 2, "texture coordinate");
        check(c.normal, normals_.size() / 3, "normal");
      }
      warn("faces before their vertices", face.line, "the face stands before its vertices");
      add_polygon(face.corners, face.material);
    }
    for (auto& part : parts_) {
      if (part.mesh.indices.empty()) continue;
      if (uvs_.empty() || options_.positions_only) part.mesh.uvs.clear();
      model_.meshes.push_back(std::move(part.mesh));
    }
    if (model_.meshes.empty()) throw FileError(path_, "holds no face");
  }

  std::string path_;
  ObjOptions options_;
  TextureStore& textures_;
  Warnings& warnings_;
  std::string text_;
  LineCounter counter_;
  LineBuffer buffer_;
  ObjModel model_;
  std::vector<float> positions_, normals_, uvs_;
  std::vector<Corner> polygon_;
  std::vector<EarlyFace> early_faces_;
  std::vector<float> corner_positions_;
  Part parts_[2];  // flat, smooth
  uint32_t material_ = kNone;
  std::map<std::string, uint32_t> by_name_;             // into model_.materials
  std::multimap<std::string, uint32_t> in_lower_case_;  // those of the MTLs
  std::set<std::string> read_mtls_;
};

}  // namespace

std::vector<uint32_t> triangulate_polygon(const std::vector<float>& points) {
  const size_t n = points.size() / 3;
  std::vector<uint32_t> triangles;
  // Newell's normal; the polygon is cut in the plane of its two smaller axes.
  double normal[3] = {0, 0, 0};
  for (size_t i = 0; i < n; ++i) {
    const float* a = &points[i * 3];
    const float* b = &points[(i + 1) % n * 3];
    for (int k = 0; k < 3; ++k) {
      const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
      normal[k] += (double{a[k1]} - b[k1]) * (double{a[k2]} + b[k2]);
    }
  }
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(normal[k]) > std::abs(normal[axis])) axis = k;
  const double sign = normal[axis] < 0 ? -1.0 : 1.0;
  const auto u = [&](uint32_t i) { return double{points[i * 3 + static_cast<size_t>((axis + 1) % 3)]}; };
  const auto v = [&](uint32_t i) { return double{points[i * 3 + static_cast<size_t>((axis + 2) % 3)]}; };
  const auto turn = [&](uint32_t a, uint32_t b, uint32_t c) {
    return sign * ((u(b) - u(a)) * (v(c) - v(a)) - (v(b) - v(a)) * (u(c) - u(a)));
  };
  std::vector<uint32_t> left(n);
  for (uint32_t i = 0; i < n; ++i) left[i] = i;
  while (left.size() > 3) {
    const size_t m = left.size();
    size_t ear = m;
    for (size_t i = 0; i < m && ear == m; ++i) {
      const uint32_t a = left[(i + m - 1) % m], b = left[i], c = left[(i + 1) % m];
      if (!(turn(a, b, c) > 0)) continue;
      bool empty = true;
      for (size_t j = 0; j < m && empty; ++j) {
        const uint32_t p = left[j];
        if (p == a || p == b || p == c) continue;
        empty = !(turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0);
      }
      if (empty) ear = i;
    }
    if (ear == m) ear = 1;  // degenerate or self-intersecting: as a fan
    triangles.insert(triangles.end(), {left[(ear + m - 1) % m], left[ear], left[(ear + 1) % m]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  triangles.insert(triangles.end(), {left[0], left[1], left[2]});
  return triangles;
}

ObjModel read_obj(const std::string& path, const ObjOptions& options, TextureStore& textures, Warnings& warnings) {
  return ObjReader(path, options, textures, warnings).read();
}

Mesh read_obj_positions(const std::string& path, Warnings& warnings) {
  std::vector<Texture> textures;
  TextureStore store(textures);
  return std::move(read_obj(path, {.read_materials = false, .positions_only = true}, store, warnings).meshes.at(0));
}

}  // namespace lumicut::io
