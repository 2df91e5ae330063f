// What lighting designers ask for: illuminance against closed forms, and one image for each light group.
#include "box_scene.h"

namespace {

using namespace box;

constexpr double kPi = 3.14159265358979;
constexpr double kLumenPerWatt = 683;

// A wide floor at z = 0 that reflects 40 %, seen from above by one pixel on the axis of the lamp. `flags`: of its material.
double lux_below(const lumicut_light& light, const char* integrator, int vpls = 20000, uint32_t flags = 0) {
  const api::Device device(2);
  api::Scene s(device);
  Geometry g;
  g.quad({{{-50, -50, 0}, {50, -50, 0}, {50, 50, 0}, {-50, 50, 0}}}, 0);
  std::vector<lumicut_material> m(1, make<lumicut_material>());
  m[0].diffuse[0] = m[0].diffuse[1] = m[0].diffuse[2] = 0.4f;
  m[0].flags = flags;
  s.set_materials(m);
  s.add_mesh(g.mesh());
  s.set_lights({light});
  auto c = make<lumicut_camera>();
  c.to_world[0] = c.to_world[5] = c.to_world[10] = 1;
  c.to_world[11] = 1.0f;
  c.fov_y = 0.001f;
  s.set_camera(c);
  s.commit();
  const api::Integrator i = box::integrator(device, vpls, integrator);
  EXPECT_EQ(lumicut_integrator_set(i.get(), "max_depth", "0"), LUMICUT_OK);
  auto f = frame(1, 1);
  f.tile_size = 8;
  f.flags = LUMICUT_ILLUMINANCE;
  f.samples = 4;
  const api::Render r(i, s, f);
  r.wait();
  return r.read("illuminance")[0];
}

lumicut_light lamp_of(uint32_t type, float value, float height) {
  auto l = make<lumicut_light>();
  l.type = type;
  l.color[0] = l.color[1] = l.color[2] = 1;
  l.value = value;
  l.position[2] = height;
  return l;
}

// The clamp, a twentieth of the scene's radius, is 3.5 here: lights hang higher.
TEST(Illuminance, OfAPointFallsWithTheSquareOfTheDistance) {
  for (const float height : {4.0f, 8.0f})
    EXPECT_NEAR(lux_below(lamp_of(LUMICUT_POINT, 10, height), "lightcuts") / (kLumenPerWatt * 10 / (height * height)),
                1.0, 0.01);
}

TEST(Illuminance, OfADiskIsTheClosedForm) {
  auto l = lamp_of(LUMICUT_DISK, 3, 5);
  l.u[0] = 4, l.v[1] = -4;  // radius 2, shines down
  const double expected = kLumenPerWatt * kPi * 3 * 4 / (4 + 25.0);
  EXPECT_NEAR(lux_below(l, "exhaustive") / expected, 1.0, 0.01);
  EXPECT_NEAR(lux_below(l, "lightcuts") / expected, 1.0, 0.01);
}

TEST(Illuminance, OfASphereIsThatOfItsIntensityInTheMiddle) {
  auto l = lamp_of(LUMICUT_POINT, 10, 5);
  l.radius = 1;
  EXPECT_NEAR(lux_below(l, "exhaustive", 60000) / (kLumenPerWatt * 10 / 25), 1.0, 0.01);
}

TEST(Illuminance, OfASunIsItsIrradiance) {
  auto l = lamp_of(LUMICUT_SUN, 2, 0);
  l.direction[2] = -1;
  EXPECT_NEAR(lux_below(l, "lightcuts") / (kLumenPerWatt * 2), 1.0, 0.01);
}

// Burley's diffuse, of a smooth surface, gives back a sixth less of such a sun; GGX has a falloff towards it.
TEST(Illuminance, DoesNotDependOnTheMaterial) {
  auto l = lamp_of(LUMICUT_SUN, 2, 0);
  l.direction[0] = std::sqrt(1 - 0.2f * 0.2f), l.direction[2] = -0.2f;
  for (const uint32_t flags : {0u, uint32_t{LUMICUT_GGX}, uint32_t{LUMICUT_GGX | LUMICUT_BURLEY}})
    EXPECT_NEAR(lux_below(l, "lightcuts", 20000, flags) / (kLumenPerWatt * 2 * 0.2), 1.0, 0.01) << flags;
}

TEST(Illuminance, IsZeroUnlessAskedFor) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 50);
  const api::Render r(i, s, frame());
  r.wait();
  for (const float v : r.read("illuminance")) ASSERT_EQ(v, 0.0f);
}

class Groups : public testing::Test {
 protected:
  // The box with its light in group 7, a point light in group 3, and a constant sky in group 0.
  api::Scene scene_with(bool lamp_on, bool point_on) {
    api::Scene s(device_);
    s.set_materials(materials());
    s.add_mesh(geometry().mesh());
    auto a = lamp();
    a.group = 7;
    auto b = lamp_of(LUMICUT_POINT, 1, -0.7f);
    b.position[0] = 0.5f, b.group = 3;
    b.color[0] = 0.2f;
    std::vector<lumicut_light> lights;
    if (lamp_on) lights.push_back(a);
    if (point_on) lights.push_back(b);
    s.set_lights(lights);
    auto e = make<lumicut_environment>();
    e.color[0] = e.color[1] = e.color[2] = 0.1f;
    s.set_environment(e);
    s.set_camera(camera());
    s.commit();
    return s;
  }
  api::Device device_{2};
};

TEST_F(Groups, TogetherAreTheWhole) {
  const api::Scene s = scene_with(true, true);
  const api::Integrator i = integrator(device_, 300, "lightcuts");
  for (const uint32_t passes : {1u, 3u}) {
    auto f = frame();
    f.flags = LUMICUT_GROUPS;
    f.passes = passes;
    const api::Render r(i, s, f);
    r.wait();
    const uint32_t* groups = nullptr;
    uint64_t count = 0;
    ASSERT_EQ(lumicut_render_groups(r.get(), &groups, &count), LUMICUT_OK);
    ASSERT_EQ(std::vector<uint32_t>(groups, groups + count), (std::vector<uint32_t>{0, 3, 7}));
    const auto all = r.read("radiance");
    std::vector<float> a(all.size()), b(all.size()), c(all.size());
    ASSERT_EQ(lumicut_render_read(r.get(), "radiance.0", nullptr, a.data()), LUMICUT_OK);
    ASSERT_EQ(lumicut_render_read(r.get(), "radiance.3", nullptr, b.data()), LUMICUT_OK);
    ASSERT_EQ(lumicut_render_read(r.get(), "radiance.7", nullptr, c.data()), LUMICUT_OK);
    double sky = 0, point = 0, area = 0;
    for (size_t k = 0; k < all.size(); ++k) {
      ASSERT_NEAR(a[k] + b[k] + c[k], all[k], 1e-5f * (1 + all[k]));
      sky += a[k], point += b[k], area += c[k];
    }
    EXPECT_GT(sky, 0);
    EXPECT_GT(point, 0);
    EXPECT_GT(area, 0);
  }
}

TEST_F(Groups, EachIsTheImageOfItsLampAlone) {
  const api::Integrator i = integrator(device_, 300);
  ASSERT_EQ(lumicut_integrator_set(i.get(), "max_depth", "0"), LUMICUT_OK);
  const api::Scene both = scene_with(true, true), alone = scene_with(false, true);
  auto f = frame();
  f.flags = LUMICUT_GROUPS;
  std::vector<float> x, y;
  for (const api::Scene* s : {&both, &alone}) {
    const api::Render r(i, *s, f);
    r.wait();
    auto& into = s == &both ? x : y;
    into.resize(r.read("radiance").size());
    ASSERT_EQ(lumicut_render_read(r.get(), "radiance.3", nullptr, into.data()), LUMICUT_OK);
  }
  // Direct light of a point light is one virtual light, whatever else there is.
  for (size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k], y[k], 1e-6f * (1 + x[k]));
}

TEST_F(Groups, HaveNoChannelUnlessAskedFor) {
  const api::Scene s = scene_with(true, true);
  const api::Integrator i = integrator(device_, 50);
  const api::Render r(i, s, frame());
  r.wait();
  std::vector<float> out(3 * 48 * 32);
  EXPECT_EQ(lumicut_render_read(r.get(), "radiance.3", nullptr, out.data()), LUMICUT_INVALID_ARGUMENT);
  const uint32_t* groups = nullptr;
  uint64_t count = 1;
  EXPECT_EQ(lumicut_render_groups(r.get(), &groups, &count), LUMICUT_OK);
  EXPECT_EQ(count, 0u);
}

}  // namespace
