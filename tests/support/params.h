// Values of parameters that are not their defaults.
#pragma once

#include <string>

#include "core/number_text.h"
#include "integrators/params.h"

namespace lumicut::test {

inline std::string another_value(const ParamInfo& info) {
  if (info.type == ParamType::boolean) return info.default_text == "0" ? "true" : "false";
  if (info.type == ParamType::choice) {
    const std::string all = info.choices, first = all.substr(0, all.find('|'));
    return first != info.default_text ? first : all.substr(all.rfind('|') + 1);
  }
  const double now = std::stod(info.default_text);
  if (info.type == ParamType::integer) return number_text(now < info.maximum ? now + 1 : now - 1);
  return number_text(0.5 * (now + (now < info.maximum ? info.maximum : info.minimum)));
}

}  // namespace lumicut::test
