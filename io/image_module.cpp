#include "io/image_module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

// Beside the program, where the build and the installation put it.
const ImageModule* load(const std::string& file) {
  std::error_code code;
  const auto prefix = std::filesystem::read_symlink("/proc/self/exe", code).parent_path().parent_path();
  std::string tried;
  for (const char* folder : {"lib", LUMICUT_LIBDIR}) {
    const std::string path = prefix / folder / "lumicut/images.so";
    // Never closed: OpenImageIO's threads may outlive a render.
    void* handle = dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    const void* entry = handle ? dlsym(handle, "lumicut_image_module") : nullptr;
    if (entry) return *static_cast<const ImageModule* const*>(entry);
    tried += fmt::format("\n  {}", dlerror());
  }
  throw FileError(file, "the module for pictures cannot be loaded:" + tried);
}

}  // namespace

const ImageModule& image_module(const std::string& file) {
  static const ImageModule* const module = load(file);
  return *module;
}

}  // namespace lumicut::io
