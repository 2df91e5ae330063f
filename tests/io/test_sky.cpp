#include "io/sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace lumicut::io {
namespace {

constexpr double kPi = std::numbers::pi;
using Vec = std::array<double, 3>;

Vec at(double elevation, double azimuth) {
  const double e = elevation * kPi / 180, a = azimuth * kPi / 180;
  return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
}
double luminance(const Vec& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }

TEST(Sky, ZenithHasTheLuminanceAndColourOfTheFormulas) {
  // cd/m² and x from the paper's zenith formulas, worked out on their own.
  const struct {
    double turbidity, elevation, luminance, x;
  } cases[] = {{2, 90, 15500.67, 0.26674},
               {2, 30, 3487.33, 0.238013},
               {3, 30, 5139.16, 0.244929},
               {6, 30, 9585.27, 0.265468},
               {6, 60, 22066.7, 0.263126}};
  for (const auto& c : cases) {
    const Sky sky{c.elevation, 0, c.turbidity};
    const auto [x, y, luminance] = sky.xyY({0, 0, 1});
    EXPECT_NEAR(luminance / c.luminance, 1.0, 1e-5);
    EXPECT_NEAR(x, c.x, 1e-5);
    EXPECT_GT(y, 0.2);
  }
}

TEST(Sky, HorizonStandsToZenithAsPerezSays) {
  // Luminance 5 degrees high over that of the zenith: opposite the sun, and to its side.
  const struct {
    double turbidity, elevation, opposite, side;
  } cases[] = {{2, 30, 4.428675, 4.340442}, {3, 30, 1.422285, 1.479802}, {6, 60, 0.409790, 0.484587}};
  for (const auto& c : cases) {
    const Sky sky{c.elevation, 70, c.turbidity};
    const double zenith = sky.xyY({0, 0, 1})[2];
    EXPECT_NEAR(sky.xyY(at(5, 250))[2] / zenith, c.opposite, 1e-4);
    EXPECT_NEAR(sky.xyY(at(5, 160))[2] / zenith, c.side, 1e-4);
    EXPECT_NEAR(sky.xyY(at(5, -20))[2] / zenith, c.side, 1e-4) << "the same on both sides";
  }
}

TEST(Sky, IsBlueAwayFromTheSunAndBrightestAtIt) {
  const Sky sky{40, 0, 2.5};
  const Vec blue = sky.radiance(at(60, 180));
  EXPECT_GT(blue[2], 1.5 * blue[0]);
  EXPECT_NEAR(luminance(blue) * 683, sky.xyY(at(60, 180))[2], 0.03 * sky.xyY(at(60, 180))[2]) << "candela over 683";
  EXPECT_GT(sky.xyY(sky.sun_direction())[2], 3 * sky.xyY(at(40, 90))[2]);
}

TEST(Sky, TheSunIsAsBrightAsMeasuredAndReddensWithItsWayThroughAir) {
  // Direct normal illuminance under clear air: about 100 klx high up, 60 to 90 klx at 30 degrees, a few at the horizon.
  const auto lux = [](double elevation, double turbidity) {
    return 683 * luminance(Sky{elevation, 0, turbidity}.sun_irradiance());
  };
  EXPECT_NEAR(lux(90, 2), 100e3, 10e3);
  EXPECT_GT(lux(30, 2.5), 60e3);
  EXPECT_LT(lux(30, 2.5), 90e3);
  EXPECT_LT(lux(2, 2.5), 20e3);
  EXPECT_LT(lux(30, 8), 0.6 * lux(30, 2));
  const Vec low = Sky{3, 0, 3}.sun_irradiance(), high = Sky{80, 0, 3}.sun_irradiance();
  EXPECT_GT(low[0] / low[2], 3 * high[0] / high[2]);
}

TEST(Sky, TheMapHoldsTheSkyAndTheGroundItsReflection) {
  const Sky sky{35, 90, 3};
  constexpr uint32_t kHeight = 64;
  const auto map = sky.map(kHeight, {0.2, 0.2, 0.2}, true);
  ASSERT_EQ(map.size(), size_t{3} * 2 * kHeight * kHeight);
  const auto texel = [&](uint32_t x, uint32_t y) { return &map[3 * (size_t{y} * 2 * kHeight + x)]; };
  // 90 degrees of azimuth lie a quarter of the width left of the middle.
  const Vec expected = sky.radiance(at(90 - 180 * 20.5 / kHeight, (0.5 - 32.5 / 128) * 360));
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(texel(32, 20)[k], expected[k], 1e-5);
  EXPECT_GT(texel(32, 22)[1], texel(96, 22)[1]) << "the sun's side";
  double irradiance = 0;
  for (uint32_t y = 0; y < kHeight / 2; ++y)
    for (uint32_t x = 0; x < 2 * kHeight; ++x) {
      const double e = (0.5 - (y + 0.5) / kHeight) * kPi;
      irradiance += double{texel(x, y)[1]} * std::sin(e) * std::cos(e) * kPi / kHeight * kPi / kHeight;
    }
  irradiance += sky.sun_irradiance()[1] * std::sin(35 * kPi / 180);
  EXPECT_NEAR(texel(5, 50)[1], 0.2 * irradiance / kPi, 1e-4 * irradiance);
  const auto black = sky.map(kHeight, {0, 0, 0}, false);
  EXPECT_EQ(black[3 * (size_t{50} * 2 * kHeight + 5)], 0.0f);
}

}  // namespace
}  // namespace lumicut::io
