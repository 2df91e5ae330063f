// Level 2: what a scene takes, keeps, and gives back after an error.
#include <cstring>
#include <functional>

#include "box_scene.h"
#include "tests/support/backends.h"

namespace {

using namespace box;

TEST(Scene, UpdatedMeshesRenderAsIfTheyHadBeenAddedSo) {
  const api::Device device(2);
  const api::Integrator i = integrator(device);
  api::Scene moved = scene(device);
  const auto before = render(i, moved);
  Geometry g = geometry();
  for (size_t k = 0; k < g.positions.size(); k += 3) g.positions[k] *= 0.8f;
  moved.update_mesh(0, g.positions.data(), nullptr, nullptr);
  moved.commit();
  const auto after = render(i, moved);
  EXPECT_NE(after, before);

  api::Scene fresh(device);
  fresh.set_materials(materials());
  fresh.add_mesh(g.mesh());
  fresh.set_lights({lamp()});
  fresh.set_camera(camera());
  fresh.commit();
  EXPECT_EQ(render(i, fresh), after);

  moved.update_mesh(0, geometry().positions.data(), nullptr, nullptr);
  moved.commit();
  EXPECT_EQ(render(i, moved), before);
}

TEST(Scene, UpdatedTransformsMoveInstances) {
  const api::Device device(2);
  const Geometry g = geometry();
  const float here[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, there[12] = {1, 0, 0, 0.2f, 0, 1, 0, 0, 0, 0, 1, 0};
  const auto room = [&](const float* transform) {
    api::Scene s(device);
    s.set_materials(materials());
    auto m = g.mesh();
    m.transforms = transform, m.transform_count = 1;
    s.add_mesh(m);
    s.set_lights({lamp()});
    s.set_camera(camera());
    s.commit();
    return s;
  };
  const api::Integrator i = integrator(device);
  api::Scene s = room(there);
  const auto moved = render(i, s);
  s.update_mesh(0, nullptr, nullptr, here);
  s.commit();
  const auto back = render(i, s);
  EXPECT_NE(back, moved);
  EXPECT_EQ(back, render(i, room(here)));
}

TEST(Scene, AFailedCommitIsToldAndCanBeMended) {
  const api::Device device(2);
  const api::Integrator i = integrator(device);
  api::Scene s = scene(device);
  const auto good = render(i, s);

  auto m = materials();
  m[0].diffuse_texture = 3;  // there are none
  s.set_materials(m);
  EXPECT_CODE(lumicut_scene_commit(s.get()), LUMICUT_INVALID_ARGUMENT, "diffuse_texture");
  auto f = frame();
  lumicut_render r = nullptr;
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &r), LUMICUT_INVALID_STATE, "changed since its last commit");
  EXPECT_CODE(lumicut_integrator_prepare(i.get(), s.get()), LUMICUT_INVALID_STATE, "changed since its last commit");
  EXPECT_EQ(s.status().state, LUMICUT_FAILED);

  s.set_materials(materials());
  s.commit();
  EXPECT_EQ(s.status().state, LUMICUT_DONE);
  EXPECT_EQ(render(i, s), good);
}

TEST(Scene, AMeshWhoseMaterialIsMissingFailsTheCommit) {
  const api::Device device(1);
  api::Scene s = scene(device, false);
  s.set_materials({});
  EXPECT_CODE(lumicut_scene_commit(s.get()), LUMICUT_INVALID_ARGUMENT, "material");
}

TEST(Scene, NeverCommittedScenesAndMissingCamerasAreToldApart) {
  const api::Device device(1);
  const api::Integrator i = integrator(device, 10);
  api::Scene s(device);
  auto f = frame();
  lumicut_render r = nullptr;
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &r), LUMICUT_INVALID_STATE, "never committed");
  s.commit();
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &r), LUMICUT_INVALID_STATE, "no camera");
}

TEST(Scene, ObjectsOfTwoDevicesDoNotMix) {
  const api::Device one(1), other(1);
  const api::Scene s = scene(one);
  const api::Integrator i = integrator(other, 10);
  auto f = frame();
  lumicut_render r = nullptr;
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &r), LUMICUT_INVALID_ARGUMENT, "another device");
  EXPECT_CODE(lumicut_integrator_prepare(i.get(), s.get()), LUMICUT_INVALID_ARGUMENT, "another device");
}

TEST(Scene, WithoutGeometryTheEnvironmentIsSeen) {
  const api::Device device(1);
  api::Scene s(device);
  auto e = make<lumicut_environment>();
  e.color[0] = e.color[1] = e.color[2] = 0.5f;
  s.set_environment(e);
  s.set_camera(camera());
  s.commit();
  for (const float v : render(integrator(device, 10), s)) ASSERT_EQ(v, 0.5f);
}

TEST(Scene, AHiddenEnvironmentLightsWhatTheCameraSeesAndIsBlackItself) {
  const api::Device device(1);
  const api::Integrator i = integrator(device, 500);
  api::Scene s = scene(device, false);
  s.set_lights({});
  auto e = make<lumicut_environment>();
  e.color[0] = e.color[1] = e.color[2] = 0.5f;
  s.set_environment(e);
  s.commit();
  const auto shown = render(i, s);
  e.flags = LUMICUT_HIDDEN;
  s.set_environment(e);
  s.commit();
  const auto hidden = render(i, s);
  int background = 0, lit = 0;
  for (size_t p = 0; p < shown.size(); ++p) {
    if (hidden[p] != shown[p]) {
      ASSERT_EQ(hidden[p], 0.0f);
      ASSERT_EQ(shown[p], 0.5f);
      ++background;
    } else if (hidden[p] > 0) {
      ++lit;
    }
  }
  EXPECT_GT(background + lit, 0);
  EXPECT_GT(lit, 0);
  api::Scene empty(device);
  empty.set_environment(e);
  empty.set_camera(camera());
  empty.commit();
  for (const float v : render(i, empty)) ASSERT_EQ(v, 0.0f);
}

TEST(Scene, WithoutLightsItIsBlack) {
  const api::Device device(1);
  api::Scene s = scene(device, false);
  s.set_lights({});
  s.commit();
  EXPECT_EQ(mean(render(integrator(device, 10), s)), 0.0);
}

namespace {
// A diffuse_texture that is `texture` darkens red by half as a diffuse of half as much red does.
void expect_half_of_red(
    const lumicut_texture& texture, const std::function<void()>& after = [] {}) {
  const api::Device device(2);
  const api::Integrator i = integrator(device);
  api::Scene s = scene(device);
  auto m = materials();
  for (auto& each : m) each.diffuse[0] *= 0.5f;
  s.set_materials(m);
  s.commit();
  const auto expected = render(i, s);

  m = materials();
  for (auto& each : m) each.diffuse_texture = 1;
  s.set_textures({texture});
  s.set_materials(m);
  after();
  s.commit();
  const auto textured = render(i, s);
  // The same but for the order of two multiplications.
  ASSERT_EQ(textured.size(), expected.size());
  for (size_t k = 0; k < textured.size(); ++k) ASSERT_NEAR(textured[k], expected[k], 1e-4f + 1e-4f * expected[k]);
}
}  // namespace

TEST(Scene, TexturesAreCopiedAndMultiplyTheColour) {
  std::vector<float> pixels = {0.5f, 1, 1, 0.5f, 1, 1};
  auto t = make<lumicut_texture>();
  t.width = 2, t.height = 1, t.channels = 3, t.format = LUMICUT_FLOAT32, t.pixels = pixels.data();
  expect_half_of_red(t, [&] { pixels.assign(6, 0.0f); });
}

TEST(Scene, AProgramOfAConstantIsThatFactor) {
  const float constant[3] = {0.5f, 1, 1};
  lumicut_instruction sum{};
  sum.op = LUMICUT_OP_CLAMP, sum.inputs[0] = sum.inputs[1] = sum.inputs[2] = -1;
  auto program = make<lumicut_program>();
  program.instruction_count = program.constant_count = 1;
  program.instructions = &sum, program.constants = constant;
  auto t = make<lumicut_texture>();
  t.program = &program;
  expect_half_of_red(t);
}

// What is told in the camera's terms is another surface to another camera: lights are traced again.
TEST(Scene, AnotherCameraPreparesAgainWhereProgramsAskForIt) {
  const api::Device device(1);
  api::Integrator i = integrator(device, 200);
  api::Scene s = scene(device);
  lumicut_instruction depth{};
  depth.op = LUMICUT_OP_CAMERA, depth.mode = 2;
  lumicut_instruction wave{};
  wave.op = LUMICUT_OP_WAVE, wave.inputs[1] = wave.inputs[2] = wave.inputs[3] = wave.inputs[4] = wave.inputs[5] = -1;
  const lumicut_instruction steps[] = {depth, wave};
  const float zero[3] = {};
  auto program = make<lumicut_program>();
  program.instruction_count = 2, program.constant_count = 1, program.instructions = steps, program.constants = zero;
  auto t = make<lumicut_texture>();
  t.program = &program;
  s.set_textures({t});
  auto m = materials();
  for (auto& each : m) each.diffuse_texture = 1;
  s.set_materials(m);
  s.commit();
  i.prepare(s);
  const auto before = i.lights();
  auto moved = camera();
  moved.to_world[11] += 0.1f;
  s.set_camera(moved);
  s.commit();
  i.prepare(s);
  const auto after = i.lights();
  EXPECT_NE(std::memcmp(before.data(), after.data(), std::min(before.size(), after.size()) * sizeof(lumicut_vpl)), 0);
}

TEST(Scene, BrokenNormalsAndTextureCoordinatesAreMended) {
  const api::Device device(2);
  const api::Integrator i = integrator(device);
  const auto expected = render(i, scene(device));
  const Geometry g = geometry();
  const std::vector<float> broken(g.positions.size(), NAN);
  auto m = g.mesh();
  api::Scene mended(device);
  m.normals = broken.data(), m.uvs = broken.data();
  mended.set_materials(materials());
  mended.add_mesh(m);
  mended.set_lights({lamp()});
  mended.set_camera(camera());
  mended.commit();
  EXPECT_EQ(render(i, mended), expected);
}

TEST(Scene, ANewCameraAsksForNoNewLights) {
  const api::Device device(2);
  const api::Integrator i = integrator(device);
  api::Scene s = scene(device);
  const auto before = render(i, s);
  auto c = camera();
  c.to_world[3] = 0.3f;
  s.set_camera(c);
  lumicut_render none = nullptr;
  auto f = frame();
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &none), LUMICUT_INVALID_STATE,
              "changed since its last commit");
  s.commit();
  const api::Render r(i, s, f);
  r.wait();
  EXPECT_NE(r.read("radiance"), before);
  EXPECT_NE(r.stats_json().find("\"prepare_reused\": 1"), std::string::npos) << r.stats_json();
}

TEST(Scene, IsTracedByOurBvhAndWatertightUnlessToldOtherwise) {
  const api::Device device(2);
  // What the camera sees, and the bytes of what traces: Embree's differ from ours.
  const auto traced = [&](const lumicut_scene_desc* desc) {
    lumicut_scene handle = nullptr;
    EXPECT_EQ(lumicut_scene_create(device.get(), desc, &handle), LUMICUT_OK) << lumicut_last_error();
    const std::unique_ptr<lumicut_scene_t, void (*)(void*)> owner(handle, lumicut_release);
    const Geometry g = geometry();
    const auto m = materials();
    const lumicut_mesh mesh = g.mesh();
    const lumicut_camera c = camera();
    EXPECT_EQ(lumicut_scene_set_materials(handle, m.data(), m.size()), LUMICUT_OK);
    EXPECT_EQ(lumicut_scene_add_mesh(handle, &mesh, nullptr), LUMICUT_OK);
    const lumicut_light l = lamp();
    EXPECT_EQ(lumicut_scene_set_lights(handle, &l, 1), LUMICUT_OK);
    EXPECT_EQ(lumicut_scene_set_camera(handle, &c), LUMICUT_OK);
    EXPECT_EQ(lumicut_scene_commit(handle), LUMICUT_OK);
    const std::string stats = lumicut_stats_json(handle);
    const double bytes = std::stod(stats.substr(stats.find("\"accel_bytes\":") + 14));
    const api::Integrator first = integrator(device, 10);
    lumicut_render render = nullptr;
    const auto f = frame();
    EXPECT_EQ(lumicut_render_start(first.get(), handle, &f, &render), LUMICUT_OK) << lumicut_last_error();
    EXPECT_EQ(lumicut_render_wait(render, LUMICUT_FOREVER, nullptr), LUMICUT_OK);
    std::vector<float> out(size_t{3} * f.width * f.height);
    EXPECT_EQ(lumicut_render_read(render, "position", nullptr, out.data()), LUMICUT_OK);
    lumicut_release(render);
    return std::pair(out, bytes);
  };
  auto desc = make<lumicut_scene_desc>();
  const auto usual = traced(nullptr);
  EXPECT_EQ(traced(&desc), usual);
  desc.robust = LUMICUT_ROBUST, desc.accel = "bvh";
  EXPECT_EQ(traced(&desc), usual);
  desc.accel = "agglomerative", desc.builder = "";
  EXPECT_EQ(traced(&desc), usual);
  // The triangle test that is not watertight rounds otherwise.
  desc.robust = LUMICUT_FAST;
  EXPECT_NE(traced(&desc).first, usual.first);
  if (!lumicut::test::kHasEmbree) return;
  desc = make<lumicut_scene_desc>(), desc.accel = "embree";
  EXPECT_NE(traced(&desc).second, usual.second);
}

// Rays between such places overflow single precision. Embree as Debian builds it would end the process.
TEST(Scene, RefusesPlacesFartherThanRaysReach) {
  const api::Device device(1);
  lumicut_scene handle = nullptr;
  ASSERT_EQ(lumicut_scene_create(device.get(), nullptr, &handle), LUMICUT_OK);
  const std::unique_ptr<lumicut_scene_t, void (*)(void*)> owner(handle, lumicut_release);
  const auto far_light = [&](const char* text, const auto& change) {
    lumicut_light l = lamp();
    change(l);
    EXPECT_CODE(lumicut_scene_set_lights(handle, &l, 1), LUMICUT_INVALID_ARGUMENT, text);
  };
  far_light("lumicut_light[0].position[2]: 1e+20 is not in [-9e+17, 9e+17]", [](auto& l) { l.position[2] = 1e20f; });
  far_light("lumicut_light[0].u[0]: -1e+18", [](auto& l) { l.u[0] = -1e18f; });
  far_light("lumicut_light[0].radius: 1e+30", [](auto& l) { l.type = LUMICUT_POINT, l.radius = 1e30f; });
  lumicut_camera c = camera();
  c.to_world[11] = 2e18f;
  EXPECT_CODE(lumicut_scene_set_camera(handle, &c), LUMICUT_INVALID_ARGUMENT, "lumicut_camera.to_world[11]: 2e+18");
  Geometry g = geometry();
  g.positions[4] = -1e19f;
  lumicut_mesh m = g.mesh();
  EXPECT_CODE(lumicut_scene_add_mesh(handle, &m, nullptr), LUMICUT_INVALID_ARGUMENT,
              "lumicut_mesh.positions[4]: -1e+19");
  // Each number is small enough, what they give together is not.
  g = geometry();
  g.positions[4] = 1e15f;
  m = g.mesh();
  float transforms[24] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1e6f, 0, 0, 0, 0, 1, 0};
  m.transforms = transforms, m.transform_count = 2;
  const auto all = materials();
  ASSERT_EQ(lumicut_scene_set_materials(handle, all.data(), all.size()), LUMICUT_OK);
  ASSERT_EQ(lumicut_scene_add_mesh(handle, &m, nullptr), LUMICUT_OK);
  EXPECT_CODE(lumicut_scene_commit(handle), LUMICUT_INVALID_ARGUMENT,
              "mesh[0] vertex 1 of instance[1] lies at (1, 1e+21");
}

TEST(Scene, RefusesWhatItsAccelDoesNotHave) {
  const api::Device device(1);
  const auto refused = [&](uint32_t robust, const char* accel, const char* builder, lumicut_result code,
                           const char* text) {
    auto desc = make<lumicut_scene_desc>();
    desc.robust = robust, desc.accel = accel, desc.builder = builder;
    lumicut_scene made = nullptr;
    EXPECT_CODE(lumicut_scene_create(device.get(), &desc, &made), code, text);
    EXPECT_EQ(made, nullptr);
  };
  refused(3, nullptr, nullptr, LUMICUT_INVALID_ARGUMENT, "lumicut_scene_desc.robust: 3");
  refused(0, "octree", nullptr, LUMICUT_INVALID_ARGUMENT, "accel 'octree' is neither");
  refused(0, nullptr, "magic", LUMICUT_INVALID_ARGUMENT, "builder 'magic' is none of");
  refused(0, "embree", "sweep", LUMICUT_UNSUPPORTED,
          lumicut::test::kHasEmbree ? "lumicut_scene_desc.builder" : "accel 'embree' is not in this library");
}

TEST(Scene, EveryBuilderGivesTheSameImage) {
  const api::Device device(2);
  const api::Scene usual = scene(device);
  const auto expected = render(integrator(device, 100), usual);
  for (const char* builder : {"agglomerative", "sweep", "binned-agglomerative+reinsert:20x8"}) {
    api::Scene other(device, nullptr, true, builder);
    other.set_materials(materials());
    other.add_mesh(geometry().mesh());
    other.set_lights({lamp()});
    other.set_camera(camera());
    other.commit();
    EXPECT_EQ(render(integrator(device, 100), other), expected) << builder;
  }
}

TEST(Scene, EitherAccelGivesTheSameImage) {
  SKIP_WITHOUT_EMBREE();
  const api::Device device(2);
  const api::Scene usual = scene(device);
  const api::Integrator first = integrator(device, 200).set("clamp_distance", "0.1");
  const auto expected = render(first, usual);
  api::Scene own(device, "embree");
  own.set_materials(materials());
  own.add_mesh(geometry().mesh());
  own.set_lights({lamp()});
  own.set_camera(camera());
  own.commit();
  api::Integrator second = integrator(device, 200).set("clamp_distance", "0.1");
  second.set_lights(first.lights());
  const auto image = render(second, own);
  // Where a shadow ray passes an edge, two tracers may round differently.
  size_t differing = 0;
  for (size_t i = 0; i < image.size(); ++i) differing += std::abs(image[i] - expected[i]) > 0.01 * mean(expected);
  EXPECT_LT(differing, image.size() / 100);
}

TEST(Scene, KeepsItsDeviceAlive) {
  lumicut_scene s = nullptr;
  {
    const api::Device device(1);
    const api::Scene made = scene(device);
    s = made.get();
    lumicut_retain(s);
  }
  EXPECT_EQ(lumicut_scene_commit(s), LUMICUT_OK);
  lumicut_release(s);
}

}  // namespace
