#include "core/number_text.h"

#include <charconv>

namespace lumicut {

namespace {
template <typename T>
std::string text_of(T value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value).ptr;
  return {buffer, end};
}
}  // namespace

std::string number_text(float value) { return text_of(value); }
std::string number_text(double value) { return text_of(value); }
std::string number_text(uint64_t value) { return text_of(value); }
std::string number_text(int64_t value) { return text_of(value); }

}  // namespace lumicut
