// The filter on images whose truth is known: passes of a formula and noise.
#include <gtest/gtest.h>

#include <functional>
#include <numeric>

#include "core/parallel.h"
#include "core/rng.h"
#include "film/denoise.h"
#include "film/iteration_mean.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 96, kHeight = 64;

struct Pixel {
  Rgb base{};      // without noise
  Rgb residual{};  // what its passes have in the mean
  Rgb albedo{0.5f, 0.5f, 0.5f};
  Vec3f normal{0, 0, 1};
  float depth = 2;
};
using Picture = std::function<Pixel(uint32_t x, uint32_t y)>;
// A factor of mean 1.
using Noise = std::function<float(Rng& rng)>;

float exponential(Rng& rng) { return -std::log(1.0f - rng.next_float()); }
// One of twenty passes has all the light.
float sparse(Rng& rng) { return rng.next_float() < 0.05f ? 20.0f : 0.0f; }

struct Result {
  Film film;
  double rmse(Channel channel, const Picture& truth) const {
    double sum = 0;
    for_each(truth, [&](uint32_t x, uint32_t y, const Rgb& right) {
      const float* p = film.pixel(channel, x, y);
      sum += static_cast<double>(length2(Rgb{p[0], p[1], p[2]} - right)) / 3;
    });
    return std::sqrt(sum / (kWidth * kHeight));
  }
  double mean(Channel channel) const {
    double sum = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) sum += static_cast<double>(film.pixel(channel, x, y)[1]);
    return sum / (kWidth * kHeight);
  }
  // Share of the pixels whose luminance lies within `denoised_error` of the truth.
  double covered(const Picture& truth) const {
    double inside = 0;
    for_each(truth, [&](uint32_t x, uint32_t y, const Rgb& right) {
      const float* p = film.pixel(Channel::denoised, x, y);
      const float away = std::abs(luminance(Rgb{p[0], p[1], p[2]} - right));
      if (away <= *film.pixel(Channel::denoised_error, x, y)) ++inside;
    });
    return inside / (kWidth * kHeight);
  }
  template <typename Fn>
  static void for_each(const Picture& truth, Fn&& fn) {
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) fn(x, y, truth(x, y).base + truth(x, y).residual);
  }
};

Result denoised(const Picture& picture, const Noise& noise, uint32_t passes, bool keep_fireflies = false,
                int threads = 2) {
  const Rect crop{0, 0, kWidth, kHeight};
  Result result{Film(crop, {}, true)};
  Film pass(crop, {}, true);
  IterationMean mean(crop, 0.95, true);
  for (uint32_t n = 1; n <= passes; ++n) {
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) {
        const Pixel p = picture(x, y);
        Rng rng(n, Stage::camera, x, y);
        const Rgb residual = p.residual * noise(rng);
        pass.set(Channel::residual, x, y, residual);
        pass.set(Channel::radiance, x, y, p.base + residual);
        pass.set(Channel::denoising_albedo, x, y, p.albedo);
        pass.set(Channel::denoising_normal, x, y, p.normal);
        pass.set(Channel::denoising_depth, x, y, p.depth);
      }
    mean.add(pass, crop, n, result.film);
  }
  mean.write_error(passes, result.film);
  const Progress progress;
  Arena(threads).run([&] { denoise({passes, 0.95, keep_fireflies}, mean.residuals(), progress, result.film); });
  return result;
}

Pixel even(uint32_t, uint32_t) { return {{1, 1, 1}, {0.3f, 0.3f, 0.3f}}; }

TEST(Denoise, EvenLightLosesNearlyAllOfItsNoise) {
  for (const auto& noise : {exponential, sparse}) {
    const Result r = denoised(even, noise, 16);
    EXPECT_LT(r.rmse(Channel::denoised, even), 0.1 * r.rmse(Channel::radiance, even));
    EXPECT_NEAR(r.mean(Channel::denoised) / r.mean(Channel::radiance), 1, 0.002);  // light is moved, not lost
  }
}

TEST(Denoise, WhatHasNoNoiseStaysBitForBit) {
  const Picture picture = [](uint32_t x, uint32_t y) {
    return Pixel{{static_cast<float>(x * 7 % 13), static_cast<float>(y % 3), 0.3f}, {}};
  };
  const Result r = denoised(picture, exponential, 8);
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x)
      for (int k = 0; k < 3; ++k)
        ASSERT_EQ(r.film.pixel(Channel::denoised, x, y)[k], r.film.pixel(Channel::radiance, x, y)[k]);
}

// Stripes of two pixels, of a wallpaper of one normal: only the albedo tells.
TEST(Denoise, TextureKeepsItsContrast) {
  const Picture stripes = [](uint32_t x, uint32_t) {
    const float a = x / 2 % 2 == 0 ? 0.2f : 0.6f;
    return Pixel{Rgb{1, 1, 1} * a, Rgb{1, 1, 1} * (0.5f * a), Rgb{1, 1, 1} * a};
  };
  const Result r = denoised(stripes, exponential, 16);
  EXPECT_LT(r.rmse(Channel::denoised, stripes), 0.2 * r.rmse(Channel::radiance, stripes));
  double dark = 0, bright = 0;
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x)
      (x / 2 % 2 == 0 ? dark : bright) += static_cast<double>(r.film.pixel(Channel::denoised, x, y)[0]);
  EXPECT_NEAR(bright / dark, 3, 0.02);
}

TEST(Denoise, LightDoesNotCrossFromOneSurfaceToAnother) {
  const auto corner = [](bool by_depth) -> Picture {
    return [by_depth](uint32_t x, uint32_t) {
      Pixel p = even(0, 0);
      if (x < kWidth / 2) return p;
      p.residual = {0.03f, 0.03f, 0.03f};
      if (by_depth)
        p.depth = 3;
      else
        p.normal = {1, 0, 0};
      return p;
    };
  };
  for (const bool by_depth : {false, true}) {
    const Result r = denoised(corner(by_depth), exponential, 16);
    double dark = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
      dark += static_cast<double>(r.film.pixel(Channel::denoised, kWidth / 2, y)[0]) - 1;
    EXPECT_NEAR(dark / kHeight, 0.03, 0.006) << by_depth;
  }
}

// An edge that no feature shows: where its error would be larger than the noise, places choose narrow kernels.
TEST(Denoise, AShadowStaysWhereNoiseIsLess) {
  const Picture shadow = [](uint32_t x, uint32_t) {
    Pixel p = even(0, 0);
    if (x >= kWidth / 2) p.residual = {0.1f, 0.1f, 0.1f};
    return p;
  };
  const Result r = denoised(
      shadow, [](Rng& rng) { return 0.9f + 0.2f * rng.next_float(); }, 16);
  double lit = 0, dark = 0;
  for (uint32_t y = 0; y < kHeight; ++y) {
    lit += static_cast<double>(r.film.pixel(Channel::denoised, kWidth / 2 - 2, y)[0]) / kHeight;
    dark += static_cast<double>(r.film.pixel(Channel::denoised, kWidth / 2 + 1, y)[0]) / kHeight;
  }
  EXPECT_NEAR(lit - dark, 0.2, 0.02);
  EXPECT_LT(r.rmse(Channel::denoised, shadow), 1.05 * r.rmse(Channel::radiance, shadow));
}

// One pass of one pixel in 2,000 is 500 times as bright: more than any kernel of a smooth image hides.
TEST(Denoise, FirefliesAreSpreadAndTheirLightIsNotLost) {
  const Noise fireflies = [](Rng& rng) { return rng.next_float() < 0.0005f ? 500.0f : 1.0f; };
  const auto most = [](const Result& r, Channel channel) {
    float all = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) all = std::max(all, r.film.pixel(channel, x, y)[1]);
    return all;
  };
  const Result spread = denoised(even, fireflies, 16), kept = denoised(even, fireflies, 16, true);
  EXPECT_GT(most(spread, Channel::radiance), 9);
  EXPECT_LT(most(spread, Channel::denoised), 1.1 * 1.375);  // of the mean
  EXPECT_LT(most(spread, Channel::denoising_color), 2.1);
  EXPECT_GT(most(kept, Channel::denoising_color), 9);
  EXPECT_NEAR(spread.mean(Channel::denoised) / spread.mean(Channel::radiance), 1, 0.005);
  EXPECT_NEAR(spread.mean(Channel::denoising_color) / spread.mean(Channel::radiance), 1, 0.005);
}

// What is bright in every pass is no firefly, however small.
TEST(Denoise, ASmallHighlightStays) {
  const Picture glint = [](uint32_t x, uint32_t y) {
    Pixel p = even(0, 0);
    if (x == 40 && y == 30) p.residual = {200, 200, 200};
    return p;
  };
  const Result r = denoised(
      glint, [](Rng& rng) { return 0.9f + 0.2f * rng.next_float(); }, 64);
  EXPECT_NEAR(r.film.pixel(Channel::denoised, 40, 30)[1], 201, 20);
}

TEST(Denoise, IntervalsHoldTheTruth) {
  const Picture slope = [](uint32_t x, uint32_t y) {
    Pixel p = even(0, 0);
    p.residual = Rgb{1, 1, 1} * (0.05f + 0.3f * static_cast<float>(x) / kWidth);
    if (y > 40) p.normal = {0, 1, 0}, p.residual = p.residual * 2.0f;
    return p;
  };
  // Neighbours share the filter's noise: a picture has few errors that are independent, and the share scatters.
  for (const auto& noise : {exponential, sparse}) {
    const double covered = denoised(slope, noise, 16).covered(slope);
    EXPECT_GT(covered, 0.88);
    EXPECT_LE(covered, 1.0);
  }
}

TEST(Denoise, ThreadsChangeNoBit) {
  const Result one = denoised(even, sparse, 8, false, 1), four = denoised(even, sparse, 8, false, 4);
  for (const Channel c : {Channel::denoised, Channel::denoised_error, Channel::denoising_color})
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x) ASSERT_EQ(*one.film.pixel(c, x, y), *four.film.pixel(c, x, y));
}

TEST(Denoise, OfOnePassNothingIsKnownAndItStays) {
  const Result r = denoised(even, exponential, 1);
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x) {
      ASSERT_EQ(*r.film.pixel(Channel::denoised, x, y), *r.film.pixel(Channel::radiance, x, y));
      ASSERT_EQ(*r.film.pixel(Channel::denoised_error, x, y), 0);
    }
}

TEST(Denoise, StopsWhenCancelled) {
  Film film({0, 0, 64, 64}, {}, true);
  const std::vector<ResidualSums> sums(64 * 64);
  Progress progress;
  progress.cancel();
  EXPECT_THROW(denoise({4, 0.95, false}, sums, progress, film), Error);
}

}  // namespace
}  // namespace lumicut
