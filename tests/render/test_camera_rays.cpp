// Panoramas and pixel filters against what they are by definition.
#include <gtest/gtest.h>

#include <numbers>

#include "render/camera_rays.h"

namespace lumicut {

constexpr float kPi = std::numbers::pi_v<float>;

TEST(Camera, EquirectangularImagesHaveTheViewInTheMiddleAndUpAtTheTop) {
  Camera c;
  c.panorama = Camera::Panorama::equirectangular;
  const auto expect = [&](float x, float y, const Vec3f& direction) {
    const Camera::Sample s = c.generate(x, y, 200, 100, 0, 0);
    EXPECT_NEAR(length(s.direction - direction), 0.0f, 1e-5f) << x << " " << y;
    EXPECT_EQ(s.forward_cosine, 1.0f);
  };
  expect(100, 50, c.forward), expect(150, 50, c.right), expect(50, 50, -c.right), expect(100, 0, c.up);
  expect(100, 100, -c.up), expect(0, 50, -c.forward);
  c.longitude[0] = 0, c.longitude[1] = kPi, c.latitude[0] = 0, c.latitude[1] = kPi / 2;
  expect(0, 100, c.forward), expect(100, 100, c.right), expect(0, 0, c.up);
}

TEST(Camera, FisheyesGrowWithTheAngleAndWithTheSineOfItsHalf) {
  Camera c;
  c.panorama = Camera::Panorama::fisheye_equidistant, c.fisheye_fov = 3.0f;
  for (const float share : {0.1f, 0.5f, 0.9f}) {
    const Camera::Sample s = c.generate(50 + 50 * share, 50, 100, 100, 0, 0);
    EXPECT_NEAR(std::acos(dot(s.direction, c.forward)), 1.5f * share, 1e-4f);
    EXPECT_GT(dot(s.direction, c.right), 0.0f);
    EXPECT_FALSE(s.outside);
  }
  EXPECT_TRUE(c.generate(1, 1, 100, 100, 0, 0).outside);
  c.panorama = Camera::Panorama::fisheye_equisolid, c.fisheye_lens = 10, c.sensor_width = 36, c.sensor_height = 24;
  for (const float r : {2.0f, 6.0f, 11.0f}) {
    const Camera::Sample s = c.generate(50, 50 - 100 * r / 24, 100, 100, 0, 0);
    EXPECT_NEAR(2 * 10 * std::sin(0.5f * std::acos(dot(s.direction, c.forward))), r, 1e-3f);
    EXPECT_GT(dot(s.direction, c.up), 0.0f);
  }
}

TEST(Camera, MirrorBallsShowTheReflectionsOfABall) {
  Camera c;
  c.panorama = Camera::Panorama::mirror_ball;
  for (const float r : {0.0f, 0.3f, 0.9f}) {
    const Camera::Sample s = c.generate(100 + 80 * r, 50 - 30 * r, 200, 100, 0, 0);  // an ellipse
    const float x = 0.8f * r, y = 0.6f * r;
    const Vec3f normal = c.right * x + c.up * y - c.forward * std::sqrt(1 - r * r);
    // The ball's reflection of what looks along `forward`, mirrored front to back.
    Vec3f seen = c.forward - normal * (2 * dot(c.forward, normal));
    seen = seen - c.forward * (2 * dot(seen, c.forward));
    EXPECT_NEAR(length(s.direction - seen), 0.0f, 1e-5f) << r;
    EXPECT_FALSE(s.outside);
  }
  EXPECT_TRUE(c.generate(5, 5, 200, 100, 0, 0).outside);
}

TEST(Camera, FacesOfEquiangularCubesHaveEvenAngles) {
  Camera c;
  c.panorama = Camera::Panorama::equiangular_cube;
  for (const float share : {-1.0f, -0.5f, 0.0f, 0.25f}) {
    const Vec3f d = c.generate(50 + 50 * share, 50, 100, 100, 0, 0).direction;
    EXPECT_NEAR(std::atan2(dot(d, c.right), dot(d, c.forward)), share * kPi / 4, 1e-5f);
    EXPECT_NEAR(dot(d, c.up), 0.0f, 1e-6f);
  }
}

TEST(Camera, PanoramasShiftByWidthsAndHeights) {
  Camera c, shifted;
  c.panorama = shifted.panorama = Camera::Panorama::equirectangular;
  shifted.shift_x = 0.1f, shifted.shift_y = 0.2f;
  EXPECT_NEAR(
      length(shifted.generate(80, 60, 200, 100, 0, 0).direction - c.generate(100, 40, 200, 100, 0, 0).direction), 0.0f,
      1e-5f);
}

TEST(PixelFilter, OffsetsAreDistributedAsTheFilterSays) {
  for (const auto kind : {PixelFilter::Kind::box, PixelFilter::Kind::gaussian, PixelFilter::Kind::blackman_harris})
    for (const float width : {1.0f, 1.5f, 4.0f}) {
      if (kind == PixelFilter::Kind::box && width != 1.0f) continue;
      const FilterSampler sampler({kind, width});
      double sum2 = 0.0;
      constexpr int kCount = 100000;
      for (int i = 0; i < kCount; ++i) {
        const auto x = static_cast<double>(sampler.offset((static_cast<float>(i) + 0.5f) / kCount));
        sum2 += x * x / kCount;
      }
      EXPECT_EQ(sampler.offset(0.5f), 0.0f);
      EXPECT_NEAR(static_cast<double>(sampler.offset(0.25f)), -static_cast<double>(sampler.offset(0.75f)), 1e-5);
      // Variances: of the box 1/12; of exp(−2(2x/w)²), cut at 1.5 w, w²/16 (the cut takes less than 1e-3 of it); of
      // Blackman-Harris' window of length 2w by its cosine series: ∫ x² cos(2πk(x/2w)) over the window.
      double expected = 1.0 / 12;
      if (kind == PixelFilter::Kind::gaussian) expected = static_cast<double>(width * width) / 16;
      if (kind == PixelFilter::Kind::blackman_harris) {
        const double w = static_cast<double>(width), a[4] = {0.35875, 0.48829, 0.14128, 0.01168};
        double series = a[0] / 3;  // in units of w², about the centre, where the signs of all terms are +
        for (int k = 1; k < 4; ++k)
          series += a[k] * 2 * std::cos(std::numbers::pi * k) / (std::numbers::pi * std::numbers::pi * k * k);
        expected = w * w * series / a[0];
      }
      EXPECT_NEAR(sum2, expected, 0.003 * expected) << static_cast<int>(kind) << " " << width;
    }
}

}  // namespace lumicut
