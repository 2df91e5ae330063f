// A font of 5x7 dots for the labels of pictures. Drawn for this project.
#pragma once

#include <cstdint>
#include <string>

namespace lumicut::tools {

inline constexpr int kGlyphWidth = 5, kGlyphHeight = 7, kGlyphAdvance = 6;

// Seven rows from the top, bit 4 is the leftmost dot. Characters that the font has not are boxes.
const uint8_t* glyph(char c);
inline int text_width(const std::string& text) { return static_cast<int>(text.size()) * kGlyphAdvance; }

}  // namespace lumicut::tools
