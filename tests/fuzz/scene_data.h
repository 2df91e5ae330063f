// What must hold of every scene that a reader gives.
#pragma once

#include <cmath>

#include "io/scene_data.h"
#include "tests/fuzz/fuzz.h"

namespace lumicut::fuzz {

inline void check_scene(const io::SceneData& scene) {
  for (const io::Mesh& mesh : scene.meshes) {
    const size_t vertices = mesh.positions.size() / 3;
    if (mesh.indices.size() % 3 != 0 || mesh.materials.size() != mesh.indices.size() / 3)
      finding("a material for each triangle");
    for (const uint32_t i : mesh.indices)
      if (i >= vertices) finding("an index beyond the vertices");
    for (const uint32_t m : mesh.materials)
      if (m >= scene.materials.size()) finding("a material that is not there");
    if ((!mesh.normals.empty() && mesh.normals.size() != 3 * vertices) ||
        (!mesh.uvs.empty() && mesh.uvs.size() != 2 * vertices) || mesh.transforms.size() % 12 != 0)
      finding("arrays of other lengths");
    for (const float x : mesh.positions)
      if (!std::isfinite(x)) finding("a coordinate that is not finite");
    for (const float x : mesh.transforms)
      if (!std::isfinite(x)) finding("a transform that is not finite");
  }
  const auto textures = static_cast<int32_t>(scene.textures.size());
  for (const io::Material& material : scene.materials) {
    const lumicut_material& m = material.values;
    for (const int32_t t : {m.diffuse_texture, m.specular_texture, m.opacity_texture, m.emission_texture,
                            m.normal_texture, m.height_texture, m.roughness_texture, m.metallic_texture,
                            m.translucency_texture, m.diffuse_roughness_texture})
      if (t < 0 || t > textures) finding("a texture that is not there");
  }
  for (const lumicut_light& light : scene.lights)
    if (light.profile > scene.profiles.size() || !std::isfinite(light.value)) finding("a light that is none");
  if (scene.environment && (scene.environment->texture < 0 || scene.environment->texture > textures))
    finding("an environment that is not there");
  for (const float x : scene.camera.to_world)
    if (!std::isfinite(x)) finding("a camera that is nowhere");
}

}  // namespace lumicut::fuzz
