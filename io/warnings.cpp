#include "io/warnings.h"

#include <fmt/format.h>

namespace lumicut::io {

void Warnings::add(const std::string& kind, const std::string& file, const std::string& text) {
  if (++counts_[kind] <= kShown) texts_.push_back(fmt::format("{}: {}", file, text));
}

void Warnings::add(const std::string& kind, const std::string& file, int line, const std::string& text) {
  add(kind, file, fmt::format("line {}: {}", line, text));
}

std::vector<std::string> Warnings::lines() const {
  std::vector<std::string> all = texts_;
  for (const auto& [kind, count] : counts_)
    if (count > kShown) all.push_back(fmt::format("{} more {}", count - kShown, kind));
  return all;
}

}  // namespace lumicut::io
