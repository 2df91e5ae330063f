// Textures of any format through OpenImageIO.
#include <OpenImageIO/filesystem.h>
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "io/file_error.h"
#include "io/image_module.h"
#include "io/image_size.h"

namespace lumicut::io::oiio {

Texture read_texture(const std::string& path, std::string_view held, TextureUse use, uint32_t flags,
                     const std::string& user) {
  std::error_code code;
  if (held.empty() && !std::filesystem::exists(path, code))
    throw FileError(path, fmt::format("no such texture, wanted by {}", user));
  OIIO::Filesystem::IOMemReader memory(held.data(), held.size());
  const std::string as = "a texture of " + user;
  const auto input = held.empty() ? open_image(path, as) : open_held_image(path, as, held, memory);
  const OIIO::ImageSpec spec = input->spec();
  if (spec.width < 1 || spec.height < 1 || spec.depth > 1 || spec.deep)
    throw FileError(path, fmt::format("a texture of {} x {} x {} pixels cannot be used (by {})", spec.width,
                                      spec.height, spec.depth, user));
  check_image_size(path, *input, held.empty() ? std::filesystem::file_size(path) : held.size());
  if (spec.nchannels < 1 || spec.nchannels > 4)
    throw FileError(path, fmt::format("has {} channels; 1 to 4 can be used (by {})", spec.nchannels, user));

  Texture texture;
  texture.file = path;
  texture.width = static_cast<uint32_t>(spec.width);
  texture.height = static_cast<uint32_t>(spec.height);
  texture.flags = flags;
  // Heights of 16 bits lose their slopes in 8.
  const bool fine = use == TextureUse::numbers && spec.format.basesize() > 1;
  const bool integers = !spec.format.is_floating_point() && use != TextureUse::radiance && !fine;
  const int in = spec.nchannels;
  int first = 0;
  int out = in >= 3 ? 3 : 1;
  if (use == TextureUse::mask) {
    out = 1;
    if (in == 2 || in == 4) first = in - 1;
  }
  if (use == TextureUse::vectors && out != 3)
    throw FileError(path, fmt::format("has {} channels; a normal map (of {}) needs 3", in, user));
  texture.channels = static_cast<uint32_t>(out);
  const size_t pixels = size_t{texture.width} * texture.height;
  const auto read = [&](auto& kept, OIIO::TypeDesc type) {
    std::remove_reference_t<decltype(kept)> all(pixels * static_cast<size_t>(in));
    if (!input->read_image(0, 0, 0, in, type, all.data()))
      throw FileError(path, fmt::format("reading this texture of {} failed: {}", user, input->geterror()));
    if (in == out) {
      kept = std::move(all);
      return;
    }
    kept.resize(pixels * static_cast<size_t>(out));
    for (size_t i = 0; i < pixels; ++i)
      for (int c = 0; c < out; ++c)
        kept[i * static_cast<size_t>(out) + static_cast<size_t>(c)] =
            all[i * static_cast<size_t>(in) + static_cast<size_t>(first + c)];
  };
  if (integers) {
    if (use == TextureUse::colour) texture.flags |= LUMICUT_SRGB;
    if ((texture.flags & LUMICUT_SRGB) == 0) texture.flags &= ~uint32_t{LUMICUT_BLEND_STORED};
    read(texture.bytes, OIIO::TypeDesc::UINT8);
  } else {
    texture.flags &= ~uint32_t{LUMICUT_BLEND_STORED};  // floats are linear
    read(texture.floats, OIIO::TypeDesc::FLOAT);
    // Times the factors that scenes have, light stays finite.
    const float most = use == TextureUse::radiance ? 1e20f : std::numeric_limits<float>::max();
    for (size_t i = 0; i < texture.floats.size(); ++i) {
      const float value = texture.floats[i];
      if (std::isfinite(value) && value >= 0.0f && value <= most) continue;
      const size_t pixel = i / static_cast<size_t>(out);
      throw FileError(path, fmt::format("pixel ({}, {}) is {}; a texture (of {}) must be finite and not negative{}",
                                        pixel % texture.width, pixel / texture.width, value, user,
                                        value > most && std::isfinite(value) ? ", at most 1e20" : ""));
    }
  }
  return texture;
}

}  // namespace lumicut::io::oiio
