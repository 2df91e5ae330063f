#include "tools/false_color.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/tiny_font.h"

namespace lumicut::tools {

namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

struct Lab {
  double l, a, b;
};

Lab from_lch(double l, double c, double h) { return {l, c * std::cos(h * kDegree), c * std::sin(h * kDegree)}; }

// Linear sRGB of an OKLab colour. [Ottosson 2020]
std::array<double, 3> linear(const Lab& lab) {
  const auto cube = [](double x) { return x * x * x; };
  const double l = cube(lab.l + 0.3963377774 * lab.a + 0.2158037573 * lab.b),
               m = cube(lab.l - 0.1055613458 * lab.a - 0.0638541728 * lab.b),
               s = cube(lab.l - 0.0894841775 * lab.a - 1.2914855480 * lab.b);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool in_gamut(const Lab& lab) {
  for (const double v : linear(lab))
    if (v < 0 || v > 1) return false;
  return true;
}

// As much of the chroma as a display can show.
Lab displayable(double l, double c, double h) {
  if (in_gamut(from_lch(l, c, h))) return from_lch(l, c, h);
  double low = 0, high = c;
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    (in_gamut(from_lch(l, middle, h)) ? low : high) = middle;
  }
  return from_lch(l, low, h);
}

Srgb8 to_srgb8(const Lab& lab) {
  Srgb8 out{};
  const auto rgb = linear(lab);
  for (size_t k = 0; k < 3; ++k) {
    const double x = std::clamp(rgb[k], 0.0, 1.0);
    out[k] = static_cast<uint8_t>((x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055) * 255 + 0.5);
  }
  return out;
}

constexpr size_t kTable = 1024;
using Table = std::array<Srgb8, kTable>;

// The curve at equal distances along it.
template <typename Curve>
Table even_steps(const Curve& curve) {
  constexpr size_t kFine = 8 * kTable;
  std::vector<Lab> points(kFine + 1);
  std::vector<double> length(kFine + 1, 0);
  for (size_t i = 0; i <= kFine; ++i) {
    points[i] = curve(static_cast<double>(i) / kFine);
    if (i == 0) continue;
    const Lab &p = points[i - 1], &q = points[i];
    length[i] = length[i - 1] + std::hypot(std::hypot(q.l - p.l, q.a - p.a), q.b - p.b);
  }
  Table table;
  for (size_t i = 0; i < kTable; ++i) {
    const double at = length.back() * static_cast<double>(i) / (kTable - 1);
    const auto found = std::lower_bound(length.begin(), length.end(), at);
    table[i] = to_srgb8(points[std::min(static_cast<size_t>(found - length.begin()), kFine)]);
  }
  return table;
}

Srgb8 look_up(const Table& table, double t) {
  return table[static_cast<size_t>(std::clamp(t, 0.0, 1.0) * (kTable - 1) + 0.5)];
}

// Position of a value on the scale: [0,1], or [-1,1] of a diverging one.
double position(double value, const FalseColor& o) {
  if (o.scale == ColorScale::diverging) return std::clamp(value / o.high, -1.0, 1.0);
  return std::clamp(std::log(value / o.low) / std::log(o.high / o.low), 0.0, 1.0);
}

Srgb8 color_at(double t, const FalseColor& o) {
  return o.scale == ColorScale::diverging ? diverging_color(t) : sequential_color(t);
}

Srgb8 color_of(float value, const FalseColor& o) {
  if (std::isnan(value)) return {128, 128, 128};
  if (o.scale == ColorScale::logarithmic && value <= 0) return {0, 0, 0};
  return color_at(position(value, o), o);
}

void put(ColorImage& image, int x, int y, const Srgb8& color) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  const size_t at = 3 * (static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x));
  for (size_t k = 0; k < 3; ++k) image.pixels[at + k] = color[k];
}

void write_text(ColorImage& image, int x, int y, const std::string& text, const Srgb8& color) {
  for (const char c : text) {
    const uint8_t* rows = glyph(c);
    for (int r = 0; r < kGlyphHeight; ++r)
      for (int k = 0; k < kGlyphWidth; ++k)
        if (rows[r] >> (kGlyphWidth - 1 - k) & 1) put(image, x + k, y + r, color);
    x += kGlyphAdvance;
  }
}

}  // namespace

Srgb8 sequential_color(double t) {
  // Violet at 305 degrees, blue, green at 160, yellow at 105.
  static const Table table =
      even_steps([](double s) { return displayable(0.2 + 0.75 * s, 0.14 + 0.03 * s, 305 - 200 * s); });
  return look_up(table, t);
}

Srgb8 diverging_color(double t) {
  const auto half = [](double hue) {
    return even_steps([hue](double s) { return displayable(0.94 - 0.56 * s, 0.2 * s, hue); });
  };
  static const Table below = half(260), above = half(27);
  return look_up(t < 0 ? below : above, std::abs(t));
}

double round_up_125(double x) {
  const double decade = std::pow(10.0, std::floor(std::log10(x)));
  for (const double step : {1.0, 2.0, 5.0})
    if (x <= step * decade * (1 + 1e-6)) return step * decade;  // a hair above 1 is 1, not 2
  return 10 * decade;
}

std::array<double, 2> decade_range(const std::vector<float>& values, double floor) {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const float v : values) {
    if (!(v > 0) || !std::isfinite(v)) continue;
    low = std::min(low, double{v}), high = std::max(high, double{v});
  }
  if (!(high > 0)) return {1, 10};
  high = round_up_125(std::max(high, 2 * floor));
  low = 1 / round_up_125(1 / std::max(low, floor));
  if (low >= high) low = high / 2;
  return {low, high};
}

ColorImage false_color(const std::vector<float>& values, int width, int height, const FalseColor& options) {
  ColorImage image{width, height, std::vector<uint8_t>(values.size() * 3)};
  for (size_t i = 0; i < values.size(); ++i) {
    const Srgb8 color = color_of(values[i], options);
    std::copy(color.begin(), color.end(), image.pixels.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
  return image;
}

std::string label_text(double value, bool percent) {
  if (percent) return fmt::format("{:.3g}%", value * 100);
  if (std::abs(value) >= 1e9) return fmt::format("{:.3g}G", value / 1e9);
  if (std::abs(value) >= 1e6) return fmt::format("{:.3g}M", value / 1e6);
  if (std::abs(value) >= 1e3) return fmt::format("{:.3g}k", value / 1e3);
  return fmt::format("{:.3g}", value);
}

std::vector<double> bar_ticks(const FalseColor& o) {
  std::vector<double> ticks;
  if (o.scale == ColorScale::diverging) {
    for (int i = -2; i <= 2; ++i) ticks.push_back(o.high * i / 2);
    return ticks;
  }
  const bool few = o.high / o.low < 1001;
  const int first = static_cast<int>(std::floor(std::log10(o.low) - 1e-9)),
            last = static_cast<int>(std::ceil(std::log10(o.high) + 1e-9));
  for (int e = first; e <= last; ++e)
    for (const double step : {1.0, 2.0, 5.0}) {
      const double value = step * std::pow(10.0, e);
      if ((step == 1.0 || few) && value >= o.low * (1 - 1e-9) && value <= o.high * (1 + 1e-9)) ticks.push_back(value);
    }
  return ticks;
}

ColorImage false_color_with_bar(const std::vector<float>& values, int width, int height, const FalseColor& options) {
  constexpr int kMargin = 8, kBar = 14, kTick = 4, kLabels = 6 * kGlyphAdvance, kFoot = kGlyphHeight + 8;
  constexpr Srgb8 kInk = {32, 32, 32};
  const ColorImage picture = false_color(values, width, height, options);
  // A small picture still has room for its bar and title.
  const int bar_height = std::max(height, 100) - 2 * kMargin;
  ColorImage image;
  const int left = std::max(width, text_width(options.title) - kMargin - kBar - kTick - kLabels);
  image.width = left + kMargin + kBar + kTick + kLabels + kMargin;
  image.height = std::max(height, 100) + kFoot;
  image.pixels.assign(size_t{3} * static_cast<size_t>(image.width) * static_cast<size_t>(image.height), 255);
  for (int y = 0; y < height; ++y)
    std::copy_n(picture.pixels.begin() + std::ptrdiff_t{3} * y * width, std::ptrdiff_t{3} * width,
                image.pixels.begin() + std::ptrdiff_t{3} * y * image.width);
  const bool both_sides = options.scale == ColorScale::diverging;
  const int x0 = left + kMargin;
  for (int y = 0; y < bar_height; ++y) {
    const double t = 1 - static_cast<double>(y) / (bar_height - 1);
    for (int x = 0; x < kBar; ++x) put(image, x0 + x, kMargin + y, color_at(both_sides ? 2 * t - 1 : t, options));
  }
  for (const double tick : bar_ticks(options)) {
    double t = position(tick, options);
    if (both_sides) t = (t + 1) / 2;
    const int y = kMargin + static_cast<int>((1 - t) * (bar_height - 1) + 0.5);
    for (int x = 0; x < kTick; ++x) put(image, x0 + kBar + x, y, kInk);
    write_text(image, x0 + kBar + kTick + 2, y - kGlyphHeight / 2, label_text(tick, options.percent), kInk);
  }
  write_text(image, 2, image.height - kGlyphHeight - 4, options.title, kInk);
  return image;
}

}  // namespace lumicut::tools
