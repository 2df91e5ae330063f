// Clear and hazy skies by the analytic model of Preetham, Shirley and Smits, "A Practical Analytic Model for Daylight",
// 1999: luminance and colour of the sky by direction, and the sun through the same air.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace lumicut::io {

struct Sky {
  double sun_elevation = 30;  // degrees above the horizon, above 0
  double sun_azimuth = 0;     // degrees from x towards y; z is up
  double turbidity = 3;       // 2 clear, 6 hazy; 1.9 to 10

  // CIE xyY towards a unit direction above the horizon; Y in cd/m².
  std::array<double, 3> xyY(const std::array<double, 3>& direction) const;
  std::array<double, 3> sun_direction() const;  // towards it
  // Of the sun alone, on a surface that faces it: linear Rec.709, lux/683.
  std::array<double, 3> sun_irradiance() const;
  // Linear Rec.709, cd/m² over 683; never below 0.
  std::array<double, 3> radiance(const std::array<double, 3>& direction) const;
  // Latitude-longitude map of 3 · 2·height · height floats, row 0 towards z. Below the horizon a ground that reflects
  // `ground` of sun and sky.
  std::vector<float> map(uint32_t height, const std::array<double, 3>& ground, bool with_sun) const;
};

}  // namespace lumicut::io
