#include "film/film.h"

#include <algorithm>
#include <cstring>

#include "core/current_work.h"
#include "core/error.h"

namespace lumicut {

std::span<const ChannelInfo> channel_table() {
  static constexpr ChannelInfo table[] = {
      {Channel::radiance, "radiance", 3, "Radiance, linear Rec.709, W/(sr m2)"},
      {Channel::alpha, "alpha", 1, "Share of the pixel that geometry covers"},
      {Channel::depth, "depth", 1, "Distance along the camera's axis, scene units; 0 where nothing is hit"},
      {Channel::normal, "normal", 3, "Shading normal in world space, turned to the viewer"},
      {Channel::albedo, "albedo", 3, "Diffuse and specular reflectance"},
      {Channel::position, "position", 3, "World position, scene units"},
      {Channel::cut_size, "cut_size", 1, "Clusters or lights summed, a sample"},
      {Channel::rays, "rays", 1, "Shadow rays, a sample"},
      {Channel::bounds, "bounds", 1, "Error bounds evaluated, a sample"},
      {Channel::error, "error", 1,
       "Half the width of the confidence interval of the luminance, W/(sr m2); 0 before two passes"},
      {Channel::illuminance, "illuminance", 1, "Illuminance of the side that is seen, lux; 0 unless asked for"},
      {Channel::residual, "residual", 3,
       "Part of the radiance whose noise is each pixel's own, W/(sr m2); 0 unless denoised"},
      {Channel::denoising_albedo, "denoising_albedo", 3,
       "Reflectance of what is seen, by way of mirrors and smooth glass too; 0 unless denoised"},
      {Channel::denoising_normal, "denoising_normal", 3,
       "Its normal in world space, mean over the pixel; 0 unless denoised"},
      {Channel::denoising_depth, "denoising_depth", 1,
       "Way to it along the camera's axis, scene units, mean over the pixel; 0 unless denoised"},
      {Channel::denoising_color, "denoising_color", 3,
       "Radiance with fireflies spread over their surroundings: a denoiser's input; 0 unless denoised"},
      {Channel::denoised, "denoised", 3, "Denoised radiance; before the last pass the plain one; 0 unless denoised"},
      {Channel::denoised_error, "denoised_error", 1,
       "As error, of the denoised radiance, with what denoising blurs; 0 unless denoised"},
  };
  return table;
}

uint64_t film_pixel_bytes(size_t groups, bool denoised) {
  uint64_t components = 3 * groups;
  for (const ChannelInfo& c : channel_table())
    if (denoised || !of_denoising(c.channel)) components += c.components;
  return components * sizeof(float);
}

Film::Film(Rect crop, std::vector<uint32_t> groups, bool denoised) : crop_(crop), groups_(std::move(groups)) {
  const size_t pixels = size_t{crop.width()} * crop.height();
  const auto clear = [&](std::vector<float>& plane, size_t components) {
    if (const Progress* work = CurrentWork::progress()) work->check();  // a plane may have hundreds of megabytes
    plane.assign(pixels * components, 0.0f);
  };
  for (const ChannelInfo& c : channel_table())
    if (denoised || !of_denoising(c.channel)) clear(planes_[static_cast<size_t>(c.channel)], c.components);
  group_planes_.resize(groups_.size());
  for (std::vector<float>& plane : group_planes_) clear(plane, 3);
}

template <typename Planes, typename Groups, typename Fn>
static void for_each_plane(Planes& planes, Groups& groups, Fn&& fn) {
  for (auto& plane : planes) fn(plane);
  for (auto& plane : groups) fn(plane);
}

void Film::save(std::vector<uint8_t>& out) const {
  for_each_plane(planes_, group_planes_, [&](const std::vector<float>& plane) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(plane.data());
    out.insert(out.end(), bytes, bytes + plane.size() * sizeof(float));
  });
}

bool Film::load(std::span<const uint8_t> bytes) {
  size_t size = 0;
  for_each_plane(planes_, group_planes_,
                 [&](const std::vector<float>& plane) { size += plane.size() * sizeof(float); });
  if (bytes.size() != size) return false;
  for_each_plane(planes_, group_planes_, [&](std::vector<float>& plane) {
    std::copy_n(bytes.data(), plane.size() * sizeof(float), reinterpret_cast<uint8_t*>(plane.data()));
    bytes = bytes.subspan(plane.size() * sizeof(float));
  });
  return true;
}

void Film::read(Channel channel, const Rect& rect, float* out) const {
  if (rect.x0 < crop_.x0 || rect.y0 < crop_.y0 || rect.x1 > crop_.x1 || rect.y1 > crop_.y1 || rect.x0 > rect.x1 ||
      rect.y0 > rect.y1)
    fail_argument("rectangle (" + std::to_string(rect.x0) + ", " + std::to_string(rect.y0) + ", " +
                  std::to_string(rect.x1) + ", " + std::to_string(rect.y1) + ") is not inside the crop");
  const auto c = static_cast<size_t>(channel);
  const size_t components = channel_table()[c].components;
  const size_t row = size_t{rect.width()} * components;
  if (!has(channel)) return std::fill_n(out, row * rect.height(), 0.0f), void();
  for (uint32_t y = rect.y0; y < rect.y1; ++y) {
    const size_t first = (size_t{y - crop_.y0} * crop_.width() + (rect.x0 - crop_.x0)) * components;
    std::memcpy(out + (y - rect.y0) * row, planes_[c].data() + first, row * sizeof(float));
  }
}

}  // namespace lumicut
