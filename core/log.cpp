#include "core/log.h"

namespace lumicut {

void Log::operator()(LogLevel level, const std::string& text) const {
  if (enabled(level)) callback_(user_, static_cast<int>(level), text.c_str());
}

}  // namespace lumicut
