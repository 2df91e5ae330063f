#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "scene/scene.h"
#include "tests/support/test_scenes.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

SurfacePoint point_of(const Rgb& kd, const Rgb& ks, float exponent, const Vec3f& to_viewer) {
  SurfacePoint p;
  p.normal = normalize(Vec3f{0.2f, -0.3f, 0.9f});
  p.mirror = normalize(reflect(to_viewer, p.normal));
  p.diffuse = kd * std::numbers::inv_pi_v<float>;
  p.specular = ks * cosine_lobe_scale(false, exponent);
  p.shape = exponent;
  return p;
}

const Vec3f kSlanting = normalize(Vec3f{0.2f, -0.3f, 0.9f});

// Of a level surface, not of rough glass.
Bsdf seen_from(const Vec3f& to_viewer, const Material& m) {
  Scene scene(Scene::Config{});
  scene.set_materials({m});
  return scene.bsdf({{}, {0, 0, 1}, {0, 0, 1}, to_viewer, 1e-5f}, 0, {});
}

// What one pixel shows of a coated surface: base and coat.
struct Coated {
  SurfacePoint base;
  std::optional<SurfacePoint> coat;
};

Coated coated(Material m, const Vec3f& to_viewer, const Vec3f& normal = {0, 0, 1}) {
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1};
  Scene scene(Scene::Config{});
  scene.set_materials({m});
  const Bsdf bsdf = scene.bsdf({{}, normal, normal, to_viewer, 1e-5f}, 0, {});
  const auto layers = bsdf.layers();
  return {layers[0], layers.size() > 1 ? std::optional(layers[1]) : std::nullopt};
}

Material lacquer(float coat, float coat_roughness, float roughness, float metallic, const Rgb& base = {1, 1, 1}) {
  Material m;
  m.diffuse = base, m.roughness = roughness, m.metallic = metallic;
  m.coat = coat, m.coat_roughness = coat_roughness;
  return m;
}

// A GGX surface as the scene makes it.
SurfacePoint ggx_point(const Rgb& base, float roughness, float metallic, float ior, const Vec3f& to_viewer,
                       const Vec3f& normal = normalize(Vec3f{0.2f, -0.3f, 0.9f})) {
  Material m;
  m.lobe = LobeModel::ggx;
  m.diffuse = base, m.specular = {1, 1, 1};
  m.roughness = roughness, m.metallic = metallic, m.ior = ior;
  Scene scene(Scene::Config{});
  scene.set_materials({m});
  return scene.bsdf({{}, normal, normal, to_viewer, 1e-5f}, 0, {}).layers()[0];
}

Material glossy_clay(const Rgb& base, float slope, bool once, const Rgb& gloss) {
  Material m;
  m.lobe = LobeModel::ggx, m.fresnel = false, m.diffuse = base, m.specular = gloss, m.roughness = 0.4f;
  m.diffuse_roughness = slope, m.diffuse_once = once;
  return m;
}

std::vector<SurfacePoint> points() {
  const Vec3f steep = normalize(Vec3f{0.3f, 0.1f, 0.9f}), flat = normalize(Vec3f{0.9f, 0.3f, 0.2f});
  return {point_of({0.5f, 0.4f, 0.3f}, {}, 0, steep),
          point_of({0.2f, 0.2f, 0.2f}, {0.6f, 0.5f, 0.4f}, 40, steep),
          point_of({}, {0.8f, 0.8f, 0.8f}, 5, flat),
          point_of({0.1f, 0.1f, 0.1f}, {0.5f, 0.5f, 0.5f}, 300, flat),
          ggx_point({0.5f, 0.4f, 0.3f}, 0.6f, 0, 1.5f, steep),
          ggx_point({0.9f, 0.7f, 0.3f}, 0.5f, 1, 1.5f, flat),
          ggx_point({0.2f, 0.2f, 0.2f}, 1.0f, 0.5f, 2.0f, flat),
          seen_from(flat, glossy_clay({0.5f, 0.4f, 0.3f}, 1.0f, false, {0.3f, 0.3f, 0.3f})).layers()[0],
          coated(lacquer(1.0f, 0.4f, 0.6f, 0.0f, {0.5f, 0.4f, 0.3f}), steep, kSlanting).base,
          *coated(lacquer(1.0f, 0.4f, 0.6f, 0.0f), steep, kSlanting).coat};
}

// Pearson's statistic over 16 x 32 cells of the sphere, against the density integrated over each cell.
TEST(Bsdf, SamplesFollowTheirDensity) {
  constexpr int kRows = 16, kColumns = 32, kSamples = 200000, kSub = 16;
  for (const SurfacePoint& p : points()) {
    const PointBsdf bsdf(p);
    std::array<double, kRows * kColumns> expected{};
    std::array<double, kRows * kColumns> found{};
    double mass = 0;
    for (int r = 0; r < kRows * kSub; ++r)
      for (int c = 0; c < kColumns * kSub; ++c) {
        const double z = -1.0 + 2.0 * (r + 0.5) / (kRows * kSub), phi = 2 * M_PI * (c + 0.5) / (kColumns * kSub);
        const double s = std::sqrt(1 - z * z);
        const Vec3f d{static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
                      static_cast<float>(z)};
        const double m = bsdf.pdf(d) * 4 * M_PI / (kRows * kSub * kColumns * kSub);
        expected[(r / kSub) * kColumns + c / kSub] += m;
        mass += m;
      }
    Rng rng(7, Stage::test);
    double lost = 0;
    for (int i = 0; i < kSamples; ++i) {
      const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
      const auto s = bsdf.sample(choice, u, v);
      if (!s) {
        lost += 1;
        continue;
      }
      ASSERT_NEAR(length(s->direction), 1.0f, 1e-4f);
      const int r = std::clamp(static_cast<int>((s->direction.z + 1) / 2 * kRows), 0, kRows - 1);
      const double phi = std::atan2(s->direction.y, s->direction.x);
      const int c =
          std::clamp(static_cast<int>((phi < 0 ? phi + 2 * M_PI : phi) / (2 * M_PI) * kColumns), 0, kColumns - 1);
      found[r * kColumns + c] += 1;
    }
    // What the density lacks of 1 is what falls below the horizon.
    EXPECT_NEAR(mass, 1.0 - lost / kSamples, 0.01);
    double chi2 = 0;
    int cells = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      const double e = expected[i] * kSamples;
      if (e < 10) continue;
      // The cells' integrals are good to about 1 %.
      chi2 += (found[i] - e) * (found[i] - e) / (e + 1e-4 * e * e);
      ++cells;
    }
    // Five standard deviations of chi-squared with `cells` degrees of freedom.
    EXPECT_LT(chi2, cells + 5 * std::sqrt(2.0 * cells)) << "lobe " << p.lobe << ", shape " << p.shape;
  }
}

TEST(Bsdf, WeightIsReflectanceTimesCosineOverDensity) {
  Rng rng(3, Stage::test);
  for (const SurfacePoint& p : points())
    for (int i = 0; i < 1000; ++i) {
      const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
      const auto s = PointBsdf(p).sample(choice, u, v);
      if (!s) continue;
      const Rgb f = reflectance(p, s->direction);
      const float scale = dot(p.normal, s->direction) / s->pdf;
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(s->weight[k], f[k] * scale, 1e-4f * (1 + f[k] * scale));
    }
}

// Reflected share of light that comes evenly from everywhere, by steps over the hemisphere that are fine where the
// lobe is.
double albedo(const SurfacePoint& p, int channel, int samples = static_cast<int>(test::trimmed(20000))) {
  const PointBsdf bsdf(p);
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    const auto u = static_cast<float>(std::fmod(0.5 + i * 0.7548776662466927, 1.0)),
               v = static_cast<float>(std::fmod(0.5 + i * 0.5698402909980532, 1.0));
    if (const auto s = bsdf.sample((static_cast<float>(i) + 0.5f) / samples, u, v)) sum += s->weight[channel];
  }
  return sum / samples;
}

TEST(Bsdf, AWhiteFurnaceStaysWhiteAtMost) {
  double least = 1, worst = 0;
  for (const float metallic : {0.0f, 0.5f, 1.0f})
    for (const float ior : {1.0f, 1.1f, 1.5f, 2.0f})
      for (const float roughness : {0.1f, 0.2f, 0.32f, 0.45f, 0.55f, 0.7f, 0.85f, 1.0f})
        for (const float cosine : {0.02f, 0.1f, 0.2f, 0.3f, 0.5f, 0.7f, 0.9f, 1.0f}) {
          const Vec3f view{std::sqrt(1 - cosine * cosine), 0, cosine};
          const SurfacePoint p = ggx_point({1, 1, 1}, roughness, metallic, ior, view, {0, 0, 1});
          const double a = albedo(p, 1);
          EXPECT_LE(a, 1.02) << "metallic " << metallic << " ior " << ior << " roughness " << roughness << " cosine "
                             << cosine;
          // Edge-on the fits give up light rather than gain any.
          if (cosine >= 0.3f) {
            EXPECT_GE(a, 0.92) << "metallic " << metallic << " ior " << ior << " roughness " << roughness << " cosine "
                               << cosine;
          }
          least = std::min(least, a), worst = std::max(worst, a);
        }
  RecordProperty("least", std::to_string(least));
  RecordProperty("most", std::to_string(worst));
}

TEST(Bsdf, WhiteOfEveryRoughnessReflectsAllButAFewPercentOfEvenLight) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.1f, 0.2f, 0.32f, 0.45f, 0.55f, 0.7f, 0.85f, 1.0f}) {
      double sum = 0;
      for (int i = 0; i < 32; ++i) {  // over the view's projected solid angle
        const float cosine = std::sqrt((static_cast<float>(i) + 0.5f) / 32);
        const SurfacePoint p =
            ggx_point({1, 1, 1}, roughness, metallic, 1.5f, {std::sqrt(1 - cosine * cosine), 0, cosine}, {0, 0, 1});
        sum += albedo(p, 1) / 32;
      }
      EXPECT_LE(sum, 1.005) << "metallic " << metallic << " roughness " << roughness;
      EXPECT_GE(sum, 0.985) << "metallic " << metallic << " roughness " << roughness;
    }
}

// The even part is to 2 %: the view's factor is what coat or single reflection leave, the light's is a fit to that.
TEST(Bsdf, GgxIsReciprocal) {
  Rng rng(5, Stage::test);
  for (int i = 0; i < 4000; ++i) {
    const bool metal = i % 2 == 1;
    const float roughness = 0.1f + (metal ? 0.3f : 0.9f) * rng.next_float(), metallic = metal ? rng.next_float() : 0.0f,
                ior = 1 + rng.next_float();
    const Vec3f normal = test::random_direction(rng);
    Vec3f a = test::random_direction(rng), b = test::random_direction(rng);
    if (dot(a, normal) < 0) a = -a;
    if (dot(b, normal) < 0) b = -b;
    if (dot(a, normal) < 0.02f || dot(b, normal) < 0.02f) continue;
    const Rgb base{rng.next_float(), rng.next_float(), rng.next_float()};
    SurfacePoint from_a = ggx_point(base, roughness, metallic, ior, a, normal),
                 from_b = ggx_point(base, roughness, metallic, ior, b, normal);
    const Rgb there = reflectance(from_a, b), back = reflectance(from_b, a);
    from_a.diffuse = from_b.diffuse = {};
    const Rgb gloss_there = reflectance(from_a, b), gloss_back = reflectance(from_b, a);
    // As light: edge-on, of metals of roughness up to 0.4, less than two hundredths of what comes in.
    const float light = dot(a, normal) * dot(b, normal) * 3.1416f;
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(gloss_there[k] * light, gloss_back[k] * light, (2e-3f * gloss_there[k] + 1e-5f) * light) << roughness;
      EXPECT_NEAR(there[k] * light, back[k] * light, 2e-3f * there[k] * light + 0.02f) << roughness;
    }
  }
}

Material burley(const Rgb& base, float roughness) {
  Material m;
  m.lobe = LobeModel::ggx, m.burley = true, m.diffuse = base, m.roughness = roughness;
  return m;
}

Vec3f direction_at(double cosine, double azimuth) {
  const double sine = std::sqrt(1 - cosine * cosine);
  return {static_cast<float>(sine * std::cos(azimuth)), static_cast<float>(sine * std::sin(azimuth)),
          static_cast<float>(cosine)};
}

// As the paper writes it, with the half vector. [Burley 2012, 5.3]
double burley_brdf(double roughness, const Vec3f& view, const Vec3f& light) {
  const double difference = dot(light, normalize(view + light)), f90 = 0.5 + 2 * roughness * difference * difference;
  return std::numbers::inv_pi * (1 + (f90 - 1) * std::pow(1 - light.z, 5)) * (1 + (f90 - 1) * std::pow(1 - view.z, 5));
}

TEST(Bsdf, BurleysDiffuseIsThePapersAndReciprocal) {
  Rng rng(31, Stage::test);
  for (int i = 0; i < 2000; ++i) {
    const Material m = burley({0.8f, 0.5f, 0.2f}, rng.next_float());
    const Vec3f view = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float()),
                light = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float());
    const Rgb there = seen_from(view, m).evaluate(light), back = seen_from(light, m).evaluate(view);
    const double expected = burley_brdf(m.roughness, view, light);
    for (int k = 0; k < 3; ++k) {
      ASSERT_NEAR(there[k], m.diffuse[k] * expected, 1e-5);
      ASSERT_NEAR(there[k], back[k], 1e-5);
    }
  }
}

TEST(Bsdf, VirtualLightsOfBurleysDiffuseCarryWhatItReflects) {
  for (const float roughness : {0.0f, 0.3f, 0.7f, 1.0f}) {
    const Material m = burley({1, 1, 1}, roughness);
    double even = 0;
    for (int v = 0; v < 32; ++v) {
      const double cosine = std::sqrt((v + 0.5) / 32);
      const Vec3f view = direction_at(cosine, 0);
      double reflected = 0;
      constexpr int kCosines = 200, kTurns = 64;
      for (int i = 0; i < kCosines; ++i)
        for (int j = 0; j < kTurns; ++j)
          reflected +=
              burley_brdf(roughness, view, direction_at(std::sqrt((i + 0.5) / kCosines), 6.2831853 * j / kTurns));
      reflected *= std::numbers::pi / (kCosines * kTurns);
      const Bsdf bsdf = seen_from(view, m);
      EXPECT_NEAR(bsdf.lambertian_intensity({1, 1, 1}).x * std::numbers::pi, reflected, 2e-3)
          << roughness << " " << cosine;
      even += reflected / 32;
    }
    EXPECT_NEAR(even, 0.953 + 0.1123 * roughness, 2e-3) << "of even light";
  }
}

TEST(Bsdf, CoatsOfBurleysSurfacesTakeNothingFromThem) {
  Material m = burley({0.5f, 0.5f, 0.5f}, 0.5f), coat = m;
  m.specular = {}, coat.specular = {1, 1, 1};
  coat.coat = 0.25f, coat.coat_roughness = 0.3f;
  const Vec3f view = direction_at(0.4, 0), light = direction_at(0.6, 2);
  const Bsdf bare = seen_from(view, m), coated = seen_from(view, coat);
  ASSERT_EQ(coated.layers().size(), 2u);
  EXPECT_EQ(bare.layers()[0].diffuse, coated.layers()[0].diffuse);
  EXPECT_GT(coated.evaluate(light).x, bare.evaluate(light).x);
}

Material grooved(const Rgb& base, float slope, bool once) {
  Material m;
  m.oren_nayar = true, m.facets_once = once, m.diffuse = base, m.roughness = slope;
  return m;
}

// Mean of t over the light's projected solid angle, times π. [Fujii 2012; Portsmouth, Kutz, Hill 2024]
double groove_integral(double cosine) {
  const double angle = std::acos(cosine), sine = std::sin(angle);
  return sine * (angle - 2.0 / 3 - sine * cosine) + 2.0 / 3 * sine / cosine * (1 - sine * sine * sine);
}

double oren_nayar_brdf(double slope, double color, bool once, const Vec3f& view, const Vec3f& light) {
  const double a = 1 / (std::numbers::pi + slope * (std::numbers::pi / 2 - 2.0 / 3)), b = slope * a;
  const double s = dot(view, light) - view.z * light.z, t = s > 0 ? s / std::max(view.z, light.z) : s;
  if (once) return color * (a + b * t);
  const auto kept = [&](double c) { return a * std::numbers::pi + b * groove_integral(c); };
  const double mean = a * std::numbers::pi + b * (2 * std::numbers::pi - 5.6) / 3;
  const double series = color * color * mean / (1 - mean) / (1 - color * (1 - mean)) / std::numbers::pi;
  return color * (a + b * t + series * (1 - kept(view.z)) * (1 - kept(light.z)));
}

// What comes back between facets has an edge that is a polynomial's, to 2e-3 of it.
TEST(Bsdf, OrenNayarsDiffuseIsFujiisAndReciprocal) {
  Rng rng(33, Stage::test);
  for (int i = 0; i < 4000; ++i) {
    const bool once = i % 2 == 0;
    const float grey = rng.next_float(), slope = rng.next_float();
    const Material m = grooved({grey, grey, grey}, slope, once);
    const Vec3f view = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float()),
                light = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float());
    const double there = seen_from(view, m).evaluate(light).x, back = seen_from(light, m).evaluate(view).x;
    const double expected = oren_nayar_brdf(slope, grey, once, view, light), tolerance = 1e-5 + 4e-3 * expected;
    ASSERT_NEAR(there, expected, tolerance) << slope << " " << once;
    ASSERT_NEAR(there, back, tolerance);
  }
}

TEST(Bsdf, EvenLightOnOrenNayarsSurfacesComesBackAsItsFormulaSays) {
  for (const bool once : {false, true})
    for (const float slope : {0.2f, 0.6f, 1.0f})
      for (const float cosine : {0.05f, 0.2f, 0.5f, 0.8f, 1.0f}) {
        const Vec3f view = direction_at(cosine, 0);
        const Material m = grooved({1.0f, 0.6f, 0.1f}, slope, once);
        const Bsdf bsdf = seen_from(view, m);
        const Rgb virtual_light = bsdf.lambertian_intensity({1, 1, 1}) * std::numbers::pi_v<float>;
        constexpr int kCosines = 400, kTurns = 128;
        for (int k = 0; k < 3; ++k) {
          double formula = 0, ours = 0;
          for (int i = 0; i < kCosines; ++i)
            for (int j = 0; j < kTurns; ++j) {
              const Vec3f light = direction_at(std::sqrt((i + 0.5) / kCosines), 6.2831853 * j / kTurns);
              formula += oren_nayar_brdf(slope, m.diffuse[k], once, view, light);
              ours += bsdf.evaluate(light)[k];
            }
          const double norm = std::numbers::pi / (kCosines * kTurns);
          EXPECT_NEAR(ours * norm, formula * norm, 2e-3) << slope << " " << cosine << " " << once;
          EXPECT_NEAR(virtual_light[k], formula * norm, 2e-3) << slope << " " << cosine << " " << once;
          EXPECT_LE(ours * norm, 1.002) << "a furnace";
        }
      }
}

TEST(Bsdf, RoughDiffuseBesideGlossIsOrenNayarsOfItsOwnColour) {
  Rng rng(34, Stage::test);
  for (int i = 0; i < 4000; ++i) {
    const bool once = i % 2 == 0;
    const float grey = rng.next_float(), slope = rng.next_float(), share = 0.9f * rng.next_float();
    const Rgb base = Rgb{1, 1, 1} * (grey * (1 - share)), gloss = Rgb{1, 1, 1} * share;
    const Vec3f view = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float()),
                light = direction_at(0.02 + 0.98 * rng.next_float(), 6.28 * rng.next_float());
    const double lobe = seen_from(view, glossy_clay({}, 0, once, gloss)).evaluate(light).x;
    const double expected = lobe + (1 - share) * oren_nayar_brdf(slope, grey, once, view, light);
    ASSERT_NEAR(seen_from(view, glossy_clay(base, slope, once, gloss)).evaluate(light).x, expected,
                1e-4 + 5e-3 * expected)
        << slope << " " << once;
  }
}

// What stays after the coat is Lambert's with the light's falloff times the facets' factor: the mean of the product is not
// the product of the means, and white gains up to 2 % by it.
TEST(Bsdf, RoughDiffuseBeneathACoatKeepsEvenLight) {
  for (const float slope : {0.3f, 1.0f})
    for (const float roughness : {0.2f, 0.6f, 1.0f})
      for (const float cosine : {0.05f, 0.3f, 0.7f, 1.0f}) {
        Material m;
        m.lobe = LobeModel::ggx, m.diffuse = m.specular = {1, 1, 1}, m.roughness = roughness;
        const Vec3f view = direction_at(cosine, 0);
        const double smooth = albedo(seen_from(view, m).layers()[0], 1);
        m.diffuse_roughness = slope;
        const Bsdf rough = seen_from(view, m);
        EXPECT_LE(albedo(rough.layers()[0], 1), 1.02) << slope << " " << roughness << " " << cosine;
        EXPECT_NEAR(albedo(rough.layers()[0], 1), smooth, 0.03) << slope << " " << roughness << " " << cosine;
      }
}

TEST(Bsdf, RoughnessOfADiffuseShareLeavesWhatMetalReflectsAgainAsItIs) {
  const Vec3f view = direction_at(0.4, 0);
  const auto even_part = [&](float slope, bool lost) {
    Material m;
    m.lobe = LobeModel::ggx, m.diffuse = {0.9f, 0.9f, 0.9f}, m.metallic = 0.6f, m.roughness = 0.9f;
    m.diffuse_roughness = slope, m.facets_once = lost;
    return seen_from(view, m).lambertian_intensity({1, 1, 1}).x;
  };
  const float of_metal = even_part(0, false) - even_part(0, true);
  EXPECT_GT(of_metal, 0.03f);
  EXPECT_NEAR(even_part(1, false) - even_part(1, true), of_metal, 0.05f * of_metal);
}

TEST(Bsdf, AMirrorOfAnyIndexAndItsWhiteBaseGiveBackAllLight) {
  for (const float ior : {0.1f, 0.3f, 0.5f, 0.67f, 0.9f, 1.1f, 1.5f, 3.0f, 10.0f})
    for (const float cosine : {0.05f, 0.3f, 0.6f, 0.8f, 0.9f, 1.0f}) {
      Material m;
      m.lobe = LobeModel::ggx, m.roughness = 0, m.diffuse = m.specular = {1, 1, 1}, m.ior = ior;
      const Bsdf bsdf = seen_from(direction_at(cosine, 0), m);
      const SurfacePoint base = bsdf.layers()[0];
      const float diffuse = base.diffuse.x * std::numbers::pi_v<float> * mean_diffuse_falloff(base.falloff);
      const auto mirrored = bsdf.sample_specular(0.5f, 0.5f, 0.5f);
      EXPECT_NEAR(diffuse + (mirrored ? mirrored->weight.x : 0.0f), 1.0f, 1e-3f) << ior << " " << cosine;
    }
}

// The mean over views, of even light. Facets reflect F of what meets them, and lose 1 − E of that to other facets, which
// reflect F of it, and so on: F·E/(1 − F(1 − E)).
TEST(Bsdf, WhatFacetsOfMetalReflectAgainMakesTheLobeBrighterOrIsLostOrLeavesEvenly) {
  enum class Again { even, lobe, lost };
  const auto mean_albedo = [](float reflectance, float roughness, bool bare, Again again, double* least) {
    Material m;
    m.lobe = LobeModel::ggx, m.roughness = roughness, m.facets_once = again == Again::lost;
    m.bright_lobe = again == Again::lobe;
    if (bare)
      m.fresnel = false, m.diffuse = {}, m.specular = Rgb{1, 1, 1} * reflectance;
    else
      m.metallic = 1, m.diffuse = Rgb{1, 1, 1} * reflectance;
    double sum = 0;
    constexpr int kSteps = 24;
    for (int i = 0; i < kSteps; ++i) {
      const float cosine = std::sqrt((static_cast<float>(i) + 0.5f) / kSteps);
      const double a = albedo(seen_from(direction_at(cosine, 0), m).layers()[0], 0);
      sum += a / kSteps, *least = std::min(*least, a);
    }
    return sum;
  };
  for (const float roughness : {0.3f, 0.5f, 0.8f, 1.0f}) {
    double least = 1, least_lost = 1;
    const double kept = mean_albedo(1, roughness, true, Again::lost, &least_lost);
    EXPECT_LT(kept, 0.995 - 0.3 * std::pow(roughness, 4)) << roughness;
    EXPECT_NEAR(mean_albedo(1, roughness, false, Again::lost, &least_lost), kept, 0.002) << roughness;
    EXPECT_NEAR(mean_albedo(1, roughness, false, Again::lobe, &least), 1, 0.01) << roughness;
    EXPECT_NEAR(mean_albedo(1, roughness, true, Again::lobe, &least), 1, 0.01) << roughness;
    EXPECT_GT(least, 0.97) << "of each view, roughness " << roughness;
    for (const float f : {0.3f, 0.7f}) {
      const double series = f * kept / (1 - f * (1 - kept));
      EXPECT_NEAR(mean_albedo(f, roughness, true, Again::lost, &least), f * kept, 0.002) << roughness;
      EXPECT_NEAR(mean_albedo(f, roughness, true, Again::lobe, &least), series, 0.01) << roughness;
      // Towards the edge metal is brighter, by 5.4 % of what it lacks: kMeanShare.
      const double mean = f + 0.054 * (1 - f), of_metal = mean * kept / (1 - mean * (1 - kept));
      EXPECT_NEAR(mean_albedo(f, roughness, false, Again::lobe, &least), of_metal, 0.02) << roughness;
      EXPECT_NEAR(mean_albedo(f, roughness, false, Again::even, &least), of_metal, 0.02) << roughness;
    }
  }
}

TEST(Bsdf, MetalsEdgeTintIsItsColourAt82Degrees) {
  Material m;
  m.lobe = LobeModel::ggx, m.metallic = 1, m.roughness = 0, m.diffuse = {0.9f, 0.6f, 0.3f};
  m.specular_tint = {1.0f, 0.7f, 0.4f};
  Material plain = m;
  plain.specular_tint = {1, 1, 1};
  const auto mirrored = [](const Material& material, float cosine) {
    const Bsdf bsdf = seen_from(direction_at(cosine, 0), material);
    return bsdf.sample_specular(0.5f, 0.5f, 0.5f)->weight;
  };
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(mirrored(m, 1.0f / 7)[k], m.specular_tint[k] * mirrored(plain, 1.0f / 7)[k], 1e-4f);
    EXPECT_NEAR(mirrored(m, 1)[k], m.diffuse[k], 1e-5f) << "straight on it is the base colour";
  }
}

TEST(Bsdf, ACoatAndItsWhiteBaseReflectNoMoreThanAllLight) {
  double least = 1, most = 0;
  for (const float metallic : {0.0f, 0.5f, 1.0f})
    for (const float roughness : {0.1f, 0.4f, 1.0f})
      for (const float coat : {0.25f, 1.0f})
        for (const float coat_roughness : {0.1f, 0.5f})
          for (const float cosine : {0.02f, 0.1f, 0.2f, 0.3f, 0.5f, 0.7f, 0.9f, 1.0f}) {
            const Coated c =
                coated(lacquer(coat, coat_roughness, roughness, metallic), {std::sqrt(1 - cosine * cosine), 0, cosine});
            ASSERT_TRUE(c.coat);
            const double a = albedo(c.base, 1, 5000) + albedo(*c.coat, 1, 5000);
            // The fits alone are up to 2 % over; see AWhiteFurnaceStaysWhiteAtMost.
            EXPECT_LE(a, 1.02) << "metallic " << metallic << " roughness " << roughness << " coat " << coat << " "
                               << coat_roughness << " cosine " << cosine;
            if (cosine >= 0.3f) {
              EXPECT_GE(a, 0.86) << "metallic " << metallic << " roughness " << roughness << " coat " << coat << " "
                                 << coat_roughness << " cosine " << cosine;
            }
            least = std::min(least, cosine >= 0.3f ? a : 1.0), most = std::max(most, a);
          }
  RecordProperty("least", std::to_string(least));
  RecordProperty("most", std::to_string(most));
}

TEST(Bsdf, ACoatAloneReflectsFresnelsFourPercentStraightOnAndMoreAtTheEdge) {
  const Coated front = coated(lacquer(1.0f, 0.2f, 0.5f, 0.0f, {0, 0, 0}), {0, 0, 1});
  EXPECT_NEAR(albedo(*front.coat, 1), 0.04, 0.001);
  const Coated edge = coated(lacquer(1.0f, 0.2f, 0.5f, 0.0f, {0, 0, 0}), {std::sqrt(1 - 0.04f), 0, 0.2f});
  EXPECT_GT(albedo(*edge.coat, 1), 0.25);
  EXPECT_FALSE(coated(lacquer(0.0f, 0.2f, 0.5f, 0.0f), {0, 0, 1}).coat) << "no coat, no point";
  EXPECT_FALSE(coated(lacquer(1.0f, 0.05f, 0.5f, 0.0f), {0, 0, 1}).coat) << "smooth ones are specular";
}

// Over a base of its own fading the product of both is the same in the mean only, and lobes beneath are dimmed by what
// the coat leaves of the view's direction alone: those are not.
TEST(Bsdf, CoatedDiffuseIsReciprocalToFivePercent) {
  Rng rng(6, Stage::test);
  for (int i = 0; i < 2000; ++i) {
    Material m = lacquer(rng.next_float(), 0.1f + 0.9f * rng.next_float(), 0.5f + 0.5f * rng.next_float(), 0.0f);
    m.ior = 1.0f;  // the base without a lobe of its own
    const auto direction = [&] {
      const float c = 0.3f + 0.7f * rng.next_float(), phi = 6.2831853f * rng.next_float(), s = std::sqrt(1 - c * c);
      return Vec3f{s * std::cos(phi), s * std::sin(phi), c};
    };
    const Vec3f a = direction(), b = direction();
    const Coated from_a = coated(m, a), from_b = coated(m, b);
    const float there = reflectance(from_a.base, b).x, back = reflectance(from_b.base, a).x;
    EXPECT_NEAR(there / back, 1.0f, 0.05f) << "to the fit of the light's factor";
    if (!from_a.coat) continue;
    const float coat_there = reflectance(*from_a.coat, b).x, coat_back = reflectance(*from_b.coat, a).x;
    EXPECT_NEAR(coat_there, coat_back, 2e-3f * coat_there + 1e-5f);
  }
}

TEST(Bsdf, ABlackSurfaceReflectsNothing) {
  const SurfacePoint p = point_of({}, {}, 10, {0, 0, 1});
  EXPECT_TRUE(PointBsdf(p).black());
  EXPECT_FALSE(PointBsdf(p).sample(0.5f, 0.5f, 0.5f));
  EXPECT_EQ(PointBsdf(p).pdf(p.normal), 0.0f);
}

// A clear coat over a rough base: the whole's sample, density and value belong together.
TEST(Bsdf, SamplesOfALayeredSurfaceWeighItsValueByItsDensity) {
  Material m = lacquer(0.7f, 0.4f, 0.6f, 0.3f, {0.5f, 0.4f, 0.3f});
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1};
  Scene scene(Scene::Config{});
  scene.set_materials({m});
  const Vec3f view = normalize(Vec3f{0.5f, 0.2f, 0.8f});
  const Bsdf bsdf = scene.bsdf({{}, {0, 0, 1}, {0, 0, 1}, view, 1e-5f}, 0, {});
  ASSERT_EQ(bsdf.layers().size(), 2u);
  Rng rng(9, Stage::test);
  double sampled = 0, integral = 0, density = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const float layer = rng.next_float(), choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
    if (const auto s = bsdf.sample(layer, choice, u, v)) {
      const float expected = bsdf.evaluate(s->direction).y * s->direction.z / bsdf.pdf(s->direction);
      ASSERT_NEAR(s->weight.y, expected, 1e-4f * (1 + expected));
      ASSERT_EQ(s->flags, uint32_t{kReflected});
      sampled += s->weight.y / kSamples;
    }
    const float z = rng.next_float(), phi = 6.2831853f * rng.next_float(), r = std::sqrt(1 - z * z);
    const Vec3f d{r * std::cos(phi), r * std::sin(phi), z};
    integral += bsdf.evaluate(d).y * z * 6.2831853f / kSamples, density += bsdf.pdf(d) * 6.2831853f / kSamples;
  }
  EXPECT_NEAR(sampled, integral, 0.01);  // 100,000 even directions leave .4 %
  EXPECT_LE(density, 1.01);
}

// What passes evenly: value, samples and density over the whole sphere, beside gloss and under a coat.
TEST(Bsdf, ATranslucentSheetSpreadsWhatItReflectsAndWhatItPassesEachToItsSide) {
  Material paper, leaf = lacquer(0.5f, 0.4f, 0.6f, 0.3f, {0.4f, 0.3f, 0.2f}), cloth;
  paper.diffuse = {0.5f, 0.5f, 0.5f}, paper.translucency = {0.2f, 0.4f, 0.3f};
  leaf.lobe = LobeModel::ggx, leaf.specular = {1, 1, 1}, leaf.translucency = {0.1f, 0.5f, 0.1f};
  cloth.diffuse = {}, cloth.translucency = {0.6f, 0.7f, 0.8f};
  for (const Material& m : {paper, leaf, cloth})
    for (const float side : {1.0f, -1.0f}) {
      const Bsdf bsdf = seen_from(normalize(Vec3f{0.5f, 0.2f, 0.8f * side}), m);
      const SurfacePoint other = bsdf.layers().back();
      EXPECT_LT(other.position.z * side, 0.0f) << "its shadow rays start on the other side";
      EXPECT_LT(other.normal.z * side, 0.0f);
      Rng rng(12, Stage::test);
      double sampled[2] = {}, integral[2] = {}, density = 0, carried[2] = {};
      constexpr auto kSamples = static_cast<int>(test::trimmed(200000));
      for (int i = 0; i < kSamples; ++i) {
        const float layer = rng.next_float(), choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
        if (const auto s = bsdf.sample(layer, choice, u, v)) {
          const bool passed = s->direction.z * side < 0.0f;
          ASSERT_EQ((s->flags & kTransmitted) != 0, passed);
          const float expected = bsdf.evaluate(s->direction).y * std::abs(s->direction.z) / bsdf.pdf(s->direction);
          ASSERT_NEAR(s->weight.y, expected, 1e-4f * (1 + expected));
          sampled[passed] += s->weight.y / kSamples;
        }
        if (const auto s = bsdf.scatter(rng))
          carried[s->direction.z * side < 0.0f] += s->weight.y * s->factor / kSamples;
        const Vec3f d = test::random_direction(rng);
        integral[d.z * side < 0.0f] += bsdf.evaluate(d).y * std::abs(d.z) * 12.5663706f / kSamples;
        density += bsdf.pdf(d) * 12.5663706f / kSamples;
      }
      EXPECT_NEAR(integral[1], m.translucency.y, test::trimmed_noise(0.01)) << "all that is passed, whatever the view";
      for (int k = 0; k < 2; ++k) {
        EXPECT_NEAR(sampled[k], integral[k], test::trimmed_noise(0.01));
        EXPECT_NEAR(carried[k], integral[k], test::trimmed_noise(0.01));
      }
      EXPECT_NEAR(density, 1.0, test::trimmed_noise(0.03)) << "but for glossy samples below the horizon";
    }
}

// The continuation of light paths loses no power on the average: what it carries is what the surface reflects.
TEST(Bsdf, RouletteKeepsThePowerOfLightPaths) {
  struct Case {
    Material material;
    const char* name;
  };
  Material matte, phong, coated = lacquer(1.0f, 0.3f, 0.5f, 0.0f, {0.6f, 0.6f, 0.6f}), mirror, glass;
  matte.diffuse = {0.5f, 0.5f, 0.5f};
  phong.diffuse = {0.3f, 0.3f, 0.3f}, phong.specular = {0.4f, 0.4f, 0.4f}, phong.shininess = 30;
  mirror.diffuse = {0.8f, 0.8f, 0.8f}, mirror.metallic = 1, mirror.roughness = 0;
  glass.transmission = 1, glass.roughness = 0.3f, glass.diffuse = {0.9f, 0.9f, 0.9f};
  for (Material* m : {&coated, &mirror, &glass}) m->lobe = LobeModel::ggx, m->specular = {1, 1, 1};
  for (const Case& c :
       {Case{matte, "matte"}, {phong, "Blinn"}, {coated, "coated"}, {mirror, "mirror"}, {glass, "glass"}})
    for (const float side : {1.0f, -1.0f}) {
      Scene scene(Scene::Config{});
      scene.set_materials({c.material});
      const Vec3f view = normalize(Vec3f{0.5f, 0.2f, 0.8f * side});
      const Bsdf bsdf = scene.bsdf({{}, {0, 0, 1}, {0, 0, 1}, view, 1e-5f}, 0, {});
      Rng rng(11, Stage::test);
      double carried = 0, reflected = 0;
      constexpr int kSamples = 100000;
      for (int i = 0; i < kSamples; ++i) {
        if (const auto s = bsdf.scatter(rng)) {
          // Flux without the factor of refraction, by which light paths match what camera paths leave out.
          const float index = side > 0.0f ? 1.5f : 1.0f / 1.5f;
          const float narrowed = (s->flags & kTransmitted) != 0 ? index * index : 1.0f;
          carried += s->weight.y * s->factor * narrowed / kSamples;
          const float away = s->direction.z * side;
          EXPECT_EQ((s->flags & kTransmitted) != 0, away < 0.0f) << c.name;
          EXPECT_EQ((bsdf.origin(s->flags).z * side < 0.0f), (s->flags & kTransmitted) != 0) << c.name;
        }
        const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
        for (const SurfacePoint& p : bsdf.layers())
          if (const auto s = PointBsdf(p).sample(choice, u, v)) reflected += s->weight.y / kSamples;
        if (const auto s = bsdf.sample_specular(choice, u, v)) reflected += s->weight.y / kSamples;
      }
      EXPECT_NEAR(carried, reflected, 0.012) << c.name << " " << side;  // three deviations of 100,000 samples
    }
}

}  // namespace
}  // namespace lumicut
