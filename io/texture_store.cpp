#include "io/texture_store.h"

#include <fmt/format.h>

#include <filesystem>

#include "io/file_error.h"
#include "io/image_module.h"

namespace lumicut::io {

int32_t TextureStore::get(const std::string& path, TextureUse use, uint32_t flags, const std::string& user) {
  std::error_code code;
  const auto canonical = std::filesystem::weakly_canonical(path, code);
  return get(canonical.string(), path, {}, use, flags, user);
}

int32_t TextureStore::get_held(const std::string& name, std::string_view bytes, TextureUse use, uint32_t flags,
                               const std::string& user) {
  if (bytes.empty()) throw FileError(name, fmt::format("a texture of {} has no bytes", user));
  return get("held " + name, name, bytes, use, flags, user);
}

int32_t TextureStore::get(const std::string& key, const std::string& path, std::string_view held, TextureUse use,
                          uint32_t flags, const std::string& user) {
  const std::string whole = fmt::format("{}|{}|{}", key, static_cast<int>(use), flags);
  if (const auto found = known_.find(whole); found != known_.end()) return found->second;
  textures_.push_back(image_module(path).read_texture(path, held, use, flags, user));
  return known_[whole] = static_cast<int32_t>(textures_.size());
}

int32_t TextureStore::grey() {
  int32_t& index = known_["grey"];
  if (index == 0) {
    Texture texture;
    texture.file = "grey";
    texture.width = texture.height = 1, texture.channels = 3;
    texture.floats = {0.5f, 0.5f, 0.5f};
    textures_.push_back(std::move(texture));
    index = static_cast<int32_t>(textures_.size());
  }
  return index;
}

}  // namespace lumicut::io
