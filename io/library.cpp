#include "io/library.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

namespace lumicut::io {

namespace {

std::vector<std::string> candidates() {
  if (const char* given = std::getenv("LUMICUT_LIBRARY"); given && *given) return {given};
  std::error_code code;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", code);
  std::vector<std::string> paths;
  if (!code) {
    const auto lib = self.parent_path().parent_path() / "lib";
    paths.push_back((lib / "liblumicut.so").string());
    paths.push_back((lib / "liblumicut.so.1").string());
  }
  paths.emplace_back("liblumicut.so.1");
  return paths;
}

}  // namespace

Library::Library() {
  std::string tried;
  for (const auto& path : candidates()) {
    handle_ = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle_) {
      path_ = path;
      break;
    }
    tried += fmt::format("\n  {}", dlerror());
  }
  if (!handle_)
    throw LibraryError(LUMICUT_UNSUPPORTED,
                       "the Lumicut library cannot be loaded (LUMICUT_LIBRARY may name it):" + tried);
  try {
    api_ = api::load([this](const char* name) { return dlsym(handle_, name); });
  } catch (const LibraryError& error) {
    dlclose(handle_);
    throw LibraryError(error.code(), fmt::format("{} {}", path_, error.what()));
  }
}

// Not closed: its worker threads may still be winding down, and the program ends soon.
Library::~Library() = default;

}  // namespace lumicut::io
