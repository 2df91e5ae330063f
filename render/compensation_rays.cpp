#include "render/compensation_rays.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/parallel.h"
#include "film/coarse_plane.h"

namespace lumicut {

namespace {

constexpr uint8_t kFirst = 2;         // of the first iteration
constexpr float kShare = 2.0f;        // of a pixel of mean noise
constexpr size_t kBlur = 1;           // in blocks of 4x4: noise of one pixel says little
constexpr float kLeastLight = 0.25f;  // of the image's mean: darker places are seen as this

float light_of(const Film& film, uint32_t x, uint32_t y) {
  const float* r = film.pixel(Channel::radiance, x, y);
  return luminance(Rgb{r[0], r[1], r[2]});
}

// Squared distance from the mean of the pixel and those around it, for one iteration alone says nothing of its noise.
float stands_out(const Film& film, uint32_t x, uint32_t y) {
  const Rect& c = film.crop();
  float sum = 0.0f, own = 0.0f;
  int count = 0;
  for (uint32_t v = std::max(c.y0 + 1, y) - 1; v < std::min(c.y1, y + 2); ++v)
    for (uint32_t u = std::max(c.x0 + 1, x) - 1; u < std::min(c.x1, x + 2); ++u, ++count) {
      const float light = light_of(film, u, v);
      if (u == x && v == y) own = light;
      sum += light;
    }
  const float away = own - sum / static_cast<float>(count);
  return away * away;
}

// Of value(x, y) over all pixels: rows by all threads, their sums in order.
template <typename Fn>
float mean_over(size_t width, size_t height, const Progress& progress, const Fn& value) {
  std::vector<double> rows(height);
  parallel_chunks(height, 16, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    for (size_t y = begin; y < end; ++y)
      for (size_t x = 0; x < width; ++x) rows[y] += value(x, y);
  });
  progress.check();
  return static_cast<float>(std::accumulate(rows.begin(), rows.end(), 0.0) / static_cast<double>(width * height));
}

}  // namespace

std::vector<uint8_t> compensation_rays(const IterationMean& mean, const Film& film, uint64_t iterations,
                                       const Progress& progress) {
  const Rect& crop = film.crop();
  const size_t width = crop.width(), height = crop.height();
  if (iterations == 0) return std::vector<uint8_t>(width * height, kFirst);
  const auto at = [&](size_t i, uint32_t from) { return from + static_cast<uint32_t>(i); };
  CoarsePlane variance(width, height), light(width, height);
  variance.fill(progress, [&](size_t x, size_t y) {
    return iterations < 2 ? stands_out(film, at(x, crop.x0), at(y, crop.y0))
                          : static_cast<float>(mean.variance(at(x, crop.x0), at(y, crop.y0), iterations));
  });
  light.fill(progress, [&](size_t x, size_t y) { return light_of(film, at(x, crop.x0), at(y, crop.y0)); });
  variance.blur(kBlur), light.blur(kBlur);
  const float least =
      kLeastLight * mean_over(width, height, progress, [&](size_t x, size_t y) { return light.at(x, y); });
  std::vector<float> noise(width * height);
  const float usual = mean_over(width, height, progress, [&](size_t x, size_t y) {
    const float over = light.at(x, y) + least;
    const float n = over > 0.0f ? std::sqrt(std::max(0.0f, variance.at(x, y))) / over : 0.0f;
    return noise[y * width + x] = std::isfinite(n) ? n : 0.0f;
  });
  std::vector<uint8_t> rays(noise.size(), 1);
  if (!(usual > 0.0f)) return rays;
  for (size_t i = 0; i < noise.size(); ++i)
    rays[i] =
        static_cast<uint8_t>(std::clamp(std::floor(kShare * noise[i] / usual), 1.0f, float{kMostCompensationRays}));
  return rays;
}

}  // namespace lumicut
