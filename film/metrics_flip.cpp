// LDR-FLIP: a difference evaluator for alternating images. [Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström,
// Fairchild 2020, Proc. ACM Comput. Graph. Interact. Tech. 3(2)] Sections and equations below are that paper's.
// Departs: takes linear RGB (the paper decodes sRGB first); borders repeat the outermost pixel.
// HDR-FLIP: [Andersson, Nilsson, Shirley, Akenine-Möller 2021, Visualizing Errors in Rendered High Dynamic Range Images]
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/vec.h"
#include "film/metrics.h"

namespace lumicut {

namespace {

constexpr double kPi = 3.14159265358979323846;

// ---- Colour spaces. Reference white: that of linear (1, 1, 1), D65 ----

constexpr double kRgbToXyz[3][3] = {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
                                    {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
                                    {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};

Vec3d white() {
  Vec3d w;
  for (int r = 0; r < 3; ++r) w[r] = kRgbToXyz[r][0] + kRgbToXyz[r][1] + kRgbToXyz[r][2];
  return w;
}
const Vec3d kWhite = white();

// XYZ of a linear colour, divided by that of white.
Vec3d to_relative_xyz(const Vec3d& rgb) {
  Vec3d xyz;
  for (int r = 0; r < 3; ++r)
    xyz[r] = (kRgbToXyz[r][0] * rgb.x + kRgbToXyz[r][1] * rgb.y + kRgbToXyz[r][2] * rgb.z) / kWhite[r];
  return xyz;
}

Vec3d to_rgb(const Vec3d& relative_xyz) {
  const auto& m = kRgbToXyz;
  const Vec3d v{relative_xyz.x * kWhite.x, relative_xyz.y * kWhite.y, relative_xyz.z * kWhite.z};
  const Vec3d c0{m[0][0], m[1][0], m[2][0]}, c1{m[0][1], m[1][1], m[2][1]}, c2{m[0][2], m[1][2], m[2][2]};
  const double determinant = dot(c0, cross(c1, c2));  // Cramer's rule
  return {dot(v, cross(c1, c2)) / determinant, dot(c0, cross(v, c2)) / determinant,
          dot(c0, cross(c1, v)) / determinant};
}

// The linear opponent space in which the eye's contrast sensitivity is modelled. (sec. 4.1.1)
Vec3d to_opponent(const Vec3d& rgb) {
  const Vec3d t = to_relative_xyz(rgb);
  return {116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)};
}
Vec3d from_opponent(const Vec3d& ycc) {
  const double y = (ycc.x + 16) / 116;
  return to_rgb({y + ycc.y / 500, y, y - ycc.z / 200});
}

Vec3d to_lab(const Vec3d& rgb) {
  const auto f = [](double t) {
    constexpr double delta = 6.0 / 29;
    return t > delta * delta * delta ? std::cbrt(t) : t / (3 * delta * delta) + 4.0 / 29;
  };
  const Vec3d t = to_relative_xyz(rgb);
  return {116 * f(t.y) - 16, 500 * (f(t.x) - f(t.y)), 200 * (f(t.y) - f(t.z))};
}

// Colours of dark pixels differ less to the eye. (Hunt effect, Eq. 5)
Vec3d hunt(const Vec3d& lab) { return {lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z}; }

double hyab(const Vec3d& a, const Vec3d& b) { return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z); }

// ---- Separable filters ----

using Plane = std::vector<double>;
struct Size {
  int width, height;
};

// Both axes, borders repeated; kernels have odd lengths.
Plane filter(const Plane& in, Size size, const std::vector<double>& along_x, const std::vector<double>& along_y) {
  const auto pass = [&](const Plane& source, const std::vector<double>& kernel, bool horizontal) {
    const int radius = static_cast<int>(kernel.size() / 2);
    Plane out(source.size());
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        double sum = 0;
        for (int k = -radius; k <= radius; ++k) {
          const int sx = horizontal ? std::clamp(x + k, 0, size.width - 1) : x;
          const int sy = horizontal ? y : std::clamp(y + k, 0, size.height - 1);
          sum += kernel[static_cast<size_t>(k + radius)] *
                 source[static_cast<size_t>(sy) * static_cast<size_t>(size.width) + static_cast<size_t>(sx)];
        }
        out[static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)] = sum;
      }
    return out;
  };
  return pass(pass(in, along_x, true), along_y, false);
}

std::vector<double> sampled(int radius, const auto& function) {
  std::vector<double> kernel;
  for (int k = -radius; k <= radius; ++k) kernel.push_back(function(static_cast<double>(k)));
  return kernel;
}

double sum_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum;
}

std::vector<double> scaled(std::vector<double> values, double factor) {
  for (double& v : values) v *= factor;
  return values;
}

// Contrast sensitivity as one or two Gaussians a√(π/b)·exp(-π²x²/b), x in degrees. (Table 1)
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kSensitivity[3] = {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};

// ---- The two pipelines ----

struct Opponent {
  Plane channel[3];
};

Opponent opponent_planes(const RgbImage& image) {
  const size_t n = size_t{image.width} * image.height;
  Opponent planes;
  for (auto& plane : planes.channel) plane.resize(n);
  for (size_t p = 0; p < n; ++p) {
    Vec3d rgb;
    for (int c = 0; c < 3; ++c) {
      const float v = image.pixels[p * 3 + static_cast<size_t>(c)];
      rgb[c] = std::isnan(v) ? 0.0 : std::clamp(double{v}, 0.0, 1.0);
    }
    const Vec3d ycc = to_opponent(rgb);
    for (int c = 0; c < 3; ++c) planes.channel[c][p] = ycc[c];
  }
  return planes;
}

// What the eye sees of the colours at this distance, in Hunt-adjusted L*a*b*. (sec. 4.1.1-2)
std::vector<Vec3d> perceived_colours(const Opponent& planes, Size size, double pixels_per_degree) {
  double widest = 0;
  for (const auto& s : kSensitivity) widest = std::max({widest, s.b1, s.b2});
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(widest / (2 * kPi * kPi)) * pixels_per_degree));
  std::vector<Vec3d> colours(planes.channel[0].size());
  for (int c = 0; c < 3; ++c) {
    const Sensitivity& s = kSensitivity[c];
    const auto gaussian = [&](double b) {
      return sampled(
          radius, [&](double k) { return std::exp(-kPi * kPi * k * k / (pixels_per_degree * pixels_per_degree * b)); });
    };
    const auto g1 = gaussian(s.b1), g2 = gaussian(s.b2);
    const double w1 = s.a1 * std::sqrt(kPi / s.b1), w2 = s.a2 * std::sqrt(kPi / s.b2);
    const double total = w1 * sum_of(g1) * sum_of(g1) + w2 * sum_of(g2) * sum_of(g2);
    Plane seen = filter(planes.channel[c], size, scaled(g1, w1 / total), g1);
    if (w2 > 0) {
      const Plane second = filter(planes.channel[c], size, scaled(g2, w2 / total), g2);
      for (size_t p = 0; p < seen.size(); ++p) seen[p] += second[p];
    }
    for (size_t p = 0; p < seen.size(); ++p) colours[p][c] = seen[p];
  }
  for (auto& colour : colours) {
    Vec3d rgb = from_opponent(colour);
    for (int c = 0; c < 3; ++c) rgb[c] = std::clamp(rgb[c], 0.0, 1.0);
    colour = hunt(to_lab(rgb));
  }
  return colours;
}

// Strengths of edges and of points of the luminance. (sec. 4.2)
struct Features {
  Plane edges, points;
};

Features find_features(const Opponent& planes, Size size, double pixels_per_degree) {
  Plane y = planes.channel[0];
  for (double& v : y) v = (v + 16) / 116;
  constexpr double kWidth = 0.082;  // degrees
  const double deviation = 0.5 * kWidth * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * deviation));
  const auto g = sampled(radius, [&](double k) { return std::exp(-k * k / (2 * deviation * deviation)); });
  // Positive weights sum to 1, negative ones to -1.
  const auto normalised = [&](std::vector<double> kernel) {
    double positive = 0, negative = 0;
    for (const double v : kernel) (v > 0 ? positive : negative) += v;
    positive *= sum_of(g), negative *= sum_of(g);
    for (double& v : kernel) v /= v > 0 ? positive : -negative;
    return kernel;
  };
  const auto edge =
      normalised(sampled(radius, [&](double k) { return -k * std::exp(-k * k / (2 * deviation * deviation)); }));
  const auto dot_like = normalised(sampled(radius, [&](double k) {
    const double t = k * k / (deviation * deviation);
    return (t - 1) * std::exp(-0.5 * t);
  }));
  const auto strength = [&](const std::vector<double>& kernel) {
    Plane x = filter(y, size, kernel, g);
    const Plane other = filter(y, size, g, kernel);
    for (size_t p = 0; p < x.size(); ++p) x[p] = std::hypot(x[p], other[p]);
    return x;
  };
  return {strength(edge), strength(dot_like)};
}

}  // namespace

std::vector<float> flip_image(const RgbImage& image, const RgbImage& reference, float pixels_per_degree) {
  const size_t n = size_t{reference.width} * reference.height;
  if (n == 0 || image.width != reference.width || image.height != reference.height || image.pixels.size() != 3 * n ||
      reference.pixels.size() != 3 * n)
    fail_argument("FLIP needs two images of one size; they have " + std::to_string(image.pixels.size()) + " and " +
                  std::to_string(reference.pixels.size()) + " values");
  if (!(pixels_per_degree >= 1.0f && pixels_per_degree <= 1000.0f))
    fail_argument("pixels_per_degree is " + std::to_string(pixels_per_degree) + ", but must be 1 to 1000");
  const Size size{static_cast<int>(image.width), static_cast<int>(image.height)};
  const double ppd = double{pixels_per_degree};
  const Opponent a = opponent_planes(image), b = opponent_planes(reference);
  const auto colours_a = perceived_colours(a, size, ppd), colours_b = perceived_colours(b, size, ppd);
  const Features features_a = find_features(a, size, ppd), features_b = find_features(b, size, ppd);

  // Large colour differences are compressed into [pt, 1]. (sec. 4.1.3)
  constexpr double kColourPower = 0.7, kFeaturePower = 0.5, kKnee = 0.4, kKneeValue = 0.95;
  const double greatest = std::pow(hyab(hunt(to_lab({0, 1, 0})), hunt(to_lab({0, 0, 1}))), kColourPower);
  std::vector<float> result(n);
  for (size_t p = 0; p < n; ++p) {
    const double power = std::pow(hyab(colours_a[p], colours_b[p]), kColourPower);
    const double colour = power < kKnee * greatest ? kKneeValue / (kKnee * greatest) * power
                                                   : kKneeValue + (power - kKnee * greatest) /
                                                                      (greatest - kKnee * greatest) * (1 - kKneeValue);
    const double features = std::max(std::abs(features_a.edges[p] - features_b.edges[p]),
                                     std::abs(features_a.points[p] - features_b.points[p]));
    const double feature = std::pow(std::min(features / std::sqrt(2.0), 1.0), kFeaturePower);
    result[p] = static_cast<float>(std::clamp(std::pow(colour, 1 - feature), 0.0, 1.0));
  }
  return result;
}

HdrFlip hdr_flip_image(const RgbImage& image, const RgbImage& reference, float pixels_per_degree) {
  // The ACES curve (k0 x² + k1 x) / (k2 x² + k3 x + k4), with the factor .6 before it.
  constexpr double k0 = 0.36 * 2.51, k1 = 0.6 * 0.03, k2 = 0.36 * 2.43, k3 = 0.6 * 0.59, k4 = 0.14;
  constexpr double kBright = 0.85;  // where the exposures bring the brightest pixel and the median
  constexpr double a = k0 - kBright * k2, b = k1 - kBright * k3, c = -kBright * k4;
  const double bright = (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);

  std::vector<double> luminances;
  for (size_t p = 0; p + 2 < reference.pixels.size(); p += 3) {
    const double l = 0.2126 * reference.pixels[p] + 0.7152 * reference.pixels[p + 1] + 0.0722 * reference.pixels[p + 2];
    if (std::isfinite(l)) luminances.push_back(l);
  }
  HdrFlip result;
  const double greatest = luminances.empty() ? 0 : *std::max_element(luminances.begin(), luminances.end());
  if (greatest > 0) {
    const auto middle = luminances.begin() + static_cast<std::ptrdiff_t>(luminances.size() / 2);
    std::nth_element(luminances.begin(), middle, luminances.end());
    double median = *middle;
    if (luminances.size() % 2 == 0) median = 0.5 * (median + *std::max_element(luminances.begin(), middle));
    // A reference that is mostly black has no end of exposures.
    median = std::max(median, greatest * 0x1p-24);
    result.start = std::log2(bright / greatest), result.stop = std::log2(bright / median);
  }
  result.exposures = std::max(2, static_cast<int>(std::ceil(result.stop - result.start)));
  const auto mapped = [&](const RgbImage& from, double exposure) {
    std::vector<float> to(from.pixels.begin(), from.pixels.end());
    for (float& v : to) {
      const double x = std::max(0.0, double{v} * exposure);  // NaN becomes 0
      v = x < 1e6 ? static_cast<float>(std::min(1.0, (k0 * x * x + k1 * x) / (k2 * x * x + k3 * x + k4))) : 1.0f;
    }
    return to;
  };
  for (int i = 0; i < result.exposures; ++i) {
    const double exposure = std::exp2(result.start + (result.stop - result.start) * i / (result.exposures - 1));
    const auto x = mapped(image, exposure), y = mapped(reference, exposure);
    const auto flip =
        flip_image({x, image.width, image.height}, {y, reference.width, reference.height}, pixels_per_degree);
    result.image.resize(flip.size(), 0.0f);
    for (size_t p = 0; p < flip.size(); ++p) result.image[p] = std::max(result.image[p], flip[p]);
  }
  return result;
}

}  // namespace lumicut
