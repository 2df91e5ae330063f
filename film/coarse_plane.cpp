#include "film/coarse_plane.h"

namespace lumicut {

namespace {

// Means over [i − radius, i + radius] of `count` values that lie `stride` apart, in double: sums run along.
void box(const float* in, float* out, size_t count, size_t stride, size_t radius) {
  double sum = 0.0;
  size_t first = 0, last = 0;  // of what is in the sum
  for (size_t i = 0; i < count; ++i) {
    for (; last < std::min(count, i + radius + 1); ++last) sum += static_cast<double>(in[last * stride]);
    for (; first + radius < i; ++first) sum -= static_cast<double>(in[first * stride]);
    out[i * stride] = static_cast<float>(sum / static_cast<double>(last - first));
  }
}

}  // namespace

void CoarsePlane::blur(size_t radius) {
  for (int i = 0; i < 2; ++i) {
    parallel_chunks(height_, 16, [&](size_t begin, size_t end) {
      for (size_t y = begin; y < end; ++y) box(&values_[y * width_], &other_[y * width_], width_, 1, radius);
    });
    parallel_chunks(width_, 16, [&](size_t begin, size_t end) {
      for (size_t x = begin; x < end; ++x) box(&other_[x], &values_[x], height_, width_, radius);
    });
  }
}

float CoarsePlane::at(size_t x, size_t y) const {
  // Centres of blocks lie at 1.5, 5.5, ...
  const auto place = [](size_t i, size_t count, size_t& low, size_t& high) {
    const float at = (static_cast<float>(i) - 1.5f) / static_cast<float>(kBlock);
    const float floor = at < 0.0f ? 0.0f : at;
    low = std::min(count - 1, static_cast<size_t>(floor)), high = std::min(count - 1, low + 1);
    return floor - static_cast<float>(low);
  };
  size_t x0, x1, y0, y1;
  const float u = place(x, width_, x0, x1), v = std::min(1.0f, place(y, height_, y0, y1));
  const auto row = [&](size_t line) {
    const float* values = &values_[line * width_];
    return values[x0] + (values[x1] - values[x0]) * std::min(1.0f, u);
  };
  const float above = row(y0), below = row(y1);
  return above + (below - above) * v;
}

}  // namespace lumicut
