#include "io/scene_writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "io/affine.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "io/program_json.h"

namespace lumicut::io {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr char kManifest[] = "lumicut_convert.json";

// FNV-1a of 64 bits.
uint64_t checksum(std::string_view bytes) {
  uint64_t hash = 14695981039346656037u;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash;
}

double degrees(float radians) { return double{radians} * 180 / std::numbers::pi; }

Json numbers(const float* values, size_t count) {
  Json out = Json::array();
  for (size_t k = 0; k < count; ++k) out.push_back(double{values[k]});
  return out;
}

// Readers bring directions to unit length in double precision. This one becomes `v` there: of a vector that was rounded
// from unit length such a one exists, between the roundings of its components.
Json direction(const float* v) {
  const Vec wanted{v[0], v[1], v[2]};
  Vec at = wanted;
  for (int i = 0; i < 200; ++i) {
    const Vec there = at * (1.0 / length(at));
    float rounded[3];
    store(rounded, there);
    if (std::equal(rounded, rounded + 3, v)) return Json{at[0], at[1], at[2]};
    at = there;
    for (size_t k = 0; k < 3; ++k) {
      const double half = 0.49 * (double{std::nextafter(std::abs(v[k]), std::numeric_limits<float>::infinity())} -
                                  std::abs(double{v[k]}));
      at[k] = std::clamp(at[k], wanted[k] - half, wanted[k] + half);
    }
  }
  return Json{wanted[0], wanted[1], wanted[2]};
}

// The folder NAME_files: files appear in it at once, and are gone again unless `keep` is called.
class Files {
 public:
  explicit Files(const fs::path& scene)
      : folder_(fs::path(scene).replace_extension().string() + "_files"), made_(false) {
    std::error_code code;
    made_ = fs::create_directories(folder_, code);
    if (!fs::is_directory(folder_, code)) throw FileError(folder_.string(), "is no folder, and cannot be made one");
  }
  ~Files() {
    std::error_code ignored;
    if (!kept_)
      for (const std::string& name : fresh_) fs::remove(folder_ / name, ignored);
    if (made_ || kept_) fs::remove(folder_, ignored);  // an empty one alone
  }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;

  // The name that the scene file calls it by.
  std::string add(const std::string& stem, const std::string& ending, const std::string& bytes) {
    return put(stem, ending, checksum(bytes), [&](const std::string& path) { write_whole_file(path, bytes); });
  }
  template <typename Write>
  std::string put(const std::string& stem, const std::string& ending, uint64_t sum, Write&& write) {
    const std::string name = fmt::format("{}-{:016x}{}", stem, sum, ending);
    if (names_.insert(name).second) {
      std::error_code code;
      if (!fs::exists(folder_ / name, code)) fresh_.insert(name);
      write((folder_ / name).string());
    }
    return (folder_.filename() / name).string();
  }
  // The scene file names them now. What an earlier one named goes.
  void keep() {
    kept_ = true;
    const fs::path manifest = folder_ / kManifest;
    std::set<std::string> earlier;
    std::error_code code;
    if (fs::exists(manifest, code)) try {
        const Json old = parse_json<Json>(read_whole_file(manifest.string(), 1 << 26), manifest.string());
        if (old.is_object() && old.contains("files") && old["files"].is_array())
          for (const auto& name : old["files"])
            if (name.is_string()) earlier.insert(name.get<std::string>());
      } catch (const FileError&) {
        // Not ours: nothing is known to be of an earlier conversion.
      }
    if (names_.empty() && earlier.empty()) return;
    write_whole_file(manifest.string(), json_text(Json{{"files", names_}}, 1) + "\n");
    for (const std::string& name : earlier)
      if (names_.count(name) == 0 && name.find('/') == std::string::npos && name != "." && name != "..")
        fs::remove(folder_ / name, code);
    if (names_.empty()) fs::remove(manifest, code);
  }

 private:
  fs::path folder_;
  bool made_, kept_ = false;
  std::set<std::string> names_, fresh_;
};

class Writer {
 public:
  Writer(const SceneData& scene, Files& files) : scene_(scene), files_(files) {}

  Json write() {
    Json out;
    out["description"] = fmt::format("Converted from {}", fs::path(scene_.file).filename().string());
    out["image"] = {{"size", {scene_.width, scene_.height}}, {"samples", scene_.samples}};
    constexpr const char* kFilters[] = {"box", "gaussian", "blackman_harris"};
    if (scene_.filter != LUMICUT_BOX)
      out["image"]["filter"] = kFilters[scene_.filter], out["image"]["filter_width"] = double{scene_.filter_width};
    out["camera"] = camera();
    Json programs = Json::array();
    for (size_t t = 0; t < scene_.textures.size(); ++t)
      if (scene_.textures[t].program) programs.push_back(program(t));
    if (!programs.empty()) out["programs"] = programs;
    for (const Material& m : scene_.materials) out["materials"].push_back(material(m));
    for (const Mesh& mesh : scene_.meshes) out["meshes"].push_back(this->mesh(mesh));
    if (!bytes_.empty()) {
      const std::string file = files_.add("meshes", ".bin", bytes_);
      for (Json& m : out["meshes"]) name_file(m, file);
    }
    for (const lumicut_light& l : scene_.lights) out["lights"].push_back(light(l));
    for (const size_t l : scene_.lights_of_catchers) out["lights"][l]["shadow_catcher"] = true;
    if (scene_.environment) out["environment"] = environment(*scene_.environment);
    return out;
  }

 private:
  // ---- Arrays of meshes, in one file

  template <typename T>
  Json block(const std::vector<T>& values, size_t width) {
    static_assert(sizeof(T) == 4);
    Json out{{"file", ""}, {"offset", bytes_.size()}, {"count", values.size() / width}};
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return out;
  }
  static void name_file(Json& mesh, const std::string& file) {
    for (auto& [key, value] : mesh.items()) {
      if (value.is_object() && value.contains("file")) value["file"] = file;
      if (key == "attributes")
        for (Json& attribute : value) attribute["file"] = file;
    }
  }

  Json mesh(const Mesh& mesh) {
    Json out;
    if (!mesh.name.empty()) out["name"] = mesh.name;
    out["positions"] = block(mesh.positions, 3);
    if (!mesh.normals.empty()) out["normals"] = block(mesh.normals, 3);
    if (!mesh.uvs.empty()) out["uvs"] = block(mesh.uvs, 2);
    out["triangles"] = block(mesh.indices, 3);
    std::map<uint32_t, uint32_t> used;
    Json names = Json::array();
    std::vector<uint32_t> of_triangles;
    for (const uint32_t material : mesh.materials) {
      const auto [at, fresh] = used.emplace(material, static_cast<uint32_t>(used.size()));
      if (fresh) names.push_back(name_of(material));
      of_triangles.push_back(at->second);
    }
    if (used.size() == 1) {
      out["material"] = names[0];
    } else {
      out["material"] = names;
      out["triangle_materials"] = block(of_triangles, 1);
    }
    if (!mesh.transforms.empty()) out["transforms"] = block(mesh.transforms, 12);
    if (mesh.group != 0) out["group"] = mesh.group;
    if (mesh.mask != 0)
      if (Json hidden = hidden_from(mesh.mask); !hidden.empty()) out["hidden_from"] = hidden;
    const auto sets = [&](const char* key, uint32_t bits) {
      for (uint32_t n = 0; n < 32; ++n)
        if ((bits >> n & 1) != 0) out[key].push_back(n + 1);
    };
    sets("not_lit_by", mesh.not_lit_by), sets("not_blocking", mesh.not_blocking);
    if (mesh.receivers != 0) out["receivers"] = mesh.receivers;
    if (mesh.blockers != 0) out["blockers"] = mesh.blockers;
    if (mesh.shadow_catcher) out["shadow_catcher"] = true;
    for (const Attribute& a : mesh.attributes) {
      constexpr const char* kDomains[] = {"vertices", "triangles", "instances"};
      Json attribute{{"name", attribute_name(a.id)}, {"domain", kDomains[a.domain]}, {"components", a.components}};
      const Json place = block(a.values, a.components);
      attribute["file"] = place["file"], attribute["offset"] = place["offset"];
      out["attributes"].push_back(attribute);
    }
    return out;
  }
  static std::string attribute_name(uint32_t id) { return fmt::format("attribute {}", id); }

  static Json hidden_from(uint32_t mask) {
    Json hidden = Json::array();
    for (size_t k = 0; k < std::size(kRayKinds); ++k)
      if ((mask & (1u << k)) == 0) hidden.push_back(kRayKinds[k]);
    return hidden;
  }

  // ---- Textures and materials

  // A name each, for the library's are numbers.
  std::string name_of(uint32_t material) {
    if (names_.empty())
      for (const Material& m : scene_.materials) {
        std::string name = m.name.empty() ? "material" : m.name;
        for (int n = 2; taken_.count(name) != 0; ++n) name = fmt::format("{} ({})", m.name, n);
        taken_.insert(name);
        names_.push_back(std::move(name));
      }
    return names_.at(material);
  }

  std::string image_file(const Texture& t) {
    const bool bytes = t.floats.empty();
    const std::string_view all =
        bytes ? std::string_view(reinterpret_cast<const char*>(t.bytes.data()), t.bytes.size())
              : std::string_view(reinterpret_cast<const char*>(t.floats.data()), t.floats.size() * sizeof(float));
    const uint64_t sum = checksum(all) ^ (uint64_t{t.width} << 32) ^ (uint64_t{t.height} << 8) ^ t.channels;
    std::string stem = fs::path(t.file).stem().string();
    for (char& c : stem)
      if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_') c = '_';
    const auto width = static_cast<int>(t.width), height = static_cast<int>(t.height);
    const auto channels = static_cast<int>(t.channels);
    return files_.put(stem.substr(0, 60), bytes ? ".png" : ".exr", sum, [&](const std::string& path) {
      if (bytes) return write_png(path, t.bytes, width, height, channels);
      Image image;
      image.width = width, image.height = height;
      image.layers.push_back({"radiance", channels, t.floats});
      write_exr(path, image, false);
    });
  }
  static std::string program_name(size_t texture) { return fmt::format("program {}", texture + 1); }

  Json texture(int32_t number) {
    const auto index = static_cast<size_t>(number) - 1;
    const Texture& t = scene_.textures.at(index);
    if (t.program) return {{"program", program_name(index)}};
    const std::string file = image_file(t);
    Json out{{"file", file}};
    if ((t.flags & LUMICUT_CLAMP) != 0) out["clamp"] = true;
    if ((t.flags & LUMICUT_NEAREST) != 0) out["nearest"] = true;
    if ((t.flags & LUMICUT_BLEND_STORED) != 0) out["blend_stored"] = true;
    if ((t.flags & LUMICUT_BY_VIEW) != 0) out["by_view"] = true;
    if (out.size() == 1) return file;
    return out;
  }
  Json program(size_t texture) {
    const auto image = [&](uint32_t number) {
      const Texture& t = scene_.textures.at(number - 1);
      Json out{{"file", image_file(t)}};
      if (t.floats.empty() && (t.flags & LUMICUT_SRGB) == 0) out["use"] = "numbers";
      if ((t.flags & LUMICUT_CLAMP) != 0) out["clamp"] = true;
      if ((t.flags & LUMICUT_NEAREST) != 0) out["nearest"] = true;
      if ((t.flags & LUMICUT_BLEND_STORED) != 0) out["blend_stored"] = true;
      return out;
    };
    return {{"name", program_name(texture)},
            {"steps", program_json(*scene_.textures[texture].program, attribute_name, image)}};
  }

  Json material(const Material& from) {
    const lumicut_material &m = from.values, usual = default_material();
    const bool ggx = (m.flags & LUMICUT_GGX) != 0;
    Json out{{"name", name_of(static_cast<uint32_t>(&from - scene_.materials.data()))}};
    if (ggx) out["model"] = "ggx";
    if ((m.flags & LUMICUT_PHONG) != 0) out["model"] = "phong";
    const auto flag = [&](uint32_t bit, const char* key, bool value) {
      if ((m.flags & bit) != 0) out[key] = value;
    };
    flag(LUMICUT_NO_FRESNEL, "fresnel", false);
    flag(LUMICUT_BURLEY, "burley", true);
    if ((m.flags & LUMICUT_OREN_NAYAR) != 0) {
      out["oren_nayar"] = (m.flags & LUMICUT_FACETS_ONCE) != 0 ? "once" : "often";
      out["roughness"] = m.roughness;
    }
    if (ggx && (m.flags & (LUMICUT_BRIGHT_LOBE | LUMICUT_FACETS_ONCE)) != 0)
      out["multiple_scattering"] = (m.flags & LUMICUT_BRIGHT_LOBE) != 0 ? "lobe" : "none";
    if ((m.flags & LUMICUT_DIFFUSE_ONCE) != 0) out["diffuse_facets"] = "once";
    flag(LUMICUT_SHADOWS_PASS, "shadows_pass", true);
    flag(LUMICUT_OPEN_GLASS, "open_glass", true);
    flag(LUMICUT_EMIT_BOTH_SIDES, "emit_both_sides", true);
    flag(LUMICUT_HOLDOUT, "holdout", true);
    flag(LUMICUT_BUMP_SHADOWS, "bump_shadows", true);
    const auto colour = [&](const char* key, const float* now, const float* before, bool always = false) {
      if (always || !std::equal(now, now + 3, before)) out[key] = numbers(now, 3);
    };
    colour("diffuse", m.diffuse, usual.diffuse, true);
    colour("specular", m.specular, usual.specular, ggx);
    colour("emission", m.emission, usual.emission);
    colour("translucency", m.translucency, usual.translucency);
    const auto number = [&](const char* key, float now, float before) {
      if (now != before) out[key] = double{now};
    };
    if (m.opacity != 0) number("opacity", m.opacity, 1);
    if (ggx) {
      number("roughness", m.roughness, usual.roughness);
      number("diffuse_roughness", m.diffuse_roughness, 0);
      number("metallic", m.metallic, 0), number("transmission", m.transmission, 0);
      if (m.ior != 0) number("ior", m.ior, usual.ior);
      number("coat", m.coat, 0), number("coat_roughness", m.coat_roughness, 0), number("coat_ior", m.coat_ior, 0);
      colour("specular_tint", m.specular_tint, usual.specular_tint);
      colour("absorption", m.absorption, usual.absorption);
    } else {
      number("shininess", m.shininess, usual.shininess);
    }
    number("normal_strength", m.normal_strength, 0);
    number("bump_distance", m.bump_distance, 0), number("bump_strength", m.bump_strength, 0);
    const auto image = [&](const char* key, int32_t texture) {
      if (texture > 0) out[key] = this->texture(texture);
    };
    image("diffuse_texture", m.diffuse_texture), image("specular_texture", m.specular_texture);
    image("opacity_texture", m.opacity_texture), image("emission_texture", m.emission_texture);
    image("translucency_texture", m.translucency_texture), image("normal_texture", m.normal_texture);
    image("height_texture", m.height_texture);
    if (ggx) {
      image("roughness_texture", m.roughness_texture), image("metallic_texture", m.metallic_texture);
      image("diffuse_roughness_texture", m.diffuse_roughness_texture);
    }
    return out;
  }

  // ---- Camera and lights

  Json panorama(Json out) const {
    const lumicut_camera& c = scene_.camera;
    constexpr const char* kTypes[] = {"equirectangular", "fisheye_equidistant", "fisheye_equisolid", "mirror_ball",
                                      "equiangular_cube"};
    out["type"] = kTypes[c.panorama - 1];
    if (c.near_clip != 0) out["near"] = double{c.near_clip};
    if (c.far_clip != 0) out["far"] = double{c.far_clip};
    if (c.shift[0] != 0 || c.shift[1] != 0) out["shift"] = numbers(c.shift, 2);
    if (c.panorama == LUMICUT_MIRROR_BALL || c.panorama == LUMICUT_EQUIANGULAR_CUBE) return out;
    if (c.panorama == LUMICUT_EQUIRECTANGULAR) {
      out["longitude"] = {degrees(c.longitude[0]), degrees(c.longitude[1])};
      out["latitude"] = {degrees(c.latitude[0]), degrees(c.latitude[1])};
      return out;
    }
    out["fov"] = degrees(c.fisheye_fov);
    if (c.panorama == LUMICUT_FISHEYE_EQUISOLID)
      out["lens"] = double{c.fisheye_lens}, out["sensor"] = numbers(c.sensor, 2);
    return out;
  }

  Json camera() const {
    const lumicut_camera& c = scene_.camera;
    Json out{{"matrix", numbers(c.to_world, 12)}};
    if (c.panorama != 0) return panorama(out);
    if (c.orthographic != 0) {
      out["type"] = "orthographic";
      out["height"] = double{c.height};
    } else {
      out["fov_y"] = degrees(c.fov_y);
    }
    if (c.shift[0] != 0 || c.shift[1] != 0) out["shift"] = numbers(c.shift, 2);
    const auto number = [&](const char* key, float value) {
      if (value != 0) out[key] = double{value};
    };
    number("near", c.near_clip), number("far", c.far_clip), number("pixel_aspect", c.pixel_aspect);
    number("lens_radius", c.lens_radius), number("focus_distance", c.focus_distance);
    return out;
  }

  Json light(const lumicut_light& l) {
    constexpr const char* kTypes[] = {"point", "spot", "rectangle", "disk", "sun"};
    Json out{{"type", kTypes[l.type]}, {"value", double{l.value}}, {"color", numbers(l.color, 3)}};
    if (l.unit == LUMICUT_WATT) out["unit"] = "watt";
    if (l.group != 0) out["group"] = l.group;
    if ((l.flags & LUMICUT_NO_SHADOWS) != 0) out["shadows"] = false;
    if (l.mask != 0) out["hidden_from"] = hidden_from(l.mask | LUMICUT_SHADOW_RAYS);
    if (l.receivers != 0) out["receivers"] = l.receivers;
    if (l.blockers != 0) out["blockers"] = l.blockers;
    if (l.type == LUMICUT_SUN) {
      out["direction"] = direction(l.direction);
      if (l.radius != 0) out["angular_radius"] = degrees(l.radius);
      return out;
    }
    out["position"] = numbers(l.position, 3);
    if (l.type == LUMICUT_RECTANGLE || l.type == LUMICUT_DISK) {
      out["u"] = numbers(l.u, 3), out["v"] = numbers(l.v, 3);
      if (l.spread != 0) out["spread"] = degrees(l.spread);
      if (l.texture > 0) out["texture"] = image_file(scene_.textures.at(static_cast<size_t>(l.texture) - 1));
      return out;
    }
    if (l.radius != 0) out["radius"] = double{l.radius};
    if ((l.flags & LUMICUT_FACING_DISK) != 0) out["facing_disk"] = true;
    if (l.type == LUMICUT_SPOT) {
      out["direction"] = direction(l.direction);
      out["angle"] = degrees(l.angle);
      if (l.blend != 0) out["blend"] = double{l.blend};
      if (l.spot_cosine != 0) out["cosine"] = true;
    }
    if (l.profile != 0) {
      const Profile& p = scene_.profiles.at(l.profile - 1);
      Json angles[2];
      for (const float a : p.vertical) angles[0].push_back(degrees(a));
      for (const float a : p.horizontal) angles[1].push_back(degrees(a));
      out["direction"] = direction(l.direction);
      out["profile"] = {{"vertical", angles[0]},
                        {"horizontal", angles[1]},
                        {"values", numbers(p.values.data(), p.values.size())},
                        {"tangent", numbers(l.tangent, 3)}};
    }
    return out;
  }

  Json environment(const lumicut_environment& e) {
    Json out{{"color", numbers(e.color, 3)}};
    if (e.texture > 0) out["image"] = image_file(scene_.textures.at(static_cast<size_t>(e.texture) - 1));
    if (std::any_of(e.world_to_map, e.world_to_map + 9, [](float x) { return x != 0; }))
      out["world_to_map"] = numbers(e.world_to_map, 9);
    if (e.group != 0) out["group"] = e.group;
    if ((e.flags & LUMICUT_HIDDEN) != 0) out["hidden"] = true;
    if (e.mask != 0) out["hidden_from"] = hidden_from(e.mask | LUMICUT_SHADOW_RAYS | LUMICUT_CAMERA_RAYS);
    return out;
  }

  const SceneData& scene_;
  Files& files_;
  std::string bytes_;
  std::vector<std::string> names_;
  std::set<std::string> taken_;
};

}  // namespace

void write_scene(const SceneData& scene, const std::string& path) {
  check_writable(path);
  const std::string name = std::filesystem::path(path).filename().string();
  if (Json(name).dump(-1, ' ', false, Json::error_handler_t::replace) !=
      Json(name).dump(-1, ' ', false, Json::error_handler_t::ignore))
    throw FileError(path, "is a name that is no UTF-8: the scene could not name its files, which lie beside it");
  Files files(path);
  const Json json = Writer(scene, files).write();
  write_whole_file(path, json_text(json, 1) + "\n");
  files.keep();
}

}  // namespace lumicut::io
