// PNG through OpenImageIO.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "io/file_error.h"
#include "io/image_module.h"

namespace lumicut::io::oiio {

std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                       int components) {
  if (pixels.size() != static_cast<size_t>(width) * static_cast<size_t>(height) * static_cast<size_t>(components) ||
      pixels.empty())
    throw FileError(name,
                    fmt::format("{} values are no image of {} x {} x {}", pixels.size(), width, height, components));
  const auto out = OIIO::ImageOutput::create("png");
  if (!out) throw FileError(name, "OpenImageIO cannot write PNG here");
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  OIIO::ImageSpec spec(width, height, components, OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  out->set_ioproxy(&memory);
  if (!out->open("memory.png", spec) || !out->write_image(OIIO::TypeDesc::UINT8, pixels.data()) || !out->close())
    throw FileError(name, fmt::format("cannot be written: {}", out->geterror()));
  return {bytes.begin(), bytes.end()};
}

}  // namespace lumicut::io::oiio
