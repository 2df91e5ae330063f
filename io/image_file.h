// Images on disk, read through OpenImageIO (image_module.h); written as multi-layer EXR (OpenEXR) and PNG. Writing is
// atomic.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace lumicut::io {

// Of the names of Image::attributes in an EXR's header.
inline constexpr char kAttributePrefix[] = "lumicut:";

struct ImageLayer {
  std::string name;           // "radiance", "depth", "normal", "albedo", "cut_size" ...
  int components = 3;         // 1 or 3
  std::vector<float> pixels;  // interleaved, rows from the top
};

// The window is what was rendered: x0, y0 are its place in the whole frame.
struct Image {
  int width = 0, height = 0;
  int x0 = 0, y0 = 0, frame_width = 0, frame_height = 0;  // frame 0: the window is the frame
  std::vector<ImageLayer> layers;
  std::map<std::string, std::string> attributes;  // strings of the header

  const ImageLayer* find(const std::string& name) const {
    for (const auto& layer : layers)
      if (layer.name == name) return &layer;
    return nullptr;
  }
};

// Channels: radiance is R, G, B (the default layer); alpha is A; depth is Z; normal is N.X, N.Y, N.Z; other layers are
// name.R, name.G, name.B, or name.V when they have one component. ZIP compression; 32-bit float, or 16 with `half`
// (values beyond 65504 are cut to it). Attributes are written as "lumicut:<key>". Throws FileError.
void write_exr(const std::string& path, const Image& image, bool half);

// Reads any format that OpenImageIO reads: EXR of several parts too (those of the first's window), PNG, JPEG, TIFF, HDR.
// Layers are named as above; "red" and "r" are as good as "R". The second part's R, G, B are the layer of the part's name.
// Integers are decoded from sRGB to linear unless the file says that they are linear. A lone grey channel gives radiance
// of equal components. Throws FileError.
Image read_image(const std::string& path);

// The bytes of a PNG: 8 bits a channel, sRGB, rows from the top; components 1 or 3. `name` is what errors call it.
// Throws FileError.
std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                       int components);

// The same into a file. Throws FileError.
void write_png(const std::string& path, const std::vector<uint8_t>& pixels, int width, int height, int components);

}  // namespace lumicut::io
