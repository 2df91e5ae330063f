// Numbers as colours: perceptually uniform maps, on a linear or logarithmic scale, with a colour bar and its labels.
// Both maps are curves through OKLab [Ottosson 2020] walked at even speed, so that equal steps of the value look
// equally large; lightness rises along the sequential one, so that it also reads in grey.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace lumicut::tools {

using Srgb8 = std::array<uint8_t, 3>;

// t in [0,1], cut to it: from dark violet over blue and green to light yellow.
Srgb8 sequential_color(double t);
// t in [-1,1], cut to it: blue is below, light grey is 0, red above.
Srgb8 diverging_color(double t);

enum class ColorScale {
  logarithmic,  // low..high, both > 0; what is below low is shown as low
  diverging     // -high..high, linear
};

struct FalseColor {
  ColorScale scale = ColorScale::logarithmic;
  double low = 1, high = 10;
  std::string title;     // under the picture: lower-case letters, digits, blanks and .%-+/()
  bool percent = false;  // labels are the values times 100, with %
};

// Decades around the finite values above 0 (1, 2 or 5 times a power of ten), for logarithmic scales. `floor` > 0 bounds
// it from below. {1, 10} when no value is above 0.
std::array<double, 2> decade_range(const std::vector<float>& values, double floor = 0);
// 1, 2 or 5 times a power of ten, not below x > 0.
double round_up_125(double x);

struct ColorImage {
  int width = 0, height = 0;
  std::vector<uint8_t> pixels;  // RGB, sRGB, rows from the top
};

// The values (rows of `width`) in colour, without a bar. NaN is grey; 0 and below on a logarithmic scale are black.
ColorImage false_color(const std::vector<float>& values, int width, int height, const FalseColor& options);
// The same with a colour bar at its right and the title below.
ColorImage false_color_with_bar(const std::vector<float>& values, int width, int height, const FalseColor& options);

// "10", "0.5", "2k", "3M", "0.1%": how the bar's labels say a value.
std::string label_text(double value, bool percent);
// Values that the bar labels, between low and high: decades, and 2 and 5 times them where there are few.
std::vector<double> bar_ticks(const FalseColor& options);

}  // namespace lumicut::tools
