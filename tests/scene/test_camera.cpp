#include <gtest/gtest.h>

#include "scene/camera.h"

namespace lumicut {

TEST(Camera, CentreOfTheImageLooksForward) {
  const Camera c;
  const auto s = c.generate(320, 240, 640, 480, 0.5f, 0.5f);
  EXPECT_EQ(s.direction, c.forward);
  EXPECT_EQ(s.origin, c.position);
}

TEST(Camera, TopRowLooksUpByHalfTheFieldOfView) {
  Camera c;
  c.tan_half_fov_y = std::tan(0.4f);
  const auto s = c.generate(320, 0, 640, 480, 0, 0);
  EXPECT_NEAR(std::atan2(s.direction.y, -s.direction.z), 0.4f, 1e-6f);
  EXPECT_NEAR(s.forward_cosine, std::cos(0.4f), 1e-6f);
}

TEST(Camera, ShiftMovesTheImageByItsHeight) {
  Camera c, shifted;
  shifted.shift_y = 0.5f;
  // Half an image up: the centre looks where the top edge looked.
  EXPECT_EQ(shifted.generate(320, 240, 640, 480, 0, 0).direction, c.generate(320, 0, 640, 480, 0, 0).direction);
}

TEST(Camera, OrthographicRaysAreParallelAndSpanItsHeight) {
  Camera c;
  c.orthographic = true;
  c.height = 3.0f;
  const auto top = c.generate(320, 0, 640, 480, 0, 0), bottom = c.generate(320, 480, 640, 480, 0, 0);
  EXPECT_EQ(top.direction, bottom.direction);
  EXPECT_NEAR(top.origin.y - bottom.origin.y, 3.0f, 1e-6f);
}

TEST(Camera, LensRaysMeetInTheFocalPlane) {
  Camera c;
  c.lens_radius = 0.2f, c.focus_distance = 4.0f;
  const auto a = c.generate(100, 80, 640, 480, 0.9f, 0.1f), b = c.generate(100, 80, 640, 480, 0.4f, 0.6f);
  const auto at_focus = [&](const Camera::Sample& s) { return s.origin + s.direction * (4.0f / s.forward_cosine); };
  EXPECT_LT(length(at_focus(a) - at_focus(b)), 1e-5f);  // rounding of a few units around 4
  EXPECT_GT(length(a.origin - b.origin), 0.05f);
}

}  // namespace lumicut
