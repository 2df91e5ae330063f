#include "lights/texture_integral.h"

#include <gtest/gtest.h>

#include "core/rng.h"
#include "tests/support/trimmed.h"

namespace lumicut {

namespace {

Texture random_texture(Rng& rng, uint32_t width, uint32_t height, Texture::Options options) {
  std::vector<float> pixels(size_t{3} * width * height);
  for (float& p : pixels) p = rng.next_below(3) == 0 ? 0.0f : 5.0f * rng.next_float();
  return Texture(width, height, 3, Texture::Format::float32, options, pixels.data());
}

// Midpoints of a fine subdivision.
double sampled(const Texture& t, const Rgb& factor, Vec2f a, Vec2f b, Vec2f c, int n) {
  double sum = 0;
  int count = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * (n - i) - 1; ++j, ++count) {
      const double third = j % 2 == 0 ? 1.0 / 3 : 2.0 / 3;
      const double s = (i + third) / n, r = (j / 2 + third) / n;
      sum += luminance(factor * t.color(static_cast<float>(a.x + (b.x - a.x) * s + (c.x - a.x) * r),
                                        static_cast<float>(a.y + (b.y - a.y) * s + (c.y - a.y) * r)));
    }
  return sum / count;
}

}  // namespace

TEST(TextureIntegral, IsTheMeanOverTheTriangleForEveryFilterAndBorder) {
  const Rgb factor{0.5f, 1.0f, 2.0f};
  for (int kind = 0; kind < 4; ++kind)
    for (uint32_t trial = 0; trial < (test::kSanitized ? 5 : 25); ++trial) {
      Rng rng(trial, Stage::test, kind);
      Texture::Options options;
      options.clamp = (kind & 1) != 0, options.nearest = (kind & 2) != 0;
      const Texture texture = random_texture(rng, 1 + rng.next_below(9), 1 + rng.next_below(9), options);
      const TextureIntegral integral(texture, factor);
      // From within a texel to several repeats, and beyond the borders.
      const float size = trial % 3 == 0 ? 0.1f : trial % 3 == 1 ? 1.0f : 3.0f;
      const auto uv = [&] { return Vec2f{size * (rng.next_float() - 0.3f), size * (rng.next_float() - 0.3f)}; };
      const Vec2f a = uv(), b = uv(), c = uv();
      const double expected = sampled(texture, factor, a, b, c, 700);
      // 490,000 midpoints: 1e-4 where the texture is continuous, the crossed edges' share where it is not.
      EXPECT_NEAR(integral.mean(a, b, c), expected, (options.nearest ? 1e-2 : 2e-4) * (expected + 0.5))
          << kind << " " << trial;
      EXPECT_NEAR(integral.mean(a, c, b), integral.mean(a, b, c), 1e-9 + 1e-9 * expected) << "either winding";
    }
}

TEST(TextureIntegral, BlackPartsAreExactlyBlackAndPartsMakeTheWhole) {
  constexpr uint32_t kSize = 64;
  std::vector<float> pixels(kSize * kSize, 0.0f);
  for (uint32_t y = 0; y < kSize; ++y)
    for (uint32_t x = 0; x < kSize / 2; ++x) pixels[y * kSize + x] = 3.0f;
  Texture::Options options;
  options.clamp = true;
  const Texture texture(kSize, kSize, 1, Texture::Format::float32, options, pixels.data());
  const TextureIntegral integral(texture, {1, 1, 1});
  EXPECT_EQ(integral.mean({0.6f, 0.1f}, {0.9f, 0.3f}, {0.7f, 0.8f}), 0.0);
  EXPECT_NEAR(integral.mean({0.1f, 0.1f}, {0.4f, 0.3f}, {0.2f, 0.8f}), 3.0, 1e-6);
  // The whole square: the ramp between the halves is symmetric, so half of it is lit.
  const double lower = integral.mean({0, 0}, {1, 0}, {1, 1}), upper = integral.mean({0, 0}, {1, 1}, {0, 1});
  EXPECT_NEAR(0.5 * (lower + upper), 1.5, 1e-6);
}

TEST(TextureIntegral, PointsAndSegmentsHaveTheirColour) {
  const float pixels[2] = {0.0f, 2.0f};
  const Texture texture(2, 1, 1, Texture::Format::float32, {}, pixels);
  const TextureIntegral integral(texture, {1, 1, 1});
  EXPECT_NEAR(integral.mean({0.75f, 0.5f}, {0.75f, 0.5f}, {0.75f, 0.5f}), 2.0, 1e-5);
  EXPECT_NEAR(integral.mean({0.25f, 0.5f}, {0.75f, 0.5f}, {0.5f, 0.5f}), 1.0, 0.02);
}

}  // namespace lumicut
