// The module lib/lumicut/models.so: assimp's side of model.h, loaded in the process that reads (scene_model.cpp).
#include <assimp/GltfMaterial.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <new>
#include <numbers>
#include <optional>

#include "io/affine.h"
#include "io/model.h"
#include "io/srgb.h"
#include "io/text_lines.h"
#include "io/vertex_colours.h"

namespace lumicut::io {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kDeepest = 256;
constexpr size_t kMostNodes = 1 << 22;

Affine affine(const aiMatrix4x4& m) {
  Affine out;
  out.m = {m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4};
  return out;
}
Vec vec(const aiVector3D& v) { return {v.x, v.y, v.z}; }

class Reader {
 public:
  Reader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {
    ending_ = bytes.empty() ? lower(std::filesystem::path(path).extension().string()) : ".ply";
  }

  Model read() {
    Assimp::Importer importer;
    importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS, false);
    importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
    importer.SetPropertyInteger(AI_CONFIG_PP_FD_REMOVE, 1);
    constexpr unsigned kSteps = aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_SortByPType |
                                aiProcess_ValidateDataStructure;
    assimp_ = bytes_.empty() ? importer.ReadFile(path_, kSteps)
                             : importer.ReadFileFromMemory(bytes_.data(), bytes_.size(), kSteps, "ply");
    if (assimp_ == nullptr || assimp_->mRootNode == nullptr) {
      const std::string error = one_line(importer.GetErrorString());
      if (error.find("bad_alloc") != error.npos || error.find("std::vector") != error.npos ||
          error.find("vector::") != error.npos)
        throw std::bad_alloc();  // what assimp made of it
      throw FileError(path_, error);
    }
    for (unsigned i = 0; i < assimp_->mNumMaterials; ++i) read_material(*assimp_->mMaterials[i], i);
    if (ending_ == ".ply")  // which knows none: what there is is assimp's
      for (Material& material : model_.scene.materials) material.values = default_material();
    for (unsigned i = 0; i < assimp_->mNumMeshes; ++i) read_mesh(*assimp_->mMeshes[i], i);
    Affine root;
    aiString generator;
    if (assimp_->mMetaData != nullptr && assimp_->mMetaData->Get("SourceAsset_Generator", generator))
      of_blender_ = ending_ == ".fbx" && std::string(generator.C_Str()).find("Blender") != std::string::npos;
    if (ending_ == ".fbx") {  // centimetres a unit
      double unit = 1;
      float single = 1;
      if (assimp_->mMetaData != nullptr && !assimp_->mMetaData->Get("UnitScaleFactor", unit) &&
          assimp_->mMetaData->Get("UnitScaleFactor", single))
        unit = single;
      if (!(unit > 1e-9 && unit < 1e9)) throw FileError(path_, fmt::format("its UnitScaleFactor is {}", unit));
      for (size_t k = 0; k < 12; ++k) root.m[k] *= unit / 100;
    }
    read_node(*assimp_->mRootNode, root, 0);
    if (assimp_->mNumAnimations > 0) leave_out("animations");
    auto& meshes = model_.scene.meshes;
    for (size_t i = 0; i < meshes.size(); ++i)
      if (meshes[i].transforms.empty()) meshes[i].indices.clear();
    std::erase_if(meshes, [](const Mesh& mesh) { return mesh.indices.empty(); });
    if (meshes.empty()) throw FileError(path_, "has no triangles: there is nothing to see");
    return std::move(model_);
  }

 private:
  static std::string one_line(std::string text) {
    for (char& c : text)
      if (static_cast<unsigned char>(c) < ' ') c = ' ';
    return text.empty() ? "cannot be read" : text.substr(0, 300);
  }
  void warn(const std::string& kind, const std::string& text) { model_.warnings.emplace_back(kind, one_line(text)); }
  void leave_out(const std::string& what) { warn("things left out", what + ": left out"); }

  // ---- Materials

  // Each from 0 to `most`; what is no number is 0.
  static void store_colour(float* out, const aiColor3D& c, double most) {
    for (unsigned k = 0; k < 3; ++k) out[k] = c[k] >= 0 ? static_cast<float>(std::min<double>(c[k], most)) : 0.0f;
  }
  static float share(double value) { return value >= 0 ? static_cast<float>(std::min(value, 1.0)) : 0.0f; }

  int32_t texture(const aiMaterial& from, aiTextureType type, TextureUse use) {
    if (from.GetTextureCount(type) == 0) return 0;
    aiString name;
    aiTextureMapMode modes[2] = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
    unsigned set = 0;
    if (from.GetTexture(type, 0, &name, nullptr, &set, nullptr, nullptr, modes) != aiReturn_SUCCESS) return 0;
    ModelTexture out;
    out.use = use, out.name = name.C_Str();
    if (modes[0] == aiTextureMapMode_Clamp && modes[1] == aiTextureMapMode_Clamp) out.flags |= LUMICUT_CLAMP;
    if (const aiTexture* held = assimp_->GetEmbeddedTexture(name.C_Str())) {
      if (held->mHeight != 0) {
        leave_out("a texture of plain texels inside of the file");
        return 0;
      }
      out.bytes.assign(reinterpret_cast<const char*>(held->pcData), held->mWidth);
    }
    model_.textures.push_back(std::move(out));
    return static_cast<int32_t>(model_.textures.size());
  }

  void read_material(const aiMaterial& from, unsigned index) {
    Material out;
    aiString name;
    out.name = from.Get(AI_MATKEY_NAME, name) == aiReturn_SUCCESS && name.length > 0
                   ? name.C_Str()
                   : fmt::format("material {}", index);
    lumicut_material& m = out.values = default_material();
    const auto colour = [&](const char* key, unsigned type, unsigned number, const aiColor3D& missing) {
      aiColor3D c = missing;
      aiColor4D four;
      if (from.Get(key, type, number, four) == aiReturn_SUCCESS) c = {four.r, four.g, four.b};
      return c;
    };
    const auto number = [&](const char* key, unsigned type, unsigned at) -> std::optional<double> {
      ai_real value = 0;
      if (from.Get(key, type, at, value) != aiReturn_SUCCESS || !std::isfinite(value)) return std::nullopt;
      return value;
    };
    const aiColor3D black(0, 0, 0);
    store_colour(m.diffuse, colour(AI_MATKEY_COLOR_DIFFUSE, {0.5f, 0.5f, 0.5f}), 1);
    m.diffuse_texture = texture(from, aiTextureType_DIFFUSE, TextureUse::colour);
    if (const int32_t base = texture(from, aiTextureType_BASE_COLOR, TextureUse::colour)) m.diffuse_texture = base;
    aiColor3D emission = colour(AI_MATKEY_COLOR_EMISSIVE, black);
    m.emission_texture = texture(from, aiTextureType_EMISSIVE, TextureUse::colour);
    if (m.emission_texture != 0 && emission.IsBlack()) emission = {1, 1, 1};
    store_colour(m.emission, emission, 1e15);
    const auto roughness = number(AI_MATKEY_ROUGHNESS_FACTOR), metallic = number(AI_MATKEY_METALLIC_FACTOR);
    const double shininess = number(AI_MATKEY_SHININESS).value_or(0);
    const aiColor3D base = colour(AI_MATKEY_BASE_COLOR, {-1, 0, 0});
    int model = aiShadingMode_Gouraud;
    if (base.r >= 0 || metallic || (roughness && ending_ != ".fbx")) {
      m.flags = LUMICUT_GGX;
      if (base.r >= 0) store_colour(m.diffuse, base, 1);
      m.roughness = share(roughness.value_or(0.5)), m.metallic = share(metallic.value_or(0));
      for (float& c : m.specular) c = 1;
    } else if (ending_ == ".fbx") {
      // Phong's terms as Blender writes and reads them: a SpecularFactor of 1/4 is an index of refraction of 1.5.
      m.flags = LUMICUT_GGX;
      m.roughness = share(1 - std::sqrt(std::clamp(shininess, 0.0, 100.0)) / 10);
      m.metallic = share(number(AI_MATKEY_REFLECTIVITY).value_or(0));
      const float gloss = share(4 * number(AI_MATKEY_SHININESS_STRENGTH).value_or(0.25));
      for (float& c : m.specular) c = gloss;
    } else if (from.Get(AI_MATKEY_SHADING_MODEL, model) == aiReturn_SUCCESS &&
               (model == aiShadingMode_Phong || model == aiShadingMode_Blinn) && shininess > 0) {
      store_colour(m.specular, colour(AI_MATKEY_COLOR_SPECULAR, black), 1);
      m.shininess = static_cast<float>(std::clamp(shininess, 1.0, 1e6));
    }
    const int32_t mask = texture(from, aiTextureType_OPACITY, TextureUse::mask);
    m.opacity_texture = mask;
    // Files disagree on what a transparency of 0 is: what nobody could see is taken as solid.
    double opacity = number(AI_MATKEY_OPACITY).value_or(1);
    if (!(opacity > 0 && opacity <= 1)) {
      warn("opacities taken as 1", fmt::format("material \"{}\": an opacity of {} is taken as 1", out.name, opacity));
      opacity = 1;
    }
    m.opacity = std::max(kHole, static_cast<float>(opacity));
    m.normal_texture = texture(from, aiTextureType_NORMALS, TextureUse::vectors);
    int two_sided = 0;
    if (from.Get(AI_MATKEY_TWOSIDED, two_sided) == aiReturn_SUCCESS && two_sided != 0)
      m.flags |= LUMICUT_EMIT_BOTH_SIDES;
    if (from.GetTextureCount(aiTextureType_HEIGHT) > 0) leave_out(fmt::format("material \"{}\": bumps", out.name));
    model_.scene.materials.push_back(std::move(out));
  }

  // ---- Meshes

  void read_mesh(const aiMesh& from, unsigned index) {
    Mesh out;
    out.name = from.mName.length > 0 ? from.mName.C_Str() : fmt::format("mesh {}", index);
    const auto add = [&](std::vector<float>& to, const aiVector3D* values, unsigned width, const char* what) {
      for (unsigned i = 0; i < from.mNumVertices; ++i)
        for (unsigned k = 0; k < width; ++k) {
          if (!(std::abs(values[i][k]) < kLargestCoordinate))
            throw FileError(
                path_, fmt::format("mesh \"{}\": vertex {} has a {} of {}", one_line(out.name), i, what, values[i][k]));
          to.push_back(values[i][k]);
        }
    };
    if (from.HasPositions()) add(out.positions, from.mVertices, 3, "coordinate");
    if (from.HasNormals()) {
      bool good = true;
      for (unsigned i = 0; i < from.mNumVertices; ++i) {
        const float l = from.mNormals[i].Length();
        good = good && l > 1e-6f && std::isfinite(l);
      }
      if (good)
        add(out.normals, from.mNormals, 3, "normal");
      else
        warn("meshes without good normals",
             fmt::format("mesh \"{}\": a normal has no length; taken as flat", out.name));
    }
    if (from.HasTextureCoords(0)) add(out.uvs, from.mTextureCoords[0], 2, "texture coordinate");
    if (from.mMaterialIndex >= model_.scene.materials.size())
      throw FileError(path_, "a mesh names a material that is not there");
    if (from.HasVertexColors(0)) read_colours(from, out);
    for (unsigned i = 0; i < from.mNumFaces; ++i) {
      const aiFace& face = from.mFaces[i];
      if (face.mNumIndices != 3) continue;
      for (unsigned k = 0; k < 3; ++k) {
        if (face.mIndices[k] >= from.mNumVertices)
          throw FileError(path_, fmt::format("mesh \"{}\": index {} of {} vertices", one_line(out.name),
                                             face.mIndices[k], from.mNumVertices));
        out.indices.push_back(face.mIndices[k]);
      }
    }
    if (from.HasBones()) leave_out(fmt::format("mesh \"{}\": bones", out.name));
    out.materials.assign(out.indices.size() / 3, from.mMaterialIndex);
    model_.scene.meshes.push_back(std::move(out));
  }

  // PLY has no other colour. In FBX and COLLADA they may be anything: masks, weights, shadows.
  void read_colours(const aiMesh& from, Mesh& out) {
    if (ending_ != ".ply") return leave_out(fmt::format("mesh \"{}\": colours of vertices", out.name));
    Attribute colours;
    colours.id = VertexColours::kAttribute;
    colours.components = 3, colours.domain = LUMICUT_OF_VERTICES;
    for (unsigned i = 0; i < from.mNumVertices; ++i)
      for (unsigned k = 0; k < 3; ++k)
        colours.values.push_back(static_cast<float>(linear_of_srgb(share(from.mColors[0][i][k]))));
    out.attributes.push_back(std::move(colours));
    for (float& c : model_.scene.materials.at(from.mMaterialIndex).values.diffuse) c = 1;
  }

  // ---- Nodes

  void read_node(const aiNode& node, const Affine& parent, int depth) {
    const std::string name = one_line(node.mName.C_Str());
    if (depth > kDeepest || ++nodes_ > kMostNodes) throw FileError(path_, "nodes lie in each other without end");
    const Affine world = parent * affine(node.mTransformation);
    for (const double v : world.m)
      if (!(std::abs(v) < kLargestCoordinate))
        throw FileError(path_, fmt::format("node \"{}\": its transform has the number {}", name, v));
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= model_.scene.meshes.size())
        throw FileError(path_, fmt::format("node \"{}\" names a mesh that is not there", name));
      if (!(std::abs(world.determinant()) > 0)) {
        leave_out(fmt::format("node \"{}\", which is scaled to nothing", name));
        continue;
      }
      for (const double v : world.m) model_.scene.meshes[node.mMeshes[i]].transforms.push_back(static_cast<float>(v));
    }
    for (unsigned i = 0; i < assimp_->mNumCameras && !model_.has_camera; ++i)
      if (assimp_->mCameras[i]->mName == node.mName) read_camera(*assimp_->mCameras[i], world);
    for (unsigned i = 0; i < assimp_->mNumLights; ++i)
      if (assimp_->mLights[i]->mName == node.mName) read_light(*assimp_->mLights[i], world, name);
    for (unsigned i = 0; i < node.mNumChildren; ++i) read_node(*node.mChildren[i], world, depth + 1);
  }

  void read_camera(const aiCamera& from, const Affine& world) {
    lumicut_camera& camera = model_.scene.camera;
    camera.struct_size = sizeof(camera);
    const Vec z = unit(world.vector(vec(from.mLookAt))) * -1.0, x = unit(cross(world.vector(vec(from.mUp)), z)),
              y = cross(z, x);
    const Vec eye = world.point(vec(from.mPosition));
    for (size_t r = 0; r < 3; ++r) {
      const double row[4] = {x[r], y[r], z[r], eye[r]};
      for (size_t c = 0; c < 4; ++c) camera.to_world[4 * r + c] = static_cast<float>(row[c]);
    }
    const double aspect = from.mAspect > 0.05 && from.mAspect < 20 ? from.mAspect : 4.0 / 3;
    const double fov = from.mHorizontalFOV;
    if (from.mOrthographicWidth > 0) {
      camera.orthographic = 1;
      camera.height = static_cast<float>(2 * from.mOrthographicWidth / aspect);
    } else if (fov > 1e-3 && fov < kPi - 1e-3) {
      camera.fov_y = static_cast<float>(2 * std::atan(std::tan(fov / 2) / aspect));
    } else {
      warn("cameras that are not read", fmt::format("camera \"{}\" has an angle of {}", from.mName.C_Str(), fov));
      return;
    }
    model_.scene.width = static_cast<uint32_t>(std::lround(model_.scene.height * aspect));
    model_.has_camera = true;
  }

  // Their strength in watt as Blender's lamps have it: what Blender writes, and what nobody else writes is told by no file.
  void read_light(const aiLight& from, const Affine& world, const std::string& name) {
    lumicut_light light{};
    light.struct_size = sizeof(light);
    light.unit = LUMICUT_WATT, light.value = 1;
    aiColor3D colour = from.mColorDiffuse;
    // Blender leaves a white lamp's colour out, and where there is a camera too its file says that 0.8 is then meant.
    if (of_blender_ && assimp_->mNumCameras > 0 && colour.r == colour.g && colour.g == colour.b)
      colour = colour * (1 / 0.8f);
    store_colour(light.color, colour, 1e15);
    store(light.position, world.point(vec(from.mPosition)));
    store(light.direction, unit(world.vector(vec(from.mDirection))));
    switch (from.mType) {
      case aiLightSource_DIRECTIONAL:
        light.type = LUMICUT_SUN;
        for (float& p : light.position) p = 0;
        break;
      case aiLightSource_SPOT: {
        light.type = LUMICUT_SPOT;
        // COLLADA's one angle comes as the inner one; the outer is assimp's guess.
        const double outer = ending_ == ".dae" ? from.mAngleInnerCone : from.mAngleOuterCone;
        const double inner = std::clamp<double>(from.mAngleInnerCone, 0, outer);
        if (!(outer > 1e-2 && outer <= kPi)) {
          leave_out(fmt::format("light \"{}\", a spot with an angle of {} degrees", name, outer * 180 / kPi));
          return;
        }
        light.angle = static_cast<float>(outer);
        light.blend = static_cast<float>(1 - inner / outer);
        break;
      }
      case aiLightSource_AMBIENT:
        leave_out(fmt::format("light \"{}\", which is ambient", name));
        return;
      case aiLightSource_POINT:
        light.type = LUMICUT_POINT;
        break;
      default:
        light.type = LUMICUT_POINT;
        warn("lights of a kind that is not read", fmt::format("light \"{}\" is taken as a point", name));
    }
    if (light.type != LUMICUT_SPOT && light.type != LUMICUT_SUN) store(light.direction, {0, 0, 0});
    model_.scene.lights.push_back(light);
    model_.scene.light_names.push_back(fmt::format("light \"{}\"", name));
  }

  std::string path_, ending_;
  std::string_view bytes_;
  const aiScene* assimp_ = nullptr;
  Model model_;
  size_t nodes_ = 0;
  bool of_blender_ = false;
};

class Module final : public ModelModule {
 public:
  Model read(const std::string& path, std::string_view bytes) const override { return Reader(path, bytes).read(); }
};

const Module kModule;

}  // namespace

}  // namespace lumicut::io

extern "C" __attribute__((visibility("default"))) const lumicut::io::ModelModule* const lumicut_model_module =
    &lumicut::io::kModule;
