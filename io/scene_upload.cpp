#include "io/scene_upload.h"

#include <fmt/format.h>

#include <charconv>
#include <string_view>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

// "lumicut_light[3].angle: ..." -> "lights[5].angle: ..." as the file has it.
std::string in_terms_of_file(std::string text, const SceneData& data) {
  const auto rename = [&](std::string_view type, size_t count, auto name_of) {
    const size_t begin = text.find(type);
    if (begin == std::string::npos) return;
    size_t index = 0;
    const char* const digits = text.data() + begin + type.size();
    const auto [end, error] = std::from_chars(digits, text.data() + text.size(), index);
    if (error != std::errc() || end == text.data() + text.size() || *end != ']' || index >= count) return;
    text.replace(begin, static_cast<size_t>(end + 1 - text.data()) - begin, name_of(index));
  };
  rename("lumicut_light[", data.light_names.size(), [&](size_t i) { return data.light_names[i]; });
  rename("lumicut_material[", data.materials.size(), [&](size_t i) { return "\"" + data.materials[i].name + "\""; });
  rename("lumicut_texture[", data.textures.size(), [&](size_t i) { return data.textures[i].file; });
  rename("lumicut_profile[", data.profiles.size(), [&](size_t i) { return data.profiles[i].file; });
  return text;
}

void upload(const Api& api, lumicut_scene scene, const SceneData& data) {
  std::vector<lumicut_texture> textures;
  std::vector<lumicut_program> programs;
  programs.reserve(data.textures.size());
  for (const auto& texture : data.textures) {
    lumicut_texture t{};
    t.struct_size = sizeof(t);
    if (texture.program) {
      const Program& from = *texture.program;
      lumicut_program p{};
      p.struct_size = sizeof(p);
      p.instruction_count = static_cast<uint32_t>(from.instructions.size());
      p.constant_count = static_cast<uint32_t>(from.constants.size() / 3);
      p.table_count = static_cast<uint32_t>(from.table.size());
      p.instructions = from.instructions.data(), p.constants = from.constants.data(), p.table = from.table.data();
      programs.push_back(p);
      t.program = &programs.back();
      textures.push_back(t);
      continue;
    }
    t.width = texture.width, t.height = texture.height, t.channels = texture.channels;
    t.format = texture.floats.empty() ? LUMICUT_UINT8 : LUMICUT_FLOAT32;
    t.flags = texture.flags;
    t.pixels = texture.floats.empty() ? static_cast<const void*>(texture.bytes.data()) : texture.floats.data();
    textures.push_back(t);
  }
  if (!textures.empty()) check(api, api.scene_set_textures(scene, textures.data(), textures.size()), "textures");

  std::vector<lumicut_material> materials;
  for (const auto& material : data.materials) materials.push_back(material.values);
  if (!materials.empty()) check(api, api.scene_set_materials(scene, materials.data(), materials.size()), "materials");

  for (const auto& mesh : data.meshes) {
    lumicut_mesh m{};
    m.struct_size = sizeof(m);
    m.positions = mesh.positions.data();
    m.normals = mesh.normals.empty() ? nullptr : mesh.normals.data();
    m.uvs = mesh.uvs.empty() ? nullptr : mesh.uvs.data();
    m.vertex_count = mesh.positions.size() / 3;
    m.indices = mesh.indices.data();
    m.triangle_count = mesh.indices.size() / 3;
    m.materials = mesh.materials.data();
    m.transforms = mesh.transforms.empty() ? nullptr : mesh.transforms.data();
    m.transform_count = mesh.transforms.size() / 12;
    m.group = mesh.group;
    m.mask = mesh.mask;
    m.not_lit_by = mesh.not_lit_by, m.not_blocking = mesh.not_blocking;
    m.receivers = mesh.receivers, m.blockers = mesh.blockers;
    std::vector<lumicut_attribute> attributes;
    for (const Attribute& from : mesh.attributes) {
      lumicut_attribute a{};
      a.struct_size = sizeof(a);
      a.id = from.id, a.components = from.components, a.domain = from.domain, a.values = from.values.data();
      attributes.push_back(a);
    }
    m.attributes = attributes.data(), m.attribute_count = attributes.size();
    uint32_t id = 0;
    check(api, api.scene_add_mesh(scene, &m, &id), fmt::format("mesh {}", mesh.name));
  }
  std::vector<lumicut_profile> profiles;
  for (const auto& profile : data.profiles) {
    lumicut_profile p{};
    p.struct_size = sizeof(p);
    p.vertical_count = static_cast<uint32_t>(profile.vertical.size());
    p.horizontal_count = static_cast<uint32_t>(profile.horizontal.size());
    p.vertical = profile.vertical.data(), p.horizontal = profile.horizontal.data(), p.values = profile.values.data();
    profiles.push_back(p);
  }
  if (!profiles.empty()) check(api, api.scene_set_profiles(scene, profiles.data(), profiles.size()), "profiles");
  if (!data.lights.empty()) check(api, api.scene_set_lights(scene, data.lights.data(), data.lights.size()), "lights");
  if (data.environment) check(api, api.scene_set_environment(scene, &*data.environment), "environment");
  check(api, api.scene_set_camera(scene, &data.camera), "camera");
}

}  // namespace

void upload_scene(const Api& api, lumicut_scene scene, const SceneData& data) try {
  upload(api, scene, data);
} catch (const LibraryError& error) {
  if (error.code() != LUMICUT_INVALID_ARGUMENT) throw;
  throw FileError(data.file, in_terms_of_file(error.what(), data));
}

}  // namespace lumicut::io
