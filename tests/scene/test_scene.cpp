#include <gtest/gtest.h>

#include <numbers>

#include <limits>

#include "core/error.h"
#include "tests/support/backends.h"
#include "tests/support/test_scenes.h"

namespace lumicut {

namespace {

std::string error_of(const std::function<void()>& fn) {
  try {
    fn();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

Mesh triangle() {
  Mesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.indices = {0, 1, 2};
  return m;
}

RayHit down(float x, float y) {
  RayHit r;
  r.ray.org = {x, y, 5};
  r.ray.dir = {0, 0, -1};
  return r;
}

}  // namespace

TEST(Scene, EmptySceneCommitsAndHitsNothing) {
  Scene scene{{}};
  Progress progress;
  scene.commit(progress);
  RayHit r = down(0, 0);
  scene.accel().intersect({&r, 1});
  EXPECT_EQ(r.hit.geom, kNoId);
  EXPECT_EQ(scene.radius(), 1.0f);
}

TEST(Scene, ErrorsNameFieldAndValue) {
  Scene scene{{}};
  Mesh m = triangle();
  m.indices[1] = 3;
  EXPECT_NE(error_of([&] { scene.add_mesh(m); }).find("index[1] = 3"), std::string::npos);
  m = triangle();
  m.positions[2].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(error_of([&] { scene.add_mesh(m); }).find("position[2]"), std::string::npos);
  m = triangle();
  m.material = 4;
  scene.add_mesh(m);
  Progress progress;
  EXPECT_NE(error_of([&] { scene.commit(progress); }).find("material 4"), std::string::npos);
  EXPECT_FALSE(scene.committed());
}

TEST(Scene, InstancesAreSeenWhereTheirTransformsPutThem) {
  Scene scene{{}};
  scene.set_materials({Material{}});
  Mesh m = triangle();
  Transform moved;
  moved.m[3] = 10;
  Transform mirrored;  // x -> -x, turns the winding over
  mirrored.m[0] = -1;
  m.instances = {Transform{}, moved, mirrored};
  scene.add_mesh(m);
  Progress progress;
  scene.commit(progress);
  for (const auto& [x, inst] : {std::pair{0.2f, 0u}, {10.2f, 1u}, {-0.2f, 2u}}) {
    RayHit r = down(x, 0.2f);
    scene.accel().intersect({&r, 1});
    ASSERT_NE(r.hit.geom, kNoId) << x;
    EXPECT_EQ(r.hit.inst, inst);
    const SurfaceHit s = scene.surface(r);
    EXPECT_NEAR(s.position.x, x, 1e-5f);
    EXPECT_EQ(s.geometric_normal, (Vec3f{0, 0, 1})) << "the front stays the front, mirrored or not";
  }
}

TEST(Scene, CutOutsLetRaysThrough) {
  Scene scene{{}};
  const uint8_t mask[] = {255, 0};  // left opaque, right a hole
  scene.set_textures({Texture(2, 1, 1, Texture::Format::uint8, {.clamp = true, .nearest = true}, mask)});
  Material m;
  m.opacity_texture = 0;
  scene.set_materials({m});
  Mesh mesh;
  test::add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, 0);
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  scene.add_mesh(mesh);
  Progress progress;
  scene.commit(progress);
  RayHit rays[] = {down(0.25f, 0.5f), down(0.75f, 0.4f)};
  scene.accel().intersect(rays);
  EXPECT_EQ(rays[0].hit.geom, 0u);
  EXPECT_EQ(rays[1].hit.geom, kNoId);
}

TEST(Scene, WhatIsPartlyTransparentStopsItsShareOfTheRays) {
  for (const char* kind : test::backends()) {
    Scene scene{{.accel = kind}};
    Material m;
    m.opacity = 0.3f;
    test::commit_quad(scene, m, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0});
    constexpr int kSide = 200;
    int stopped = 0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const float x = (static_cast<float>(i % kSide) + 0.5f) / kSide,
                  y = (static_cast<float>(i / kSide) + 0.5f) / kSide;
      RayHit ray = down(x, y), again = ray;
      Ray shadow = ray.ray;
      scene.accel().intersect({&ray, 1});
      scene.accel().intersect({&again, 1});
      scene.accel().occluded({&shadow, 1});
      ASSERT_EQ(ray.hit.geom, again.hit.geom);
      ASSERT_EQ(ray.hit.geom == kNoId, !(shadow.tfar < 0.0f)) << "shadows are of what is seen";
      stopped += ray.hit.geom != kNoId ? 1 : 0;
    }
    // Five standard deviations of 40,000 tosses are 0.0115.
    EXPECT_NEAR(static_cast<double>(stopped) / (kSide * kSide), 0.3, 0.0115);
  }
}

TEST(Scene, UpdateMovesTheMeshAtTheNextCommit) {
  Scene scene{{}};
  scene.set_materials({Material{}});
  const uint32_t id = scene.add_mesh(triangle());
  Progress progress;
  scene.commit(progress);
  const auto version = scene.version();
  scene.update_mesh(id, {{5, 0, 0}, {6, 0, 0}, {5, 1, 0}}, {}, {});
  scene.commit(progress);
  EXPECT_GT(scene.version(), version);
  RayHit rays[] = {down(0.2f, 0.2f), down(5.2f, 0.2f)};
  scene.accel().intersect(rays);
  EXPECT_EQ(rays[0].hit.geom, kNoId);
  EXPECT_EQ(rays[1].hit.geom, 0u);
  EXPECT_THROW(scene.update_mesh(id, {{0, 0, 0}}, {}, {}), Error);
}

TEST(Scene, ShadingIsTwoSidedAndPointsStandOffTheSurface) {
  const auto room = test::make_room();
  const Vec3f n{0, 0, 1};
  for (float side : {1.0f, -1.0f}) {
    const SurfacePoint p = room->bsdf({{0, 0, 0}, n, n, {0, 0, side}, 1e-3f}, 0, {}).layers()[0];
    EXPECT_EQ(p.normal.z, side);
    EXPECT_NEAR(p.position.z, side * 1e-3f, 1e-12f);
  }
}

TEST(Scene, EnvironmentMapFollowsItsFormula) {
  // Four texels around the equator; map space is z up.
  const float pixels[] = {1, 2, 3, 4};
  Scene scene{{}};
  scene.set_textures({Texture(4, 1, 1, Texture::Format::float32, {.nearest = true}, pixels)});
  Environment env;
  env.color = {1, 1, 1};
  env.texture = 0;
  scene.set_environment(env);
  const auto at = [&](float azimuth) {
    return scene.environment_radiance({std::cos(azimuth), std::sin(azimuth), 0}).x;
  };
  EXPECT_EQ(at(0.1f), 2.0f);   // u = 0.5 - small
  EXPECT_EQ(at(-0.1f), 3.0f);  // u = 0.5 + small
  EXPECT_EQ(at(3.0f), 1.0f);
  EXPECT_EQ(at(-3.0f), 4.0f);
}

TEST(Scene, NormalMapsTurnTheShadingNormalAlongUAndV) {
  const float toward_u[3] = {0.5f + 0.5f * 0.6f, 0.5f, 0.5f + 0.5f * 0.8f};
  for (const int turned : {0, 1, 2}) {
    Scene scene(Scene::Config{});
    scene.set_textures({Texture(1, 1, 3, Texture::Format::float32, {}, toward_u)});
    Material m = test::diffuse(0.5f, 0.5f, 0.5f);
    m.normal_texture = 0;
    if (turned == 2) m.normal_strength = 0.5f;
    scene.set_materials({m});
    Mesh mesh;
    test::add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, 0);
    // u along x, or along -y.
    mesh.uvs = turned == 1 ? std::vector<Vec2f>{{1, 0}, {1, 1}, {0, 1}, {0, 0}}
                           : std::vector<Vec2f>{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    scene.add_mesh(mesh);
    Progress progress;
    scene.commit(progress);
    std::vector<RayHit> rays(1);
    rays[0].ray.org = {0.6f, 0.3f, 1}, rays[0].ray.dir = {0, 0, -1};
    scene.accel().intersect(rays);
    const SurfaceHit hit = scene.surface(rays[0]);
    const Vec3f expected = turned == 0   ? Vec3f{0.6f, 0, 0.8f}
                           : turned == 1 ? Vec3f{0, -0.6f, 0.8f}
                                         : normalize(Vec3f{0.3f, 0, 0.9f});
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(hit.normal[k], expected[k], 1e-5f) << turned;
    EXPECT_EQ(hit.geometric_normal, (Vec3f{0, 0, 1}));
  }
}

namespace {
// One square of texture coordinates 0 to 1 in the plane z = 0, `size` wide, of a material whose textures are
// `textures`.
std::unique_ptr<Scene> square(const Material& material, std::vector<Texture> textures, float size = 1.0f,
                              bool flat_uvs = false) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_textures(std::move(textures));
  scene->set_materials({material});
  Mesh mesh;
  test::add_quad(mesh, {0, 0, 0}, {size, 0, 0}, {size, size, 0}, {0, size, 0}, 0);
  if (!flat_uvs) mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  if (flat_uvs) mesh.uvs = {{0.5f, 0.5f}, {0.5f, 0.5f}, {0.5f, 0.5f}, {0.5f, 0.5f}};
  scene->add_mesh(mesh);
  Progress progress;
  scene->commit(progress);
  return scene;
}

SurfaceHit above(const Scene& scene, float x, float y) {
  std::vector<RayHit> rays(1);
  rays[0].ray.org = {x, y, 1}, rays[0].ray.dir = {0, 0, -1};
  scene.accel().intersect(rays);
  return scene.surface(rays[0]);
}

Texture grey(uint32_t width, uint32_t height, const std::vector<float>& values) {
  return {width, height, 1, Texture::Format::float32, {false, true, false}, values.data()};
}
}  // namespace

TEST(Scene, BumpsTiltTheNormalByTheSlopeOfTheHeight) {
  // Height u over the middle of the texture: rises by `distance` in `size`.
  std::vector<float> ramp;
  for (int i = 0; i < 64; ++i) ramp.push_back((static_cast<float>(i % 8) + 0.5f) / 8);
  for (const float size : {1.0f, 2.0f})
    for (const float distance : {0.5f, -0.25f})
      for (const float strength : {1.0f, 0.5f, 2.0f}) {
        Material m = test::diffuse(0.5f, 0.5f, 0.5f);
        m.height_texture = 0, m.bump_distance = distance, m.bump_strength = strength;
        const auto scene = square(m, {grey(8, 8, ramp)}, size);
        const SurfaceHit hit = above(*scene, 0.4f * size, 0.45f * size);
        const Vec3f turned = normalize(Vec3f{-distance / size, 0, 1}), flat{0, 0, 1};
        const Vec3f expected = normalize(flat + (turned - flat) * strength);
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(hit.normal[k], expected[k], 1e-4f) << size << " " << distance;
        EXPECT_EQ(hit.geometric_normal, flat);
      }
}

TEST(Scene, BumpsLieOnTopOfNormalMapsAndNeedTextureCoordinates) {
  std::vector<float> ramp;
  for (int i = 0; i < 64; ++i) ramp.push_back((static_cast<float>(i % 8) + 0.5f) / 8);
  const float toward_v[3] = {0.5f, 0.5f + 0.5f * 0.6f, 0.5f + 0.5f * 0.8f};
  Material m = test::diffuse(0.5f, 0.5f, 0.5f);
  m.height_texture = 0, m.bump_distance = 0.5f, m.normal_texture = 1;
  const auto textures = [&] {
    return std::vector<Texture>{grey(8, 8, ramp), Texture(1, 1, 3, Texture::Format::float32, {}, toward_v)};
  };
  const SurfaceHit hit = above(*square(m, textures()), 0.4f, 0.45f);
  EXPECT_LT(hit.normal.x, -0.3f);
  EXPECT_GT(hit.normal.y, 0.4f);
  EXPECT_NEAR(length(hit.normal), 1.0f, 1e-5f);
  EXPECT_EQ(above(*square(m, textures(), 1.0f, true), 0.4f, 0.45f).normal, (Vec3f{0, 0, 1})) << "no direction of u";
}

TEST(Scene, TexturesOfRoughnessAndMetalMultiplyGreenAndBlue) {
  // Packed as glTF has it: occlusion, roughness, metal.
  const float packed[6] = {1, 0.5f, 0.25f, 1, 0.0f, 1.0f};
  Material m = test::diffuse(0.5f, 0.5f, 0.5f);
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1};
  m.roughness = 0.8f, m.metallic = 0.5f, m.roughness_texture = m.metallic_texture = 0;
  const auto scene = square(m, {Texture(2, 1, 3, Texture::Format::float32, {false, true, true}, packed)});
  const SurfaceHit rough = above(*scene, 0.2f, 0.4f), sharp = above(*scene, 0.8f, 0.4f);
  const Bsdf of_rough = scene->interaction(rough, {0, 0, 1}).bsdf, of_sharp = scene->interaction(sharp, {0, 0, 1}).bsdf;
  const BsdfParameters p = scene->bsdf_parameters(0, rough.uv);
  EXPECT_FLOAT_EQ(p.alpha, 0.16f);
  EXPECT_FLOAT_EQ(p.metallic, 0.125f);
  // Specular where the texture makes it a mirror, shaded where it does not.
  EXPECT_FALSE(of_rough.is_specular());
  EXPECT_TRUE(of_sharp.is_specular());
  EXPECT_FALSE(of_rough.sample_specular(0.5f, 0.5f, 0.5f));
  ASSERT_TRUE(of_sharp.sample_specular(0.5f, 0.5f, 0.5f));
  EXPECT_NEAR(of_sharp.sample_specular(0.5f, 0.5f, 0.5f)->weight.x, 0.5f * 0.5f + 0.5f * 0.04f, 1e-3f);
  EXPECT_GT(max_component(of_rough.layers()[0].specular), 0.0f);
  EXPECT_EQ(max_component(of_sharp.layers()[0].specular), 0.0f);
}

TEST(Scene, TexturesByViewAreLookedUpByTheSideAndTheCosineToTheViewer) {
  // Back, straight on to edge-on; front, edge-on to straight on.
  const float texels[8] = {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f, 0.7f, 0.8f};
  Texture::Options by_view;
  by_view.by_view = by_view.clamp = true;
  const Texture table(8, 1, 1, Texture::Format::float32, by_view, texels);
  Material m = test::diffuse(1, 1, 1);
  m.diffuse_texture = 0;
  const auto scene = square(m, {table});
  const SurfaceHit hit = above(*scene, 0.3f, 0.6f);
  for (const float cosine : {0.0f, 0.25f, 1.0f / 3, 0.8f, 1.0f})
    for (const float side : {1.0f, -1.0f}) {
      const Vec3f view{std::sqrt(1 - cosine * cosine), 0, cosine * side};
      if (cosine == 0.0f && side < 0) continue;  // neither side
      const float expected = side > 0 ? 0.5f + 0.3f * cosine : 0.4f - 0.3f * cosine;
      EXPECT_NEAR(scene->interaction(hit, view).bsdf.albedo().x, expected, 1e-5f) << cosine << " " << side;
    }
  m.diffuse_texture = -1, m.emission_texture = 0, m.emission = {1, 1, 1};
  EXPECT_NE(error_of([&] { square(m, {table}); }).find("emission_texture = 0 is a texture by view"), std::string::npos);
}

TEST(Scene, FactorsAboveOneStayUntilTheTextureHasMultipliedThem) {
  const float texels[6] = {0.5f, 0.25f, 0.9f, 4.0f, -1.0f, 0.5f};
  Material m = test::diffuse(1.5f, 2.0f, 1.25f);
  m.specular = {3, 0.5f, 1}, m.diffuse_texture = m.specular_texture = 0;
  const auto scene = square(m, {Texture(2, 1, 3, Texture::Format::float32, {false, true, true}, texels)});
  const BsdfParameters left = scene->bsdf_parameters(0, {0.2f, 0.5f}), right = scene->bsdf_parameters(0, {0.8f, 0.5f});
  EXPECT_EQ(left.diffuse, (Rgb{0.75f, 0.5f, 1})) << "1.25 times 0.9 is cut";
  EXPECT_EQ(left.specular, (Rgb{1, 0.125f, 0.9f}));
  EXPECT_EQ(right.diffuse, (Rgb{1, 0, 0.625f})) << "so is what a texture holds beyond 0 to 1";
}

TEST(Scene, WithoutFresnelALobeReflectsAsMuchAtEveryAngle) {
  Material m = test::diffuse(0.5f, 0.25f, 0.125f);
  m.lobe = LobeModel::ggx, m.fresnel = false, m.specular = {0.3f, 0.2f, 0.1f};
  for (const float roughness : {0.5f, 0.0f}) {
    m.roughness = roughness;
    const auto scene = square(m, {});
    const SurfaceHit hit = above(*scene, 0.4f, 0.4f);
    for (const Vec3f view : {Vec3f{0, 0, 1}, normalize(Vec3f{1, 0, 0.05f})}) {
      const Bsdf bsdf = scene->interaction(hit, view).bsdf;
      const SurfacePoint& p = bsdf.layers()[0];
      EXPECT_NEAR(p.diffuse.x * std::numbers::pi_v<float>, 0.5f, 1e-6f);
      EXPECT_EQ(p.falloff, 0.0f) << "Lambert";
      if (roughness > 0.0f) {
        EXPECT_EQ(p.specular, m.specular);
        EXPECT_EQ(p.grazing, m.specular);
      } else {
        const auto s = bsdf.sample_specular(0.5f, 0.5f, 0.5f);
        ASSERT_TRUE(s);
        EXPECT_NEAR(s->weight.x, 0.3f, 1e-6f);
        EXPECT_NEAR(s->weight.z, 0.1f, 1e-6f);
      }
    }
  }
}

}  // namespace lumicut
