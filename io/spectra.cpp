#include "io/spectra.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace lumicut::io {

double internal_reflectance(double index) {
  // Fresnel's equations, weighted by the cosine.
  constexpr int kSteps = 4096;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double c2 = (i + 0.5) / kSteps, sine2 = index * index * (1 - c2);  // even in the square of the cosine
    if (sine2 >= 1) {
      sum += 1;
      continue;
    }
    const double c = std::sqrt(c2), t = std::sqrt(1 - sine2);
    const double across = (index * c - t) / (index * c + t), along = (c - index * t) / (c + index * t);
    sum += 0.5 * (across * across + along * along);
  }
  return sum / kSteps;
}

Metal metal_of(const Vec& eta, const Vec& k) {
  // Fresnel's equations for a conductor in air.
  const auto reflectance = [](double c, double n, double absorbing) {
    const double c2 = c * c, s2 = 1 - c2, n2 = n * n, k2 = absorbing * absorbing, t = n2 - k2 - s2;
    const double both = std::sqrt(std::max(0.0, t * t + 4 * n2 * k2)), a = std::sqrt(std::max(0.0, 0.5 * (both + t)));
    const double across = (both + c2 - 2 * a * c) / (both + c2 + 2 * a * c);
    return 0.5 * across * (1 + (c2 * both + s2 * s2 - 2 * a * c * s2) / (c2 * both + s2 * s2 + 2 * a * c * s2));
  };
  Metal out;
  const double c = std::cos(82 * 3.14159265358979323846 / 180);
  for (size_t i = 0; i < 3; ++i) {
    const double f0 = std::clamp(reflectance(1, eta[i], k[i]), 0.0, 1.0);
    const double schlick = f0 + (1 - f0) * std::pow(1 - c, 5);
    out.colour[i] = f0;
    out.tint[i] = schlick > 0 ? std::clamp(reflectance(c, eta[i], k[i]) / schlick, 1e-6, 1.0) : 1;
  }
  return out;
}

std::optional<std::pair<Vec, Vec>> named_metal(const std::string& name) {
  // Measured spectra (Palik and others, as renderers distribute them), each the mean under the curve of red, green and blue.
  static const std::map<std::string, std::pair<Vec, Vec>> kMetals = {
      {"a-C", {{2.444, 2.348, 2.165}, {0.7366, 0.8428, 0.897}}},
      {"Ag", {{0.1289, 0.1231, 0.1523}, {4.008, 3.292, 2.362}}},
      {"Al", {{1.376, 0.9283, 0.5735}, {7.656, 6.611, 5.322}}},
      {"Au", {{0.1188, 0.3954, 1.587}, {3.306, 2.516, 1.764}}},
      {"Be", {{3.474, 3.358, 3.063}, {3.183, 3.174, 3.157}}},
      {"Cr", {{3.627, 3.075, 1.821}, {4.321, 4.462, 4.131}}},
      {"CsI", {{1.78, 1.795, 1.829}, {0, 0, 0}}},
      {"Cu", {{0.1664, 0.9743, 1.213}, {3.248, 2.586, 2.357}}},
      {"Cu2O", {{2.946, 3.113, 3.011}, {0.09397, 0.2053, 0.6603}}},
      {"CuO", {{2.694, 2.583, 2.418}, {0.4318, 0.6018, 0.7891}}},
      {"CuZn", {{0.444, 0.527, 1.094}, {3.695, 2.765, 1.829}}},
      {"d-C", {{2.411, 2.422, 2.449}, {0, 0, 0}}},
      {"Hg", {{1.991, 1.518, 1.001}, {5.252, 4.61, 3.765}}},
      {"HgTe", {{3.967, 3.407, 2.927}, {1.355, 1.667, 1.903}}},
      {"Ir", {{2.562, 2.195, 1.78}, {4.642, 4.288, 3.595}}},
      {"K", {{0.05316, 0.04894, 0.04201}, {1.747, 1.422, 1.005}}},
      {"Li", {{0.2206, 0.2063, 0.2431}, {2.938, 2.437, 1.836}}},
      {"MgO", {{1.734, 1.741, 1.755}, {0, 0, 0}}},
      {"Mo", {{3.722, 3.717, 3.054}, {3.412, 3.607, 3.466}}},
      {"Na", {{0.05002, 0.0592, 0.0682}, {2.639, 2.227, 1.737}}},
      {"Nb", {{2.839, 2.942, 2.636}, {2.856, 2.887, 2.839}}},
      {"Ni", {{1.965, 1.754, 1.614}, {3.734, 3.216, 2.581}}},
      {"Rh", {{2.146, 1.961, 1.71}, {5.629, 4.959, 4.375}}},
      {"Se", {{3.369, 2.997, 3.103}, {0.6261, 0.6733, 0.5739}}},
      {"SiC", {{2.633, 2.663, 2.728}, {0, 0, 0}}},
      {"Ta", {{1.712, 2.523, 2.891}, {1.999, 1.836, 2.142}}},
      {"Te", {{6.134, 4.726, 2.901}, {2.703, 3.719, 3.622}}},
      {"TiC", {{3.071, 2.992, 2.841}, {2.711, 2.48, 2.391}}},
      {"TiN", {{1.368, 1.213, 1.518}, {2.796, 2.049, 1.212}}},
      {"TiO2", {{2.869, 2.954, 3.196}, {0, 0, 0}}},
      {"V", {{3.55, 3.704, 3.038}, {2.898, 3.047, 3.424}}},
      {"VC", {{3.036, 2.902, 2.787}, {2.547, 2.318, 2.16}}},
      {"VN", {{2.378, 2.234, 2.135}, {2.517, 2.168, 1.778}}},
      {"W", {{3.628, 3.48, 3.299}, {2.906, 2.747, 2.501}}}};
  const auto found = kMetals.find(name.substr(0, name.find("_palik")));
  if (found == kMetals.end()) return std::nullopt;
  return found->second;
}

namespace {

// CIE 1931 colour matching functions by the fit of Wyman, Sloan and Shirley (2013), multi-lobe.
Vec colour_matching(double nm) {
  const auto lobe = [&](double height, double middle, double below, double above) {
    const double t = (nm - middle) * (nm < middle ? below : above);
    return height * std::exp(-0.5 * t * t);
  };
  return {lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) - lobe(0.065, 501.1, 0.0490, 0.0382),
          lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
          lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)};
}
Vec rgb_of_xyz(const Vec& c) {
  Vec out{3.2404542 * c[0] - 1.5371385 * c[1] - 0.4985314 * c[2],
          -0.9692660 * c[0] + 1.8760108 * c[1] + 0.0415560 * c[2],
          0.0556434 * c[0] - 0.2040259 * c[1] + 1.0572252 * c[2]};
  for (double& x : out) x = std::max(0.0, x);
  return out;
}

}  // namespace

std::optional<std::pair<double, double>> below_zero(const Spectrum& spectrum) {
  double most = 0;
  for (const auto& sample : spectrum) most = std::max(most, sample.second);
  for (const auto& sample : spectrum)
    if (sample.second < -0.01 * most) return sample;
  return std::nullopt;
}

Vec rgb_of_spectrum(const Spectrum& spectrum) {
  if (spectrum.empty()) return {0, 0, 0};
  Vec sum{0, 0, 0};
  double white = 0;
  for (double nm = 360; nm <= 830; nm += 1) {
    const auto above =
        std::lower_bound(spectrum.begin(), spectrum.end(), nm, [](const auto& s, double x) { return s.first < x; });
    double value = 0;
    if (above != spectrum.end() && above->first == nm) {
      value = above->second;
    } else if (above != spectrum.begin() && above != spectrum.end()) {
      const auto below = above - 1;
      value = below->second + (above->second - below->second) * (nm - below->first) / (above->first - below->first);
    }
    const Vec c = colour_matching(nm);
    sum = sum + c * value;
    white += c[1];
  }
  return rgb_of_xyz(sum * (1 / white));
}

Vec blackbody_radiance(double kelvin) {
  Spectrum spectrum;
  for (double nm = 360; nm <= 830; nm += 5) {
    const double x = 1.438776877e7 / (nm * kelvin);
    // 2 h c^2 / wavelength^5, a nanometre.
    spectrum.emplace_back(nm, 1.191042972e20 * std::pow(nm, -5) / (x < 700 ? std::expm1(x) : 1e304));
  }
  return rgb_of_spectrum(spectrum);
}

Vec blackbody(double kelvin) {
  const Vec rgb = blackbody_radiance(kelvin);
  const double white = luminance(rgb);
  return white > 0 ? rgb * (1 / white) : Vec{1, 0, 0};
}

Vec rgb_of_reflectance(const Spectrum& spectrum) {
  static const Vec flat = rgb_of_spectrum({{300, 1}, {900, 1}});
  Vec rgb = rgb_of_spectrum(spectrum);
  for (size_t k = 0; k < 3; ++k) rgb[k] /= flat[k];
  return rgb;
}

Vec hair_absorption(double eumelanin, double pheomelanin) {
  return Vec{0.419, 0.697, 1.37} * std::max(0.0, eumelanin) + Vec{0.187, 0.4, 1.05} * std::max(0.0, pheomelanin);
}

Vec hair_colour(const Vec& absorption, double azimuthal) {
  const double b = azimuthal, per_root = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
  Vec out;
  for (size_t k = 0; k < 3; ++k) out[k] = std::exp(-std::sqrt(std::max(0.0, absorption[k])) * per_root);
  return out;
}

}  // namespace lumicut::io
