#include "io/scene_data.h"

namespace lumicut::io {

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
