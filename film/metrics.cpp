// Image measures: film/metrics.h says what each is and where it departs from the thesis.
#include "film/metrics.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/vec.h"

namespace lumicut {

namespace {

Rgb at(const RgbImage& image, size_t pixel) {
  const float* p = &image.pixels[pixel * 3];
  return {p[0], p[1], p[2]};
}

void check_shape(const RgbImage& image, const char* name) {
  const size_t expected = size_t{3} * image.width * image.height;
  if (expected == 0 || image.pixels.size() != expected)
    fail_argument(std::string(name) + " has " + std::to_string(image.pixels.size()) + " values, but " +
                  std::to_string(image.width) + " x " + std::to_string(image.height) + " pixels need " +
                  std::to_string(expected));
}

void check_shapes(const RgbImage& image, const RgbImage& reference) {
  check_shape(image, "the image");
  check_shape(reference, "the reference");
  if (image.width != reference.width || image.height != reference.height)
    fail_argument("the image has " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                  " pixels, the reference " + std::to_string(reference.width) + " x " +
                  std::to_string(reference.height));
}

double luminance64(const Rgb& c) { return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z; }

float to_display(float value, float exposure) { return std::clamp(value * exposure, 0.0f, 1.0f); }

// Nearest rank: the smallest value that at least the fraction q does not exceed. Reorders `values`.
double percentile(std::vector<double>& values, double q) {
  const auto rank = static_cast<size_t>(std::ceil(q * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::max<size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

struct Laplacians {
  double difference2 = 0, reference2 = 0;
};

// Sums of squared Laplacians over pixels whose whole five-point stencil counts.
Laplacians laplacians(const RgbImage& image, const RgbImage& reference, const std::vector<uint8_t>& counts) {
  Laplacians sums;
  const size_t w = image.width, h = image.height;
  for (size_t y = 1; y + 1 < h; ++y)
    for (size_t x = 1; x + 1 < w; ++x) {
      const size_t p = y * w + x;
      if (!(counts[p] && counts[p - 1] && counts[p + 1] && counts[p - w] && counts[p + w])) continue;
      for (size_t c = 0; c < 3; ++c) {
        const auto laplacian = [&](const RgbImage& f) {
          const auto v = [&](size_t q) { return double{f.pixels[q * 3 + c]}; };
          return v(p + 1) + v(p - 1) + v(p + w) + v(p - w) - 4 * v(p);
        };
        const double r = laplacian(reference), d = laplacian(image) - r;
        sums.difference2 += d * d;
        sums.reference2 += r * r;
      }
    }
  return sums;
}

std::vector<float> exposed(const RgbImage& image, float exposure) {
  std::vector<float> result(image.pixels.size());
  for (size_t i = 0; i < result.size(); ++i) result[i] = image.pixels[i] * exposure;
  return result;
}

}  // namespace

Metrics compare_images(const RgbImage& image, const RgbImage& reference, const MetricOptions& options) {
  check_shapes(image, reference);
  const size_t n = size_t{image.width} * image.height;
  Metrics m;
  std::vector<uint8_t> counts(n, 0);
  double reference_sum = 0, luminance_sum = 0, difference_sum = 0;
  for (size_t p = 0; p < n; ++p) {
    const Rgb f = at(image, p), r = at(reference, p);
    if (!is_finite(f) || !is_finite(r)) {
      ++m.bad_pixels;
      continue;
    }
    if (luminance64(r) >= double{options.ignore_above}) {
      ++m.ignored;
      continue;
    }
    counts[p] = 1;
    ++m.pixels;
    reference_sum += double{r.x} + r.y + r.z;
    luminance_sum += luminance64(r);
    difference_sum += luminance64(f) - luminance64(r);
  }
  if (m.pixels == 0)
    fail_argument("no pixel can be compared: " + std::to_string(m.bad_pixels) + " are not finite, " +
                  std::to_string(m.ignored) + " are at or above ignore_above");
  const auto pixels = static_cast<double>(m.pixels);
  m.reference_mean = reference_sum / (3 * pixels);
  const double luminance_mean = luminance_sum / pixels;
  m.exposure = options.exposure > 0 ? double{options.exposure} : double{auto_exposure(reference)};
  const auto exposure = static_cast<float>(m.exposure);

  // A floor of 0 (a black reference) would divide by 0: then any difference counts as itself.
  const double floor = luminance_mean > 0 ? 1e-3 * luminance_mean : 1;
  const double channel_floor = m.reference_mean > 0 ? 1e-3 * m.reference_mean : 1;
  std::vector<double> relative;
  relative.reserve(m.pixels);
  double square = 0, display_square = 0, channels = 0, relative_sum = 0, relative_square = 0, symmetric = 0;
  for (size_t p = 0; p < n; ++p) {
    if (!counts[p]) continue;
    const Rgb f = at(image, p), r = at(reference, p);
    for (int c = 0; c < 3; ++c) {
      const double d = double{f[c]} - r[c];
      square += d * d;
      channels += std::abs(d) / std::max(double{r[c]}, channel_floor);
      const double shown = double{to_display(f[c], exposure)} - to_display(r[c], exposure);
      display_square += shown * shown;
    }
    const double lf = luminance64(f), lr = luminance64(r);
    const double e = std::abs(lf - lr) / std::max(lr, floor);
    relative.push_back(e);
    relative_sum += e;
    relative_square += e * e;
    const double both = std::abs(lf) + std::abs(lr);
    if (both > 0) symmetric += std::abs(lf - lr) / both;
  }
  m.rmse_absolute = std::sqrt(square / (3 * pixels));
  m.rmse = m.rmse_absolute / (m.reference_mean > 0 ? m.reference_mean : 1);
  m.rmse_display = std::sqrt(display_square / (3 * pixels));
  m.mean_relative_error = relative_sum / pixels;
  m.mean_relative_error_channels = channels / (3 * pixels);
  m.mrse = relative_square / pixels;
  m.smape = symmetric / pixels;
  m.bias = difference_sum / (luminance_sum > 0 ? luminance_sum : pixels);
  m.p95_relative_error = percentile(relative, 0.95);
  m.p99_relative_error = percentile(relative, 0.99);
  m.max_relative_error = *std::max_element(relative.begin(), relative.end());
  const Laplacians sums = laplacians(image, reference, counts);
  m.lmse = sums.difference2 == 0 ? 0 : sums.difference2 / (sums.reference2 > 0 ? sums.reference2 : 1);

  if (options.flip || options.hdr_flip) {
    // What does not count must not bleed into its neighbours: the same in both images.
    std::vector<float> a(image.pixels.begin(), image.pixels.end()), b(reference.pixels.begin(), reference.pixels.end());
    for (size_t p = 0; p < n; ++p)
      if (!counts[p])
        for (size_t c = 0; c < 3; ++c) a[p * 3 + c] = b[p * 3 + c] = is_finite(at(reference, p)) ? b[p * 3 + c] : 0.0f;
    const RgbImage x{a, image.width, image.height}, y{b, image.width, image.height};
    const auto mean = [&](const std::vector<float>& flip) {
      double sum = 0;
      for (size_t p = 0; p < n; ++p) sum += counts[p] ? double{flip[p]} : 0.0;
      return sum / pixels;
    };
    if (options.hdr_flip) m.hdr_flip = mean(hdr_flip_image(x, y, options.pixels_per_degree).image);
    if (options.flip) {
      const auto ea = exposed(x, exposure), eb = exposed(y, exposure);
      m.flip =
          mean(flip_image({ea, image.width, image.height}, {eb, image.width, image.height}, options.pixels_per_degree));
    }
  }
  return m;
}

float auto_exposure(const RgbImage& image) {
  check_shape(image, "the image");
  const size_t n = size_t{image.width} * image.height;
  double greatest = 0;
  for (size_t p = 0; p < n; ++p)
    if (is_finite(at(image, p))) greatest = std::max(greatest, luminance64(at(image, p)));
  double sum = 0;
  uint64_t count = 0;
  for (size_t p = 0; p < n; ++p) {
    const double l = luminance64(at(image, p));
    if (std::isfinite(l) && l > 1e-6 * greatest) sum += std::log(l), ++count;
  }
  if (count == 0) return 1.0f;
  const auto exposure = static_cast<float>(0.18 / std::exp(sum / static_cast<double>(count)));
  return std::isfinite(exposure) && exposure > 0 ? exposure : 1.0f;
}

std::vector<uint8_t> to_srgb8(const RgbImage& image, float exposure) {
  check_shape(image, "the image");
  std::vector<uint8_t> result(image.pixels.size());
  const auto code = [&](float linear) {
    const float v = to_display(linear, exposure);
    const float srgb = v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1.0f / 2.4f) - 0.055f;
    return static_cast<uint8_t>(srgb * 255.0f + 0.5f);
  };
  for (size_t p = 0; p < result.size() / 3; ++p) {
    const Rgb c = at(image, p);
    const bool nan = std::isnan(c.x) || std::isnan(c.y) || std::isnan(c.z);
    for (int k = 0; k < 3; ++k) result[p * 3 + static_cast<size_t>(k)] = nan ? (k == 1 ? 0 : 255) : code(c[k]);
  }
  return result;
}

std::vector<float> relative_error_image(const RgbImage& image, const RgbImage& reference) {
  check_shapes(image, reference);
  const size_t n = size_t{image.width} * image.height;
  const auto counts = [&](size_t p) { return is_finite(at(image, p)) && is_finite(at(reference, p)); };
  double sum = 0, pixels = 0;
  for (size_t p = 0; p < n; ++p)
    if (counts(p)) sum += luminance64(at(reference, p)), ++pixels;
  const double floor = sum > 0 ? 1e-3 * sum / pixels : 1;
  std::vector<float> result(n, std::numeric_limits<float>::quiet_NaN());
  for (size_t p = 0; p < n; ++p) {
    if (!counts(p)) continue;
    const double r = luminance64(at(reference, p));
    result[p] = static_cast<float>((luminance64(at(image, p)) - r) / std::max(r, floor));
  }
  return result;
}

std::vector<float> error_image(const RgbImage& image, const RgbImage& reference, float exposure, float scale) {
  check_shapes(image, reference);
  const size_t n = size_t{image.width} * image.height;
  std::vector<float> result(n);
  for (size_t p = 0; p < n; ++p) {
    const Rgb d = at(image, p) - at(reference, p);
    result[p] = is_finite(d) ? std::clamp(length(d) * exposure * scale, 0.0f, 1.0f) : 1.0f;
  }
  return result;
}

}  // namespace lumicut
