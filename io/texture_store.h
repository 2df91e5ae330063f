// Textures read once however often they are used.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/scene_data.h"

namespace lumicut::io {

enum class TextureUse {
  colour,   // integer images hold sRGB, float images linear values; grey or red, green and blue
  mask,     // one linear channel: the alpha of images that have one, else the first channel
  vectors,  // linear, three channels: normal maps
  numbers,  // linear, of up to 32 bits: heights, roughness, share of metal
  radiance  // an environment: linear floats, finite and not negative
};

class TextureStore {
 public:
  explicit TextureStore(std::vector<Texture>& textures) : textures_(textures) {}
  // 1 + index into the textures. `user` names who asks, for the error: "material \"leaf\"". Throws FileError.
  int32_t get(const std::string& path, TextureUse use, uint32_t flags, const std::string& user);
  // The same for an image whose bytes another file holds; `name` says where it stands: "room.glb: images[3]".
  int32_t get_held(const std::string& name, std::string_view bytes, TextureUse use, uint32_t flags,
                   const std::string& user);
  // The same for a texture that is missing: one pixel of .5, linear.
  int32_t grey();

 private:
  int32_t get(const std::string& key, const std::string& path, std::string_view held, TextureUse use, uint32_t flags,
              const std::string& user);
  std::vector<Texture>& textures_;
  std::map<std::string, int32_t> known_;
};

}  // namespace lumicut::io
