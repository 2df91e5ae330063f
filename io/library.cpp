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
  const auto load = [&](const char* name) {
    void* symbol = dlsym(handle_, name);
    if (!symbol) throw LibraryError(LUMICUT_UNSUPPORTED, fmt::format("{} lacks the function {}", path_, name));
    return symbol;
  };
  try {
#define LUMICUT_LOAD(name) api_.name = reinterpret_cast<decltype(api_.name)>(load("lumicut_" #name));
    LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_LOAD)
#undef LUMICUT_LOAD
    uint32_t major = 0, minor = 0;
    api_.version(&major, &minor);
    if (major != LUMICUT_ABI_MAJOR)
      throw LibraryError(LUMICUT_UNSUPPORTED, fmt::format("{} speaks version {}.{} of the ABI; {} is needed", path_,
                                                          major, minor, LUMICUT_ABI_MAJOR));
  } catch (...) {
    dlclose(handle_);
    throw;
  }
}

// Not closed: its worker threads may still be winding down, and the program ends soon.
Library::~Library() = default;

void check(const Api& api, lumicut_result code, const std::string& doing) {
  if (code == LUMICUT_OK) return;
  const char* text = api.last_error();
  throw LibraryError(
      code, fmt::format("{}: {}", doing, text && *text ? text : fmt::format("failed with code {}", code).c_str()));
}

}  // namespace lumicut::io
