#include "io/scene_gltf.h"

#include <fmt/format.h>
#include <tiny_gltf.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <numbers>

#include "io/affine.h"
#include "io/file_error.h"
#include "io/gltf_document.h"
#include "io/scene_defaults.h"
#include "io/texture_store.h"
#include "io/vertex_colours.h"

namespace lumicut::io {

namespace {

namespace gltf = tinygltf;
namespace fs = std::filesystem;

constexpr double kPi = std::numbers::pi;
constexpr double kLumensPerWatt = 683;  // as other exporters take it: candela, lux and nits over this
constexpr int kDeepest = 256;

Affine placed(const Vec& move, const std::array<double, 4>& q, const Vec& scale) {
  const auto [x, y, z, w] = q;
  Affine out;
  out.m = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),     move[0],
           2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),     move[1],
           2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y), move[2]};
  for (size_t r = 0; r < 3; ++r)
    for (size_t c = 0; c < 3; ++c) out.m[4 * r + c] *= scale[c];
  return out;
}

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), textures_(scene_.textures), coloured_(scene_) {}

  SceneData read() {
    check_regular_file(path_);
    gltf::TinyGLTF loader;
    // As they are in the file: they are read by what they are used for.
    loader.SetImageLoader(
        [](gltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes, int size, void*) {
          image->image.assign(bytes, bytes + size);
          return true;
        },
        nullptr);
    std::string folder = fs::path(path_).parent_path().string();
    if (folder.empty()) folder = ".";
    loader.SetFsCallbacks(
        {exists_beside, [](const std::string& name, void*) { return name; }, read_beside, nullptr, &folder});
    std::string error, warning;
    const std::string file = read_whole_file(path_, std::numeric_limits<uint32_t>::max());
    check_gltf_document(path_, file);
    const auto* bytes = reinterpret_cast<const unsigned char*>(file.data());
    const auto size = static_cast<unsigned>(file.size());
    const bool done = is_binary_gltf(file)
                          ? loader.LoadBinaryFromMemory(&model_, &error, &warning, bytes, size, folder)
                          : loader.LoadASCIIFromString(&model_, &error, &warning, file.data(), size, folder);
    if (!done) throw FileError(path_, error.empty() ? "is no glTF 2.0 file" : one_line(error));
    if (!warning.empty()) scene_.warnings.add("warnings of the glTF reader", path_, one_line(warning));
    note_extensions();
    for (gltf::Material& material : model_.materials) translate_glossiness(material);
    for (size_t m = 0; m < model_.materials.size(); ++m) read_material(m);
    Material plain;
    plain.name = "no material";
    plain.values = default_material();
    scene_.materials.push_back(plain);
    read_nodes();
    if (scene_.meshes.empty()) throw FileError(path_, "has no triangles: there is nothing to see");
    if (!has_camera_) frame_scene(scene_);
    if (!is_lit(scene_)) add_sky(scene_);
    scene_.file = path_;
    return std::move(scene_);
  }

 private:
  // tinygltf looks in the working folder too, where the file would be another one.
  static bool exists_beside(const std::string& name, void* folder) {
    std::error_code code;
    const std::string& start = *static_cast<const std::string*>(folder);
    return (name.starts_with(start) || name.starts_with('/')) && fs::exists(name, code);
  }
  static bool read_beside(std::vector<unsigned char>* out, std::string*, const std::string& name, void*) {
    check_regular_file(name);
    const std::string bytes = read_whole_file(name);
    out->assign(bytes.begin(), bytes.end());
    return true;
  }
  [[noreturn]] void fail(const std::string& where, const std::string& text) const {
    throw FileError(path_, fmt::format("{}: {}", where, text));
  }
  static std::string one_line(std::string text) {
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
    for (char& c : text)
      if (c == '\n') c = ' ';
    return text;
  }
  template <typename List>
  auto& at(const List& list, int index, const std::string& where) const {
    if (index < 0 || static_cast<size_t>(index) >= list.size())
      fail(where, fmt::format("names number {}, but there are {}", index, list.size()));
    return list[static_cast<size_t>(index)];
  }

  void note_extensions() {
    static const std::set<std::string> kRead = {"KHR_lights_punctual",        "KHR_materials_emissive_strength",
                                                "KHR_materials_transmission", "KHR_materials_ior",
                                                "KHR_materials_clearcoat",    "KHR_materials_specular",
                                                "KHR_texture_transform",      "EXT_mesh_gpu_instancing",
                                                "KHR_materials_volume",       "KHR_materials_pbrSpecularGlossiness"};
    for (const auto& name : model_.extensionsRequired)
      if (kRead.count(name) == 0) fail("extensionsRequired", fmt::format("{} is not supported", name));
    for (const auto& name : model_.extensionsUsed)
      if (kRead.count(name) == 0) leave_out(name);
    if (!model_.animations.empty()) leave_out("animations");
    if (!model_.skins.empty()) leave_out("skins");
  }
  void leave_out(const std::string& what) {
    scene_.warnings.add("things left out", path_, fmt::format("{}: left out", what));
  }

  // ---- Numbers of accessors

  // `width` numbers an element, integers of normalized accessors as shares of 1.
  std::vector<double> numbers(int index, int width, const std::string& where) const {
    const auto& accessor = at(model_.accessors, index, where);
    const std::string name = fmt::format("accessors[{}]", index);
    if (gltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type)) != width)
      fail(name, fmt::format("has another type than {} numbers an element, which {} needs", width, where));
    if (accessor.sparse.isSparse) fail(name, "is sparse, which is not supported");
    const int bytes = gltf::GetComponentSizeInBytes(static_cast<uint32_t>(accessor.componentType));
    if (accessor.count == 0) return {};
    const auto& view = at(model_.bufferViews, accessor.bufferView, name);
    const auto& buffer = at(model_.buffers, view.buffer, fmt::format("bufferViews[{}]", accessor.bufferView));
    const int stride = accessor.ByteStride(view);
    const size_t start = view.byteOffset + accessor.byteOffset, element = static_cast<size_t>(bytes * width);
    if (bytes <= 0 || stride < static_cast<int>(element) || start > buffer.data.size() ||
        accessor.count - 1 > (buffer.data.size() - start) / static_cast<size_t>(stride) ||
        (accessor.count - 1) * static_cast<size_t>(stride) + element > buffer.data.size() - start)
      fail(name, fmt::format("its {} elements do not lie in buffers[{}] of {} bytes", accessor.count, view.buffer,
                             buffer.data.size()));
    std::vector<double> out(accessor.count * static_cast<size_t>(width));
    for (size_t i = 0; i < accessor.count; ++i)
      for (int k = 0; k < width; ++k) {
        const unsigned char* at =
            &buffer.data[start + i * static_cast<size_t>(stride) + static_cast<size_t>(k * bytes)];
        out[i * static_cast<size_t>(width) + static_cast<size_t>(k)] =
            number(at, accessor.componentType, accessor.normalized);
      }
    return out;
  }
  static double number(const unsigned char* at, int type, bool normalized) {
    const auto as = [&]<typename T>(T value, double most) {
      std::memcpy(&value, at, sizeof(value));
      return normalized ? std::max(static_cast<double>(value) / most, -1.0) : static_cast<double>(value);
    };
    switch (type) {
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return as(int8_t{}, 127);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return as(uint8_t{}, 255);
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return as(int16_t{}, 32767);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return as(uint16_t{}, 65535);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return as(uint32_t{}, 4294967295.0);
      case TINYGLTF_COMPONENT_TYPE_DOUBLE:
        return as(double{}, 1);
      default:
        return as(float{}, 1);
    }
  }

  // ---- Values of extensions

  static const gltf::Value* extension(const gltf::ExtensionMap& all, const char* name) {
    const auto found = all.find(name);
    return found == all.end() ? nullptr : &found->second;
  }
  static double number_of(const gltf::Value* from, const char* key, double missing) {
    if (from == nullptr || !from->Has(key) || !from->Get(key).IsNumber()) return missing;
    return from->Get(key).GetNumberAsDouble();
  }
  // What is no number of an element is one that no list has.
  static int index_of(const gltf::Value* from, const char* key, int missing) {
    const double number = number_of(from, key, missing);
    return std::abs(number) < 2147483647.0 && number == std::floor(number) ? static_cast<int>(number) : 2147483647;
  }
  static Vec vector_of(const gltf::Value* from, const char* key, const Vec& missing) {
    if (from == nullptr || !from->Has(key) || !from->Get(key).IsArray()) return missing;
    Vec out = missing;
    const auto& list = from->Get(key);
    for (size_t k = 0; k < 3 && k < list.ArrayLen(); ++k)
      if (list.Get(static_cast<int>(k)).IsNumber()) out[k] = list.Get(static_cast<int>(k)).GetNumberAsDouble();
    return out;
  }
  float share(double value, const std::string& where, double most = 1) const {
    if (!(value >= 0 && value <= most)) fail(where, fmt::format("{} is not in [0, {}]", value, most));
    return static_cast<float>(value);
  }

  // ---- Textures

  uint32_t flags_of(int sampler) const {
    if (sampler < 0) return 0;
    const auto& s = at(model_.samplers, sampler, "textures");
    uint32_t flags = 0;
    if (s.wrapS == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE && s.wrapT == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE)
      flags |= LUMICUT_CLAMP;
    if (s.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) flags |= LUMICUT_NEAREST;
    return flags;
  }
  int32_t texture(int index, TextureUse use, const std::string& user) {
    if (index < 0) return 0;
    const uint32_t flags = flags_of(at(model_.textures, index, user).sampler);
    const int source = at(model_.textures, index, user).source;
    const auto& image = at(model_.images, source, user);
    if (image.image.empty()) fail(user, fmt::format("images[{}] ({}) is not there", source, image.uri));
    const std::string name = fmt::format("{}: images[{}]{}", path_, source, image.uri.empty() ? "" : ": " + image.uri);
    const std::string_view bytes(reinterpret_cast<const char*>(image.image.data()), image.image.size());
    return textures_.get_held(name, bytes, use, flags, user);
  }
  // One channel of an image as a texture of its own.
  int32_t channel_of(int index, size_t channel, const std::string& user) {
    if (index < 0) return 0;
    const auto key = std::pair(index, channel);
    if (const auto found = channels_.find(key); found != channels_.end()) return found->second;
    const Texture& all = scene_.textures[static_cast<size_t>(texture(index, TextureUse::vectors, user)) - 1];
    Texture one;
    one.file = all.file, one.width = all.width, one.height = all.height, one.channels = 1;
    one.flags = all.flags & ~uint32_t{LUMICUT_SRGB | LUMICUT_BLEND_STORED};
    for (size_t i = channel; i < all.bytes.size(); i += all.channels) one.bytes.push_back(all.bytes[i]);
    for (size_t i = channel; i < all.floats.size(); i += all.channels) one.floats.push_back(all.floats[i]);
    scene_.textures.push_back(std::move(one));
    return channels_[key] = static_cast<int32_t>(scene_.textures.size());
  }

  // ---- Materials

  // Diffuse and specular colours as base colour and share of metal, by the conversion that the extension's text gives.
  void translate_glossiness(gltf::Material& m) {
    const auto* from = extension(m.extensions, "KHR_materials_pbrSpecularGlossiness");
    if (from == nullptr) return;
    constexpr double kDielectric = 0.04, kLeast = 1e-6;
    const auto brightness = [](const Vec& c) {
      return std::sqrt(0.299 * c[0] * c[0] + 0.587 * c[1] * c[1] + 0.114 * c[2] * c[2]);
    };
    const Vec diffuse = vector_of(from, "diffuseFactor", {1, 1, 1}), f0 = vector_of(from, "specularFactor", {1, 1, 1});
    const double rest = 1 - std::max({f0[0], f0[1], f0[2]}), d = brightness(diffuse), s = brightness(f0);
    double metallic = 0;
    if (s >= kDielectric) {
      const double b = d * rest / (1 - kDielectric) + s - 2 * kDielectric, c = kDielectric - s;
      metallic = (std::sqrt(std::max(0.0, b * b - 4 * kDielectric * c)) - b) / (2 * kDielectric);
      metallic = std::clamp(metallic, 0.0, 1.0);
    }
    auto& pbr = m.pbrMetallicRoughness;
    pbr.baseColorFactor = {1, 1, 1, 1};
    for (size_t k = 0; k < 3; ++k) {
      const double of_diffuse = diffuse[k] * rest / (1 - kDielectric) / std::max(1 - metallic, kLeast);
      const double of_metal = (f0[k] - kDielectric * (1 - metallic)) / std::max(metallic, kLeast);
      pbr.baseColorFactor[k] = std::clamp(of_diffuse + metallic * metallic * (of_metal - of_diffuse), 0.0, 1.0);
    }
    if (from->Has("diffuseFactor") && from->Get("diffuseFactor").IsArray() && from->Get("diffuseFactor").ArrayLen() > 3)
      pbr.baseColorFactor[3] = from->Get("diffuseFactor").Get(3).GetNumberAsDouble();
    pbr.metallicFactor = metallic;
    pbr.roughnessFactor = 1 - number_of(from, "glossinessFactor", 1);
    if (from->Has("diffuseTexture")) {
      const gltf::Value& texture = from->Get("diffuseTexture");
      pbr.baseColorTexture.index = index_of(&texture, "index", -1);
      pbr.baseColorTexture.texCoord = index_of(&texture, "texCoord", 0);
    }
    if (from->Has("specularGlossinessTexture")) leave_out("textures of KHR_materials_pbrSpecularGlossiness's gloss");
  }

  void read_material(size_t index) {
    const gltf::Material& from = model_.materials[index];
    Material out;
    out.name = from.name.empty() ? fmt::format("materials[{}]", index) : from.name;
    const std::string where = fmt::format("materials[{}]", index);
    lumicut_material& m = out.values = default_material();
    m.flags = LUMICUT_GGX;
    const auto& pbr = from.pbrMetallicRoughness;
    if (pbr.baseColorFactor.size() != 4 || from.emissiveFactor.size() != 3)
      fail(where, "a factor has another number of values");
    for (size_t k = 0; k < 3; ++k) m.diffuse[k] = share(pbr.baseColorFactor[k], where + ".baseColorFactor");
    m.diffuse_texture = texture(pbr.baseColorTexture.index, TextureUse::colour, where);
    m.roughness = share(pbr.roughnessFactor, where + ".roughnessFactor");
    m.metallic = share(pbr.metallicFactor, where + ".metallicFactor");
    if (pbr.metallicRoughnessTexture.index >= 0) {
      m.roughness_texture = channel_of(pbr.metallicRoughnessTexture.index, 1, where);
      m.metallic_texture = channel_of(pbr.metallicRoughnessTexture.index, 2, where);
    }
    const auto* specular = extension(from.extensions, "KHR_materials_specular");
    const Vec tint = vector_of(specular, "specularColorFactor", {1, 1, 1});
    for (size_t k = 0; k < 3; ++k)
      m.specular[k] = share(std::min(1.0, number_of(specular, "specularFactor", 1) * tint[k]), where + ".specular");
    const double ior = number_of(extension(from.extensions, "KHR_materials_ior"), "ior", 1.5);
    if (!(ior >= 1 && ior <= 10)) fail(where + ".ior", fmt::format("{} is not in [1, 10]", ior));
    m.ior = static_cast<float>(ior);
    m.transmission = share(number_of(extension(from.extensions, "KHR_materials_transmission"), "transmissionFactor", 0),
                           where + ".transmissionFactor");
    const auto* volume = extension(from.extensions, "KHR_materials_volume");
    if (number_of(volume, "thicknessFactor", 0) > 0) {
      const double distance = number_of(volume, "attenuationDistance", 0);  // 0: not given, infinite
      const Vec left = vector_of(volume, "attenuationColor", {1, 1, 1});
      for (size_t k = 0; k < 3 && distance > 0; ++k) {
        share(left[k], where + ".attenuationColor");
        m.absorption[k] = static_cast<float>(std::min(-std::log(std::max(left[k], 1e-6)) / distance, 1e15));
      }
    } else if (m.transmission > 0) {
      m.flags |= LUMICUT_SHADOWS_PASS;  // without a volume it is a thin sheet
    }
    const auto* coat = extension(from.extensions, "KHR_materials_clearcoat");
    m.coat = share(number_of(coat, "clearcoatFactor", 0), where + ".clearcoatFactor");
    m.coat_roughness = share(number_of(coat, "clearcoatRoughnessFactor", 0), where + ".clearcoatRoughnessFactor");
    const double strength =
        number_of(extension(from.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
    for (size_t k = 0; k < 3; ++k)
      m.emission[k] = share(from.emissiveFactor[k] * strength, where + ".emissiveFactor", 1e15);
    m.emission_texture = texture(from.emissiveTexture.index, TextureUse::colour, where);
    if (from.doubleSided) m.flags |= LUMICUT_EMIT_BOTH_SIDES;
    if (from.normalTexture.index >= 0) {
      m.normal_texture = texture(from.normalTexture.index, TextureUse::vectors, where);
      m.normal_strength = share(from.normalTexture.scale, where + ".normalTexture.scale", 10);
    }
    if (from.alphaMode != "OPAQUE") read_alpha(from, m, where);
    scene_.materials.push_back(std::move(out));
  }
  void read_alpha(const gltf::Material& from, lumicut_material& m, const std::string& where) {
    const auto& pbr = from.pbrMetallicRoughness;
    const bool mask = from.alphaMode == "MASK";
    const double factor = share(pbr.baseColorFactor[3], where + ".baseColorFactor");
    if (pbr.baseColorTexture.index < 0) {
      m.opacity = mask ? (factor >= from.alphaCutoff ? 1 : kHole) : std::max(kHole, static_cast<float>(factor));
      return;
    }
    m.opacity = mask ? 1 : std::max(kHole, static_cast<float>(factor));
    m.opacity_texture = texture(pbr.baseColorTexture.index, TextureUse::mask, where);
    if (!mask) return;
    Texture cut = scene_.textures[static_cast<size_t>(m.opacity_texture) - 1];
    for (uint8_t& b : cut.bytes) b = b / 255.0 * factor >= from.alphaCutoff ? 255 : 0;
    for (float& f : cut.floats) f = f * factor >= from.alphaCutoff ? 1 : 0;
    scene_.textures.push_back(std::move(cut));
    m.opacity_texture = static_cast<int32_t>(scene_.textures.size());
  }

  // ---- Meshes

  void read_primitive(const gltf::Primitive& from, const std::string& where, Mesh& out) {
    if (from.mode != TINYGLTF_MODE_TRIANGLES && from.mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
        from.mode != TINYGLTF_MODE_TRIANGLE_FAN) {
      leave_out(where + ": points or lines");
      return;
    }
    const auto attribute = [&](const std::string& name) {
      const auto found = from.attributes.find(name);
      return found == from.attributes.end() ? -1 : found->second;
    };
    if (attribute("POSITION") < 0) return;
    if (!from.targets.empty()) leave_out(where + ": morph targets");
    const auto add = [&](std::vector<float>& to, const std::vector<double>& values) {
      for (const double v : values) to.push_back(static_cast<float>(v));
    };
    add(out.positions, numbers(attribute("POSITION"), 3, where + ".POSITION"));
    const size_t vertices = out.positions.size() / 3;
    if (attribute("NORMAL") >= 0) add(out.normals, numbers(attribute("NORMAL"), 3, where + ".NORMAL"));
    const int material = from.material;
    int set = 0;
    const gltf::Value* transform = nullptr;
    if (material >= 0) {
      const auto& texture = at(model_.materials, material, where).pbrMetallicRoughness.baseColorTexture;
      set = texture.texCoord;
      transform = extension(texture.extensions, "KHR_texture_transform");
      set = index_of(transform, "texCoord", set);
    }
    if (attribute(fmt::format("TEXCOORD_{}", set)) >= 0) {
      const auto uvs = numbers(attribute(fmt::format("TEXCOORD_{}", set)), 2, where + ".TEXCOORD");
      const Vec move = vector_of(transform, "offset", {0, 0, 0}), scale = vector_of(transform, "scale", {1, 1, 1});
      const double angle = number_of(transform, "rotation", 0), c = std::cos(angle), s = std::sin(angle);
      for (size_t i = 0; i + 1 < uvs.size(); i += 2) {
        const double u = uvs[i] * scale[0], v = uvs[i + 1] * scale[1];
        out.uvs.push_back(static_cast<float>(c * u + s * v + move[0]));
        out.uvs.push_back(static_cast<float>(1 - (c * v - s * u + move[1])));  // v counts from the top there
      }
    }
    if ((!out.normals.empty() && out.normals.size() != 3 * vertices) ||
        (!out.uvs.empty() && out.uvs.size() != 2 * vertices))
      fail(where, "its attributes have different numbers of elements");
    std::vector<uint32_t> order;
    if (from.indices >= 0) {
      const int type = at(model_.accessors, from.indices, where + ".indices").componentType;
      if (type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
          type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
        fail(fmt::format("accessors[{}]", from.indices),
             fmt::format("componentType {} is no unsigned integer, as {}.indices are", type, where));
      for (const double i : numbers(from.indices, 1, where + ".indices")) {
        if (!(i < static_cast<double>(vertices))) fail(where, fmt::format("index {} is not below {}", i, vertices));
        order.push_back(static_cast<uint32_t>(i));
      }
    } else {
      for (uint32_t i = 0; i < vertices; ++i) order.push_back(i);
    }
    const auto triangle = [&](uint32_t a, uint32_t b, uint32_t c) { out.indices.insert(out.indices.end(), {a, b, c}); };
    for (size_t i = 0; i + 2 < order.size(); i += from.mode == TINYGLTF_MODE_TRIANGLES ? 3 : 1) {
      const bool odd = i % 2 != 0;
      if (from.mode == TINYGLTF_MODE_TRIANGLES)
        triangle(order[i], order[i + 1], order[i + 2]);
      else if (from.mode == TINYGLTF_MODE_TRIANGLE_FAN)
        triangle(order[0], order[i + 1], order[i + 2]);
      else
        triangle(order[i], order[i + (odd ? 2 : 1)], order[i + (odd ? 1 : 2)]);
    }
    auto number = static_cast<uint32_t>(material >= 0 ? static_cast<size_t>(material) : model_.materials.size());
    if (attribute("COLOR_0") >= 0) number = read_colours(attribute("COLOR_0"), number, vertices, where, out);
    out.materials.assign(out.indices.size() / 3, number);
  }

  // The material that shows them.
  uint32_t read_colours(int index, uint32_t material, size_t vertices, const std::string& where, Mesh& out) {
    Attribute colours;
    colours.id = VertexColours::kAttribute, colours.domain = LUMICUT_OF_VERTICES;
    colours.components = at(model_.accessors, index, where + ".COLOR_0").type == TINYGLTF_TYPE_VEC4 ? 4 : 3;
    for (const double v : numbers(index, static_cast<int>(colours.components), where + ".COLOR_0"))
      colours.values.push_back(share(v, where + ".COLOR_0"));
    if (colours.values.size() != vertices * colours.components)
      fail(where, "its attributes have different numbers of elements");
    const std::string mode = material < model_.materials.size() ? model_.materials[material].alphaMode : "OPAQUE";
    if (mode == "MASK" && colours.components == 4) leave_out(where + ": opacities of vertices");
    const bool alpha = mode == "BLEND" && colours.components == 4;
    out.attributes.push_back(std::move(colours));
    return coloured_.material(material, alpha);
  }

  // ---- Nodes

  void read_nodes() {
    // Those of a mesh that is placed often are stored once.
    for (size_t m = 0; m < model_.meshes.size(); ++m) {
      first_.push_back(scene_.meshes.size());
      for (size_t p = 0; p < model_.meshes[m].primitives.size(); ++p) {
        Mesh mesh;
        mesh.name = model_.meshes[m].name;
        read_primitive(model_.meshes[m].primitives[p], fmt::format("meshes[{}].primitives[{}]", m, p), mesh);
        scene_.meshes.push_back(std::move(mesh));
      }
    }
    first_.push_back(scene_.meshes.size());
    std::vector<int> roots;
    if (!model_.scenes.empty()) {
      roots = at(model_.scenes, std::max(0, model_.defaultScene), "scene").nodes;
    } else {
      std::vector<bool> child(model_.nodes.size());
      for (const gltf::Node& node : model_.nodes)
        for (const int n : node.children) child[static_cast<size_t>(n)] = true;
      for (size_t n = 0; n < model_.nodes.size(); ++n)
        if (!child[n]) roots.push_back(static_cast<int>(n));
    }
    for (const int root : roots) read_node(root, {}, 0);
    std::erase_if(scene_.meshes, [](const Mesh& mesh) { return mesh.indices.empty() || mesh.transforms.empty(); });
  }
  void read_node(int index, const Affine& parent, int depth) {
    const std::string where = fmt::format("nodes[{}]", index);
    if (depth > kDeepest) fail(where, fmt::format("lies in more than {} others", kDeepest));
    const gltf::Node& node = at(model_.nodes, index, where);
    Affine local;
    if (node.matrix.size() == 16) {
      for (size_t r = 0; r < 3; ++r)
        for (size_t c = 0; c < 4; ++c) local.m[4 * r + c] = node.matrix[4 * c + r];
    } else {
      const auto& t = node.translation;
      const auto& q = node.rotation;
      const auto& s = node.scale;
      local = placed(t.size() == 3 ? Vec{t[0], t[1], t[2]} : Vec{0, 0, 0},
                     q.size() == 4 ? std::array{q[0], q[1], q[2], q[3]} : std::array{0.0, 0.0, 0.0, 1.0},
                     s.size() == 3 ? Vec{s[0], s[1], s[2]} : Vec{1, 1, 1});
    }
    const Affine world = parent * local;
    for (const double v : world.m)
      if (!(std::abs(v) < kLargestCoordinate)) fail(where, fmt::format("its transform has the number {}", v));
    if (node.mesh >= 0) place(node, world, where);
    if (node.camera >= 0 && !has_camera_) read_camera(node.camera, world, where);
    if (const auto* light = extension(node.extensions, "KHR_lights_punctual"))
      read_light(index_of(light, "light", -1), world, where);
    for (const int child : node.children) read_node(child, world, depth + 1);
  }
  void place(const gltf::Node& node, const Affine& world, const std::string& where) {
    at(model_.meshes, node.mesh, where);
    std::vector<Affine> places{world};
    if (const auto* instancing = extension(node.extensions, "EXT_mesh_gpu_instancing");
        instancing && instancing->Has("attributes")) {
      const auto& attributes = instancing->Get("attributes");
      const auto read = [&](const char* name, int width) {
        const int accessor = index_of(&attributes, name, -1);
        return accessor < 0 ? std::vector<double>{} : numbers(accessor, width, where + "." + name);
      };
      const auto t = read("TRANSLATION", 3), q = read("ROTATION", 4), s = read("SCALE", 3);
      const size_t count = std::max({t.size() / 3, q.size() / 4, s.size() / 3});
      for (const size_t n : {t.size() / 3, q.size() / 4, s.size() / 3})
        if (n != 0 && n != count) fail(where, "its instances have different numbers of attributes");
      for (size_t i = 0; i + 3 < q.size(); i += 4)
        if (q[i] == 0 && q[i + 1] == 0 && q[i + 2] == 0 && q[i + 3] == 0)
          fail(where, fmt::format("ROTATION of its instance {} is none: its length is 0", i / 4));
      places.clear();
      for (size_t i = 0; i < count; ++i)
        places.push_back(world * placed(t.empty() ? Vec{0, 0, 0} : Vec{t[3 * i], t[3 * i + 1], t[3 * i + 2]},
                                        q.empty() ? std::array{0.0, 0.0, 0.0, 1.0}
                                                  : std::array{q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]},
                                        s.empty() ? Vec{1, 1, 1} : Vec{s[3 * i], s[3 * i + 1], s[3 * i + 2]}));
    }
    for (const Affine& place : places) {
      if (!(std::abs(place.determinant()) > 0)) {
        leave_out(where + ": what is scaled to nothing");
        continue;
      }
      for (size_t m = first_[static_cast<size_t>(node.mesh)]; m < first_[static_cast<size_t>(node.mesh) + 1]; ++m)
        for (const double v : place.m) scene_.meshes[m].transforms.push_back(static_cast<float>(v));
    }
  }

  // ---- Camera and lights

  void read_camera(int index, const Affine& world, const std::string& where) {
    const auto& from = at(model_.cameras, index, where);
    set_camera(scene_, world.column(3), world.column(2), world.column(1));
    has_camera_ = true;
    lumicut_camera& camera = scene_.camera;
    if (from.type == "orthographic") {
      camera.orthographic = 1;
      if (!(from.orthographic.ymag > 0)) fail(fmt::format("cameras[{}].ymag", index), "is not above 0");
      camera.height = static_cast<float>(2 * from.orthographic.ymag);
    } else {
      const double fov = from.perspective.yfov;
      if (!(fov > 1e-3 && fov < kPi - 1e-3)) fail(fmt::format("cameras[{}].yfov", index), fmt::format("is {}", fov));
      camera.fov_y = static_cast<float>(fov);
      const double aspect = from.perspective.aspectRatio;
      if (aspect > 0.05 && aspect < 20) scene_.width = static_cast<uint32_t>(std::lround(scene_.height * aspect));
    }
  }
  void read_light(int index, const Affine& world, const std::string& where) {
    const gltf::Light& from = at(model_.lights, index, where);
    lumicut_light light{};
    light.struct_size = sizeof(light);
    light.unit = LUMICUT_RADIOMETRIC;
    for (size_t k = 0; k < 3; ++k)
      light.color[k] = from.color.size() == 3 ? share(from.color[k], where + ".color", 1e6) : 1;
    light.value = share(from.intensity / kLumensPerWatt, where + ".intensity", 1e15);
    const Vec position = world.column(3), direction = unit(world.column(2)) * -1.0;
    for (size_t k = 0; k < 3; ++k)
      light.position[k] = static_cast<float>(position[k]), light.direction[k] = static_cast<float>(direction[k]);
    if (from.type == "point") {
      light.type = LUMICUT_POINT;
    } else if (from.type == "directional") {
      light.type = LUMICUT_SUN;
      for (float& p : light.position) p = 0;
    } else if (from.type == "spot") {
      light.type = LUMICUT_SPOT;
      const double outer = from.spot.outerConeAngle, inner = from.spot.innerConeAngle;
      if (!(outer > 0 && outer <= kPi / 2 && inner >= 0 && inner <= outer))
        fail(fmt::format("lights[{}].spot", index), fmt::format("its angles are {} and {}", inner, outer));
      light.angle = static_cast<float>(2 * outer);
      light.blend = static_cast<float>(1 - inner / outer);
    } else {
      fail(fmt::format("lights[{}].type", index), fmt::format("\"{}\" is none of point, spot, directional", from.type));
    }
    scene_.lights.push_back(light);
    scene_.light_names.push_back(where);
  }

  std::string path_;
  SceneData scene_;
  gltf::Model model_;
  TextureStore textures_;
  VertexColours coloured_;
  std::map<std::pair<int, size_t>, int32_t> channels_;
  std::vector<size_t> first_;  // of a mesh's primitives in scene_.meshes; one more at the end
  bool has_camera_ = false;
};

}  // namespace

bool is_gltf(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending == ".gltf" || ending == ".glb";
}

SceneData read_gltf(const std::string& path) { return Reader(path).read(); }

}  // namespace lumicut::io
