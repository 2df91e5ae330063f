#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
#include "scene/texture.h"

namespace lumicut {

using F = Texture::Format;

TEST(Texture, RowZeroIsTheTop) {
  const uint8_t pixels[] = {255, 0};  // white over black
  const Texture t(1, 2, 1, F::uint8, {.clamp = true}, pixels);
  EXPECT_EQ(t.color(0.5f, 0.9f).x, 1.0f);
  EXPECT_EQ(t.color(0.5f, 0.1f).x, 0.0f);
  EXPECT_FLOAT_EQ(t.color(0.5f, 0.5f).x, 0.5f);
}

TEST(Texture, SrgbIsDecodedInColourAndNotInAlpha) {
  const uint8_t pixels[] = {188, 188, 188, 188};
  const Texture t(1, 1, 4, F::uint8, {.srgb = true}, pixels);
  EXPECT_NEAR(t.color(0, 0).x, 0.5029f, 1e-4f);  // IEC 61966-2-1 of 188/255
  EXPECT_FLOAT_EQ(t.mask(0, 0), 188.0f / 255.0f);
}

// A quarter of the way from black to white: .25 decoded, and .25 of what white is.
TEST(Texture, IsDecodedBeforeItIsBlendedOrAfterwards) {
  const uint8_t p[] = {0, 255};
  EXPECT_FLOAT_EQ(Texture(2, 1, 1, F::uint8, {.srgb = true, .clamp = true}, p).color(0.375f, 0.5f).x, 0.25f);
  const Texture stored(2, 1, 1, F::uint8, {.srgb = true, .clamp = true, .blend_stored = true}, p);
  EXPECT_NEAR(stored.color(0.375f, 0.5f).x, 0.05087608f, 1e-6f);  // ((.25 + .055) / 1.055)^2.4
  EXPECT_FLOAT_EQ(stored.color(0.9f, 0.5f).y, 1.0f);
  EXPECT_EQ(stored.average(), (Rgb{0.5f, 0.5f, 0.5f}));
}

TEST(Texture, RepeatsOverTheEdgeUnlessClamped) {
  const float pixels[] = {0, 1};
  const Texture repeated(2, 1, 1, F::float32, {}, pixels), clamped(2, 1, 1, F::float32, {.clamp = true}, pixels);
  EXPECT_FLOAT_EQ(repeated.color(0.0f, 0.5f).x, 0.5f);
  EXPECT_FLOAT_EQ(repeated.color(1.25f, 0.5f).x, repeated.color(0.25f, 0.5f).x);
  EXPECT_FLOAT_EQ(clamped.color(0.0f, 0.5f).x, 0.0f);
  EXPECT_FLOAT_EQ(clamped.color(7.0f, 0.5f).x, 1.0f);
}

TEST(Texture, BrokenTexelsAndCoordinatesGiveFiniteColours) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const float pixels[] = {nan, 1, inf, 1};
  const Texture t(2, 2, 1, F::float32, {}, pixels);
  for (float c : {nan, inf, -inf, 1e30f, -1e30f, 0.3f}) EXPECT_TRUE(is_finite(t.color(c, c))) << c;
}

TEST(Texture, RefusesWhatItCannotBe) {
  const uint8_t p[4] = {};
  EXPECT_THROW(Texture(0, 1, 1, F::uint8, {}, p), Error);
  EXPECT_THROW(Texture(1, 1, 5, F::uint8, {}, p), Error);
  EXPECT_THROW(Texture(1, 1, 1, F::uint8, {}, nullptr), Error);
  EXPECT_THROW(Texture(70000, 1, 1, F::uint8, {}, p), Error);
}

}  // namespace lumicut
