#include "io/image_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "io/file_error.h"
#include "io/physical_memory.h"

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

// OpenEXR takes the memory that an attribute's size asks for, up to 2 GB, before it looks for the bytes. Headers are lists
// of name, type, size, value that an empty name ends; several parts are ended by an empty header.
// [https://openexr.com/en/latest/OpenEXRFileLayout.html]
void check_exr_attributes(const std::string& path, const std::string& as, std::istream& file) {
  uint32_t start[2] = {};
  constexpr uint32_t kMagic = 20000630, kMultiPart = 0x1000;
  if (!file.read(reinterpret_cast<char*>(start), sizeof(start)) || start[0] != kMagic) return;
  const auto after = file.tellg();
  file.seekg(0, std::ios::end);
  const auto length = static_cast<int64_t>(file.tellg());
  file.seekg(after);
  std::string name, type;
  bool empty = true;  // the header, so far
  for (;;) {
    if (!std::getline(file, name, '\0')) return;  // OpenEXR says what is cut short
    if (name.empty()) {
      if (empty || !(start[1] & kMultiPart)) return;
      empty = true;
      continue;
    }
    empty = false;
    int32_t size = 0;
    if (!std::getline(file, type, '\0') || !file.read(reinterpret_cast<char*>(&size), sizeof(size))) return;
    const int64_t left = length - static_cast<int64_t>(file.tellg());
    if (size < 0 || size > left)
      throw FileError(path, fmt::format("not readable as {}: the header's attribute at byte {} claims {} bytes of {}",
                                        as, length - left, size, left));
    file.seekg(size, std::ios::cur);
  }
}

// libpng takes and clears what a chunk's length asks for, up to 2 GB, before it looks for the bytes; pixels alone it reads
// piece by piece. [https://www.w3.org/TR/png/#5Chunk-layout]
void check_png_chunks(const std::string& path, const std::string& as, std::istream& file) {
  char signature[8] = {};
  if (!file.read(signature, sizeof(signature)) || std::string_view(signature, sizeof(signature)) != "\x89PNG\r\n\x1a\n")
    return;
  const auto after = file.tellg();
  file.seekg(0, std::ios::end);
  const auto length = static_cast<int64_t>(file.tellg());
  file.seekg(after);
  for (unsigned char head[8]; file.read(reinterpret_cast<char*>(head), sizeof(head));) {
    const std::string_view type(reinterpret_cast<char*>(head) + 4, 4);
    const int64_t size = int64_t{head[0]} << 24 | head[1] << 16 | head[2] << 8 | head[3],
                  left = length - static_cast<int64_t>(file.tellg());
    if (type == "IEND" || (type == "IDAT" && size > left)) return;  // libpng says what is cut short
    if (size > left)
      throw FileError(path, fmt::format("not readable as {}: the chunk at byte {} claims {} bytes of {}", as,
                                        length - left - 8, size, left));
    file.seekg(size + 4, std::ios::cur);  // a checksum ends it
  }
}

void check_claims(const std::string& path, const std::string& as, std::istream& file) {
  check_exr_attributes(path, as, file);
  file.clear(), file.seekg(0);
  check_png_chunks(path, as, file);
}

}  // namespace

std::unique_ptr<OIIO::ImageInput> open_image(const std::string& path, const std::string& as,
                                             const OIIO::ImageSpec* wish) {
  check_regular_file(path);
  std::ifstream file(path, std::ios::binary);
  check_claims(path, as, file);
  auto input = OIIO::ImageInput::open(path, wish);
  if (!input) throw FileError(path, fmt::format("not readable as {}: {}", as, OIIO::geterror()));
  return input;
}

std::unique_ptr<OIIO::ImageInput> open_held_image(const std::string& path, const std::string& as, std::string_view held,
                                                  OIIO::Filesystem::IOMemReader& memory) {
  std::istringstream file{std::string(held)};
  check_claims(path, as, file);
  // The ending says which format is tried first.
  auto input = OIIO::ImageInput::open(held.starts_with("\xff\xd8") ? "image.jpg" : "image.png", nullptr, &memory);
  if (!input) throw FileError(path, fmt::format("not readable as {}: {}", as, OIIO::geterror()));
  return input;
}

void check_image_size(const std::string& path, const OIIO::ImageInput& input, uint64_t size) {
  const OIIO::ImageSpec& spec = input.spec();
  const double pixels = static_cast<double>(spec.width) * spec.height;
  if (!(pixels >= 1) || pixels > static_cast<double>(kMaxImagePixels))
    throw FileError(path,
                    fmt::format("has {} x {} pixels; 1 to {} are read", spec.width, spec.height, kMaxImagePixels));
  const double bytes = pixels * spec.nchannels * sizeof(float);
  if (bytes > 0.5 * static_cast<double>(physical_memory()))
    throw FileError(
        path, fmt::format("takes {:.1f} GB as {} x {} pixels of {} channels, more than half of this machine's memory",
                          bytes / 1e9, spec.width, spec.height, spec.nchannels));
  if (!knows_limit(input.format_name(), spec.get_string_attribute("compression"))) return;
  if (pixels * static_cast<double>(spec.pixel_bytes(true)) > static_cast<double>(size) * kBestRatio)
    throw FileError(path, fmt::format("promises {} x {} pixels of {} channels, more than its {} bytes can hold",
                                      spec.width, spec.height, spec.nchannels, size));
}

}  // namespace lumicut::io
