#include "film/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/rng.h"

namespace lumicut {
namespace {

struct Picture {
  uint32_t width, height;
  std::vector<float> pixels;
  Picture(uint32_t w, uint32_t h, float value = 0) : width(w), height(h), pixels(size_t{3} * w * h, value) {}
  RgbImage view() const { return {pixels, width, height}; }
  void set(uint32_t x, uint32_t y, float r, float g, float b) {
    float* p = &pixels[(size_t{y} * width + x) * 3];
    p[0] = r, p[1] = g, p[2] = b;
  }
};

Picture noise(uint32_t w, uint32_t h, uint64_t seed) {
  Picture picture(w, h);
  Rng rng(seed, Stage::test);
  for (float& v : picture.pixels) v = 0.1f + rng.next_float();
  return picture;
}

Picture scaled(Picture picture, float factor) {
  for (float& v : picture.pixels) v *= factor;
  return picture;
}

TEST(Metrics, EqualImagesHaveNoError) {
  const Picture a = noise(24, 16, 1);
  const Metrics m = compare_images(a.view(), a.view());
  for (const double v :
       {m.rmse, m.rmse_absolute, m.rmse_display, m.lmse, m.mean_relative_error, m.p95_relative_error,
        m.p99_relative_error, m.max_relative_error, m.mean_relative_error_channels, m.mrse, m.smape, m.bias, m.flip})
    EXPECT_EQ(v, 0.0);
  EXPECT_EQ(m.pixels, 24u * 16u);
}

TEST(Metrics, AFactorGivesItsAnalyticErrors) {
  // Grey .5 against .55: every relative measure is 10 %.
  const Picture reference(8, 8, 0.5f), image(8, 8, 0.55f);
  MetricOptions options;
  options.exposure = 1;
  const Metrics m = compare_images(image.view(), reference.view(), options);
  const double tolerance = 1e-6;  // .55 and .5 in float
  EXPECT_NEAR(m.rmse, 0.1, tolerance);
  EXPECT_NEAR(m.rmse_absolute, 0.05, tolerance);
  EXPECT_NEAR(m.rmse_display, 0.05, tolerance);
  EXPECT_NEAR(m.mean_relative_error, 0.1, tolerance);
  EXPECT_NEAR(m.p99_relative_error, 0.1, tolerance);
  EXPECT_NEAR(m.mean_relative_error_channels, 0.1, tolerance);
  EXPECT_NEAR(m.mrse, 0.01, tolerance);
  EXPECT_NEAR(m.smape, 0.05 / 1.05, tolerance);
  EXPECT_NEAR(m.bias, 0.1, tolerance);
  EXPECT_EQ(m.lmse, 0.0);  // a constant difference has no gradient
  EXPECT_NEAR(m.reference_mean, 0.5, tolerance);
}

TEST(Metrics, DisplayRmseCutsToTheUnitRange) {
  const Picture reference(4, 4, 2.0f), image(4, 4, 30.0f);  // both white
  MetricOptions options;
  options.exposure = 1;
  const Metrics m = compare_images(image.view(), reference.view(), options);
  EXPECT_EQ(m.rmse_display, 0.0);
  EXPECT_EQ(m.flip, 0.0);
  EXPECT_NEAR(m.rmse, 14.0, 1e-5);
}

TEST(Metrics, LaplacianErrorOfOneChangedPixelIsCountedByHand) {
  // Reference: one bright pixel of 1 in black, image: the same pixel at 1 + d. Laplacians: -4 at it, 1 at four
  // neighbours: Σ(∇R)² = 20 a channel, Σ(∇F-∇R)² = 20 d².
  Picture reference(7, 7), image(7, 7);
  reference.set(3, 3, 1, 1, 1);
  image.set(3, 3, 1.25f, 1.25f, 1.25f);
  EXPECT_NEAR(compare_images(image.view(), reference.view()).lmse, 0.0625, 1e-9);
}

TEST(Metrics, ScalingBothImagesChangesNoRelativeMeasure) {
  const Picture a = noise(32, 32, 1), b = noise(32, 32, 2);
  const Metrics m = compare_images(a.view(), b.view());
  // A power of two: exact in float, so that only the exposure is rounded otherwise.
  const Metrics s = compare_images(scaled(a, 1024).view(), scaled(b, 1024).view());
  EXPECT_NEAR(s.rmse, m.rmse, 1e-12);
  EXPECT_NEAR(s.lmse, m.lmse, 1e-12);
  EXPECT_NEAR(s.mean_relative_error, m.mean_relative_error, 1e-12);
  EXPECT_NEAR(s.p95_relative_error, m.p95_relative_error, 1e-12);
  EXPECT_NEAR(s.mrse, m.mrse, 1e-12);
  EXPECT_NEAR(s.bias, m.bias, 1e-12);
  EXPECT_NEAR(s.rmse_display, m.rmse_display, 1e-5);
  EXPECT_NEAR(s.flip, m.flip, 1e-5);
  EXPECT_NEAR(s.rmse_absolute, 1024 * m.rmse_absolute, 1e-9 * 1024);
}

TEST(Metrics, BlackReferencePixelsAreMeasuredAgainstTheFloor) {
  Picture reference(10, 10, 1.0f), image(10, 10, 1.0f);
  reference.set(5, 5, 0, 0, 0);
  image.set(5, 5, 0.00099f, 0.00099f, 0.00099f);  // one floor (.001 of a mean of .99)
  const Metrics m = compare_images(image.view(), reference.view());
  EXPECT_NEAR(m.max_relative_error, 1.0, 1e-5);
  EXPECT_NEAR(m.mean_relative_error, 0.01, 1e-7);
}

TEST(Metrics, PercentilesAreNearestRanks) {
  // Relative errors of 1 % to 100 %, one each.
  Picture reference(100, 1, 1.0f), image(100, 1, 1.0f);
  for (uint32_t i = 0; i < 100; ++i) {
    const float v = 1.0f + 0.01f * static_cast<float>((i * 37) % 100 + 1);
    image.set(i, 0, v, v, v);
  }
  const Metrics m = compare_images(image.view(), reference.view());
  EXPECT_NEAR(m.p95_relative_error, 0.95, 1e-6);
  EXPECT_NEAR(m.p99_relative_error, 0.99, 1e-6);
  EXPECT_NEAR(m.max_relative_error, 1.0, 1e-6);
}

TEST(Metrics, BrightPixelsOfTheReferenceAreLeftOut) {
  Picture reference(10, 10, 1.0f), image(10, 10, 1.0f);
  reference.set(2, 2, 50, 50, 50);
  MetricOptions options;
  EXPECT_GT(compare_images(image.view(), reference.view(), options).rmse, 1.0);
  options.ignore_above = 20;
  const Metrics m = compare_images(image.view(), reference.view(), options);
  EXPECT_EQ(m.ignored, 1u);
  EXPECT_EQ(m.pixels, 99u);
  EXPECT_EQ(m.rmse, 0.0);
  EXPECT_EQ(m.lmse, 0.0);
  EXPECT_EQ(m.flip, 0.0);
  // The limit is of the reference: a bright pixel of the image counts.
  image.set(7, 7, 50, 50, 50);
  EXPECT_GT(compare_images(image.view(), reference.view(), options).rmse, 1.0);
}

TEST(Metrics, PixelsThatAreNotFiniteAreCountedAndLeftOut) {
  Picture reference(10, 10, 1.0f), image(10, 10, 1.1f);
  image.set(3, 3, NAN, 1, 1);
  image.set(4, 4, 1, INFINITY, 1);
  reference.set(9, 9, 1, 1, NAN);
  const Metrics m = compare_images(image.view(), reference.view());
  EXPECT_EQ(m.bad_pixels, 3u);
  EXPECT_EQ(m.pixels, 97u);
  EXPECT_NEAR(m.mean_relative_error, 0.1, 1e-6);
  EXPECT_TRUE(std::isfinite(m.rmse) && std::isfinite(m.lmse) && std::isfinite(m.flip));
}

TEST(Metrics, ImagesOfOtherShapesAreRefused) {
  const Picture a(4, 4, 1), b(4, 5, 1);
  EXPECT_THROW(compare_images(a.view(), b.view()), Error);
  EXPECT_THROW(compare_images({a.pixels, 4, 5}, b.view()), Error);
  EXPECT_THROW(compare_images({{}, 0, 0}, {{}, 0, 0}), Error);
  EXPECT_THROW(error_image(a.view(), b.view(), 1, 32), Error);
  EXPECT_THROW(flip_image(a.view(), b.view(), 67), Error);
  Picture nan(4, 4, NAN);
  EXPECT_THROW(compare_images(nan.view(), a.view()), Error) << "no pixel is left to compare";
}

TEST(Metrics, ErrorImageIsTheScaledEuclideanDistance) {
  Picture reference(2, 1, 0.1f), image(2, 1, 0.1f);
  image.set(1, 0, 0.103f, 0.104f, 0.1f);  // distance .005
  const auto error = error_image(image.view(), reference.view(), 1, 32);
  EXPECT_EQ(error[0], 0.0f);
  EXPECT_NEAR(error[1], 0.16, 1e-5);
  EXPECT_EQ(error_image(image.view(), reference.view(), 1, 1e6f)[1], 1.0f);
}

TEST(Metrics, AutoExposureBringsTheGeometricMeanToMiddleGrey) {
  EXPECT_NEAR(auto_exposure(Picture(4, 4, 0.09f).view()), 2.0, 1e-5);
  EXPECT_EQ(auto_exposure(Picture(4, 4, 0).view()), 1.0f);
  Picture mixed(2, 1);
  mixed.set(0, 0, 1, 1, 1), mixed.set(1, 0, 4, 4, 4);  // geometric mean 2
  EXPECT_NEAR(auto_exposure(mixed.view()), 0.09, 1e-6);
}

TEST(Metrics, SrgbCodesAreTheStandardsOwn) {
  Picture picture(4, 1);
  picture.set(0, 0, 0, 0.0031308f, 1);
  picture.set(1, 0, 0.2158605f, 7, -3);  // the linear value of code 128
  picture.set(2, 0, NAN, 0, 0);
  const auto bytes = to_srgb8(picture.view(), 1);
  EXPECT_EQ((std::vector<int>(bytes.begin(), bytes.begin() + 9)),
            (std::vector<int>{0, 10, 255, 128, 255, 0, 255, 0, 255}));
}

// ---- FLIP: properties that follow from the paper's equations ----

constexpr float kPpd = 67.020643f;

Picture flat(uint32_t w, uint32_t h, float r, float g, float b) {
  Picture picture(w, h);
  for (uint32_t y = 0; y < h; ++y)
    for (uint32_t x = 0; x < w; ++x) picture.set(x, y, r, g, b);
  return picture;
}

double mean(const std::vector<float>& values) {
  double sum = 0;
  for (const float v : values) sum += double{v};
  return sum / static_cast<double>(values.size());
}

TEST(Flip, GreenAgainstBlueIsTheGreatestDifference) {
  // The redistribution maps the distance of these two to 1.
  const auto flip = flip_image(flat(8, 8, 0, 1, 0).view(), flat(8, 8, 0, 0, 1).view(), kPpd);
  for (const float v : flip) EXPECT_NEAR(v, 1.0, 1e-5);
}

TEST(Flip, BlackAgainstWhiteFollowsFromLStar) {
  // ΔL* = 100, no chroma: 100^.7 = 25.119. The Hunt-adjusted green and blue are 203.08 apart in HyAB: L*a*b* of sRGB's
  // green is (87.735, -86.183, 83.180), of blue (32.297, 79.188, -107.860); a* and b* times .01 L*.
  const double green[3] = {87.735, 0.87735 * -86.183, 0.87735 * 83.180},
               blue[3] = {32.297, 0.32297 * 79.188, 0.32297 * -107.860};
  const double distance = std::abs(green[0] - blue[0]) + std::hypot(green[1] - blue[1], green[2] - blue[2]);
  const double greatest = std::pow(distance, 0.7), power = std::pow(100.0, 0.7);
  const double expected = 0.95 + (power - 0.4 * greatest) / (0.6 * greatest) * 0.05;
  const auto flip = flip_image(flat(8, 8, 0, 0, 0).view(), flat(8, 8, 1, 1, 1).view(), kPpd);
  for (const float v : flip) EXPECT_NEAR(v, expected, 1e-3);  // the published L*a*b* values are rounded
}

TEST(Flip, IsSymmetricAndWithinTheUnitRange) {
  const Picture a = noise(40, 30, 3), b = noise(40, 30, 4);
  const auto ab = flip_image(a.view(), b.view(), kPpd), ba = flip_image(b.view(), a.view(), kPpd);
  for (size_t i = 0; i < ab.size(); ++i) {
    EXPECT_EQ(ab[i], ba[i]);
    EXPECT_GE(ab[i], 0.0f);
    EXPECT_LE(ab[i], 1.0f);
  }
  EXPECT_EQ(mean(flip_image(a.view(), a.view(), kPpd)), 0.0);
}

TEST(HdrFlip, DoesNotDependOnTheUnitOfRadiance) {
  // Values against an implementation of its own: tests/tools/test_compare.py.
  auto a = noise(16, 12, 1), b = noise(16, 12, 2);
  for (size_t i = 0; i < 60; ++i) a.pixels[i] *= 40, b.pixels[i] *= 40;
  const HdrFlip one = hdr_flip_image(a.view(), b.view(), kPpd);
  EXPECT_GT(one.exposures, 4) << "the brightest pixel is 40 times as bright";
  for (auto* image : {&a, &b})
    for (float& v : image->pixels) v *= 1024;
  const HdrFlip other = hdr_flip_image(a.view(), b.view(), kPpd);
  EXPECT_EQ(one.exposures, other.exposures);
  EXPECT_NEAR(mean(one.image), mean(other.image), 1e-5) << "powers of two: rounding alone";
  EXPECT_EQ(mean(hdr_flip_image(a.view(), a.view(), kPpd).image), 0.0);
  const auto black = flat(8, 8, 0, 0, 0);
  EXPECT_EQ(mean(hdr_flip_image(black.view(), black.view(), kPpd).image), 0.0);
}

TEST(Flip, SmallDifferencesOfGreyFollowThePowerLaw) {
  // For flat grey images only the colour part is left: .95 / (.4 cmax) · ΔL*^.7, so half the ΔL* gives 2^-.7 of it.
  const auto grey = [](double lightness) { return static_cast<float>(std::pow((lightness + 16) / 116, 3)); };
  const Picture reference = flat(8, 8, grey(50), grey(50), grey(50));
  const double full = mean(flip_image(flat(8, 8, grey(54), grey(54), grey(54)).view(), reference.view(), kPpd));
  const double half = mean(flip_image(flat(8, 8, grey(52), grey(52), grey(52)).view(), reference.view(), kPpd));
  EXPECT_NEAR(half / full, std::pow(2.0, -0.7), 1e-4);
}

TEST(Flip, FineDetailIsSeenLessFromAfar) {
  Picture checks(64, 64), grey = flat(64, 64, 0.5f, 0.5f, 0.5f);
  for (uint32_t y = 0; y < 64; ++y)
    for (uint32_t x = 0; x < 64; ++x)
      if ((x + y) % 2)
        checks.set(x, y, 0.6f, 0.6f, 0.6f);
      else
        checks.set(x, y, 0.4f, 0.4f, 0.4f);
  const double near = mean(flip_image(checks.view(), grey.view(), 10)),
               far = mean(flip_image(checks.view(), grey.view(), 120));
  EXPECT_GT(near, 4 * far);
}

TEST(Flip, AnEdgeCountsMoreThanItsColours) {
  // A line of one pixel: the feature part lifts the error there above that of the blurred colour alone.
  Picture line = flat(41, 41, 0.2f, 0.2f, 0.2f), plain = line;
  for (uint32_t y = 0; y < 41; ++y) line.set(20, y, 1, 1, 1);
  const auto flip = flip_image(line.view(), plain.view(), kPpd);
  EXPECT_GT(flip[20 * 41 + 20], 0.5f);
  EXPECT_LT(flip[20 * 41 + 2], 0.02f);  // farther from it than any filter reaches, except for the sum's rounding
  EXPECT_GT(flip[20 * 41 + 20], flip[20 * 41 + 24]);
}

TEST(Flip, RefusesImpossibleViewingConditions) {
  const Picture a(4, 4, 1);
  for (const float ppd : {0.0f, -1.0f, NAN, INFINITY}) EXPECT_THROW(flip_image(a.view(), a.view(), ppd), Error);
}

TEST(RelativeErrorImage, AveragesToTheMeasureAndHasItsSign) {
  Picture a = noise(24, 16, 1);
  const Picture b = noise(24, 16, 2);
  a.set(3, 2, 0, 0, 0);
  const auto errors = relative_error_image(a.view(), b.view());
  double sum = 0, largest = 0;
  for (const float e : errors) sum += std::abs(e), largest = std::max(largest, std::abs(double{e}));
  const Metrics m = compare_images(a.view(), b.view());
  // Single precision of each pixel's value.
  EXPECT_NEAR(sum / (24 * 16), m.mean_relative_error, 1e-6 * m.mean_relative_error);
  EXPECT_NEAR(largest, m.max_relative_error, 1e-6 * largest);
  EXPECT_FLOAT_EQ(errors[2 * 24 + 3], -1);
  for (const float e : relative_error_image(scaled(b, 1.25f).view(), b.view())) EXPECT_NEAR(e, 0.25, 1e-6);
}

TEST(RelativeErrorImage, IsNotANumberWhereAnImageIsNone) {
  Picture a(4, 4, 1);
  a.set(1, 0, NAN, 1, 1);
  const Picture black(4, 4);
  const auto errors = relative_error_image(a.view(), Picture(4, 4, 1).view());
  EXPECT_TRUE(std::isnan(errors[1]));
  EXPECT_EQ(errors[0], 0);
  EXPECT_EQ(relative_error_image(black.view(), black.view())[5], 0);
}

}  // namespace
}  // namespace lumicut
