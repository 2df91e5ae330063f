// What OpenImageIO does for this folder. It brings 250 shared libraries, a fifth of a second of loading, which most commands
// do without: so it is linked to a module of its own, lib/lumicut/images.so, that is loaded when a picture is first asked for.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/image_file.h"
#include "io/texture_store.h"

namespace lumicut::io {

// A class and not a table of functions: calls through pointers are checked by UndefinedBehaviorSanitizer, and types of two
// modules are not the same to it. FileErrors pass from the module as from any function.
class ImageModule {
 public:
  virtual Image read_image(const std::string& path) const = 0;
  // `held` are the bytes of an image that lies in another file; `path` is then what errors call it. Empty: the file `path`.
  virtual Texture read_texture(const std::string& path, std::string_view held, TextureUse use, uint32_t flags,
                               const std::string& user) const = 0;
  virtual std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                                 int components) const = 0;

 protected:
  ~ImageModule() = default;
};

// Loads the module at the first call. Throws FileError, about the file that it is needed for, where that fails.
const ImageModule& image_module(const std::string& file);

// Inside the module.
namespace oiio {
Image read_image(const std::string& path);
Texture read_texture(const std::string& path, std::string_view held, TextureUse use, uint32_t flags,
                     const std::string& user);
std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                       int components);
}  // namespace oiio

}  // namespace lumicut::io
