#include "io/image_module.h"

#include "io/module.h"

namespace lumicut::io {

const ImageModule& image_module(const std::string& file) {
  // Never closed: OpenImageIO's threads may outlive a render.
  static const ImageModule* const module = load_module<ImageModule>(file, "images", "lumicut_image_module");
  return *module;
}

}  // namespace lumicut::io
