// What the module gives to those who load it.
#include "io/image_module.h"

namespace lumicut::io {

namespace {

class Module final : public ImageModule {
 public:
  Image read_image(const std::string& path) const override { return oiio::read_image(path); }
  Texture read_texture(const std::string& path, std::string_view held, TextureUse use, uint32_t flags,
                       const std::string& user) const override {
    return oiio::read_texture(path, held, use, flags, user);
  }
  std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                         int components) const override {
    return oiio::encode_png(name, pixels, width, height, components);
  }
};

const Module kModule;

}  // namespace

}  // namespace lumicut::io

// A datum and not a function, for the reason at ImageModule.
extern "C" __attribute__((visibility("default"))) const lumicut::io::ImageModule* const lumicut_image_module =
    &lumicut::io::kModule;
