#include "io/image_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <half.h>

#include <algorithm>
#include <array>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_module.h"

namespace lumicut::io {

namespace {

std::array<std::string, 3> channel_names(const ImageLayer& layer) {
  if (layer.name == "radiance" && layer.components == 3) return {"R", "G", "B"};
  if (layer.name == "normal" && layer.components == 3) return {"N.X", "N.Y", "N.Z"};
  if (layer.name == "alpha" && layer.components == 1) return {"A", "", ""};
  if (layer.name == "depth" && layer.components == 1) return {"Z", "", ""};
  if (layer.components == 1) return {layer.name + ".V", "", ""};
  return {layer.name + ".R", layer.name + ".G", layer.name + ".B"};
}

// In memory, since what OpenEXR's destructor writes fails without a word. `failed` tells of memory that ran out there.
class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto size = static_cast<size_t>(count);
    failed_ = true;
    if (at_ + size > bytes_.size()) bytes_.resize(at_ + size);
    failed_ = false;
    std::copy_n(bytes, size, bytes_.begin() + static_cast<std::ptrdiff_t>(at_));
    at_ += size;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t to) override { at_ = to; }
  bool failed() const { return failed_; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  size_t at_ = 0;
  bool failed_ = false;
};

}  // namespace

Image read_image(const std::string& path) { return image_module(path).read_image(path); }

void write_exr(const std::string& path, const Image& image, bool half_floats) {
  const Imath::Box2i window({image.x0, image.y0}, {image.x0 + image.width - 1, image.y0 + image.height - 1});
  const Imath::Box2i frame =
      image.frame_width > 0 ? Imath::Box2i({0, 0}, {image.frame_width - 1, image.frame_height - 1}) : window;
  const size_t pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
  if (pixels == 0)
    throw FileError(path, fmt::format("an image of {} x {} pixels cannot be written", image.width, image.height));
  MemoryStream stream;
  try {
    Imf::Header header(frame, window);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const auto& [key, value] : image.attributes)
      header.insert((kAttributePrefix + key).c_str(), Imf::StringAttribute(value));
    Imf::FrameBuffer buffer;
    std::vector<std::vector<half>> halves;
    halves.reserve(image.layers.size());
    const auto type = half_floats ? Imf::HALF : Imf::FLOAT;
    for (const auto& layer : image.layers) {
      const auto components = static_cast<size_t>(layer.components);
      if (layer.pixels.size() != pixels * components)
        throw FileError(path, fmt::format("the layer {} has {} values instead of {}", layer.name, layer.pixels.size(),
                                          pixels * components));
      const char* base = reinterpret_cast<const char*>(layer.pixels.data());
      size_t size = sizeof(float);
      if (half_floats) {
        auto& small = halves.emplace_back(layer.pixels.size());
        for (size_t i = 0; i < small.size(); ++i) small[i] = half(std::clamp(layer.pixels[i], -65504.0f, 65504.0f));
        base = reinterpret_cast<const char*>(small.data());
        size = sizeof(half);
      }
      const auto names = channel_names(layer);
      for (size_t c = 0; c < components; ++c) {
        header.channels().insert(names[c], Imf::Channel(type));
        buffer.insert(names[c], Imf::Slice::Make(type, base + c * size, window, size * components,
                                                 size * components * static_cast<size_t>(image.width)));
      }
    }
    Imf::OutputFile out(stream, header);
    out.setFrameBuffer(buffer);
    out.writePixels(image.height);
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(path, fmt::format("cannot be written: {}", error.what()));
  }
  if (stream.failed()) throw std::bad_alloc();
  write_whole_file(path, stream.bytes());
}

std::string encode_png(const std::string& name, const std::vector<uint8_t>& pixels, int width, int height,
                       int components) {
  return image_module(name).encode_png(name, pixels, width, height, components);
}

void write_png(const std::string& path, const std::vector<uint8_t>& pixels, int width, int height, int components) {
  write_whole_file(path, encode_png(path, pixels, width, height, components));
}

}  // namespace lumicut::io
