#include "io/scene_model.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/gzip.h"
#include "io/isolated.h"
#include "io/model.h"
#include "io/module.h"
#include "io/physical_memory.h"
#include "io/ply_check.h"
#include "io/scene_defaults.h"
#include "io/scene_obj.h"
#include "io/text_lines.h"
#include "io/texture_store.h"
#include "io/vertex_colours.h"

namespace lumicut::io {

namespace fs = std::filesystem;

namespace {

// Of the processor, for one file: hundreds of times what is usual.
double seconds_for(uint64_t bytes) {
#ifdef LUMICUT_SANITIZED
  return 1 + 0 * static_cast<double>(bytes);  // libFuzzer waits ten by the clock
#endif
  return 2 + 60 * static_cast<double>(bytes) / (1 << 20);
}

std::string ending_of(const std::string& path) { return lower(fs::path(path).extension().string()); }

// Numbers of the scene's textures by those of the model's.
std::vector<int32_t> read_textures(const Model& model, const std::string& path, SceneData& scene) {
  TextureStore store(scene.textures);
  std::vector<int32_t> numbers;
  for (const ModelTexture& texture : model.textures) {
    const std::string user = fmt::format("the model {}", path);
    if (!texture.bytes.empty()) {
      const std::string name = fmt::format("{}: its picture {} {}", path, numbers.size(), shown(texture.name));
      numbers.push_back(store.get_held(name, texture.bytes, texture.use, texture.flags, user));
      continue;
    }
    const FoundFile file = find_beside(path, texture.name);
    if (file.path.empty())
      scene.warnings.add("missing textures", path,
                         fmt::format("the texture {} does not exist; {}", texture.name,
                                     texture.use == TextureUse::colour ? "grey stands in" : "left out"));
    else if (!file.remark.empty())
      scene.warnings.add("names of textures that differ from their files'", path,
                         fmt::format("the texture {} does not exist; {}", texture.name, file.remark));
    if (!file.path.empty())
      numbers.push_back(store.get(file.path, texture.use, texture.flags, user));
    else
      numbers.push_back(texture.use == TextureUse::colour ? store.grey() : 0);
  }
  return numbers;
}

// The same of memory: assimp takes some tens of bytes for one of the file.
uint64_t memory_for(uint64_t bytes) { return std::min(physical_memory(), (uint64_t{1} << 30) + 200 * bytes); }

// `held`: the bytes of a PLY that was packed.
Model read_by_assimp(const std::string& path, const std::string& held = {}) {
  check_regular_file(path);
  const bool ply = !held.empty() || ending_of(path) == ".ply";
  const std::string reader = fmt::format("the reader of {} files", ply ? "ply" : ending_of(path).substr(1));
  std::error_code code;
  const auto stored = fs::file_size(path, code);
  const uint64_t size = std::max<uint64_t>(held.size(), code ? 0 : stored);
  const std::string bytes = isolated(path, reader, seconds_for(size), memory_for(size), [&] {
    Packer packer;
    const std::string file = ply && held.empty() ? read_whole_file(path) : held;
    if (ply) check_ply(path, file);
    const Model model = load_module<ModelModule>(path, "models", "lumicut_model_module")->read(path, file);
    pack(packer, model);
    return packer.take();
  });
  Model model;
  Unpacker unpacker(bytes, path);
  pack(unpacker, model);
  return model;
}

SceneData read_model_scene(const std::string& path) {
  Model model = read_by_assimp(path);
  SceneData scene = std::move(model.scene);
  for (const auto& [kind, text] : model.warnings) scene.warnings.add(kind, path, text);
  const auto numbers = read_textures(model, path, scene);
  for (Material& material : scene.materials) {
    lumicut_material& m = material.values;
    for (int32_t* t :
         {&m.diffuse_texture, &m.specular_texture, &m.opacity_texture, &m.emission_texture, &m.normal_texture})
      if (*t > 0) *t = numbers.at(static_cast<size_t>(*t) - 1);
  }
  VertexColours coloured(scene);
  for (Mesh& mesh : scene.meshes)
    if (!mesh.attributes.empty())
      for (uint32_t& m : mesh.materials) m = coloured.material(m, false);
  if (!model.has_camera) frame_scene(scene);
  return scene;
}

SceneData read_obj_scene(const std::string& path) {
  SceneData scene;
  TextureStore textures(scene.textures);
  ObjModel model = read_obj(path, {}, textures, scene.warnings);
  for (const auto& [name, values] : model.materials) scene.materials.push_back({name, values});
  scene.meshes = std::move(model.meshes);
  for (Mesh& mesh : scene.meshes) mesh.name = path;
  frame_scene(scene);
  return scene;
}

}  // namespace

bool is_model(const std::string& path) {
  static const std::set<std::string> kEndings = {".obj", ".ply", ".fbx", ".dae"};
  return kEndings.count(ending_of(path)) != 0;
}

bool has_meshes(const std::string& path) {
  return is_model(path) || (ending_of(path) == ".gz" && ending_of(fs::path(path).stem().string()) == ".ply");
}

std::vector<Mesh> read_model_meshes(const std::string& path, Warnings& warnings) {
  if (ending_of(path) == ".gz") {
    constexpr uint64_t kMost = uint64_t{4} << 30;
    check_regular_file(path);
    const std::string bytes = unpacked(read_whole_file(path, kMost), kMost, path);
    if (bytes.empty()) throw FileError(path, "is empty");
    return read_by_assimp(path, bytes).scene.meshes;
  }
  if (ending_of(path) == ".obj") {
    std::vector<Texture> none;
    TextureStore textures(none);
    return read_obj(path, {.read_materials = false}, textures, warnings).meshes;
  }
  return read_by_assimp(path).scene.meshes;
}

SceneData read_model(const std::string& path) {
  SceneData scene = ending_of(path) == ".obj" ? read_obj_scene(path) : read_model_scene(path);
  if (!is_lit(scene)) add_sky(scene);
  scene.file = path;
  return scene;
}

}  // namespace lumicut::io
