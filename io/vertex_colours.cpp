#include "io/vertex_colours.h"

namespace lumicut::io {

uint32_t VertexColours::material(uint32_t material, bool alpha) {
  const auto [known, fresh] = materials_.emplace(std::pair(material, alpha), 0);
  if (fresh) {
    Material coloured = scene_.materials.at(material);
    coloured.name += ", of coloured vertices";
    coloured.values.diffuse_texture = times(coloured.values.diffuse_texture, false);
    if (alpha) coloured.values.opacity_texture = times(coloured.values.opacity_texture, true);
    known->second = static_cast<uint32_t>(scene_.materials.size());
    scene_.materials.push_back(std::move(coloured));
  }
  return known->second;
}

int32_t VertexColours::times(int32_t image, bool alpha) {
  const auto [known, fresh] = textures_.emplace(std::pair(image, alpha), 0);
  if (fresh) {
    constexpr uint32_t kMultiply = 2;  // of LUMICUT_OP_VECTOR
    Program program;
    const auto step = [&](uint32_t op, uint32_t mode, int32_t a, int32_t b, uint32_t data) {
      lumicut_instruction in{};
      in.op = op, in.mode = mode, in.inputs[0] = a, in.inputs[1] = b, in.data = data;
      program.instructions.push_back(in);
      return static_cast<int32_t>(program.instructions.size() - 1);
    };
    const int32_t colour = step(LUMICUT_OP_ATTRIBUTE, alpha ? 1 : 0, 0, 0, kAttribute);
    if (image > 0) {
      const int32_t uv = step(LUMICUT_OP_UV, 0, 0, 0, 0);
      step(LUMICUT_OP_VECTOR, kMultiply, colour, step(LUMICUT_OP_IMAGE, 0, uv, 0, static_cast<uint32_t>(image)), 0);
    }
    Texture texture;
    texture.file = "colours of vertices";
    texture.program = std::move(program);
    scene_.textures.push_back(std::move(texture));
    known->second = static_cast<int32_t>(scene_.textures.size());
  }
  return known->second;
}

}  // namespace lumicut::io
