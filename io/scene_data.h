// A scene as read from files, ready to be handed to the library: all in world space, linear colour, radians.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/warnings.h"
#include "lumicut/lumicut_programs.h"

namespace lumicut::io {

// Of a coordinate or a length in the world, as the library has it: rays overflow single precision beyond.
inline constexpr double kLargestCoordinate = 9e17;

struct Program {
  std::vector<lumicut_instruction> instructions;
  std::vector<float> constants, table;
};

struct Texture {
  std::string file;
  uint32_t width = 0, height = 0, channels = 0;  // channels 1 or 3
  uint32_t flags = 0;                            // LUMICUT_SRGB ...
  std::vector<uint8_t> bytes;                    // of integer images, else
  std::vector<float> floats;                     // row 0 is the top
  std::optional<Program> program;                // in an image's place; then there are no texels
};

// Names of the bits of a mesh's mask, from LUMICUT_CAMERA_RAYS on.
// Sets of light linking that there may be. [lumicut.h]
inline constexpr uint32_t kReceiverSets = 32, kBlockerSets = 27;
inline constexpr const char* kRayKinds[] = {"camera", "diffuse", "glossy", "transmission", "shadow"};

// What programs ask of a mesh, as lumicut_attribute has it.
struct Attribute {
  uint32_t id = 0, components = 0, domain = 0;
  std::vector<float> values;
};

struct Material {
  std::string name;
  lumicut_material values;  // texture numbers are 1 + index into SceneData::textures
};

struct Mesh {
  std::string name;
  std::vector<float> positions, normals, uvs;  // normals, uvs: empty, or one a vertex
  std::vector<uint32_t> indices;
  std::vector<uint32_t> materials;  // one a triangle, index into SceneData::materials
  std::vector<float> transforms;    // twelve an instance; empty: one, as it is
  uint32_t group = 0;
  uint32_t mask = 0;  // as in lumicut_mesh, and so
  uint32_t not_lit_by = 0, not_blocking = 0, receivers = 0, blockers = 0;
  std::vector<Attribute> attributes;
  bool shadow_catcher = false;  // for `lumicut render`, which makes several scenes of it
};

// Intensity of a light by direction, as lumicut_profile has it.
struct Profile {
  std::string file;
  std::vector<float> vertical, horizontal, values;  // radians; W/sr
};

struct SceneData {
  std::string file;  // it was read from, for messages
  std::vector<Texture> textures;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Profile> profiles;
  std::vector<lumicut_light> lights;     // profile numbers are 1 + index into `profiles`
  std::vector<std::string> light_names;  // where each stands in the file: "lights[3]"
  std::set<size_t> lights_of_catchers;   // those that shine on shadow catchers where these are alone
  std::optional<lumicut_environment> environment;
  lumicut_camera camera{};
  uint32_t width = 512, height = 512, samples = 1;  // what the scene file proposes
  uint32_t filter = LUMICUT_BOX;
  float filter_width = 0.0f;
  Warnings warnings;  // what is approximated or looks wrong

  uint64_t triangle_count() const {
    uint64_t n = 0;
    for (const auto& mesh : meshes) n += mesh.indices.size() / 3;
    return n;
  }
  // Of all that emits, as the library tells them apart; one more where the environment is black.
  std::set<uint32_t> light_groups() const;
};

// Opacity of what is not there: the ABI reads 0 as "not given".
inline constexpr float kHole = 1e-3f;

lumicut_material default_material();  // grey .5, no gloss

}  // namespace lumicut::io
