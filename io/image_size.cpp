#include "io/image_size.h"

#include <fmt/format.h>

#include <filesystem>

#include "io/file_error.h"

namespace lumicut::io {

namespace {

// Most bytes of samples that a byte of the file stands for. Deflate makes 258 bytes of two bits, and a palette or single
// bits grow up to 32 times on reading. LZW, run lengths, JPEG and OpenEXR's methods (DWA: two deflated bytes for 64
// samples) stay below that; WebP, fax codes and Zstandard, for one, know no limit.
constexpr double kBestRatio = 1032 * 32;

bool knows_limit(const std::string& format, const std::string& method) {
  for (const char* known : {"openexr", "png", "jpeg", "hdr", "targa", "bmp", "pnm", "sgi", "iff"})
    if (format == known) return true;
  if (format != "tiff") return false;
  return method == "none" || method == "zip" || method == "lzw" || method == "packbits" || method == "jpeg";
}

}  // namespace

void check_image_size(const std::string& path, const OIIO::ImageInput& input) {
  const OIIO::ImageSpec& spec = input.spec();
  const double pixels = static_cast<double>(spec.width) * spec.height;
  if (!(pixels >= 1) || pixels > static_cast<double>(kMaxImagePixels))
    throw FileError(path,
                    fmt::format("has {} x {} pixels; 1 to {} are read", spec.width, spec.height, kMaxImagePixels));
  if (!knows_limit(input.format_name(), spec.get_string_attribute("compression"))) return;
  const double size = static_cast<double>(std::filesystem::file_size(path));
  if (pixels * static_cast<double>(spec.pixel_bytes(true)) > size * kBestRatio)
    throw FileError(path, fmt::format("promises {} x {} pixels of {} channels, more than its {:.0f} bytes can hold",
                                      spec.width, spec.height, spec.nchannels, size));
}

}  // namespace lumicut::io
