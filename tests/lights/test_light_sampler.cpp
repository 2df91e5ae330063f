// LightSampler: what light paths and direct VPLs carry must be the lights' own power, measured at a distance.
#include <gtest/gtest.h>

#include <array>
#include <numbers>

#include "lights/light_sampler.h"
#include "tests/support/test_scenes.h"

namespace lumicut {

namespace {

constexpr double kPi = std::numbers::pi;

std::unique_ptr<Scene> with_light(const Light& light) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_lights({light});
  Progress progress;
  scene->commit(progress);
  return scene;
}

double mean_flux(const Scene& scene, int n) {
  const LightSampler emitters(scene);
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    Rng rng(1, Stage::test, i);
    sum += luminance(emitters.sample_ray(rng).flux);
  }
  return sum / n;
}

}  // namespace

TEST(DiscreteDistribution, NeverGivesAnEntryOfNoWeight) {
  const DiscreteDistribution d({0, 1, 0, 3, 0});
  for (double u : {0.0, 0.1, 0.2499, 0.25, 0.5, 0.999999999999, 1.0 - 1e-16}) {
    const size_t i = d.sample(u);
    EXPECT_TRUE(i == 1 || i == 3) << u;
  }
  EXPECT_DOUBLE_EQ(d.pmf(1), 0.25);
  EXPECT_TRUE(DiscreteDistribution({0, 0}).empty());
}

TEST(LightSampler, PowerOfEachLampIsItsAnalyticPower) {
  Light l;
  l.value = {1, 1, 1};
  EXPECT_NEAR(mean_flux(*with_light(l), 10), 4 * kPi, 1e-4);  // every path alike: rounding only
  l.radius = 0.2f;
  EXPECT_NEAR(mean_flux(*with_light(l), 10), 4 * kPi, 1e-4);
  Light rectangle;
  rectangle.type = LightType::rectangle;
  rectangle.u = {2, 0, 0}, rectangle.v = {0, 3, 0}, rectangle.value = {5, 5, 5};
  EXPECT_NEAR(mean_flux(*with_light(rectangle), 10), kPi * 6 * 5, 1e-3);
  Light disk = rectangle;
  disk.type = LightType::disk;
  EXPECT_NEAR(mean_flux(*with_light(disk), 10), kPi * 6 * 5 * kPi / 4, 1e-3);
  disk.spread = 1.0f;  // narrowing keeps the flux; 100k paths of a factor up to 8 vary by 1 %
  EXPECT_NEAR(mean_flux(*with_light(disk), 100000) / (kPi * 6 * 5 * kPi / 4), 1.0, 0.02);
  Light spot;
  spot.type = LightType::spot;
  spot.cos_outer = 0.5f, spot.value = {1, 1, 1};
  EXPECT_NEAR(mean_flux(*with_light(spot), 10), 2 * kPi * 0.5, 1e-4);
}

// By their own directions one path in 10¹² would arrive.
TEST(LightSampler, PathsOfLampsFarAwayArriveWithTheLightThatTheyGiveThere) {
  constexpr float kDistance = 1e6f;
  const Vec3f towards = normalize(Vec3f{0.3f, -0.2f, -0.9f}), place = towards * -kDistance;
  Light point;
  point.position = place, point.value = Rgb{1, 1, 1} * (kDistance * kDistance);
  Light ball = point, spot = point, soft = point, rectangle = point;
  ball.radius = 10, soft.radius = 10, soft.facing = true;
  spot.type = LightType::spot, spot.direction = towards, spot.cos_outer = 0.99f;
  rectangle.type = LightType::rectangle, rectangle.value = Rgb{1, 1, 1} * kDistance;
  const Frame frame(towards);
  rectangle.u = frame.t * 1000.0f, rectangle.v = frame.b * 1000.0f;  // u × v: towards
  for (const Light& lamp : {point, ball, spot, soft, rectangle}) {
    auto scene = std::make_unique<Scene>(Scene::Config{});
    scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
    Mesh floor;
    test::add_quad(floor, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
    scene->add_mesh(std::move(floor));
    Light near;
    near.position = {0, 0, 1}, near.value = {1, 1, 1};
    scene->set_lights({lamp, near});
    Progress progress;
    scene->commit(progress);
    const LightSampler emitters(*scene);
    constexpr int kPaths = 200000;
    double arrived = 0;
    int of_near = 0;
    for (int i = 0; i < kPaths; ++i) {
      Rng rng(1, Stage::test, i);
      const EmittedRay ray = emitters.sample_ray(rng);
      if (ray.origin == near.position) {
        ++of_near;
        continue;
      }
      const Vec3f at = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
      if (std::max(std::abs(at.x), std::abs(at.y)) < 1) arrived += luminance(ray.flux) / kPaths;
    }
    const double irradiance = lamp.type == LightType::rectangle ? 1e6 * kDistance / (double{kDistance} * kDistance) : 1;
    EXPECT_NEAR(arrived / (4 * irradiance * -towards.z), 1, 0.02) << static_cast<int>(lamp.type) << " " << lamp.radius;
    EXPECT_GT(of_near, kPaths / 20) << "what arrives of it counts, not what it emits";
  }
}

TEST(LightSampler, DirectVplsGiveTheIrradianceOfADiskOnItsAxis) {
  // E = π L r²/(r²+h²) under a disk of radius r at height h.
  Light disk;
  disk.type = LightType::disk;
  disk.position = {0, 0, 2};
  disk.u = {2, 0, 0}, disk.v = {0, -2, 0};  // radius 1, shines down
  disk.value = {3, 3, 3};
  const auto scene = with_light(disk);
  const LightSampler emitters(*scene);
  double irradiance = 0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    Rng rng(1, Stage::test, i);
    const Vpl v = emitters.sample_direct((i + rng.next_float()) / kCount, kCount, rng);
    const double d2 = length2(v.position), c = v.position.z / std::sqrt(d2);
    EXPECT_LT(v.normal.z, -0.999f);
    irradiance += v.intensity.x * c * c / d2;
  }
  EXPECT_NEAR(irradiance / (kPi * 3 * 1 / (1 + 4.0)), 1.0, 0.01);  // 20,000 samples of 20 % spread: 0.15 %
}

TEST(LightSampler, ConstantEnvironmentGivesPiTimesItsRadianceAsIrradiance) {
  Scene scene{{}};
  Environment env;
  env.color = {2, 2, 2};
  scene.set_environment(env);
  Progress progress;
  scene.commit(progress);
  const LightSampler emitters(scene);
  double up = 0;
  constexpr int kCount = 50000;
  for (int i = 0; i < kCount; ++i) {
    const Vpl v = emitters.environment_light(i, kCount, 1);
    up += v.intensity.x * std::max(0.0f, -v.normal.z);
  }
  EXPECT_NEAR(up / (kPi * 2), 1.0, 0.02);  // spread of max(0, cos) over the sphere: 0.5 %
}

TEST(LightSampler, ImageEnvironmentIsSampledWithoutBias) {
  constexpr uint32_t kW = 16, kH = 8;
  std::vector<float> pixels(kW * kH, 0.1f);
  pixels[2 * kW + 5] = 500.0f;  // a sun
  Scene scene{{}};
  scene.set_textures({Texture(kW, kH, 1, Texture::Format::float32, {}, pixels.data())});
  Environment env;
  env.color = {1, 1, 1};
  env.texture = 0;
  const float rotation[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
  std::copy(rotation, rotation + 9, env.world_to_map);
  scene.set_environment(env);
  Progress progress;
  scene.commit(progress);
  const Vec3f n = normalize(Vec3f{0.3f, 0.8f, -0.2f});
  double expected = 0;  // uniform sampling of the sphere, the same lookup
  constexpr int kUniform = 2000000;
  for (int i = 0; i < kUniform; ++i) {
    Rng rng(3, Stage::test, i);
    const Vec3f d = test::random_direction(rng);
    expected += scene.environment_radiance(d).x * std::max(0.0f, dot(n, d)) * 4 * kPi / kUniform;
  }
  const LightSampler emitters(scene);
  double got = 0;
  constexpr int kCount = 50000;
  for (int i = 0; i < kCount; ++i) {
    const Vpl v = emitters.environment_light(i, kCount, 1);
    got += v.intensity.x * std::max(0.0f, -dot(n, v.normal));
  }
  EXPECT_NEAR(got / expected, 1.0, 0.03);  // uniform side: 0.6 % spread; importance side: 0.5 %
}

TEST(LightSampler, EnvironmentLightsVaryLessThanIndependentDraws) {
  constexpr uint32_t kW = 64, kH = 32, kLights = 64, kSeeds = 100;
  std::vector<float> pixels(kW * kH);
  for (uint32_t y = 0; y < kH; ++y)
    for (uint32_t x = 0; x < kW; ++x) pixels[y * kW + x] = y < kH / 2 ? 1.0f + 0.02f * x : 0.2f;
  for (uint32_t x = 20; x < 24; ++x) pixels[5 * kW + x] = 100.0f;  // a bright cloud
  Scene scene{{}};
  scene.set_textures({Texture(kW, kH, 1, Texture::Format::float32, {}, pixels.data())});
  Environment env;
  env.color = {1, 1, 1}, env.texture = 0;
  scene.set_environment(env);
  Progress progress;
  scene.commit(progress);
  const LightSampler emitters(scene);
  const Vec3f n{0, 0, 1};
  const auto irradiance = [&](const Vpl& v) { return v.intensity.x * std::max(0.0f, -dot(n, v.normal)); };
  double mean[2] = {}, square[2] = {};
  for (uint32_t seed = 0; seed < kSeeds; ++seed) {
    double e[2] = {};
    for (uint64_t i = 0; i < kLights; ++i) {
      e[0] += irradiance(emitters.environment_light(i, kLights, seed));
      e[1] += irradiance(emitters.environment_light(0, 1, 1000 + seed * kLights + i)) / kLights;
    }
    for (int k = 0; k < 2; ++k) mean[k] += e[k] / kSeeds, square[k] += e[k] * e[k] / kSeeds;
  }
  double expected = 0;  // Riemann sum of the upper half
  for (int i = 0; i < 1000; ++i)
    for (int j = 0; j < 1000; ++j) {
      const double elevation = 0.5 * kPi * (i + 0.5) / 1000, phi = 2 * kPi * (j + 0.5) / 1000;
      const Vec3f d{static_cast<float>(std::cos(elevation) * std::cos(phi)),
                    static_cast<float>(std::cos(elevation) * std::sin(phi)), static_cast<float>(std::sin(elevation))};
      expected += scene.environment_radiance(d).x * std::sin(elevation) * std::cos(elevation) * kPi * kPi * 1e-6;
    }
  const double stratified = square[0] - mean[0] * mean[0], independent = square[1] - mean[1] * mean[1];
  EXPECT_NEAR(mean[0] / expected, 1.0, 0.01);
  EXPECT_NEAR(mean[1] / expected, 1.0, 0.05);
  EXPECT_LT(stratified, 0.2 * independent);
}

// A square of n × n quads with a texture whose right half is black.
std::unique_ptr<Scene> half_black(uint32_t n, bool textured = true) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  constexpr uint32_t kSize = 32;
  std::vector<float> pixels(kSize * kSize, 0.0f);
  for (uint32_t y = 0; y < kSize; ++y)
    for (uint32_t x = 0; x < kSize / 2; ++x) pixels[y * kSize + x] = 4.0f;
  Texture::Options options;
  options.clamp = true;
  scene->set_textures({Texture(kSize, kSize, 1, Texture::Format::float32, options, pixels.data())});
  Material m;
  m.emission = {0.5f, 0.5f, 0.5f};
  m.emission_texture = textured ? 0 : -1;
  scene->set_materials({m});
  Mesh mesh;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i) {
      const float u = static_cast<float>(i) / n, v = static_cast<float>(j) / n;
      mesh.positions.push_back({2 * u, 2 * v, 0});
      mesh.uvs.push_back({u, v});
    }
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + 1, c = b + n + 1, d = a + n + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
    }
  scene->add_mesh(mesh);
  Progress progress;
  scene->commit(progress);
  return scene;
}

TEST(LightSampler, TexturedTrianglesHaveThePowerOfTheirOwnPart) {
  constexpr int kQuads = 64;
  const auto scene = half_black(kQuads);
  const LightSampler emitters(*scene);
  // π · area 4 · radiance 2 over half of it: the ramp between bright and black texels is symmetric.
  EXPECT_NEAR(emitters.power() / (kPi * 4 * 2 * 0.5), 1.0, 1e-6);
  EXPECT_NEAR(mean_flux(*scene, 20000) / emitters.power(), 1.0, 0.01);
  constexpr int kLights = 300, kSeeds = 300;
  const Vec3f below{0.9f, 1.1f, 1.0f};
  const auto irradiance = [&](const Vec3f& position, double intensity) {
    const Vec3f d = below - position;
    return intensity * d.z * d.z / (length2(d) * length2(d));
  };
  double mean[2] = {}, square[2] = {};
  for (int seed = 0; seed < kSeeds; ++seed) {
    double e[2] = {};
    for (int i = 0; i < kLights; ++i) {
      Rng rng(seed, Stage::test, i);
      const Vpl v = emitters.sample_direct((i + rng.next_float()) / kLights, kLights, rng);
      EXPECT_LT(v.position.x, 1.0f + 1.0f / 8) << "no light on a black triangle";
      e[0] += irradiance(v.position, v.intensity.x);
      // With the mean of the whole image for each triangle all are alike: half of the lights lie on black ones.
      const int t = static_cast<int>((i + rng.next_float()) / kLights * 2 * kQuads * kQuads);
      float x = rng.next_float(), y = rng.next_float();
      if ((y <= x) != (t % 2 == 0)) std::swap(x, y);
      const Vec3f p{(static_cast<float>(t / 2 % kQuads) + x) * 2 / kQuads,
                    (static_cast<float>(t / 2 / kQuads) + y) * 2 / kQuads, 0};
      e[1] += irradiance(p, 0.5 * scene->textures()[0].color(p.x / 2, p.y / 2).x * 4 / kLights);
    }
    for (int k = 0; k < 2; ++k) mean[k] += e[k] / kSeeds, square[k] += e[k] * e[k] / kSeeds;
  }
  EXPECT_NEAR(mean[0] / mean[1], 1.0, 0.01);
  EXPECT_LT(square[0] - mean[0] * mean[0], 0.5 * (square[1] - mean[1] * mean[1]));
}

// Two triangles of 4 m² whose program emits in every other of 8 x 8 squares, or in none but a small one.
std::unique_ptr<Scene> programmed_square(bool small) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  const auto op = [](ProgramOp o, std::array<int32_t, 3> inputs, uint32_t mode) {
    ProgramInstruction in;
    in.op = static_cast<uint32_t>(o), in.mode = mode;
    std::copy(inputs.begin(), inputs.end(), in.inputs);
    return in;
  };
  std::vector<ProgramInstruction> steps = {op(ProgramOp::position, {0, 0, 0}, 0), op(ProgramOp::vector, {0, -1, -2}, 4),
                                           op(ProgramOp::checker, {1, 0, 0}, 0)};
  if (small)  // where the length of the place is below 0.2
    steps = {op(ProgramOp::position, {0, 0, 0}, 0), op(ProgramOp::vector, {0, -1, -1}, 12),
             op(ProgramOp::math, {1, -3, -1}, 13)};
  std::vector<Texture> textures;
  textures.emplace_back(TextureProgram(steps, {{4, 4, 4}, {0, 0, 0.5f}, {0.2f, 0.2f, 0.2f}}, {}));
  scene->set_textures(std::move(textures));
  Material m;
  m.emission = {3, 3, 3}, m.emission_texture = 0;
  scene->set_materials({m});
  Mesh mesh;
  test::add_quad(mesh, {0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, 0);
  scene->add_mesh(mesh);
  Progress progress;
  scene->commit(progress);
  return scene;
}

TEST(LightSampler, ProgramsEmitWhatTheirValuesAddUpTo) {
  for (const bool small : {false, true}) {
    const auto scene = programmed_square(small);
    // Half of the squares; a quarter of a circle.
    const double expected = kPi * 3 * (small ? 0.25 * kPi * 0.2 * 0.2 : 2.0);
    // Places are drawn evenly over the triangles: of the small one few are lit.
    EXPECT_NEAR(mean_flux(*scene, small ? 4000000 : 20000) / expected, 1.0, 0.02) << small;
    // The power is by some points of each triangle, the more the less of it is lit.
    EXPECT_NEAR(LightSampler(*scene).power() / expected, 1.0, small ? 0.3 : 0.05) << small;
  }
}

TEST(LightSampler, EveryPlaceThatAProgramLightsHasADensity) {
  const auto scene = programmed_square(true);
  const LightSampler emitters(*scene);
  for (uint32_t t = 0; t < 2; ++t) EXPECT_GT(emitters.mesh_density(scene->place_on(0, t, 0.1f, 0.1f, 0)), 0.0);
}

TEST(LightSampler, AMillionEmissiveTrianglesTakeAHundredBytesEach) {
  const auto scene = half_black(708, false);
  const LightSampler emitters(*scene);
  const double triangles = 2.0 * 708 * 708;
  EXPECT_GT(triangles, 1e6);
  EXPECT_LT(static_cast<double>(emitters.bytes()) / triangles, 100);
  EXPECT_NEAR(emitters.power() / (kPi * 4 * 0.5), 1.0, 1e-4);
}

TEST(LightSampler, AVeilOfLightHasTheShareOfPowerThatRaysMeet) {
  const auto flux = [](float opacity) {
    Scene scene{{}};
    Material m;
    m.emission = {2, 2, 2}, m.opacity = opacity;
    test::commit_quad(scene, m, {0, 0, 0}, {2, 0, 0}, {2, 3, 0}, {0, 3, 0});
    return mean_flux(scene, 10);
  };
  EXPECT_NEAR(flux(1.0f), kPi * 6 * 2, 1e-4);  // rounding only
  EXPECT_NEAR(flux(0.25f), 0.25 * kPi * 6 * 2, 1e-4);
}

TEST(LightSampler, EmissiveTrianglesShineFromTheirFrontUnlessToldOtherwise) {
  for (bool both : {false, true}) {
    Scene scene{{}};
    Material m;
    m.emission = {1, 1, 1};
    m.emit_both_sides = both;
    test::commit_quad(scene, m, {0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0});
    EXPECT_NEAR(mean_flux(scene, 1000), kPi * 2 * (both ? 2 : 1), 1e-3);
    const LightSampler emitters(scene);
    int back = 0;
    for (int i = 0; i < 1000; ++i) {
      Rng rng(1, Stage::test, i);
      back += emitters.sample_ray(rng).direction.z < 0;
    }
    EXPECT_EQ(back > 0, both);
  }
}

}  // namespace lumicut
