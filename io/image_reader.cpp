// Images of any format through OpenImageIO.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "io/file_error.h"
#include "io/image_module.h"
#include "io/image_size.h"
#include "io/srgb.h"
#include "io/text_lines.h"

namespace lumicut::io::oiio {

namespace {

struct Place {
  std::string layer;
  int component;
};

// Names as write_exr has them, and the usual ones of other programs: R or r or red, ViewLayer.Combined.R.
Place place_of(const std::string& channel) {
  const size_t dot = channel.rfind('.');
  const std::string last = lower(channel.substr(dot == std::string::npos ? 0 : dot + 1));
  const bool alpha = last == "a" || last == "alpha";
  int component = -1;
  if (last == "r" || last == "red") component = 0;
  if (last == "g" || last == "green") component = 1;
  if (last == "b" || last == "blue") component = 2;
  if (dot == std::string::npos) {
    if (component >= 0) return {"radiance", component};
    for (const char* grey : {"y", "l", "i", "grey", "gray", "luminance"})
      if (last == grey) return {"radiance", 0};
    if (alpha) return {"alpha", 0};
    if (last == "z") return {"depth", 0};
    return {channel, 0};
  }
  if (alpha) return {channel, 0};
  if (last == "y") component = 1;
  if (last == "z") component = 2;
  const std::string layer = channel.substr(0, dot);
  return {layer == "N" ? "normal" : layer, std::max(component, 0)};
}

// The layers of the part that is current.
void add_layers(const std::string& path, OIIO::ImageInput& in, int part, Image& image) {
  const OIIO::ImageSpec spec = in.spec();
  const auto channels = static_cast<size_t>(spec.nchannels);
  const size_t pixels = static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height);
  std::vector<float> data(pixels * channels);
  if (!in.read_image(part, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, data.data()))
    throw FileError(path, fmt::format("not readable as an image: {}", in.geterror()));
  std::vector<Place> places;
  for (std::string name : spec.channelnames) {
    if (part > 0 && name.find('.') == std::string::npos)
      name = std::string(spec.get_string_attribute("oiio:subimagename", fmt::format("part{}", part))) + "." + name;
    places.push_back(place_of(name));
  }
  // Integers are coded for displays unless the file says otherwise.
  const bool coded =
      !spec.format.is_floating_point() && lower(spec.get_string_attribute("oiio:ColorSpace")).find("linear") != 0;
  for (const Place& first : places) {
    if (image.find(first.layer)) continue;
    const auto mine = [&](const Place& p) { return p.layer == first.layer; };
    const bool one = std::count_if(places.begin(), places.end(), mine) == 1;
    ImageLayer layer{first.layer, one && first.layer != "radiance" ? 1 : 3, {}};
    const auto components = static_cast<size_t>(layer.components);
    layer.pixels.assign(pixels * components, 0.0f);
    for (size_t channel = 0; channel < channels; ++channel) {
      if (!mine(places[channel])) continue;
      for (size_t c = 0; c < components; ++c)
        if (one || c == static_cast<size_t>(places[channel].component))
          for (size_t p = 0; p < pixels; ++p) layer.pixels[p * components + c] = data[p * channels + channel];
    }
    if (coded && components == 3)
      std::transform(layer.pixels.begin(), layer.pixels.end(), layer.pixels.begin(), linear_of_srgb<float>);
    image.layers.push_back(std::move(layer));
  }
}

}  // namespace

Image read_image(const std::string& path) {
  OIIO::ImageSpec wish;
  wish.attribute("oiio:UnassociatedAlpha", 1);  // colours as they stand in the file
  const auto in = open_image(path, "an image", &wish);
  Image image;
  for (int part = 0; in->seek_subimage(part, 0); ++part) {
    const OIIO::ImageSpec spec = in->spec();
    if (spec.deep || spec.depth > 1)
      throw FileError(path, "holds deep or three-dimensional pixels, which are not read");
    check_image_size(path, *in, std::filesystem::file_size(path));
    if (part == 0) {
      image.width = spec.width, image.height = spec.height, image.x0 = spec.x, image.y0 = spec.y;
      image.frame_width = spec.full_width, image.frame_height = spec.full_height;
      for (const auto& attribute : spec.extra_attribs) {
        const std::string name = attribute.name().string();
        if (name.rfind(kAttributePrefix, 0) == 0 && attribute.type() == OIIO::TypeDesc::STRING)
          image.attributes[name.substr(sizeof(kAttributePrefix) - 1)] = attribute.get_string();
      }
    } else if (spec.width != image.width || spec.height != image.height || spec.x != image.x0 || spec.y != image.y0) {
      continue;  // thumbnails and the like
    }
    add_layers(path, *in, part, image);
  }
  return image;
}

}  // namespace lumicut::io::oiio
