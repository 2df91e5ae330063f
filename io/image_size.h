// What an image's header says of its size, held against the file before memory is taken.
#pragma once

#include <OpenImageIO/imageio.h>

#include <cstdint>
#include <string>

namespace lumicut::io {

inline constexpr uint64_t kMaxImagePixels = uint64_t{1} << 28;

// Throws FileError when the opened image has more than kMaxImagePixels, or more samples than a file of this length can hold
// after the best compression that its format knows: a broken header. Multi-part files: what is current.
void check_image_size(const std::string& path, const OIIO::ImageInput& input);

}  // namespace lumicut::io
