// Scenes of FBX, COLLADA and PLY files as assimp has them, before their textures are read; and their way as bytes from the
// process that reads the file to the one that asked (isolated.h).
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "io/file_error.h"
#include "io/scene_data.h"
#include "io/texture_store.h"

namespace lumicut::io {

struct ModelTexture {
  std::string name;   // of a file, as the scene's file has it
  std::string bytes;  // of an image that the scene's file holds
  uint32_t flags = 0;
  TextureUse use = TextureUse::colour;
};

struct Model {
  SceneData scene;  // texture numbers of its materials are 1 + index into `textures`
  std::vector<ModelTexture> textures;
  std::vector<std::pair<std::string, std::string>> warnings;  // kind, text
  bool has_camera = false;
};

// Writes to, or reads from, a string: `archive(value)` for each, in the same order.
class Packer {
 public:
  template <typename T>
  void operator()(const T& value) {
    if constexpr (std::is_same_v<T, std::string>) {
      block(value.data(), value.size());
    } else {
      static_assert(std::is_trivially_copyable_v<T>);
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
    }
  }
  template <typename T>
  void operator()(const std::vector<T>& list) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      block(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T));
    } else {
      (*this)(uint64_t{list.size()});
      for (const T& value : list) pack(*this, value);
    }
  }
  std::string take() { return std::move(bytes_); }

 private:
  void block(const char* data, size_t size) {
    (*this)(uint64_t{size});
    bytes_.append(data, size);
  }
  std::string bytes_;
};

class Unpacker {
 public:
  Unpacker(const std::string& bytes, std::string file) : bytes_(bytes), file_(std::move(file)) {}

  template <typename T>
  void operator()(T& value) {
    if constexpr (std::is_same_v<T, std::string>) {
      const size_t size = length(1);
      value.assign(bytes_, at_ - size, size);
    } else {
      std::memcpy(&value, take(sizeof(value)), sizeof(value));
    }
  }
  template <typename T>
  void operator()(std::vector<T>& list) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      const size_t size = length(sizeof(T));
      list.resize(size / sizeof(T));
      if (size > 0) std::memcpy(list.data(), &bytes_[at_ - size], size);
    } else {
      uint64_t count = 0;
      (*this)(count);
      for (uint64_t i = 0; i < count; ++i) pack(*this, list.emplace_back());
    }
  }

 private:
  const char* take(size_t size) {
    if (size > bytes_.size() - at_) throw FileError(file_, "its reader ended too early");
    at_ += size;
    return &bytes_[at_ - size];
  }
  size_t length(size_t unit) {
    uint64_t size = 0;
    (*this)(size);
    if (size % unit != 0) throw FileError(file_, "its reader gave a broken answer");
    take(size);
    return size;
  }
  const std::string& bytes_;
  std::string file_;
  size_t at_ = 0;
};

template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, ModelTexture>
void pack(Archive& archive, T& t) { archive(t.name), archive(t.bytes), archive(t.flags), archive(t.use); }
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, Material>
void pack(Archive& archive, T& m) { archive(m.name), archive(m.values); }
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, Attribute>
void pack(Archive& archive, T& a) { archive(a.id), archive(a.components), archive(a.domain), archive(a.values); }
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, Mesh>
void pack(Archive& archive, T& m) {
  archive(m.name), archive(m.positions), archive(m.normals), archive(m.uvs), archive(m.indices);
  archive(m.materials), archive(m.transforms), archive(m.attributes);
}
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, std::string>
void pack(Archive& archive, T& text) { archive(text); }
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, std::pair<std::string, std::string>>
void pack(Archive& archive, T& both) { archive(both.first), archive(both.second); }
template <typename Archive, typename T>
requires std::is_same_v<std::remove_const_t<T>, Model>
void pack(Archive& archive, T& model) {
  archive(model.textures), archive(model.warnings), archive(model.has_camera);
  auto& scene = model.scene;
  archive(scene.materials), archive(scene.meshes), archive(scene.lights), archive(scene.light_names);
  archive(scene.camera), archive(scene.width), archive(scene.height);
}

// What the module lib/lumicut/models.so gives. A class for the reason at ImageModule.
class ModelModule {
 public:
  // `bytes`: of a PLY that is in memory already; empty: the file is read.
  virtual Model read(const std::string& path, std::string_view bytes) const = 0;

 protected:
  ~ModelModule() = default;
};

}  // namespace lumicut::io
