#include <gtest/gtest.h>

#include "bsdf/ggx_transmission.h"
#include "scene/scene.h"
#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

Material ggx(const Rgb& base, float roughness) {
  Material m;
  m.lobe = LobeModel::ggx;
  m.diffuse = base, m.specular = {1, 1, 1};
  m.roughness = roughness;
  return m;
}

Material glass(float roughness, float ior = 1.5f, const Rgb& base = {1, 1, 1}) {
  Material m = ggx(base, roughness);
  m.transmission = 1, m.ior = ior;
  return m;
}

struct OneSurface {
  explicit OneSurface(const Material& m) {
    scene.set_materials({m});
    Mesh mesh;  // that the hit is of
    test::add_quad(mesh, {0, 0, 3}, {2, 0, 3}, {2, 4, 3}, {0, 4, 3}, 0);
    scene.add_mesh(mesh);
    hit.position = {1, 2, 3}, hit.offset = 1e-5f, hit.geometric_normal = hit.normal = {0, 0, 1};
  }
  Bsdf bsdf(const Vec3f& to_viewer) const { return scene.interaction(hit, to_viewer).bsdf; }
  std::optional<BsdfSample> follow(const Vec3f& to_viewer, float choice, float u = 0.3f, float v = 0.6f) const {
    return bsdf(to_viewer).sample_specular(choice, u, v);
  }
  Scene scene{Scene::Config{}};
  SurfaceHit hit;
};

bool transmits(const BsdfSample& s) { return (s.flags & kTransmitted) != 0; }

Vec3f at(float cosine, float azimuth = 0.7f) {
  const float s = std::sqrt(1 - cosine * cosine);
  return {s * std::cos(azimuth), s * std::sin(azimuth), cosine};
}

// Mean weight of what is reflected and what is transmitted.
std::pair<double, double> energy(const Material& m, const Vec3f& to_viewer) {
  const OneSurface surface(m);
  constexpr int kSamples = 20000;
  Rng rng(2, Stage::test);
  double reflected = 0, transmitted = 0;
  for (int i = 0; i < kSamples; ++i) {
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    if (const auto f = surface.follow(to_viewer, choice, u, v))
      (transmits(*f) ? transmitted : reflected) += f->weight.y / kSamples;
  }
  return {reflected, transmitted};
}

Material window(float roughness, const Rgb& base = {1, 1, 1}) {
  Material m = glass(roughness, 1.5f, base);
  m.shadows_pass = true;
  return m;
}

}  // namespace

// Light paths and what follows the first surface that is seen; the camera's rays are bent as ever.
TEST(SpecularLobes, LightGoesStraightThroughGlassWhoseShadowsPass) {
  const OneSurface clear(window(0, {0.81f, 0.64f, 0.25f})), bends(glass(0, 1.5f, {0.81f, 0.64f, 0.25f}));
  for (const float side : {1.0f, -1.0f}) {
    const Vec3f view = at(0.6f) * side;
    const auto straight = clear.bsdf(view).sample_specular(0.9f, 0.3f, 0.6f, Passage::straight);
    ASSERT_TRUE(straight);
    EXPECT_EQ(straight->flags, kSpecular | kTransmitted | kStraight | kSharp);
    EXPECT_EQ(straight->direction, -view);
    const auto camera = clear.follow(view, 0.9f), before = bends.follow(view, 0.9f);
    ASSERT_EQ(camera.has_value(), before.has_value());
    if (camera) {
      EXPECT_EQ(camera->direction, before->direction);
    }
    // By chance of what passes: the mean has the colour once, and no factor of refraction.
    Rng rng(7, Stage::test);
    Rgb carried{};
    constexpr int kSamples = 100000;
    for (int i = 0; i < kSamples; ++i)
      if (const auto s = clear.bsdf(view).scatter(rng); s && (s->flags & kStraight) != 0)
        carried += s->weight * (s->factor / kSamples);
    float refracted = 0;
    const float passed = 1 - fresnel_reflectance(0.6f, 1.5f, refracted);
    EXPECT_NEAR(carried.x, passed * 0.9f, 0.005);
    EXPECT_NEAR(carried.y, passed * 0.8f, 0.005);
    EXPECT_NEAR(carried.z, passed * 0.5f, 0.005);
  }
}

TEST(SpecularLobes, WhiteGlassWhoseShadowsPassKeepsAllLightFromEitherSide) {
  for (const float roughness : {0.0f, 0.15f, 0.5f, 1.0f})
    for (const float cosine : {1.0f, 0.7f, 0.4f, 0.15f, -0.15f, -0.4f, -1.0f}) {
      const OneSurface surface(window(roughness));
      const Bsdf bsdf = surface.bsdf(at(cosine));
      Rng rng(8, Stage::test);
      double all = 0;
      constexpr int kSamples = 20000;
      for (int i = 0; i < kSamples; ++i) {
        const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
        if (const auto s = bsdf.sample_specular(choice, u, v, Passage::straight)) all += s->weight.y / kSamples;
      }
      EXPECT_NEAR(all, 1, 0.025) << roughness << " " << cosine;  // of the table, and noise
    }
}

// Of even light from all sides what the inside gets is what a border that bends it lets in and throws back: all. A single
// direction may get more or less.
TEST(SpecularLobes, OpenGlassKeepsEvenLightAsItsInsideSeesIt) {
  for (const float ior : {1.33f, 1.5f, 2.0f}) {
    Material m = window(0);
    m.ior = ior, m.open_glass = true;
    const OneSurface surface(m);
    Rng rng(9, Stage::test);
    double all = 0;
    constexpr int kDirections = 2000;
    for (int i = 0; i < kDirections; ++i) {
      const Vec3f view = at(-std::sqrt((static_cast<float>(i) + 0.5f) / kDirections));  // by the cosine
      const Bsdf bsdf = surface.bsdf(view);
      for (const auto& s : bsdf.specular_ways(0.3f, 0.6f, Passage::straight))
        if (s) all += s->weight.y / kDirections;
    }
    EXPECT_NEAR(all, 1, 0.002) << ior;
  }
}

TEST(SpecularLobes, RoughGlassOfSingleScatteringLosesWhatMeetsOtherFacets) {
  const GlassAlbedo kept(1.5f);
  for (const float roughness : {0.4f, 0.7f, 1.0f})
    for (const float cosine : {1.0f, 0.6f, 0.3f, -0.6f, -1.0f}) {
      Material m = glass(roughness, 1.5f);
      m.facets_once = true;
      const auto [reflected, transmitted] = energy(m, at(cosine));
      const double expected = kept.at(cosine < 0, roughness * roughness, std::abs(cosine));
      EXPECT_LT(expected, 1) << roughness << " " << cosine;
      EXPECT_NEAR(reflected + transmitted, expected, 0.02) << roughness << " " << cosine;  // of the table, and noise
    }
}

// What all ways carry together is what choosing one of them carries in the mean.
TEST(SpecularLobes, AllWaysTogetherAreTheMeanOfOneByChance) {
  Material metal = ggx({0.9f, 0.6f, 0.3f}, 0), lacquer = ggx({0.5f, 0.4f, 0.3f}, 0.6f);
  metal.metallic = 1, metal.coat = 0.7f, lacquer.coat = 1;
  for (const Material& m : {glass(0), glass(0.3f, 1.3f, {0.8f, 0.5f, 0.9f}), window(0), metal, lacquer})
    for (const float cosine : {0.9f, 0.4f, -0.2f, -0.8f})
      for (const Passage passage : {Passage::refracted, Passage::straight}) {
        const OneSurface surface(m);
        const Bsdf bsdf = surface.bsdf(at(cosine));
        Rgb all{}, mean{};
        for (const auto& s : bsdf.specular_ways(0.3f, 0.6f, passage))
          if (s) all += s->weight;
        constexpr int kChoices = 4000;
        for (int i = 0; i < kChoices; ++i)
          if (const auto s = bsdf.sample_specular((static_cast<float>(i) + 0.5f) / kChoices, 0.3f, 0.6f, passage))
            mean += s->weight / kChoices;
        EXPECT_GT(max_component(all), 0.01f);
        EXPECT_LT(max_component(max(all - mean, mean - all)), 2e-3f) << cosine;  // three ways' steps of 1/4000
      }
}

TEST(SpecularLobes, AMirrorReflectsExactly) {
  Material m = ggx({0.9f, 0.6f, 0.3f}, 0);
  m.metallic = 1;
  const OneSurface mirror(m);
  const Vec3f to_viewer = at(0.6f);
  const auto f = mirror.follow(to_viewer, 0.5f);
  ASSERT_TRUE(f);
  EXPECT_FALSE(transmits(*f));
  const Vec3f expected{-to_viewer.x, -to_viewer.y, to_viewer.z};
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(f->direction[k], expected[k], 1e-6f);
    const float f0 = m.diffuse[k];
    // Of glass of index 1.5 at 53 degrees: F = 0.064525 by Fresnel's equations. Schlick's term there is 0.4^5 = 0.0102.
    EXPECT_NEAR(f->weight[k], f0 + (1 - f0) * (0.064525f - 0.04f) / 0.96f, 2e-5f);
  }
  EXPECT_GT(mirror.bsdf(to_viewer).origin(f->flags).z, 3.0f) << "off the surface, on the viewer's side";
  const SurfacePoint p = mirror.bsdf(to_viewer).layers()[0];
  EXPECT_EQ(p.specular, Rgb{}) << "what rays follow is not shaded as well";
  EXPECT_EQ(max_component(p.diffuse), 0.0f);
}

TEST(SpecularLobes, NothingWhereLightsCanShade) {
  EXPECT_FALSE(OneSurface(ggx({0.5f, 0.5f, 0.5f}, 0.3f)).follow(at(0.6f), 0.5f));
  EXPECT_FALSE(OneSurface(test::diffuse(0.5f, 0.5f, 0.5f)).follow(at(0.6f), 0.5f));
}

TEST(SpecularLobes, GlassRefractsBySnellsLawFromBothSides) {
  const OneSurface surface(glass(0, 1.5f));
  for (const float cosine : {0.2f, 0.5f, 0.8f, 0.99f})
    for (const bool inside : {false, true}) {
      const Vec3f to_viewer = inside ? -at(cosine) : at(cosine);
      const auto f = surface.follow(to_viewer, 0.9999f);
      const float sine = std::sqrt(1 - cosine * cosine), expected = inside ? sine * 1.5f : sine / 1.5f;
      ASSERT_TRUE(f);
      if (expected >= 1) {
        EXPECT_FALSE(transmits(*f)) << "total reflection";
        EXPECT_NEAR(f->weight.x, 1.0f, 1e-5f);
        continue;
      }
      ASSERT_TRUE(transmits(*f));
      EXPECT_NEAR(std::hypot(f->direction.x, f->direction.y), expected, 1e-5f);
      EXPECT_LT(f->direction.z * to_viewer.z, 0.0f) << "goes on to the other side";
      EXPECT_LT((surface.bsdf(to_viewer).origin(f->flags).z - 3.0f) * to_viewer.z, 0.0f);
      EXPECT_NEAR(cross(f->direction, to_viewer).z, 0.0f, 1e-5f) << "in the plane of incidence";
    }
}

TEST(SpecularLobes, GlassReflectsFresnelsShareAndPassesTheRest) {
  const auto [straight, through] = energy(glass(0, 1.5f), at(1.0f));
  EXPECT_NEAR(straight, 0.04, 0.005);
  EXPECT_NEAR(through, 0.96, 0.005);
  float refracted = 0;
  const float edge = fresnel_reflectance(0.2f, 1.5f, refracted);
  const auto [slanting, rest] = energy(glass(0, 1.5f), at(0.2f));
  EXPECT_NEAR(slanting, edge, 0.01);
  EXPECT_NEAR(slanting + rest, 1.0, 1e-4);
}

TEST(SpecularLobes, TwoBordersColourLikeTheBase) {
  const OneSurface surface(glass(0, 1.5f, {0.25f, 0.81f, 1.0f}));
  const auto f = surface.follow(at(1.0f), 0.9999f);
  ASSERT_TRUE(f && transmits(*f));
  EXPECT_NEAR(f->weight.x / f->weight.z, 0.5f, 1e-5f);
  EXPECT_NEAR(f->weight.y / f->weight.z, 0.9f, 1e-5f);
}

// 20,000 samples leave 0.3 % of noise; the table, of 400 directions each, is good to 1.5 %, edge-on 2 %.
TEST(SpecularLobes, RoughGlassGivesBackWhatSingleScatteringLoses) {
  for (const float ior : {1.2f, 2.0f})
    for (const float roughness : {0.05f, 0.1f, 0.3f, 0.5f, 0.75f, 1.0f})
      for (const float cosine : {0.1f, 0.4f, 1.0f})
        for (const float sign : {1.0f, -1.0f}) {
          const auto [r, t] = energy(glass(roughness, ior), at(cosine) * sign);
          EXPECT_NEAR(r + t, 1.0, cosine <= 0.1f ? 0.025 : 0.02)
              << "ior " << ior << " roughness " << roughness << " cosine " << cosine * sign;
        }
}

TEST(SpecularLobes, GlassOfANewIndexHasAnAlbedoOfItsOwn) {
  OneSurface surface(glass(0.8f, 1.3f));
  const auto albedo = [&] { return surface.scene.bsdf_parameters(0, {}).glass->at(false, 0.64f, 0.5f); };
  const float before = albedo();
  surface.scene.set_materials({glass(0.8f, 2.0f)});
  EXPECT_EQ(albedo(), GlassAlbedo(2.0f).at(false, 0.64f, 0.5f));
  EXPECT_NE(albedo(), before);
}

TEST(SpecularLobes, SharpMirrorsLoseNothing) {
  Material m = ggx({1, 1, 1}, 0.09f);
  m.metallic = 1;
  const auto [r, t] = energy(m, at(0.5f));
  EXPECT_NEAR(r, 1.0, 0.01);
  EXPECT_EQ(t, 0.0);
}

// Clear coats above mirrors, glass and what lights shade: all that leaves is specular or shaded, and is at most all.
TEST(SpecularLobes, ASmoothClearCoatAndWhatIsBeneathTogetherKeepTheLight) {
  for (const float coat : {0.25f, 1.0f})
    for (const float coat_roughness : {0.0f, 0.08f})
      for (const float cosine : {0.1f, 0.3f, 0.6f, 1.0f}) {
        Material mirror = ggx({1, 1, 1}, 0.0f), clear = glass(0.4f), paint = ggx({1, 1, 1}, 0.6f);
        mirror.metallic = 1;
        for (Material m : {mirror, clear, paint}) {
          m.coat = coat, m.coat_roughness = coat_roughness;
          const auto [r, t] = energy(m, at(cosine));
          const OneSurface surface(m);
          const SurfacePoint p = surface.bsdf(at(cosine)).layers()[0];
          double shaded = p.diffuse.x * std::numbers::pi_v<float> * mean_diffuse_falloff(p.falloff);
          if (max_component(p.specular) > 0.0f) {
            Rng rng(4, Stage::test);
            SurfacePoint lobe = p;
            lobe.diffuse = {};
            constexpr int kSamples = 20000;
            for (int i = 0; i < kSamples; ++i) {
              const float u = rng.next_float(), v = rng.next_float();
              if (const auto s = PointBsdf(lobe).sample(0.5f, u, v)) shaded += s->weight.x / kSamples;
            }
          }
          EXPECT_LE(r + t + shaded, 1.02) << coat << " " << cosine;
          EXPECT_GE(r + t + shaded, cosine < 0.2f ? 0.75 : 0.88) << coat << " " << cosine;
        }
      }
}

TEST(SpecularLobes, ASmoothClearCoatReflectsFresnelsShareOverARoughBase) {
  Material m = ggx({0.5f, 0.5f, 0.5f}, 0.6f);
  m.coat = 1, m.coat_ior = 1.5f;
  EXPECT_NEAR(energy(m, at(1.0f)).first, 0.04, 1e-4);
  float refracted = 0.0f;
  EXPECT_NEAR(energy(m, at(0.2f)).first, fresnel_reflectance(0.2f, 1.5f, refracted), 1e-4);
  m.coat = 0.5f;
  EXPECT_NEAR(energy(m, at(1.0f)).first, 0.02, 1e-4);
}

TEST(SpecularLobes, ASmoothCoatAndItsBaseTogetherKeepTheLight) {
  const OneSurface surface(ggx({1, 1, 1}, 0.0f));
  for (const float cosine : {0.1f, 0.3f, 0.6f, 1.0f}) {
    const auto f = surface.follow(at(cosine), 0.5f);
    ASSERT_TRUE(f);
    const SurfacePoint p = surface.bsdf(at(cosine)).layers()[0];
    const float base = p.diffuse.x * std::numbers::pi_v<float> * mean_diffuse_falloff(p.falloff);
    EXPECT_LE(base + f->weight.x, 1.001f) << cosine;
    EXPECT_GE(base + f->weight.x, 0.92f) << cosine;
  }
}

}  // namespace lumicut
