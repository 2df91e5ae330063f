// ${NAME} in the paths of scene files and plans: the environment's values, which no message may print.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "io/json_reader.h"

namespace lumicut::io {

class PathVariables {
 public:
  // Relative paths start at `folder`.
  explicit PathVariables(std::string folder = "") : folder_(std::move(folder)) {}

  // The path with the environment's values. `otherwise` gives that of a name that is not set, or throws.
  std::string resolve(const JsonValue& value, const std::function<std::string(const std::string& name)>& otherwise);
  // `text` with paths as they are written, ${NAME}, in place of what `resolve` made of them.
  std::string hide(std::string text) const;

 private:
  std::string folder_;
  std::map<std::string, std::string, std::greater<>> written_;  // by beginnings of resolved paths; a longer one first
};

}  // namespace lumicut::io
