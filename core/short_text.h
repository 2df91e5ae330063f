// A number in a message: six digits, and no zeros after them.
#pragma once

#include <cstdio>
#include <string>

namespace lumicut {

inline std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

}  // namespace lumicut
