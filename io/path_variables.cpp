#include "io/path_variables.h"

#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>

namespace lumicut::io {

namespace fs = std::filesystem;

std::string PathVariables::resolve(const JsonValue& value,
                                   const std::function<std::string(const std::string&)>& otherwise) {
  const std::string written = value.text();
  if (written.empty()) value.fail("is empty, but must be a path");
  const auto placed = [&](const std::string& path) {
    return fs::path(path).is_absolute() ? path : (fs::path(folder_) / path).lexically_normal().string();
  };
  std::string text;
  size_t at = 0;
  for (size_t start; (start = written.find("${", at)) != std::string::npos;) {
    const size_t end = written.find('}', start);
    if (end == std::string::npos) value.fail_expected("a path in which every ${ is closed by }");
    const std::string name = written.substr(start + 2, end - start - 2);
    const char* found = std::getenv(name.c_str());
    text += written.substr(at, start - at) + (found && *found ? found : otherwise(name));
    at = end + 1;
    if (!found || !*found) continue;
    const fs::path beginning = placed(text);
    if (beginning.string().size() > 1) written_[beginning.string()] = written.substr(0, at);
    // An OBJ's MTL and textures stand beside it, in a folder that is part of the value.
    const std::string folder = beginning.parent_path().string();
    if (at == written.size() && std::strchr(found, '/') && folder.size() > 1)
      written_.emplace(folder + "/", written + "/../");
  }
  return placed(text + written.substr(at));
}

std::string PathVariables::hide(std::string text) const {
  for (const auto& [path, name] : written_)
    for (size_t at = 0; (at = text.find(path, at)) != std::string::npos; at += name.size())
      text.replace(at, path.size(), name);
  return text;
}

}  // namespace lumicut::io
