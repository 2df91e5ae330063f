#include "lights/light_spacing.h"

#include <gtest/gtest.h>

#include "core/rng.h"

namespace lumicut {
namespace {

// Paths of four lights each that lie close together, evenly over a square. What a clamp takes and what rays bring back add up
// to all where spacings of lights and of places have one distribution.
TEST(LightSpacing, OfALightKnowsNothingOfThoseOfItsPath) {
  constexpr uint64_t kPaths = 4000;
  constexpr size_t kOfPath = 4;
  std::vector<Vpl> lights;
  for (uint64_t i = 0; i < kPaths; ++i) {
    Rng rng(1, Stage::light_path, i);
    const Vec3f place{rng.next_float(), rng.next_float(), 0};
    for (size_t k = 0; k < kOfPath; ++k) {
      lights.emplace_back();
      lights.back().position = place + Vec3f{rng.next_float(), rng.next_float(), 0} * 0.01f;
    }
  }
  const LightSpacing spacing(lights, 1.0f, nullptr);
  BallQueryTree::Scratch scratch;
  const auto inside = [](const Vec3f& p) { return std::abs(p.x - 0.5f) < 0.3f && std::abs(p.y - 0.5f) < 0.3f; };
  double places = 0, counted = 0, apart = 0, together = 0, of_lights = 0;
  for (size_t i = 0; i < lights.size(); ++i) {
    Rng rng(2, Stage::light_path, i);
    const Vec3f place{rng.next_float(), rng.next_float(), 0};
    if (inside(place)) places += std::pow(spacing.at(place, scratch), 2.0), ++counted;
    if (!inside(lights[i].position)) continue;
    apart += std::pow(spacing.of_light(i, 32, scratch), 2.0),
        together += std::pow(spacing.of_light(i, 0, scratch), 2.0);
    ++of_lights;
  }
  // Neighbourhoods of ten lights are those of two or three paths: 4,000 paths know the mean to about 1 %.
  EXPECT_NEAR((apart / of_lights) / (places / counted), 1.0, 0.04);
  EXPECT_LT((together / of_lights) / (places / counted), 0.8);
}

TEST(LightSpacing, OfFewLightsIsThatOfAllOthers) {
  std::vector<Vpl> lights(3);
  lights[1].position = {3, 0, 0}, lights[2].position = {0, 4, 0};
  const LightSpacing spacing(lights, 7.0f, nullptr);
  BallQueryTree::Scratch scratch;
  EXPECT_NEAR(spacing.of_light(0, 0, scratch), 4 * std::sqrt(5.0), 1e-4);       // two for ten
  EXPECT_NEAR(spacing.of_light(0, 1, scratch), 4 * std::sqrt(10.0 / 3), 1e-4);  // one for ten, and for three
  EXPECT_EQ(spacing.of_light(1, 1, scratch), 7.0f);                             // none is left
}

}  // namespace
}  // namespace lumicut
