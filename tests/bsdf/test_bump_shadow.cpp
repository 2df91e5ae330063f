// The dimming of bent normals, by its formula in other words. That kernels agree with it, tests of kernels show.
#include <gtest/gtest.h>

#include "bsdf/point_bsdf.h"

namespace lumicut {

TEST(BumpShadow, FollowsItsFormulaAndEndsAtBothEnds) {
  const Vec3f smooth{0, 0, 1};
  for (const float tilt : {0.2f, 0.6f, 1.2f})
    for (float angle = -1.5f; angle < 1.5f; angle += 0.05f) {
      SurfacePoint p;
      p.normal = {std::sin(tilt), 0, std::cos(tilt)}, p.smooth = smooth, p.mirror = p.normal, p.diffuse = {1, 1, 1};
      const Vec3f light{std::sin(angle), 0, std::cos(angle)};
      const double cosine = std::cos(static_cast<double>(angle) - static_cast<double>(tilt));
      if (!(cosine > 1e-3)) continue;
      // (s·l)/((n·l)(s·n)) = 1/(1 + tan(angle) tan(tilt)) up to the signs: above 1 for light from the other side.
      const double g = std::cos(static_cast<double>(angle)) / (cosine * std::cos(static_cast<double>(tilt)));
      const double expected = g >= 1 ? 1.0 : g + g * g * (1 - g);
      EXPECT_NEAR(static_cast<double>(reflectance(p, light).x), expected, 1e-4) << tilt << " " << angle;
    }
}

TEST(BumpShadow, PointsThatAreNotBentAreAsEver) {
  SurfacePoint p;
  p.normal = p.mirror = {0, 0, 1}, p.diffuse = {0.5f, 0.5f, 0.5f};
  EXPECT_EQ(p.lobes(), Lobes::none);
  EXPECT_EQ(reflectance(p, normalize(Vec3f{1, 0, 1})).x, 0.5f);
  p.smooth = {0, 0, 1};
  EXPECT_EQ(p.lobes(), Lobes::all);
}

}  // namespace lumicut
