// A small program in a texture's place: what shading trees compute at a hit, as a flat list of instructions. Each has one
// value of three numbers; a single number stands in all three. An instruction takes values of earlier ones, or
// constants. docs/decisions/0020-texture-programs.md
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

class Texture;
struct Camera;
struct Mesh;
struct Transform;

// name, inputs, modes (0: bits), what `data` and `count` are
#define LUMICUT_PROGRAM_OPS(X)   \
  /* Of the place */             \
  X(uv, 0, 1, none)              \
  X(attribute, 0, 2, attribute)  \
  X(position, 0, 1, none)        \
  X(normal, 0, 2, none)          \
  X(to_viewer, 0, 1, none)       \
  X(behind, 0, 1, none)          \
  X(camera, 0, 4, none)          \
  X(transform, 1, 3, transform)  \
  /* Numbers and vectors */      \
  X(math, 3, 41, none)           \
  X(vector, 3, 27, none)         \
  X(grey, 1, 2, none)            \
  X(separate, 1, 3, none)        \
  X(combine, 3, 1, none)         \
  X(clamp, 3, 2, none)           \
  X(map_range, 6, 16, none)      \
  X(mapping, 4, 4, none)         \
  X(rotate, 4, 10, none)         \
  /* Colours */                  \
  X(mix, 3, 19, none)            \
  X(color, 4, 7, none)           \
  X(ramp, 1, 2, table)           \
  X(curves, 2, 2, table)         \
  /* By the view, and normals */ \
  X(fresnel, 2, 3, none)         \
  X(bump, 5, 1, none)            \
  X(normal_map, 2, 2, attribute) \
  /* Patterns */                 \
  X(noise, 8, 80, none)          \
  X(musgrave, 7, 20, none)       \
  X(voronoi, 5, 320, none)       \
  X(wave, 6, 24, none)           \
  X(magic, 2, 11, none)          \
  X(brick, 6, 1, table)          \
  X(checker, 1, 1, none)         \
  X(gradient, 1, 7, none)        \
  X(white_noise, 2, 8, none)     \
  /* Images */                   \
  X(project, 1, 4, none)         \
  X(image, 3, 8, texture)

enum class ProgramOp : uint32_t {
#define LUMICUT_OP(name, inputs, modes, data) name,
  LUMICUT_PROGRAM_OPS(LUMICUT_OP)
#undef LUMICUT_OP
};

enum class ProgramData : uint8_t { none, attribute, transform, table, texture };

struct ProgramOpInfo {
  const char* name;
  uint32_t inputs, modes;
  ProgramData data;
};
// In the order of ProgramOp.
std::span<const ProgramOpInfo> program_ops();

inline constexpr size_t kMostProgramInputs = 8;

struct ProgramInstruction {
  uint32_t op = 0, mode = 0;
  int32_t inputs[kMostProgramInputs] = {};  // of an earlier instruction; below 0: constant -1 - input
  uint32_t data = 0, count = 0;             // attribute's id, texture's index, or a part of the table
  LUMICUT_FIELDS(ProgramInstruction, op, mode, inputs, data, count)
};

// Where a program is asked.
struct ProgramPoint {
  Vec3f position, normal, geometric_normal;  // world; both normals on the viewer's side
  Vec3f to_viewer;
  Vec2f uv;
  bool behind = false;         // seen from the mesh's back
  const Mesh* mesh = nullptr;  // null: of a host's own point nothing of what follows is known
  uint32_t triangle = 0, instance = 0;
  float u = 0.0f, v = 0.0f;  // barycentric
  const Transform* to_world = nullptr;
  const Camera* camera = nullptr;
  // From where the ray came, and the least length over which the slope of a bump is taken; 0: no bumps.
  float distance = 0.0f, least_step = 0.0f;
};

class TextureProgram {
 public:
  // Throws Error naming instruction, field and value. `constants`: one for each -1 - input. The last instruction's value
  // is the program's.
  TextureProgram(std::vector<ProgramInstruction> instructions, std::vector<Vec3f> constants, std::vector<float> table);

  // Never NaN. Textures are those of the scene.
  Rgb evaluate(const ProgramPoint& point, std::span<const Texture> textures) const;

  // Throws where it names an image that is none of them.
  void check_textures(std::span<const Texture> textures, const std::string& owner) const;
  // Whether some instruction asks for the camera, which is no part of a surface.
  bool asks_for_camera() const;
  // Of places that may have other values on another instance of their mesh.
  bool varies_with_instance() const;
  bool varies_with_view() const;
  bool empty() const { return instructions_.empty(); }

  static constexpr size_t kMostInstructions = 1024;

 private:
  Vec3f value(const ProgramInstruction& instruction, const ProgramPoint& point, std::span<const Texture> textures,
              const Vec3f* values, bool within_bump) const;
  Vec3f bump(const ProgramInstruction& instruction, const ProgramPoint& point, std::span<const Texture> textures,
             const Vec3f* values) const;
  bool has(ProgramOp op) const;

  std::vector<ProgramInstruction> instructions_;
  std::vector<Vec3f> constants_;
  std::vector<float> table_;
  std::vector<std::vector<uint32_t>> heights_;  // of each bump, by its data: what its height is computed from, in order
  LUMICUT_FIELDS(TextureProgram, instructions_, constants_, table_, heights_)
};

}  // namespace lumicut
