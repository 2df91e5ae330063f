// Spectra as linear Rec.709, and metals.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/affine.h"

namespace lumicut::io {

using Spectrum = std::vector<std::pair<double, double>>;  // wavelength in nm, rising, and value; linear between

// A value below 0 that no measurement has by its noise, a hundredth of the largest, and its wavelength.
std::optional<std::pair<double, double>> below_zero(const Spectrum& spectrum);

// CIE's integral over that of Y: a flat spectrum of 1 has Y = 1, and is not grey.
Vec rgb_of_spectrum(const Spectrum& spectrum);
// Of a reflectance or an index: even ones are grey.
Vec rgb_of_reflectance(const Spectrum& spectrum);
inline double luminance(const Vec& rgb) { return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }
// Of a black body: of luminance 1; and its radiance, W/(sr·m²·nm), as rgb_of_spectrum has it.
Vec blackbody(double kelvin);
Vec blackbody_radiance(double kelvin);

// The mean reflectance of a smooth dielectric to even light from its inside; `index`: inside over outside.
double internal_reflectance(double index);

// A metal of complex index of refraction, as base colour and tint at 82 degrees of the library's GGX.
struct Metal {
  Vec colour, tint;
};
Metal metal_of(const Vec& eta, const Vec& k);
// eta and k of "Cu", "Au", "Ag", "Al" and the like in red, green and blue.
std::optional<std::pair<Vec, Vec>> named_metal(const std::string& name);

// What hair absorbs, over its diameter, by concentrations of melanin; and the colour of much hair that absorbs so much, of
// azimuthal roughness 0 to 1. [Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model"]
Vec hair_absorption(double eumelanin, double pheomelanin);
Vec hair_colour(const Vec& absorption, double azimuthal);

}  // namespace lumicut::io
