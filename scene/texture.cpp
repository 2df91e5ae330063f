#include "scene/texture.h"

#include <string>

#include "core/error.h"

namespace lumicut {

namespace {
float srgb_to_linear(float s) { return s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f); }

const float* srgb_table() {
  static const auto table = [] {
    std::vector<float> t(256);
    for (int i = 0; i < 256; ++i) t[i] = srgb_to_linear(static_cast<float>(i) / 255.0f);
    return t;
  }();
  return table.data();
}
}  // namespace

Texture::Texture(uint32_t width, uint32_t height, uint32_t channels, Format format, Options options, const void* pixels)
    : width_(width), height_(height), channels_(channels), format_(format), options_(options) {
  if (width == 0 || width > 65536) fail_argument("texture width " + std::to_string(width) + " is not in 1..65536");
  if (height == 0 || height > 65536) fail_argument("texture height " + std::to_string(height) + " is not in 1..65536");
  if (channels < 1 || channels > 4) fail_argument("texture channels " + std::to_string(channels) + " is not in 1..4");
  if (pixels == nullptr) fail_argument("texture pixels is NULL");
  const size_t n = size_t{width} * height * channels;
  if (format == Format::uint8) {
    const auto* p = static_cast<const uint8_t*>(pixels);
    bytes_.assign(p, p + n);
  } else {
    const auto* p = static_cast<const float*>(pixels);
    floats_.assign(p, p + n);
    // A broken texel is black, not a plague that spreads through every bounce.
    for (float& f : floats_)
      if (!std::isfinite(f)) f = 0.0f;
  }
}

Texture::Texture(TextureProgram program)
    : width_(0),
      height_(0),
      channels_(0),
      format_(Format::float32),
      program_(std::make_shared<const TextureProgram>(std::move(program))) {}

float Texture::stored(size_t i) const {
  return format_ == Format::uint8 ? static_cast<float>(bytes_[i]) * (1.0f / 255.0f) : floats_[i];
}

float Texture::value(uint32_t x, uint32_t y, uint32_t channel) const {
  const size_t i = (size_t{y} * width_ + x) * channels_ + channel;
  const bool alpha = has_alpha() && channel == channels_ - 1;
  if (!options_.srgb || alpha) return stored(i);
  return format_ == Format::uint8 ? srgb_table()[bytes_[i]] : srgb_to_linear(floats_[i]);
}

Rgb Texture::texel(uint32_t x, uint32_t y) const {
  if (channels_ < 3) {
    const float g = value(x, y, 0);
    return {g, g, g};
  }
  return {value(x, y, 0), value(x, y, 1), value(x, y, 2)};
}

template <typename Fetch>
auto Texture::filter(float u, float v, Fetch fetch) const {
  const auto wrap = [&](int64_t i, uint32_t size) {
    if (options_.clamp) return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, size - 1));
    const int64_t m = i % size;
    return static_cast<uint32_t>(m < 0 ? m + size : m);
  };
  const auto place = [&](float t) {  // keep huge and broken coordinates in a range that converts to integers
    if (!std::isfinite(t)) return 0.0f;
    return options_.clamp ? std::clamp(t, -1.0f, 2.0f) : t - std::floor(t);
  };
  const float x = place(u) * static_cast<float>(width_), y = (1.0f - place(v)) * static_cast<float>(height_);
  if (options_.nearest)
    return fetch(wrap(static_cast<int64_t>(std::floor(x)), width_), wrap(static_cast<int64_t>(std::floor(y)), height_));
  const float fx = std::floor(x - 0.5f), fy = std::floor(y - 0.5f);
  const float wx = x - 0.5f - fx, wy = y - 0.5f - fy;
  const auto ix = static_cast<int64_t>(fx), iy = static_cast<int64_t>(fy);
  const uint32_t x0 = wrap(ix, width_), x1 = wrap(ix + 1, width_), y0 = wrap(iy, height_), y1 = wrap(iy + 1, height_);
  return (fetch(x0, y0) * (1 - wx) + fetch(x1, y0) * wx) * (1 - wy) +
         (fetch(x0, y1) * (1 - wx) + fetch(x1, y1) * wx) * wy;
}

Rgb Texture::color(float u, float v) const {
  if (options_.blend_stored && !options_.nearest) {
    const Rgb c = filter(u, v, [&](uint32_t x, uint32_t y) {
      const size_t i = (size_t{y} * width_ + x) * channels_;
      return channels_ < 3 ? Rgb{1, 1, 1} * stored(i) : Rgb{stored(i), stored(i + 1), stored(i + 2)};
    });
    return {srgb_to_linear(c.x), srgb_to_linear(c.y), srgb_to_linear(c.z)};
  }
  return filter(u, v, [&](uint32_t x, uint32_t y) { return texel(x, y); });
}

Rgb Texture::by_view(float cosine, bool behind) const {
  const auto half = static_cast<float>(width_ / 2);
  const float step = std::min(1.0f, std::max(0.0f, cosine)) * (half - 1.0f);
  return color((behind ? half - 0.5f - step : half + 0.5f + step) / static_cast<float>(width_), 0.5f);
}

float Texture::mask(float u, float v) const {
  return filter(u, v, [&](uint32_t x, uint32_t y) {
    if (channels_ == 1) return value(x, y, 0);
    if (has_alpha()) return value(x, y, channels_ - 1);
    return (value(x, y, 0) + value(x, y, 1) + value(x, y, 2)) * (1.0f / 3.0f);
  });
}

Rgb Texture::average() const {
  Vec3d sum{};
  for (uint32_t y = 0; y < height_; ++y)
    for (uint32_t x = 0; x < width_; ++x) {
      const Rgb c = texel(x, y);
      sum += Vec3d{c.x, c.y, c.z};
    }
  const double n = 1.0 / (static_cast<double>(width_) * height_);
  return {static_cast<float>(sum.x * n), static_cast<float>(sum.y * n), static_cast<float>(sum.z * n)};
}

}  // namespace lumicut
