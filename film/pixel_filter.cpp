#include "film/pixel_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lumicut {

namespace {

// The outermost step reaches from a filter's last quantile to its end, and takes it for even: with 1,024 of them the
// Gaussian's variance is 2 % too large.
constexpr size_t kSteps = 16384;

// Half of its support, pixels.
double reach(const PixelFilter& f) {
  switch (f.kind) {
    case PixelFilter::Kind::gaussian:
      return 1.5 * static_cast<double>(f.width);
    case PixelFilter::Kind::blackman_harris:
      return static_cast<double>(f.width);
    case PixelFilter::Kind::box:
      break;
  }
  return 0.5 * static_cast<double>(f.width);
}

double value(const PixelFilter& f, double x) {
  const auto width = static_cast<double>(f.width);
  switch (f.kind) {
    case PixelFilter::Kind::gaussian:
      return std::exp(-2.0 * (2.0 * x / width) * (2.0 * x / width));
    case PixelFilter::Kind::blackman_harris: {  // over its support of two widths
      const double t = 2.0 * std::numbers::pi * (0.5 + 0.5 * x / width);
      return 0.35875 - 0.48829 * std::cos(t) + 0.14128 * std::cos(2 * t) - 0.01168 * std::cos(3 * t);
    }
    case PixelFilter::Kind::box:
      break;
  }
  return 1.0;
}

}  // namespace

FilterSampler::FilterSampler(const PixelFilter& filter) {
  if (filter == PixelFilter{}) return;
  constexpr size_t kCells = 8192;
  const double most = reach(filter), cell = 2.0 * most / kCells;
  std::vector<double> sums(kCells + 1, 0.0);
  for (size_t i = 0; i < kCells; ++i)
    sums[i + 1] = sums[i] + std::max(0.0, value(filter, (static_cast<double>(i) + 0.5) * cell - most));
  inverse_.resize(kSteps + 1);
  size_t at = 0;
  for (size_t k = 0; k <= kSteps; ++k) {
    const double wanted = sums.back() * static_cast<double>(k) / kSteps;
    while (at + 1 < kCells && sums[at + 1] < wanted) ++at;
    const double within = sums[at + 1] > sums[at] ? (wanted - sums[at]) / (sums[at + 1] - sums[at]) : 0.5;
    inverse_[k] = static_cast<float>((static_cast<double>(at) + std::clamp(within, 0.0, 1.0)) * cell - most);
  }
  // Even to the last bit: a sample at the middle lies at the centre.
  for (size_t k = 0; k < kSteps / 2; ++k) inverse_[kSteps - k] = -inverse_[k];
  inverse_[kSteps / 2] = 0.0f;
}

float FilterSampler::offset(float u) const {
  if (inverse_.empty()) return u - 0.5f;
  const float x = u * kSteps;
  const size_t i = std::min(static_cast<size_t>(x), kSteps - 1);
  return inverse_[i] + (inverse_[i + 1] - inverse_[i]) * (x - static_cast<float>(i));
}

}  // namespace lumicut
