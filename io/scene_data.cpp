#include "io/scene_data.h"

namespace lumicut::io {

std::set<uint32_t> SceneData::light_groups() const {
  std::set<uint32_t> groups;
  for (const auto& light : lights) groups.insert(light.group);
  if (environment) groups.insert(environment->group);
  for (const auto& mesh : meshes)
    for (const uint32_t material : mesh.materials) {
      const auto& emission = materials[material].values.emission;
      if (emission[0] > 0 || emission[1] > 0 || emission[2] > 0) groups.insert(mesh.group);
    }
  return groups;
}

lumicut_material default_material() {
  lumicut_material m{};
  m.struct_size = sizeof(m);
  m.opacity = 1;
  m.shininess = 1;
  m.roughness = 0.5f;
  m.ior = 1.5f;
  for (float& c : m.diffuse) c = 0.5f;
  return m;
}

}  // namespace lumicut::io
