#include "io/module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>

#include "io/file_error.h"

namespace lumicut::io {

// Beside the program, where the build and the installation put it.
const void* module_entry(const std::string& file, const char* name, const char* symbol) {
  std::error_code code;
  const auto prefix = std::filesystem::read_symlink("/proc/self/exe", code).parent_path().parent_path();
  std::string tried;
  for (const char* folder : {"lib", LUMICUT_LIBDIR}) {
    const std::string path = prefix / folder / fmt::format("lumicut/{}.so", name);
    void* handle = dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (const void* entry = handle ? dlsym(handle, symbol) : nullptr) return entry;
    tried += fmt::format("\n  {}", dlerror());
  }
  throw FileError(file, fmt::format("the module {}.so cannot be loaded:{}", name, tried));
}

}  // namespace lumicut::io
