#include "io/gltf_document.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

#include "io/file_error.h"
#include "io/json_reader.h"

namespace lumicut::io {

namespace {

constexpr double kAny = kInfinity;

class Document {
 public:
  Document(const nlohmann::json& json, const std::string& path) : top_(JsonValue(json, path, "")), path_(path) {}

  void check() const {
    if (const auto asset = object(top_, "asset"))
      if (const auto version = JsonObject(*asset).find("version"); version && !version->text().starts_with("2."))
        version->fail(fmt::format("is {}, but 2 is read", version->text()));
    check_files("buffers");
    check_files("images");
    for (const auto& value : list(top_, "bufferViews")) index(JsonObject(value), "buffer", "buffers");
    for (const auto& value : list(top_, "images")) index(JsonObject(value), "bufferView", "bufferViews");
    for (const auto& value : list(top_, "accessors")) index(JsonObject(value), "bufferView", "bufferViews");
    for (const auto& value : list(top_, "textures")) {
      index(JsonObject(value), "source", "images");
      index(JsonObject(value), "sampler", "samplers");
    }
    for (const auto& value : list(top_, "materials")) check_material(JsonObject(value));
    for (const auto& value : list(top_, "meshes"))
      for (const auto& primitive : list(JsonObject(value), "primitives")) check_primitive(JsonObject(primitive));
    size_t lights = 0;
    if (const auto extensions = object(top_, "extensions"))
      if (const auto punctual = object(*extensions, "KHR_lights_punctual"))
        for (const auto& value : list(*punctual, "lights")) check_light(JsonObject(value)), ++lights;
    check_nodes(lights);
  }

 private:
  static std::vector<JsonValue> list(JsonObject from, const char* key) {
    const auto found = from.find(key);
    return found ? found->elements() : std::vector<JsonValue>{};
  }
  static std::optional<JsonObject> object(JsonObject from, const char* key) {
    const auto found = from.find(key);
    return found ? std::optional(JsonObject(*found)) : std::nullopt;
  }
  static void number(JsonObject from, const char* key, double least = -kAny, double most = kAny) {
    if (const auto found = from.find(key)) found->number(least, most);
  }
  static void numbers(JsonObject from, const char* key, size_t count, double least = -kAny, double most = kAny) {
    if (const auto found = from.find(key)) found->numbers(count, least, most);
  }
  size_t count(const char* of) const {
    const auto& all = top_.value().raw();
    const auto found = all.find(of);
    return found == all.end() ? 0 : found->size();
  }
  // That of an element of the document's list `of`.
  size_t index(const JsonValue& value, size_t length, const char* of) const {
    const auto& raw = value.raw();
    if (!raw.is_number_integer()) value.fail_expected(fmt::format("the number of one of the {}", of));
    if (!raw.is_number_unsigned() || raw.get<uint64_t>() >= length)
      value.fail(fmt::format("names number {} of the {}, but there are {}", raw.dump(), of, length));
    return raw.get<size_t>();
  }
  void index(JsonObject from, const char* key, const char* of) const {
    if (const auto found = from.find(key)) index(*found, count(of), of);
  }

  void check_files(const char* of) const {
    const std::string folder = std::filesystem::path(path_).parent_path().string();
    for (const auto& value : list(top_, of)) {
      JsonObject file(value);
      const auto uri = file.find("uri");
      if (!uri || uri->text().starts_with("data:")) continue;
      const std::string name = gltf_file(folder, uri->text());
      std::error_code code;
      if (!std::filesystem::exists(name, code) && std::strcmp(of, "images") == 0) continue;  // may be used by nothing
      try {
        check_regular_file(name);
      } catch (const FileError& error) {
        uri->fail(error.what());
      }
    }
  }

  void check_texture(JsonObject from, const char* key) const {
    if (const auto texture = object(std::move(from), key)) {
      index(*texture, "index", "textures");
      number(*texture, "scale");
      if (const auto extensions = object(*texture, "extensions"))
        if (const auto transform = object(*extensions, "KHR_texture_transform")) {
          numbers(*transform, "offset", 2);
          numbers(*transform, "scale", 2);
          number(*transform, "rotation");
        }
    }
  }
  void check_material(const JsonObject& material) const {
    if (const auto pbr = object(material, "pbrMetallicRoughness")) {
      numbers(*pbr, "baseColorFactor", 4);
      number(*pbr, "metallicFactor");
      number(*pbr, "roughnessFactor");
      check_texture(*pbr, "baseColorTexture");
      check_texture(*pbr, "metallicRoughnessTexture");
    }
    numbers(material, "emissiveFactor", 3);
    number(material, "alphaCutoff");
    if (auto mode = JsonObject(material).find("alphaMode")) mode->choice({"OPAQUE", "MASK", "BLEND"});
    check_texture(material, "normalTexture");
    check_texture(material, "emissiveTexture");
    const auto extensions = object(material, "extensions");
    if (!extensions) return;
    static const struct {
      const char *extension, *key;
      size_t numbers;  // 1: a lone number, 0: a texture
      double least = -kAny, most = kAny;
    } kValues[] = {{"KHR_materials_emissive_strength", "emissiveStrength", 1, 0},
                   {"KHR_materials_transmission", "transmissionFactor", 1},
                   {"KHR_materials_ior", "ior", 1},
                   {"KHR_materials_clearcoat", "clearcoatFactor", 1},
                   {"KHR_materials_clearcoat", "clearcoatRoughnessFactor", 1},
                   {"KHR_materials_specular", "specularFactor", 1, 0, 1},
                   {"KHR_materials_specular", "specularColorFactor", 3, 0},
                   {"KHR_materials_volume", "thicknessFactor", 1, 0},
                   {"KHR_materials_volume", "attenuationDistance", 1, 1e-30},
                   {"KHR_materials_volume", "attenuationColor", 3, 0, 1},
                   {"KHR_materials_pbrSpecularGlossiness", "diffuseFactor", 4, 0, 1},
                   {"KHR_materials_pbrSpecularGlossiness", "specularFactor", 3, 0, 1},
                   {"KHR_materials_pbrSpecularGlossiness", "glossinessFactor", 1, 0, 1},
                   {"KHR_materials_pbrSpecularGlossiness", "diffuseTexture", 0}};
    for (const auto& value : kValues)
      if (const auto extension = object(*extensions, value.extension)) {
        if (value.numbers > 1) numbers(*extension, value.key, value.numbers, value.least, value.most);
        if (value.numbers == 1) number(*extension, value.key, value.least, value.most);
        if (value.numbers == 0) check_texture(*extension, value.key);
      }
  }

  void check_primitive(const JsonObject& primitive) const {
    index(primitive, "material", "materials");
    index(primitive, "indices", "accessors");
    check_accessors(primitive);
  }
  void check_accessors(const JsonObject& from) const {
    if (const auto attributes = object(from, "attributes"))
      for (const auto& item : attributes->value().raw().items()) index(*attributes, item.key().c_str(), "accessors");
  }

  void check_nodes(size_t lights) const {
    const auto nodes = list(top_, "nodes");
    const size_t meshes = count("meshes"), cameras = count("cameras");
    constexpr size_t kNone = ~size_t{0};
    std::vector<size_t> parents(nodes.size(), kNone);
    for (size_t n = 0; n < nodes.size(); ++n) {
      JsonObject node(nodes[n]);
      if (const auto mesh = node.find("mesh")) index(*mesh, meshes, "meshes");
      if (const auto camera = node.find("camera")) index(*camera, cameras, "cameras");
      if (const auto extensions = object(node, "extensions")) {
        if (const auto punctual = object(*extensions, "KHR_lights_punctual"))
          if (const auto light = JsonObject(*punctual).find("light")) index(*light, lights, "lights");
        if (const auto instancing = object(*extensions, "EXT_mesh_gpu_instancing")) check_accessors(*instancing);
      }
      if (const auto matrix = node.find("matrix")) {
        const auto m = matrix->numbers(16, -kAny, kAny);
        if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
          matrix->fail("is not affine: its last row is no 0 0 0 1");
      }
      numbers(node, "translation", 3);
      numbers(node, "scale", 3);
      if (const auto rotation = node.find("rotation")) {
        double squared = 0;
        for (const double v : rotation->numbers(4, -1e6, 1e6)) squared += v * v;
        if (!(squared > 1e-12)) rotation->fail("is no rotation: its length is 0");
      }
      for (const auto& value : list(node, "children")) {
        const size_t child = index(value, nodes.size(), "nodes");
        if (parents[child] != kNone)
          value.fail(fmt::format("nodes[{}] is a child of nodes[{}] already", child, parents[child]));
        parents[child] = n;
      }
    }
    index(top_, "scene", "scenes");
    for (const auto& scene : list(top_, "scenes")) {
      std::vector<bool> seen(nodes.size());
      for (const auto& value : list(JsonObject(scene), "nodes")) {
        const size_t root = index(value, nodes.size(), "nodes");
        if (parents[root] != kNone)
          value.fail(fmt::format("nodes[{}] is a child of nodes[{}], not at the top", root, parents[root]));
        if (seen[root]) value.fail(fmt::format("nodes[{}] stands here twice", root));
        seen[root] = true;
      }
    }
  }

  static void check_light(const JsonObject& light) {
    numbers(light, "color", 3, 0);
    number(light, "intensity", 0);
    if (const auto spot = object(light, "spot")) {
      number(*spot, "innerConeAngle");
      number(*spot, "outerConeAngle");
    }
  }

  JsonObject top_;
  std::string path_;
};

}  // namespace

// As tinygltf finds them: %20 and + are blanks.
std::string gltf_file(const std::string& folder, const std::string& uri) {
  std::string name;
  const auto hex = [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; };
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && hex(uri[i + 1]) && hex(uri[i + 2])) {
      name += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      name += uri[i] == '+' ? ' ' : uri[i];
    }
  }
  return folder.empty() || name.starts_with('/') ? name : folder + "/" + name;
}

void check_gltf_document(const std::string& path, const std::string& bytes) {
  std::string text = bytes;
  if (is_binary_gltf(bytes)) {
    constexpr size_t kStart = 20;  // of the first chunk's content; its length is at 12
    if (bytes.size() < kStart) return;
    uint32_t length = 0, version = 0;
    std::memcpy(&version, bytes.data() + 4, sizeof(version));
    if (version != 2) throw FileError(path, fmt::format("is of version {} of binary glTF, but 2 is read", version));
    std::memcpy(&length, bytes.data() + 12, sizeof(length));
    if (length > bytes.size() - kStart) return;  // tinygltf refuses it
    text = bytes.substr(kStart, length);
    text.resize(text.find_last_not_of('\0') + 1);  // some fill the chunk with these in place of spaces
  }
  Document(parse_json(text, path), path).check();
}

}  // namespace lumicut::io
