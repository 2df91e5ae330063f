// Numbers as text, for messages and keys.
#pragma once

#include <cstdint>
#include <string>

namespace lumicut {

// Shortest text of a number that reads back the same; '.' whatever the locale.
std::string number_text(float value);
std::string number_text(double value);
std::string number_text(uint64_t value);
std::string number_text(int64_t value);

}  // namespace lumicut
