#include "io/scene_obj.h"

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <istream>
#include <map>
#include <set>
#include <sstream>
#include <streambuf>
#include <string_view>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

constexpr size_t kMaxCorners = 1024;  // of one polygon: clipping ears takes quadratic time
constexpr size_t kMaxCount = size_t{1} << 31;

std::string trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r\n\"");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n\"") - first + 1));
}

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 60)) out += c >= ' ' && c <= '~' ? c : '?';
  return out;
}

// Memory as a stream that can tell which line was read last: tinyobjloader itself keeps no count.
class LineBuffer : public std::streambuf {
 public:
  explicit LineBuffer(std::string& text) : text_(text) { setg(text.data(), text.data(), text.data() + text.size()); }
  // Start and text of the line before the read position.
  std::string_view last_line() const {
    const char* end = gptr();
    while (end > eback() && (end[-1] == '\n' || end[-1] == '\r')) --end;
    const char* begin = end;
    while (begin > eback() && begin[-1] != '\n' && begin[-1] != '\r') --begin;
    return {begin, static_cast<size_t>(end - begin)};
  }
  int line_number(std::string_view line) const {
    int count = 1;
    for (const char* c = text_.data(); c < line.data(); ++c)
      if (*c == '\n' || (*c == '\r' && c[1] != '\n')) ++count;
    return count;
  }

 private:
  std::string& text_;
};

// ---- MTL ------------------------------------------------------------------------------------------------------------

struct MtlScan {
  std::map<std::string, int> lines;  // material -> line of its newmtl
};

bool is_finite_number(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  return end != word.c_str() && *end == '\0' && std::isfinite(value) && std::abs(value) < 3.4e38;
}

// tinyobjloader takes a number that is none for 0: look first.
MtlScan scan_mtl(const std::string& path, const std::string& text) {
  static const std::map<std::string, std::pair<size_t, bool>> kNumbers = {
      // key -> (least count, may be negative)
      {"Kd", {1, false}}, {"Ks", {1, false}}, {"Ka", {1, false}}, {"Ke", {1, false}},   {"Ns", {1, false}},
      {"Ni", {1, false}}, {"d", {1, false}},  {"Tr", {1, false}}, {"illum", {1, false}}};
  MtlScan scan;
  std::istringstream in(text);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::istringstream words(line);
    std::string key, word;
    if (!(words >> key)) continue;
    if (key == "newmtl") {
      std::getline(words, word);
      const std::string name = trimmed(word);
      if (name.empty()) throw FileError(path, fmt::format("line {}: newmtl without a name", number));
      if (!scan.lines.emplace(name, number).second)
        throw FileError(path, fmt::format("line {}: the material \"{}\" stands twice", number, shown(name)));
      continue;
    }
    const auto rule = kNumbers.find(key);
    if (rule == kNumbers.end()) continue;
    size_t count = 0;
    while (words >> word) {
      if (word == "spectral" || word == "xyz" || word == "-halo" || word[0] == '#') break;
      if (!is_finite_number(word))
        throw FileError(path, fmt::format("line {}: \"{}\" of {} is not a finite number", number, shown(word), key));
      if (!rule->second.second && word[0] == '-' && std::strtod(word.c_str(), nullptr) < 0.0)
        throw FileError(path, fmt::format("line {}: {} is {}, but must not be negative", number, key, shown(word)));
      ++count;
    }
    if (count < rule->second.first && words.eof())
      throw FileError(path, fmt::format("line {}: {} without a number", number, key));
  }
  return scan;
}

std::string beside(const std::string& file, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  const std::filesystem::path path(name);
  return path.is_absolute() ? name : (std::filesystem::path(file).parent_path() / path).string();
}

uint32_t texture_flags(const tinyobj::texture_option_t& options) {
  return options.clamp ? uint32_t{LUMICUT_CLAMP} : 0u;
}

void read_mtl(const std::string& path, ObjModel& model, TextureStore& textures) {
  const std::string text = read_whole_file(path, uint64_t{256} << 20);
  const MtlScan scan = scan_mtl(path, text);
  std::map<std::string, int> indices;
  std::vector<tinyobj::material_t> found;
  std::string warning, error;
  std::istringstream in(text);
  tinyobj::LoadMtl(&indices, &found, &in, &warning, &error);
  if (!error.empty()) throw FileError(path, trimmed(error));
  for (const auto& mtl : found) {
    const std::string name = trimmed(mtl.name);
    const auto line = scan.lines.find(name);
    if (name.empty() || line == scan.lines.end()) continue;  // keys before the first newmtl
    const std::string user = fmt::format("material \"{}\"", shown(name));
    lumicut_material m = default_material();
    bool clipped = false;
    for (int c = 0; c < 3; ++c) {
      m.diffuse[c] = std::min(mtl.diffuse[c], 1.0f);
      m.specular[c] = std::min(mtl.specular[c], 1.0f);
      m.emission[c] = mtl.emission[c];
      clipped |= mtl.diffuse[c] > 1.0f || mtl.specular[c] > 1.0f;
    }
    if (clipped)
      model.warnings.push_back(
          fmt::format("{}: {} reflects more than it receives; Kd and Ks are cut to 1", path, user));
    m.shininess = std::min(mtl.shininess, 1e6f);
    m.opacity = std::clamp(mtl.dissolve, kHole, 1.0f);
    if (mtl.illum == 7) {
      m.opacity = kHole;
      model.warnings.push_back(
          fmt::format("{}: {} is clear glass (illum 7): left out, light passes unchanged", path, user));
    }
    const auto texture = [&](const std::string& file, TextureUse use,
                             const tinyobj::texture_option_t& options) -> int32_t {
      if (file.empty()) return 0;
      if (options.scale[0] != 1.0f || options.scale[1] != 1.0f || options.origin_offset[0] != 0.0f ||
          options.origin_offset[1] != 0.0f)
        model.warnings.push_back(
            fmt::format("{}: {}: the options -s and -o of {} are not read", path, user, shown(file)));
      return textures.get(beside(path, file), use, texture_flags(options), fmt::format("{} ({})", user, path));
    };
    m.diffuse_texture = texture(mtl.diffuse_texname, TextureUse::colour, mtl.diffuse_texopt);
    m.specular_texture = texture(mtl.specular_texname, TextureUse::colour, mtl.specular_texopt);
    m.opacity_texture = texture(mtl.alpha_texname, TextureUse::mask, mtl.alpha_texopt);
    m.emission_texture = texture(mtl.emissive_texname, TextureUse::colour, mtl.emissive_texopt);
    for (const auto& known : model.materials)
      if (known.name == name) throw FileError(path, fmt::format("the {} also stands in another MTL of this OBJ", user));
    model.materials.push_back({name, m, line->second});
  }
}

// ---- OBJ ------------------------------------------------------------------------------------------------------------

struct Corner {
  int64_t position, uv, normal;  // 0-based; -1: none
};

class ObjReader {
 public:
  ObjReader(const std::string& path, const ObjOptions& options, TextureStore& textures)
      : path_(path), options_(options), textures_(textures), text_(read_whole_file(path)), buffer_(text_) {}

  ObjModel read() {
    struct Reader : tinyobj::MaterialReader {
      ObjReader* self;
      bool operator()(const std::string& file, std::vector<tinyobj::material_t>*, std::map<std::string, int>*,
                      std::string*, std::string*) override {
        self->on_mtllib(file);
        return false;  // tinyobjloader shall not keep materials
      }
    } reader;
    reader.self = this;
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
    tinyobj::LoadObjWithCallback(in, callback, this, &reader, &warning, &error);
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

  [[noreturn]] void fail(const std::string& text) const {
    const auto line = buffer_.last_line();
    throw FileError(path_, fmt::format("line {}: {} in \"{}\"", buffer_.line_number(line), text, shown(line)));
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
      list.push_back(value);
    }
    if (list.size() > kMaxCount) fail("too many vertices");
  }

  void on_mtllib(const std::string& file) {
    if (!options_.read_materials || !read_mtls_.insert(file).second) return;
    const std::string path = beside(path_, trimmed(file));
    if (!std::filesystem::is_regular_file(path))
      fail(fmt::format("the material file {} does not exist (give the mesh a \"material\" in the scene to do without)",
                       path));
    read_mtl(path, model_, textures_);
  }

  void on_usemtl(const char* raw_name) {
    if (!options_.read_materials) return;
    const std::string name = trimmed(raw_name);
    for (size_t i = 0; i < model_.materials.size(); ++i) {
      if (model_.materials[i].name == name) {
        material_ = static_cast<uint32_t>(i);
        return;
      }
    }
    fail(fmt::format("the material \"{}\" stands in no MTL of this file", shown(name)));
  }

  // tinyobjloader's numbers wrap around, and end at the first strange character.
  void check_face_line() const {
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

  int64_t resolve(int index, size_t count, const char* what) const {
    const auto n = static_cast<int64_t>(count);
    const int64_t resolved = index > 0 ? int64_t{index} - 1 : n + index;
    // Vertices must stand before the faces that use them, as every writer has it.
    if (index == 0 || resolved < 0 || resolved >= n)
      fail(fmt::format("{} index {} is out of range ({} so far)", what, index, n));
    return resolved;
  }

  void on_face(const tinyobj::index_t* corners, int count) {
    if (count < 3) fail(fmt::format("a face of {} corners", count));
    if (static_cast<size_t>(count) > kMaxCorners)
      fail(fmt::format("a face of {} corners; at most {} are read", count, kMaxCorners));
    check_face_line();
    polygon_.clear();
    bool smooth = true;
    for (int i = 0; i < count; ++i) {
      Corner c{resolve(corners[i].vertex_index, positions_.size() / 3, "vertex"), -1, -1};
      if (corners[i].texcoord_index != 0)
        c.uv = resolve(corners[i].texcoord_index, uvs_.size() / 2, "texture coordinate");
      if (corners[i].normal_index != 0) c.normal = resolve(corners[i].normal_index, normals_.size() / 3, "normal");
      smooth = smooth && c.normal >= 0 && length2(&normals_[static_cast<size_t>(c.normal) * 3]) > 1e-12f;
      polygon_.push_back(c);
    }
    if (material_ == kNone) material_ = plain_material();
    Part& part = parts_[smooth ? 1 : 0];
    part.smooth = smooth;
    if (count == 3) {
      add_triangle(part, 0, 1, 2);
      return;
    }
    corner_positions_.clear();
    for (const auto& c : polygon_)
      for (size_t k = 0; k < 3; ++k) corner_positions_.push_back(positions_[static_cast<size_t>(c.position) * 3 + k]);
    const auto triangles = triangulate_polygon(corner_positions_);
    for (size_t t = 0; t < triangles.size(); t += 3)
      add_triangle(part, triangles[t], triangles[t + 1], triangles[t + 2]);
  }

  static float length2(const float* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

  void add_triangle(Part& part, size_t a, size_t b, size_t c) {
    for (const size_t k : {a, b, c}) part.mesh.indices.push_back(vertex(part, polygon_[k]));
    part.mesh.materials.push_back(material_);
  }

  uint32_t vertex(Part& part, const Corner& corner) {
    const auto position = static_cast<size_t>(corner.position);
    const auto uv = static_cast<uint32_t>(corner.uv);
    const auto normal = part.smooth ? static_cast<uint32_t>(corner.normal) : kNone;
    if (part.head.size() <= position) part.head.resize(std::max(positions_.size() / 3, position + 1), kNone);
    for (uint32_t i = part.head[position]; i != kNone; i = part.vertices[i].next)
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
    model_.materials.push_back({"", default_material(), 0});
    return static_cast<uint32_t>(model_.materials.size() - 1);
  }

  void finish() {
    for (auto& part : parts_) {
      if (part.mesh.indices.empty()) continue;
      if (uvs_.empty()) part.mesh.uvs.clear();
      model_.meshes.push_back(std::move(part.mesh));
    }
    if (model_.meshes.empty()) throw FileError(path_, "holds no face");
  }

  std::string path_;
  ObjOptions options_;
  TextureStore& textures_;
  std::string text_;
  LineBuffer buffer_;
  ObjModel model_;
  std::vector<float> positions_, normals_, uvs_;
  std::vector<Corner> polygon_;
  std::vector<float> corner_positions_;
  Part parts_[2];  // flat, smooth
  uint32_t material_ = kNone;
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

ObjModel read_obj(const std::string& path, const ObjOptions& options, TextureStore& textures) {
  return ObjReader(path, options, textures).read();
}

}  // namespace lumicut::io
