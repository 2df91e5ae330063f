#include "lights/light_profile.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/error.h"
#include "lights/light_sampler.h"
#include "tests/support/test_scenes.h"

namespace lumicut {

namespace {

constexpr double kPi = std::numbers::pi;

// A lopsided lamp: four quarters, downwards and a little up.
LightProfile lopsided() {
  std::vector<float> vertical, horizontal, values;
  for (int i = 0; i <= 12; ++i) vertical.push_back(static_cast<float>(i * kPi / 18));  // to 120 degrees
  for (int i = 0; i <= 4; ++i) horizontal.push_back(static_cast<float>(i * kPi / 2));
  for (int h = 0; h <= 4; ++h)
    for (int v = 0; v <= 12; ++v)
      values.push_back(static_cast<float>((h % 4 == 1 ? 0 : 100 + 50 * (h % 4)) * (12 - v)));
  return LightProfile(vertical, horizontal, values);
}

std::unique_ptr<Scene> lit_by(const LightProfile& profile) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Light l;
  static std::vector<ProfileRef> held;  // as long as the scenes
  held.push_back(keep_profile(profile));
  l.profile = held.back()->id();
  l.direction = normalize(Vec3f{1, -2, 0.5f});
  l.tangent = Frame(l.direction).t;
  l.value = {2, 2, 2};
  scene->set_lights({l});
  Progress progress;
  scene->commit(progress);
  return scene;
}

}  // namespace

TEST(LightProfile, IsItsTableAtItsAnglesAndNothingBeyond) {
  const LightProfile p = lopsided();
  EXPECT_FLOAT_EQ(p.largest(), 250 * 12);
  EXPECT_FLOAT_EQ(p(0, 0), 100.0f / 250);
  EXPECT_NEAR(p(static_cast<float>(kPi / 3), static_cast<float>(kPi)), 0.8 * 6 / 12, 1e-5);
  EXPECT_NEAR(p(static_cast<float>(kPi / 3), static_cast<float>(kPi * 1.25)), 0.9 * 6 / 12, 1e-5) << "between two";
  EXPECT_EQ(p(2.2f, 1.0f), 0.0f);
  EXPECT_NEAR(p.cos_outer(), -0.5, 1e-5);
}

TEST(LightProfile, SolidAngleAndSamplingAreThoseOfTheTable) {
  const LightProfile p = lopsided();
  double integral = 0;
  constexpr int kN = 1000;
  for (int i = 0; i < kN; ++i)
    for (int j = 0; j < kN; ++j) {
      const double z = 1 - 2 * (i + 0.5) / kN, phi = 2 * kPi * (j + 0.5) / kN;
      integral += p(static_cast<float>(std::acos(z)), static_cast<float>(phi)) * 4 * kPi / (kN * kN);
    }
  EXPECT_NEAR(p.solid_angle() / integral, 1.0, 1e-3);
  double mean = 0, square = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    Rng rng(i, Stage::test);
    float vertical, horizontal, pdf;
    const float u = rng.next_float(), v = rng.next_float();
    p.sample(u, v, rng.next_float(), vertical, horizontal, pdf);
    const double x = p(vertical, horizontal) / pdf / p.solid_angle();
    mean += x / kSamples, square += x * x / kSamples;
  }
  EXPECT_NEAR(mean, 1.0, 0.01);
  EXPECT_LT(square - mean * mean, 0.3) << "by importance: what a quarter's ramp leaves";
}

TEST(LightProfile, PowerOfALampGoesRoundThroughItsPaths) {
  const LightProfile p = lopsided();
  const auto scene = lit_by(p);
  const LightSampler emitters(*scene);
  EXPECT_NEAR(emitters.power(), 2 * p.solid_angle(), 1e-4);
  double flux = 0;
  constexpr int kPaths = 50000;
  for (int i = 0; i < kPaths; ++i) {
    Rng rng(i, Stage::test);
    flux += luminance(emitters.sample_ray(rng).flux) / kPaths;
  }
  EXPECT_NEAR(flux / emitters.power(), 1.0, 0.01);
  ASSERT_EQ(emitters.delta_lights().size(), 1u) << "one VPL stands for it, exactly";
  const Vpl& v = emitters.delta_lights()[0];
  for (int i = 0; i < 1000; ++i) {
    Rng rng(i, Stage::test, 1);
    const Vec3f d = test::random_direction(rng);
    const float share = spot_profile(v, d);
    EXPECT_LE(share, 1.0f);
    EXPECT_TRUE(dot(d, v.normal) >= v.cos_outer() || share == 0.0f);
  }
  const Vec3f bitangent = cross(v.tangent(), v.normal);
  EXPECT_NEAR(spot_profile(v, -bitangent), 1.0 * 3 / 12, 1e-4) << "90 degrees down, 270 around";
}

TEST(LightProfile, OneOfTheSameContentIsKeptOnce) {
  EXPECT_EQ(keep_profile(lopsided()), keep_profile(lopsided()));
  const LightProfile other({0.0f, 1.0f}, {0.0f}, {1, 1});
  EXPECT_NE(keep_profile(other), keep_profile(lopsided()));
  EXPECT_EQ(find_profile(0), nullptr);
}

TEST(LightProfile, GoesWithTheLastWhoHoldsIt) {
  const LightProfile table({0.0f, 1.25f}, {0.0f}, {3, 1});
  const uint32_t id = table.id();
  EXPECT_EQ(hold_profile(id), nullptr);
  ProfileRef one = keep_profile(table), other = hold_profile(id);
  EXPECT_EQ(find_profile(id), one.get());
  one.reset();
  EXPECT_EQ(find_profile(id), other.get());
  other.reset();
  EXPECT_EQ(find_profile(id), nullptr);
  for (int i = 0; i < 20000; ++i)  // one after another there may be more than there is room for
    one = keep_profile(LightProfile({0.0f, 1.0f}, {0.0f}, {1, static_cast<float>(i)}));
  EXPECT_EQ(find_profile(one->id()), one.get());
  EXPECT_EQ(find_profile(id), nullptr);
}

TEST(LightProfile, TablesThatMakeNoSenseAreRefused) {
  EXPECT_THROW(LightProfile({0.0f}, {0.0f}, {1}), Error);
  EXPECT_THROW(LightProfile({0.0f, 1.0f}, {}, {}), Error);
  EXPECT_THROW(LightProfile({0.0f, 1.0f}, {0.0f}, {1}), Error);
  EXPECT_THROW(LightProfile({1.0f, 0.0f}, {0.0f}, {1, 1}), Error);
  EXPECT_THROW(LightProfile({0.0f, 9.0f}, {0.0f}, {1, 1}), Error);
  EXPECT_THROW(LightProfile({0.0f, 1.0f}, {0.0f, 1.0f}, {1, 1, 1, 1}), Error);
  EXPECT_THROW(LightProfile({0.0f, 1.0f}, {0.0f}, {1, -1}), Error);
  EXPECT_THROW(LightProfile({0.0f, 1.0f}, {0.0f}, {0, 0}), Error);
  EXPECT_THROW(LightProfile({0.0f, NAN}, {0.0f}, {1, 1}), Error);
}

}  // namespace lumicut
