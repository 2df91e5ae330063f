// The film: named planes of floats over the crop, row 0 on top.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

enum class Channel : uint32_t {
  radiance,
  alpha,
  depth,
  normal,
  albedo,
  position,
  cut_size,
  rays,
  bounds,
  error,
  illuminance,
  residual,
  denoising_albedo,
  denoising_normal,
  denoising_depth,
  denoising_color,
  denoised,
  denoised_error
};
// Those that only a film that is denoised has.
constexpr bool of_denoising(Channel c) { return c >= Channel::residual; }
// Those of them that follow from all iterations together.
constexpr bool made_by_denoising(Channel c) { return c >= Channel::denoising_color; }

struct ChannelInfo {
  Channel channel;
  const char* name;
  uint32_t components;
  const char* description;
};
// All channels, in the order of the enum.
std::span<const ChannelInfo> channel_table();

struct Rect {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
  bool operator==(const Rect&) const = default;
  LUMICUT_FIELDS(Rect, x0, y0, x1, y1)
};

// Bytes of a film for each pixel.
uint64_t film_pixel_bytes(size_t groups, bool denoised);

class Film {
 public:
  // `groups`: light groups that have a plane of radiance of their own, rising.
  explicit Film(Rect crop, std::vector<uint32_t> groups = {}, bool denoised = false);
  const Rect& crop() const { return crop_; }
  bool has(Channel channel) const { return !planes_[static_cast<size_t>(channel)].empty(); }
  const std::vector<uint32_t>& groups() const { return groups_; }
  // Radiance that the light of one group brings; `index` into groups().
  float* group_pixel(size_t index, uint32_t x, uint32_t y) {
    return const_cast<float*>(std::as_const(*this).group_pixel(index, x, y));
  }
  const float* group_pixel(size_t index, uint32_t x, uint32_t y) const {
    return group_planes_[index].data() + 3 * (static_cast<size_t>(y - crop_.y0) * crop_.width() + (x - crop_.x0));
  }
  // Pixel in image coordinates; components as in channel_table.
  float* pixel(Channel channel, uint32_t x, uint32_t y) {
    return const_cast<float*>(std::as_const(*this).pixel(channel, x, y));
  }
  const float* pixel(Channel channel, uint32_t x, uint32_t y) const {
    const auto c = static_cast<size_t>(channel);
    return planes_[c].data() +
           (static_cast<size_t>(y - crop_.y0) * crop_.width() + (x - crop_.x0)) * channel_table()[c].components;
  }
  void set(Channel channel, uint32_t x, uint32_t y, const Rgb& v) {
    float* p = pixel(channel, x, y);
    p[0] = v.x, p[1] = v.y, p[2] = v.z;
  }
  void set(Channel channel, uint32_t x, uint32_t y, float v) { *pixel(channel, x, y) = v; }
  // All planes as bytes, and back: false where the size does not fit.
  void save(std::vector<uint8_t>& out) const;
  bool load(std::span<const uint8_t> bytes);
  // Copies a rectangle inside the crop, rows packed. `out` holds width·height·components floats.
  void read(Channel channel, const Rect& rect, float* out) const;

 private:
  Rect crop_;
  std::vector<float> planes_[18];
  std::vector<uint32_t> groups_;
  std::vector<std::vector<float>> group_planes_;
};

}  // namespace lumicut
