#include "io/scene_upload.h"

#include <fmt/format.h>

namespace lumicut::io {

void upload_scene(const Api& api, lumicut_scene scene, const SceneData& data) {
  std::vector<lumicut_texture> textures;
  for (const auto& texture : data.textures) {
    lumicut_texture t{};
    t.struct_size = sizeof(t);
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

}  // namespace lumicut::io
