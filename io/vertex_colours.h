// Colours that meshes carry at their vertices, as an attribute that a small program multiplies with a material's texture.
#pragma once

#include <map>
#include <utility>

#include "io/scene_data.h"

namespace lumicut::io {

class VertexColours {
 public:
  static constexpr uint32_t kAttribute = 1;  // its number on meshes; of three components, or four with the opacity

  explicit VertexColours(SceneData& scene) : scene_(scene) {}
  // The material with base colour, and opacity where `alpha`, times the attribute. Made once for each.
  uint32_t material(uint32_t material, bool alpha);

 private:
  int32_t times(int32_t image, bool alpha);  // the texture

  SceneData& scene_;
  std::map<std::pair<uint32_t, bool>, uint32_t> materials_;
  std::map<std::pair<int32_t, bool>, int32_t> textures_;
};

}  // namespace lumicut::io
