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
  make_spheres(lights, 0.5f, 10.0f);  // at least 0.01: none of these distances
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

// n lights in a disk of radius r: ten in one of r √(10/n).
TEST(SphereRadii, OfFewerThanElevenLightsAreAsIfMoreLayAsDenselyFurtherOut) {
  std::vector<Vpl> none;
  make_spheres(none, 2.0f, 5.0f);
  std::vector<Vpl> one = oriented({{1, 2, 3}});
  make_spheres(one, 2.0f, 5.0f);
  EXPECT_EQ(one[0].radius(), 2.0f * kLonelySphere * 5.0f);
  std::vector<Vpl> few = oriented({{0, 0, 0}, {1, 0, 0}, {0, 2, 0}});
  make_spheres(few, 2.0f, 5.0f);
  EXPECT_FLOAT_EQ(few[0].radius(), 2.0f * 2.0f * std::sqrt(5.0f));
}

TEST(SphereRadii, DoNotFeelADistantLight) {
  Rng rng(1, Stage::test);
  std::vector<Vec3f> places;
  for (int i = 0; i < 500; ++i) places.push_back(test::random_point(rng, 1.0f));
  std::vector<Vpl> near = oriented(places);
  places.push_back({1e5f, 0, 0});
  std::vector<Vpl> with_far = oriented(places);
  make_spheres(near, 1.0f, 1.0f), make_spheres(with_far, 1.0f, 1.0f);
  for (size_t i = 0; i < near.size(); ++i) EXPECT_EQ(near[i].radius(), with_far[i].radius());
}

}  // namespace lumicut
