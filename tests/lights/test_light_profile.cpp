#include "scene/light_profile.h"

#include <gtest/gtest.h>

#include <numbers>
#include <unordered_map>

#include "core/error.h"
#include "lights/falloff.h"
#include "lights/light_sampler.h"
#include "lights/trace_vpls.h"
#include "tests/support/test_scenes.h"

namespace lumicut {

namespace {

constexpr double kPi = std::numbers::pi;

// A lopsided light: four quarters, downwards and a little up.
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
  LightProfiles profiles;
  profiles.add(std::make_shared<LightProfile>(profile));
  l.profile = profile.id();
  l.direction = normalize(Vec3f{1, -2, 0.5f});
  l.tangent = Frame(l.direction).t;
  l.value = {2, 2, 2};
  scene->set_lights({l}, std::move(profiles));
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
  const Falloff falloff(scene->profiles());
  for (int i = 0; i < 1000; ++i) {
    Rng rng(i, Stage::test, 1);
    const Vec3f d = test::random_direction(rng);
    const float share = falloff.of_spot(v, d);
    EXPECT_LE(share, 1.0f);
    EXPECT_TRUE(dot(d, v.normal) >= v.cos_outer() || share == 0.0f);
  }
  const Vec3f bitangent = cross(v.tangent(), v.normal);
  EXPECT_NEAR(falloff.of_spot(v, -bitangent), 1.0 * 3 / 12, 1e-4) << "90 degrees down, 270 around";
}

TEST(LightProfiles, OneOfTheSameContentIsKeptOnce) {
  LightProfiles profiles;
  const auto first = std::make_shared<LightProfile>(lopsided());
  profiles.add(first);
  profiles.add(std::make_shared<LightProfile>(lopsided()));
  EXPECT_EQ(profiles.find(first->id()), first.get());
  const auto other =
      std::make_shared<LightProfile>(std::vector<float>{0, 1}, std::vector<float>{0}, std::vector<float>{1, 1});
  EXPECT_EQ(profiles.find(other->id()), nullptr);
  profiles.add(other);
  EXPECT_EQ(profiles.find(other->id()), other.get());
  EXPECT_EQ(profiles.find(first->id()), first.get());
  EXPECT_EQ(profiles.find(0), nullptr);
}

TEST(LightProfiles, GoWithTheSceneAndTheLightsMadeOfIt) {
  const LightProfile table = lopsided();
  auto scene = lit_by(table);
  std::weak_ptr<const LightProfile> held = scene->profiles().hold(table.id());
  Progress progress;
  auto vpls = std::make_unique<VplSet>(trace_vpls(*scene, {.count = 10}, progress));
  scene.reset();
  ASSERT_FALSE(held.expired());
  EXPECT_GT(Falloff(vpls->profiles).of_spot(vpls->lights[0], vpls->lights[0].normal), 0.0f);
  vpls.reset();
  EXPECT_TRUE(held.expired());
}

// Two tables whose names are the same by chance: names have 31 bits, so that among some 100,000 tables two meet.
std::pair<LightProfile, LightProfile> namesakes() {
  const auto table = [](int i) {
    return LightProfile({0.0f, 1.0f, 2.0f}, {0.0f}, {1.0f, 1.0f, 1e-6f * static_cast<float>(1 + i)});
  };
  std::unordered_map<uint32_t, int> seen;
  for (int i = 0;; ++i)
    if (const auto [at, fresh] = seen.emplace(table(i).id(), i); !fresh) return {table(at->second), table(i)};
}

TEST(LightProfiles, OfTheSameNameDoNotMixBetweenScenes) {
  const auto [one, other] = namesakes();
  ASSERT_EQ(one.id(), other.id());
  ASSERT_FALSE(one == other);
  const auto a = lit_by(one), b = lit_by(other);
  EXPECT_EQ(*a->profiles().find(one.id()), one);
  EXPECT_EQ(*b->profiles().find(one.id()), other);
  EXPECT_NE(LightSampler(*a).power(), LightSampler(*b).power());
  EXPECT_NEAR(LightSampler(*a).power(), 2 * one.solid_angle(), 1e-4);
  EXPECT_NEAR(LightSampler(*b).power(), 2 * other.solid_angle(), 1e-4);
  // Within one scene neither could be told from the other.
  LightProfiles both;
  both.add(std::make_shared<LightProfile>(one));
  EXPECT_THROW(both.add(std::make_shared<LightProfile>(other)), Error);
  both.prefer(b->profiles());
  EXPECT_EQ(*both.find(one.id()), other);
}

TEST(LightProfiles, ALightWithoutItsTableIsRefused) {
  Scene scene{Scene::Config{}};
  Light l;
  l.profile = lopsided().id();
  scene.set_lights({l});
  Progress progress;
  EXPECT_THROW(scene.commit(progress), Error);
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
