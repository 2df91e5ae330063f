// A host that describes something of everything: textures, gloss, a coat, a profile, an environment, two lights, passes. Each
// thing is kept apart, so that a test can change one.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/plugin/box_scene.h"
#include "tests/support/backends.h"

namespace box {

struct Profile {
  std::vector<float> vertical{0, 1, 2, 3}, horizontal{0}, values{1, 0.5f, 0.7f, 1};
};

struct Host {
  const char* accel = lumicut::test::last_backend();
  bool robust = true, host_lights = false;
  std::vector<lumicut_texture> textures{4, make<lumicut_texture>()};
  std::vector<std::vector<float>> texels;
  std::vector<lumicut_material> materials = box::materials();
  Geometry walls = geometry(), panel;
  std::vector<float> normals, uvs, transforms;
  lumicut_mesh shape = make<lumicut_mesh>();  // of the panel, beside its arrays
  std::vector<Profile> profiles{2};
  std::vector<lumicut_light> lights{2, lamp()};
  lumicut_environment environment = make<lumicut_environment>();
  lumicut_camera camera = box::camera();
  lumicut_render_desc frame = box::frame(16, 12);
  std::string integrator = "lightcuts";
  std::map<std::string, std::string> parameters{{"vpls", "40"}};
  std::vector<lumicut_vpl> vpls;

  Host() {
    for (size_t t = 0; t < textures.size(); ++t) {
      texels.emplace_back();
      for (int i = 0; i < 4 * 4 * 3; ++i) texels[t].push_back(0.25f + 0.02f * static_cast<float>((i * (t + 3)) % 25));
      textures[t].width = textures[t].height = 4, textures[t].channels = 3, textures[t].format = LUMICUT_FLOAT32;
    }
    materials.push_back(make<lumicut_material>());
    materials[4].flags = LUMICUT_GGX;
    materials[4].diffuse[0] = materials[4].diffuse[1] = materials[4].specular[0] = 0.5f;
    materials[4].roughness = materials[4].metallic = materials[4].coat = materials[4].coat_roughness = 0.4f;
    materials[4].emission[0] = 0.3f;
    materials[4].diffuse_texture = 1;
    panel.quad({{{-0.4f, -0.2f, -0.8f}, {0.4f, -0.2f, -0.8f}, {0.4f, 0.6f, -0.8f}, {-0.4f, 0.6f, -0.8f}}}, 4);
    normals = {0.1f, 0, 1, 0, 0.1f, 1, 0, 0, 1, -0.1f, 0, 1};
    uvs = {0, 0, 2, 0, 2, 2, 0, 2};
    transforms = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    lights[1].type = LUMICUT_POINT, lights[1].unit = LUMICUT_RADIOMETRIC, lights[1].value = 2;
    lights[1].direction[1] = -1, lights[1].tangent[0] = 1, lights[1].profile = 1;
    environment.color[0] = environment.color[1] = environment.color[2] = 0.2f;
    environment.texture = 4;
    frame.passes = 2;
    frame.flags = LUMICUT_CHECKPOINTS;
    vpls.push_back({});
    vpls[0].kind = LUMICUT_VPL_ORIENTED, vpls[0].position[1] = 0.9f, vpls[0].position[2] = -1, vpls[0].normal[1] = -1;
    vpls[0].intensity[0] = vpls[0].intensity[1] = 1;
  }

  api::Scene scene(const api::Device& device) const {
    api::Scene s(device, accel, robust);
    auto t = textures;
    for (size_t i = 0; i < t.size(); ++i) t[i].pixels = t[i].program != nullptr ? nullptr : texels[i].data();
    s.set_textures(t);
    s.set_materials(materials);
    s.add_mesh(walls.mesh());
    lumicut_mesh m = shape;
    m.positions = panel.positions.data(), m.vertex_count = panel.positions.size() / 3;
    m.indices = panel.indices.data(), m.triangle_count = panel.indices.size() / 3;
    m.materials = panel.materials.empty() ? nullptr : panel.materials.data();
    m.normals = normals.empty() ? nullptr : normals.data(), m.uvs = uvs.empty() ? nullptr : uvs.data();
    m.transforms = transforms.data(), m.transform_count = transforms.size() / 12;
    s.add_mesh(m);
    std::vector<lumicut_profile> p(profiles.size(), make<lumicut_profile>());
    for (size_t i = 0; i < p.size(); ++i) {
      p[i].vertical = profiles[i].vertical.data(), p[i].horizontal = profiles[i].horizontal.data();
      p[i].vertical_count = static_cast<uint32_t>(profiles[i].vertical.size());
      p[i].horizontal_count = static_cast<uint32_t>(profiles[i].horizontal.size());
      p[i].values = profiles[i].values.data();
    }
    s.set_profiles(p);
    s.set_lights(lights);
    s.set_environment(environment);
    s.set_camera(camera);
    s.commit();
    return s;
  }

  api::Integrator method(const api::Device& device) const {
    api::Integrator i(device, integrator.c_str());
    for (const auto& [name, value] : parameters) i.set(name.c_str(), value);
    if (host_lights) i.set_lights(vpls);
    return i;
  }
};

}  // namespace box
