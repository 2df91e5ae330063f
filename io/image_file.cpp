#include "io/image_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <half.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "io/atomic_file.h"
#include "io/file_error.h"

namespace lumicut::io {

namespace {

constexpr uint64_t kMaxPixels = uint64_t{1} << 28;
constexpr char kAttributePrefix[] = "lumicut:";

std::array<std::string, 3> channel_names(const ImageLayer& layer) {
  if (layer.name == "radiance" && layer.components == 3) return {"R", "G", "B"};
  if (layer.name == "normal" && layer.components == 3) return {"N.X", "N.Y", "N.Z"};
  if (layer.name == "alpha" && layer.components == 1) return {"A", "", ""};
  if (layer.name == "depth" && layer.components == 1) return {"Z", "", ""};
  if (layer.components == 1) return {layer.name + ".V", "", ""};
  return {layer.name + ".R", layer.name + ".G", layer.name + ".B"};
}

// A broken header may promise more pixels than memory holds: refuse before allocating.
void check_plausible(const std::string& path, const Imf::Header& header, uint64_t pixels) {
  uint64_t channels = 0;
  for (auto it = header.channels().begin(); it != header.channels().end(); ++it) ++channels;
  const auto compression = header.compression();
  const bool deflate = compression == Imf::NO_COMPRESSION || compression == Imf::RLE_COMPRESSION ||
                       compression == Imf::ZIP_COMPRESSION || compression == Imf::ZIPS_COMPRESSION;
  // Deflate shrinks at most 1032 times, to two bytes a value or more; the other methods know no such limit.
  const uint64_t most = deflate ? std::filesystem::file_size(path) * 1032 / 2 + 1024 : kMaxPixels;
  if (pixels * channels > most)
    throw FileError(path,
                    fmt::format("promises {} pixels of {} channels, more than its size can hold", pixels, channels));
}

}  // namespace

const ImageLayer* Image::find(const std::string& name) const {
  for (const auto& layer : layers)
    if (layer.name == name) return &layer;
  return nullptr;
}

void write_exr(const std::string& path, const Image& image, bool half_floats) {
  const Imath::Box2i window({image.x0, image.y0}, {image.x0 + image.width - 1, image.y0 + image.height - 1});
  const Imath::Box2i frame =
      image.frame_width > 0 ? Imath::Box2i({0, 0}, {image.frame_width - 1, image.frame_height - 1}) : window;
  const size_t pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
  if (pixels == 0)
    throw FileError(path, fmt::format("an image of {} x {} pixels cannot be written", image.width, image.height));
  AtomicFile file(path);
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
    Imf::OutputFile out(file.temporary().c_str(), header);
    out.setFrameBuffer(buffer);
    out.writePixels(image.height);
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(path, fmt::format("cannot be written: {}", error.what()));
  }
  file.commit();
}

Image read_exr(const std::string& path) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) throw FileError(path, "no such file");
  try {
    Imf::Header::setMaxImageSize(1 << 20, 1 << 20);
    Imf::InputFile in(path.c_str());
    const Imf::Header& header = in.header();
    const Imath::Box2i window = header.dataWindow();
    const Imath::Box2i frame = header.displayWindow();
    const int64_t width = int64_t{window.max.x} - window.min.x + 1, height = int64_t{window.max.y} - window.min.y + 1;
    if (width < 1 || height < 1 || width > 1 << 20 || height > 1 << 20 ||
        static_cast<uint64_t>(width * height) > kMaxPixels)
      throw FileError(path, fmt::format("{} x {} pixels cannot be read", width, height));
    check_plausible(path, header, static_cast<uint64_t>(width * height));
    Image image;
    image.width = static_cast<int>(width), image.height = static_cast<int>(height);
    image.x0 = window.min.x, image.y0 = window.min.y;
    image.frame_width = frame.max.x - frame.min.x + 1, image.frame_height = frame.max.y - frame.min.y + 1;
    for (auto it = header.begin(); it != header.end(); ++it) {
      const std::string name = it.name();
      const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute());
      if (text && name.rfind(kAttributePrefix, 0) == 0)
        image.attributes[name.substr(sizeof(kAttributePrefix) - 1)] = text->value();
    }
    // Channels -> (layer, component); names as written above, and the usual ones of other programs.
    std::map<std::string, std::pair<std::string, int>> known = {
        {"R", {"radiance", 0}}, {"G", {"radiance", 1}}, {"B", {"radiance", 2}},   {"Y", {"radiance", 0}},
        {"A", {"alpha", 0}},    {"Z", {"depth", 0}},    {"depth.Z", {"depth", 0}}};
    struct Plane {
      std::string layer, channel;
      int component;
    };
    std::vector<Plane> planes;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
      const std::string name = it.name();
      if (it.channel().xSampling != 1 || it.channel().ySampling != 1) continue;  // subsampled chroma
      if (const auto found = known.find(name); found != known.end()) {
        planes.push_back({found->second.first, name, found->second.second});
        continue;
      }
      const size_t dot = name.rfind('.');
      const std::string layer = dot == std::string::npos ? name : name.substr(0, dot);
      const std::string last = dot == std::string::npos ? "V" : name.substr(dot + 1);
      const int component = last == "G" || last == "Y" ? 1 : last == "B" || last == "Z" ? 2 : 0;
      planes.push_back({layer == "N" ? "normal" : layer, name, component});
    }
    Imf::FrameBuffer buffer;
    const size_t pixels = static_cast<size_t>(width * height);
    std::vector<std::vector<float>> data(planes.size(), std::vector<float>(pixels));
    for (size_t i = 0; i < planes.size(); ++i)
      buffer.insert(planes[i].channel, Imf::Slice::Make(Imf::FLOAT, data[i].data(), window));
    in.setFrameBuffer(buffer);
    in.readPixels(window.min.y, window.max.y);
    for (size_t i = 0; i < planes.size(); ++i) {
      if (image.find(planes[i].layer)) continue;
      std::vector<size_t> mine;
      bool colour = false;
      for (size_t j = 0; j < planes.size(); ++j)
        if (planes[j].layer == planes[i].layer) mine.push_back(j), colour |= planes[j].component > 0;
      ImageLayer layer{planes[i].layer, colour || planes[i].layer == "radiance" ? 3 : 1, {}};
      const auto components = static_cast<size_t>(layer.components);
      layer.pixels.assign(pixels * components, 0.0f);
      for (const size_t j : mine) {
        const bool grey = layer.name == "radiance" && planes[j].channel == "Y" && mine.size() == 1;
        for (size_t c = 0; c < components; ++c)
          if (grey || c == static_cast<size_t>(planes[j].component))
            for (size_t p = 0; p < pixels; ++p) layer.pixels[p * components + c] = data[j][p];
      }
      image.layers.push_back(std::move(layer));
    }
    return image;
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw FileError(path, fmt::format("not readable as EXR: {}", error.what()));
  }
}

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

void write_png(const std::string& path, const std::vector<uint8_t>& pixels, int width, int height, int components) {
  write_whole_file(path, encode_png(path, pixels, width, height, components));
}

}  // namespace lumicut::io
