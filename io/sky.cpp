#include "io/sky.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lumicut::io {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kEfficacy = 683;             // lm/W
constexpr double kSolarIlluminance = 128000;  // lux outside the air

using Vec = std::array<double, 3>;

// Linear Rec.709 of CIE XYZ; what lies out of its gamut is cut at 0.
Vec rgb(double x, double y, double z) {
  return {std::max(0.0, 3.2404542 * x - 1.5371385 * y - 0.4985314 * z),
          std::max(0.0, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z),
          std::max(0.0, 0.0556434 * x - 0.2040259 * y + 1.0572252 * z)};
}

// Appendix A.2, Perez coefficients A to E: slope and offset over turbidity, of Y, x and y.
constexpr double kPerez[3][5][2] = {
    {{0.1787, -1.4630}, {-0.3554, 0.4275}, {-0.0227, 5.3251}, {0.1206, -2.5771}, {-0.0670, 0.3703}},
    {{-0.0193, -0.2592}, {-0.0665, 0.0008}, {-0.0004, 0.2125}, {-0.0641, -0.8989}, {-0.0033, 0.0452}},
    {{-0.0167, -0.2608}, {-0.0950, 0.0092}, {-0.0079, 0.2102}, {-0.0441, -1.6537}, {-0.0109, 0.0529}}};

double perez(int channel, double turbidity, double cos_theta, double gamma) {
  double c[5];
  for (int i = 0; i < 5; ++i) c[i] = kPerez[channel][i][0] * turbidity + kPerez[channel][i][1];
  const double cos_gamma = std::cos(gamma);
  return (1 + c[0] * std::exp(c[1] / std::max(cos_theta, 1e-4))) *
         (1 + c[2] * std::exp(c[3] * gamma) + c[4] * cos_gamma * cos_gamma);
}

// Zenith chromaticity: rows by T², T, 1; columns by θ³, θ², θ, 1.
constexpr double kZenith[2][3][4] = {
    {{0.00166, -0.00375, 0.00209, 0}, {-0.02903, 0.06377, -0.03202, 0.00394}, {0.11693, -0.21196, 0.06052, 0.25886}},
    {{0.00275, -0.00610, 0.00317, 0}, {-0.04214, 0.08970, -0.04153, 0.00516}, {0.15346, -0.26756, 0.06670, 0.26688}}};

// CIE 1931 colour matching functions by lobes; nanometres. [Wyman, Sloan and Shirley 2013]
Vec matching(double l) {
  const auto lobe = [l](double mean, double below, double above) {
    const double t = (l - mean) / (l < mean ? below : above);
    return std::exp(-0.5 * t * t);
  };
  return {1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
          0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
          1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)};
}

// Absorption by ozone, 1/cm, from 450 nm in steps of 10. [Preetham et al. 1999, table 2]
constexpr double kOzone[] = {0.003, 0.006, 0.009, 0.014, 0.021, 0.03,  0.04,  0.048, 0.063, 0.075, 0.085,
                             0.103, 0.12,  0.12,  0.115, 0.125, 0.12,  0.105, 0.09,  0.079, 0.067, 0.057,
                             0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.01,  0.009, 0.007, 0.004};

}  // namespace

Vec Sky::sun_direction() const {
  const double e = sun_elevation * kPi / 180, a = sun_azimuth * kPi / 180;
  return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
}

Vec Sky::xyY(const Vec& d) const {
  const double t = turbidity, sun = (90 - sun_elevation) * kPi / 180;
  const Vec s = sun_direction();
  const double gamma = std::acos(std::clamp(d[0] * s[0] + d[1] * s[1] + d[2] * s[2], -1.0, 1.0));
  const double chi = (4.0 / 9 - t / 120) * (kPi - 2 * sun);
  double zenith[3] = {((4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192) * 1000, 0, 0};
  for (int c = 0; c < 2; ++c)
    for (int i = 0; i < 3; ++i)
      zenith[c + 1] +=
          std::pow(t, 2 - i) *
          (((kZenith[c][i][0] * sun + kZenith[c][i][1]) * sun + kZenith[c][i][2]) * sun + kZenith[c][i][3]);
  double out[3];
  for (int c = 0; c < 3; ++c) out[c] = zenith[c] * perez(c, t, d[2], gamma) / perez(c, t, 1, sun);
  return {out[1], out[2], std::max(0.0, out[0])};
}

Vec Sky::radiance(const Vec& d) const {
  const auto [x, y, luminance] = xyY(d);
  const double scale = luminance / (kEfficacy * y);
  return rgb(x * scale, y * scale, (1 - x - y) * scale);
}

Vec Sky::sun_irradiance() const {
  const double zenith = 90 - sun_elevation;
  // Relative optical mass, and the aerosol's share by Ångström's formula. [Preetham et al. 1999, appendix A.1]
  const double mass = 1 / (std::cos(zenith * kPi / 180) + 0.15 * std::pow(93.885 - zenith, -1.253));
  const double beta = 0.04608 * turbidity - 0.04586;
  Vec sum{};
  double outside = 0;
  for (int i = 0; i <= 40; ++i) {  // 380 to 780 nm; the sun as a black body of 5778 K
    const double nm = 380 + 10 * i, um = nm * 1e-3;
    const double planck = std::pow(um, -5) / (std::exp(14387.77 / (um * 5778)) - 1);
    const int ozone = i - 7;
    const double absorbed = ozone >= 0 && ozone < 33 ? kOzone[ozone] * 0.35 : 0.0;
    const double passes = std::exp(-mass * (0.008735 * std::pow(um, -4.08) + beta * std::pow(um, -1.3) + absorbed));
    const Vec m = matching(nm);
    for (size_t k = 0; k < 3; ++k) sum[k] += planck * passes * m[k];
    outside += planck * m[1];
  }
  const double scale = kSolarIlluminance / (kEfficacy * outside);
  return rgb(sum[0] * scale, sum[1] * scale, sum[2] * scale);
}

std::vector<float> Sky::map(uint32_t height, const Vec& ground, bool with_sun) const {
  const uint32_t width = 2 * height;
  std::vector<float> pixels(size_t{3} * width * height);
  Vec irradiance{};  // on the ground
  const auto at = [&](uint32_t x, uint32_t y) { return &pixels[3 * (size_t{y} * width + x)]; };
  for (uint32_t y = 0; y < height; ++y) {
    const double elevation = (0.5 - (y + 0.5) / height) * kPi;
    if (elevation <= 0) break;
    for (uint32_t x = 0; x < width; ++x) {
      const double azimuth = (0.5 - (x + 0.5) / width) * 2 * kPi;
      const Vec r = radiance(
          {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)});
      const double solid = 2 * kPi / width * kPi / height * std::cos(elevation);
      for (size_t k = 0; k < 3; ++k) {
        at(x, y)[k] = static_cast<float>(r[k]);
        irradiance[k] += r[k] * solid * std::sin(elevation);
      }
    }
  }
  if (with_sun) {
    const Vec sun = sun_irradiance();
    for (size_t k = 0; k < 3; ++k) irradiance[k] += sun[k] * std::sin(sun_elevation * kPi / 180);
  }
  for (uint32_t y = (height + 1) / 2; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      for (size_t k = 0; k < 3; ++k) at(x, y)[k] = static_cast<float>(ground[k] * irradiance[k] / kPi);
  return pixels;
}

}  // namespace lumicut::io
