#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
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
  for (const char* kind : {"embree", "agglomerative"}) {
    Scene scene{{.accel = kind}};
    Material m;
    m.opacity = 0.3f;
    scene.set_materials({m});
    Mesh mesh;
    test::add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, 0);
    scene.add_mesh(mesh);
    Progress progress;
    scene.commit(progress);
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
    const SurfacePoint p = room->shade_point({0, 0, 0}, n, n, {}, 0, {0, 0, side}, 0);
    EXPECT_EQ(p.normal.z, side);
    EXPECT_NEAR(p.position.z, side * room->epsilon(), 1e-12f);
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

}  // namespace lumicut
