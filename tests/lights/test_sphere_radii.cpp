#include <gtest/gtest.h>

#include "lights/sphere_radii.h"
#include "tests/support/test_scenes.h"

namespace lumicut {

namespace {

std::vector<Vpl> oriented(const std::vector<Vec3f>& places) {
  std::vector<Vpl> lights(places.size());
  for (size_t i = 0; i < places.size(); ++i)
    lights[i].kind = VplKind::oriented, lights[i].normal = {0, 0, 1}, lights[i].position = places[i];
  return lights;
}

}  // namespace

TEST(SphereRadii, AreTheDistanceToTheTenthNeighbour) {
  Rng rng(1, Stage::test);
  std::vector<Vec3f> places;
  for (int i = 0; i < 3000; ++i) places.push_back(test::random_point(rng, 1.0f));
  std::vector<Vpl> lights = oriented(places);
  make_spheres(lights, 0.5f, 10.0f);  // held between 0.01 and 1: none of these distances
  for (size_t i = 0; i < places.size(); i += 37) {
    std::vector<float> d;
    for (const Vec3f& p : places) d.push_back(length(p - places[i]));
    std::nth_element(d.begin(), d.begin() + 10, d.end());  // the nearest is the light itself
    EXPECT_EQ(lights[i].kind, VplKind::sphere);
    EXPECT_NEAR(lights[i].radius(), 0.5f * d[10], 1e-6f);
  }
}

TEST(SphereRadii, OfLightsInOnePlaceAreTheLeast) {
  std::vector<Vpl> lights = oriented(std::vector<Vec3f>(40, Vec3f{1, 2, 3}));
  make_spheres(lights, 1.0f, 5.0f);
  for (const Vpl& v : lights) EXPECT_EQ(v.radius(), kLeastSphere * 5.0f);
}

TEST(SphereRadii, OfFewerThanElevenLightsAreTheLargest) {
  for (const size_t n : {0, 1, 10}) {
    std::vector<Vpl> lights = oriented(std::vector<Vec3f>(n, Vec3f{}));
    for (size_t i = 0; i < n; ++i) lights[i].position.x = 0.01f * static_cast<float>(i);
    make_spheres(lights, 2.0f, 5.0f);
    for (const Vpl& v : lights) EXPECT_EQ(v.radius(), 2.0f * kLargestSphere * 5.0f);
  }
}

}  // namespace lumicut
