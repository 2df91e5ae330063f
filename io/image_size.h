// What an image's header says of its size, held against the file before memory is taken.
#pragma once

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace lumicut::io {

inline constexpr uint64_t kMaxImagePixels = uint64_t{1} << 28;

// Opens an image; `as` is what it is wanted as ("an image"), `wish` what OpenImageIO shall do with it. Throws FileError when
// it is no plain file, not readable, or an EXR or PNG whose header claims more bytes than follow.
std::unique_ptr<OIIO::ImageInput> open_image(const std::string& path, const std::string& as,
                                             const OIIO::ImageSpec* wish = nullptr);

// The same for one whose bytes another file holds; `path` is what errors call it. `memory` reads the bytes as long as what is
// returned.
std::unique_ptr<OIIO::ImageInput> open_held_image(const std::string& path, const std::string& as, std::string_view held,
                                                  OIIO::Filesystem::IOMemReader& memory);

// Throws FileError when the opened image has more than kMaxImagePixels, or more samples than a file of `size` bytes can hold
// after the best compression that its format knows: a broken header. Multi-part files: what is current.
void check_image_size(const std::string& path, const OIIO::ImageInput& input, uint64_t size);

}  // namespace lumicut::io
