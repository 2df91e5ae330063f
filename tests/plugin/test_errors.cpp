// What a host does wrong is told by field and value, and changes nothing.
#include <atomic>
#include <functional>
#include <limits>
#include <mutex>
#include <thread>

#include "box_scene.h"

namespace {

using namespace box;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

TEST(Errors, NullAndWrongHandlesAreRefusedByEveryFunction) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  // A handle of another kind than each function wants, and none at all.
  for (void* wrong : {static_cast<void*>(nullptr), static_cast<void*>(s.get()), static_cast<void*>(device.get())}) {
    const bool is_scene = wrong == s.get(), is_device = wrong == device.get();
    const char* text = wrong == nullptr ? "is NULL" : "the handle is a lumicut_";
    auto* const d = static_cast<lumicut_device>(wrong);
    auto* const a = static_cast<lumicut_accel>(wrong);
    auto* const c = static_cast<lumicut_scene>(wrong);
    auto* const i = static_cast<lumicut_integrator>(wrong);
    auto* const r = static_cast<lumicut_render>(wrong);
    auto accel_desc = make<lumicut_accel_desc>();
    auto accel_info = make<lumicut_accel_info>();
    auto node = make<lumicut_accel_node_info>();
    auto status = make<lumicut_status>();
    auto mesh = geometry().mesh();
    auto light = lamp();
    auto cam = camera();
    auto desc = frame();
    auto tile = make<lumicut_tile>();
    lumicut_accel accel = nullptr;
    lumicut_scene made_scene = nullptr;
    lumicut_integrator made = nullptr;
    lumicut_render render = nullptr;
    const uint32_t* ids = nullptr;
    const lumicut_vpl* vpls = nullptr;
    auto vpl_set = make<lumicut_vpl_set>();
    uint64_t count = 0;
    float pixels[3];
    if (!is_device) {
      EXPECT_CODE(lumicut_accel_build(d, &accel_desc, &accel), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_create(d, nullptr, &made_scene), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_integrator_create(d, "exhaustive", &made), LUMICUT_INVALID_ARGUMENT, text);
    }
    EXPECT_CODE(lumicut_accel_get_info(a, &accel_info), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_accel_get_node(a, 0, &node), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_accel_get_primitives(a, &ids, &count), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_accel_intersect(a, nullptr, 0), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_accel_occluded(a, nullptr, 0), LUMICUT_INVALID_ARGUMENT, text);
    if (!is_scene) {
      EXPECT_CODE(lumicut_scene_set_textures(c, nullptr, 0), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_set_materials(c, nullptr, 0), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_add_mesh(c, &mesh, nullptr), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_update_mesh(c, 0, nullptr, nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_set_lights(c, &light, 1), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_set_environment(c, nullptr), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_set_camera(c, &cam), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_set_trace(c, nullptr), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_scene_commit(c), LUMICUT_INVALID_ARGUMENT, text);
    }
    EXPECT_CODE(lumicut_integrator_set(i, "vpls", "1"), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_EQ(lumicut_integrator_get(i, "vpls"), nullptr);
    EXPECT_CODE(lumicut_integrator_set_lights(i, nullptr, 0), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_integrator_prepare(i, s.get()), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_integrator_get_lights(i, &vpls, &count), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(api::lights_extension().set(i, &vpl_set), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(api::lights_extension().get(i, &vpl_set), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_integrator_shade(i, nullptr, 0, nullptr), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_render_start(i, s.get(), &desc, &render), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_render_wait(r, 0, &status), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_render_next_tile(r, &tile), LUMICUT_INVALID_ARGUMENT, text);
    EXPECT_CODE(lumicut_render_read(r, "radiance", nullptr, pixels), LUMICUT_INVALID_ARGUMENT, text);
    if (wrong == nullptr) {
      EXPECT_CODE(lumicut_get_status(wrong, &status), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_CODE(lumicut_cancel(wrong), LUMICUT_INVALID_ARGUMENT, text);
      EXPECT_EQ(lumicut_stats_json(wrong), nullptr);
    }
    EXPECT_EQ(accel, nullptr);
    EXPECT_EQ(made, nullptr);
    EXPECT_EQ(render, nullptr);
  }
  lumicut_release(nullptr);
  lumicut_retain(nullptr);
  alignas(16) unsigned char no_handle[64] = {};
  lumicut_release(no_handle);
  lumicut_retain(no_handle + 1);
  EXPECT_CODE(lumicut_cancel(no_handle), LUMICUT_INVALID_ARGUMENT, "no handle of Lumicut's");
  auto status = make<lumicut_status>();
  EXPECT_CODE(lumicut_get_status(device.get(), &status), LUMICUT_INVALID_ARGUMENT, "lumicut_device");
}

TEST(Errors, PlacesForResultsMustNotBeNull) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 10);
  auto device_desc = make<lumicut_device_desc>();
  device_desc.abi_major = LUMICUT_ABI_MAJOR;
  auto accel_desc = make<lumicut_accel_desc>();
  auto desc = frame();
  uint64_t count = 0;
  EXPECT_CODE(lumicut_device_create(&device_desc, nullptr), LUMICUT_INVALID_ARGUMENT, "device is NULL");
  EXPECT_CODE(lumicut_accel_build(device.get(), &accel_desc, nullptr), LUMICUT_INVALID_ARGUMENT, "accel is NULL");
  EXPECT_CODE(lumicut_scene_create(device.get(), nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, "scene is NULL");
  EXPECT_CODE(lumicut_integrator_create(device.get(), "exhaustive", nullptr), LUMICUT_INVALID_ARGUMENT, "is NULL");
  EXPECT_CODE(lumicut_integrator_create(device.get(), nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, "id is NULL");
  EXPECT_CODE(lumicut_integrator_set(i.get(), nullptr, "1"), LUMICUT_INVALID_ARGUMENT, "NULL");
  EXPECT_CODE(lumicut_integrator_set(i.get(), "vpls", nullptr), LUMICUT_INVALID_ARGUMENT, "NULL");
  EXPECT_CODE(lumicut_integrator_get_lights(i.get(), nullptr, &count), LUMICUT_INVALID_ARGUMENT, "NULL");
  EXPECT_CODE(lumicut_integrator_shade(i.get(), nullptr, 3, nullptr), LUMICUT_INVALID_ARGUMENT, "count is 3");
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &desc, nullptr), LUMICUT_INVALID_ARGUMENT, "render is NULL");
  const api::Render r(i, s, desc);
  r.wait();
  EXPECT_CODE(lumicut_render_read(r.get(), "radiance", nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, "out is NULL");
  EXPECT_CODE(lumicut_render_read(r.get(), nullptr, nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, "channel is NULL");
  EXPECT_EQ(lumicut_render_wait(r.get(), 0, nullptr), LUMICUT_OK);
}

template <typename T>
struct Wrong {
  std::function<void(T&)> spoil;
  const char* text;
  lumicut_result code = LUMICUT_INVALID_ARGUMENT;
};

TEST(Errors, FieldsOfMaterialsAreCheckedByNameAndValue) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  using M = lumicut_material;
  const Wrong<M> wrongs[] = {
      {[](M& m) { m.diffuse[1] = kNan; }, "lumicut_material[3].diffuse[1]: nan is not in [0, 1]"},
      {[](M& m) { m.diffuse[0] = 1.5f; }, "lumicut_material[3].diffuse[0]: 1.5 is not in [0, 1]"},
      {[](M& m) { m.specular[2] = -0.25f; }, "lumicut_material[3].specular[2]: -0.25 is not in [0, 1]"},
      {[](M& m) { m.specular_texture = 1, m.diffuse[0] = 1.5f; },
       "lumicut_material[3].diffuse[0]: 1.5 is not in [0, 1]"},
      {[](M& m) { m.diffuse_texture = 1, m.diffuse[0] = 2e6f; },
       "lumicut_material[3].diffuse[0]: 2e+06 is not in [0, 1e+06]"},
      {[](M& m) { m.shininess = kInf; }, "lumicut_material[3].shininess: inf"},
      {[](M& m) { m.opacity = 2; }, "lumicut_material[3].opacity: 2 is not in [0, 1]"},
      {[](M& m) { m.emission[0] = kInf; }, "lumicut_material[3].emission[0]: inf is not in [0, inf)"},
      {[](M& m) { m.emission_texture = -3; }, "lumicut_material[3].emission_texture: -3"},
      {[](M& m) { m.normal_texture = -1; }, "lumicut_material[3].normal_texture: -1"},
      {[](M& m) { m.normal_strength = 11; }, "lumicut_material[3].normal_strength: 11 is not in [0, 10]"},
      {[](M& m) { m.roughness = 1.5f; }, "lumicut_material[3].roughness: 1.5 is not in [0, 1]"},
      {[](M& m) { m.metallic = -1; }, "lumicut_material[3].metallic: -1 is not in [0, 1]"},
      {[](M& m) { m.ior = 0.05f; }, "lumicut_material[3].ior: 0.05 is not in [0.1, 10]"},
      {[](M& m) { m.transmission = kNan; }, "lumicut_material[3].transmission: nan is not in [0, 1]"},
      {[](M& m) { m.height_texture = -2; }, "lumicut_material[3].height_texture: -2"},
      {[](M& m) { m.translucency[2] = 1.5f; }, "lumicut_material[3].translucency[2]: 1.5 is not in [0, 1]"},
      {[](M& m) { m.translucency_texture = -2; }, "lumicut_material[3].translucency_texture: -2"},
      {[](M& m) { m.bump_distance = kNan; }, "lumicut_material[3].bump_distance: nan is not in [-1e+06, 1e+06]"},
      {[](M& m) { m.bump_strength = -1; }, "lumicut_material[3].bump_strength: -1 is not in [0, 10]"},
      {[](M& m) { m.roughness_texture = -1; }, "lumicut_material[3].roughness_texture: -1"},
      {[](M& m) { m.metallic_texture = -1; }, "lumicut_material[3].metallic_texture: -1"},
      {[](M& m) { m.diffuse_roughness_texture = -1; }, "lumicut_material[3].diffuse_roughness_texture: -1"},
      {[](M& m) { m.diffuse_roughness = 1.5f; }, "lumicut_material[3].diffuse_roughness: 1.5 is not in [0, 1]"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_BURLEY, m.diffuse_roughness = 0.5f; },
       "lumicut_material[3].diffuse_roughness: must be 0 with LUMICUT_BURLEY"},
      {[](M& m) { m.flags = LUMICUT_DIFFUSE_ONCE; },
       "lumicut_material[3].flags: holds LUMICUT_DIFFUSE_ONCE without LUMICUT_GGX"},
      {[](M& m) { m.coat = 1.5f; }, "lumicut_material[3].coat: 1.5 is not in [0, 1]"},
      {[](M& m) { m.coat_roughness = -0.5f; }, "lumicut_material[3].coat_roughness: -0.5 is not in [0, 1]"},
      {[](M& m) { m.coat_ior = 0.5f; }, "lumicut_material[3].coat_ior: 0.5 is not in [1, 10]"},
      {[](M& m) { m.flags = LUMICUT_PHONG | LUMICUT_GGX; }, "lumicut_material[3].flags: holds both"},
      {[](M& m) { m.specular_tint[1] = 1.5f; }, "lumicut_material[3].specular_tint[1]: 1.5 is not in [0, 1]"},
      {[](M& m) { m.absorption[1] = -2; }, "lumicut_material[3].absorption[1]: -2"},
      {[](M& m) { m.flags = LUMICUT_OREN_NAYAR | LUMICUT_GGX; },
       "lumicut_material[3].flags: holds both LUMICUT_OREN_NAYAR and LUMICUT_GGX"},
      {[](M& m) { m.flags = LUMICUT_FACETS_ONCE; },
       "lumicut_material[3].flags: holds LUMICUT_FACETS_ONCE without LUMICUT_OREN_NAYAR or LUMICUT_GGX"},
      {[](M& m) { m.flags = LUMICUT_BRIGHT_LOBE; },
       "lumicut_material[3].flags: holds LUMICUT_BRIGHT_LOBE without LUMICUT_GGX"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_BRIGHT_LOBE | LUMICUT_FACETS_ONCE; },
       "lumicut_material[3].flags: holds both LUMICUT_BRIGHT_LOBE and LUMICUT_FACETS_ONCE"},
      {[](M& m) { m.flags = LUMICUT_BURLEY; }, "lumicut_material[3].flags: holds LUMICUT_BURLEY without LUMICUT_GGX"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_BURLEY | LUMICUT_NO_FRESNEL; },
       "lumicut_material[3].flags: holds both LUMICUT_BURLEY and LUMICUT_NO_FRESNEL"},
      {[](M& m) { m.flags = LUMICUT_NO_FRESNEL; }, "lumicut_material[3].flags: holds LUMICUT_NO_FRESNEL without"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_NO_FRESNEL, m.metallic = 1; },
       "lumicut_material[3].metallic: must be 0 with"},
      {[](M& m) { m.flags = LUMICUT_SHADOWS_PASS; },
       "lumicut_material[3].flags: holds LUMICUT_SHADOWS_PASS without LUMICUT_GGX"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_OPEN_GLASS; },
       "lumicut_material[3].flags: holds LUMICUT_OPEN_GLASS without LUMICUT_SHADOWS_PASS"},
      {[](M& m) {
         m.flags = LUMICUT_GGX | LUMICUT_SHADOWS_PASS | LUMICUT_OPEN_GLASS, m.transmission = 1, m.absorption[1] = 2;
       },
       "lumicut_material[3].absorption: must be 0 with LUMICUT_OPEN_GLASS"},
      {[](M& m) { m.flags = LUMICUT_GGX | LUMICUT_SHADOWS_PASS, m.transmission = 0; },
       "lumicut_material[3].transmission: must be above 0 with LUMICUT_SHADOWS_PASS"},
      {[](M& m) { m.flags = 8192; }, "lumicut_material[3].flags: 8192", LUMICUT_UNSUPPORTED},
  };
  for (const auto& w : wrongs) {
    auto m = materials();
    w.spoil(m[3]);
    EXPECT_CODE(lumicut_scene_set_materials(s.get(), m.data(), m.size()), w.code, w.text);
  }
}

TEST(Errors, FieldsOfLightsAreCheckedByNameAndValue) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  using L = lumicut_light;
  const auto spot = [](L& l) {
    l.type = LUMICUT_SPOT, l.angle = 1;
    l.direction[1] = -1;
  };
  const Wrong<L> wrongs[] = {
      {[](L& l) { l.type = 9; }, "lumicut_light[0].type: 9 is not in [0, 4]"},
      {[](L& l) { l.unit = 2; }, "lumicut_light[0].unit: 2"},
      {[](L& l) { l.group = 70000; }, "lumicut_light[0].group: 70000"},
      {[](L& l) { l.value = -5; }, "lumicut_light[0].value: -5 is not in [0, inf)"},
      {[](L& l) { l.color[2] = kNan; }, "lumicut_light[0].color[2]: nan"},
      {[](L& l) { l.position[0] = kInf; }, "lumicut_light[0].position[0]: inf is not in [-9e+17, 9e+17]"},
      {[](L& l) { l.u[0] = 0; }, "lumicut_light[0].u: with v spans no area"},
      {[](L& l) { l.v[0] = 1; }, "lumicut_light[0].u: is not orthogonal to v"},
      {[](L& l) { l.v[1] = kNan; }, "lumicut_light[0].v[1]: nan"},
      {[](L& l) { l.spread = 4; }, "lumicut_light[0].spread: 4"},
      {[](L& l) { l.value = 3e38f, l.u[0] = l.v[2] = 1e-3f; }, "beyond single precision"},
      {[](L& l) { l.type = LUMICUT_POINT, l.radius = -1; }, "lumicut_light[0].radius: -1"},
      {[](L& l) { l.type = LUMICUT_SUN; }, "lumicut_light[0].direction: (0, 0, 0) has no direction"},
      {[](L& l) { l.type = LUMICUT_SUN, l.direction[0] = 1, l.radius = 2; }, "lumicut_light[0].radius: 2"},
      {[&](L& l) { spot(l), l.angle = 0; }, "lumicut_light[0].angle: 0"},
      {[&](L& l) { spot(l), l.blend = 1.5f; }, "lumicut_light[0].blend: 1.5"},
      {[&](L& l) { spot(l), l.spot_cosine = 2; }, "lumicut_light[0].spot_cosine: 2"},
      {[](L& l) { l.flags = 4; }, "lumicut_light[0].flags: 4", LUMICUT_UNSUPPORTED},
      {[](L& l) { l.mask = 32; }, "lumicut_light[0].mask: 32", LUMICUT_UNSUPPORTED},
      {[](L& l) { l.texture = 1, l.type = LUMICUT_POINT; }, "lumicut_light[0].texture: a point"},
      {[](L& l) { l.receivers = 33; }, "lumicut_light[0].receivers: 33 is not in [0, 32]"},
      {[](L& l) { l.blockers = 28; }, "lumicut_light[0].blockers: 28 is not in [0, 27]"},
      {[](L& l) { l.type = LUMICUT_POINT, l.flags = LUMICUT_FACING_DISK; },
       "lumicut_light[0].radius: must be above 0 with LUMICUT_FACING_DISK"},
      {[](L& l) { l.flags = LUMICUT_FACING_DISK; }, "lumicut_light[0].flags: LUMICUT_FACING_DISK is not for a"},
  };
  for (const auto& w : wrongs) {
    auto l = lamp();
    w.spoil(l);
    EXPECT_CODE(lumicut_scene_set_lights(s.get(), &l, 1), w.code, w.text);
  }
}

TEST(Errors, FieldsOfMeshesTexturesCamerasAndEnvironmentsAreCheckedByNameAndValue) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const auto refused_mesh = [&](const std::function<void(lumicut_mesh&)>& spoil, const char* text) {
    const Geometry g = geometry();
    auto m = g.mesh();
    spoil(m);
    EXPECT_CODE(lumicut_scene_add_mesh(s.get(), &m, nullptr), LUMICUT_INVALID_ARGUMENT, text);
  };
  const float broken[12] = {0, 0, 0, 1, kNan, 0, 0, 1, 0, 0, 0, 0};
  const uint32_t far[3] = {0, 1, 300};
  refused_mesh([&](auto& m) { m.positions = broken, m.vertex_count = 3; },
               "lumicut_mesh.positions[4]: nan is not in [-9e+17, 9e+17]");
  refused_mesh([&](auto& m) { m.indices = far, m.triangle_count = 1; },
               "lumicut_mesh.indices[2]: 300 is not below vertex_count");
  refused_mesh([&](auto& m) { m.positions = nullptr; }, "lumicut_mesh.positions: is NULL");
  refused_mesh([&](auto& m) { m.vertex_count = uint64_t{1} << 60; }, "lumicut_mesh.vertex_count: 1152921504606846976");
  refused_mesh([&](auto& m) { m.transforms = broken, m.transform_count = 1; }, "lumicut_mesh.transforms[4]: nan");
  refused_mesh([&](auto& m) { m.transform_count = 2; }, "lumicut_mesh.transforms: is NULL");
  refused_mesh([&](auto& m) { m.group = 65536; }, "lumicut_mesh.group: 65536");
  refused_mesh([&](auto& m) { m.not_blocking = 1u << 27; },
               "lumicut_mesh.not_blocking: 134217728 names sets beyond 27");
  refused_mesh([&](auto& m) { m.receivers = 33; }, "lumicut_mesh.receivers: 33");
  refused_mesh([&](auto& m) { m.blockers = 28; }, "lumicut_mesh.blockers: 28");

  const unsigned char pixels[64] = {};
  const auto refused_texture = [&](const std::function<void(lumicut_texture&)>& spoil, lumicut_result code,
                                   const char* text) {
    auto t = make<lumicut_texture>();
    t.width = t.height = 2, t.channels = 3, t.pixels = pixels;
    spoil(t);
    EXPECT_CODE(lumicut_scene_set_textures(s.get(), &t, 1), code, text);
  };
  refused_texture([](auto& t) { t.width = 0; }, LUMICUT_INVALID_ARGUMENT, "lumicut_texture[0].width: 0");
  refused_texture([](auto& t) { t.height = 70000; }, LUMICUT_INVALID_ARGUMENT, "lumicut_texture[0].height: 70000");
  refused_texture([](auto& t) { t.channels = 5; }, LUMICUT_INVALID_ARGUMENT, "lumicut_texture[0].channels: 5");
  refused_texture([](auto& t) { t.format = 2; }, LUMICUT_INVALID_ARGUMENT, "lumicut_texture[0].format: 2");
  refused_texture([](auto& t) { t.pixels = nullptr; }, LUMICUT_INVALID_ARGUMENT, "lumicut_texture[0].pixels: is NULL");
  refused_texture([](auto& t) { t.flags = 32; }, LUMICUT_UNSUPPORTED, "lumicut_texture[0].flags: 32");
  refused_texture([](auto& t) { t.flags = LUMICUT_BLEND_STORED; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].flags: holds LUMICUT_BLEND_STORED without LUMICUT_SRGB");
  refused_texture([](auto& t) { t.flags = LUMICUT_BY_VIEW, t.width = 1; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].width: 1 is not even");

  const lumicut_instruction steps[] = {{.op = LUMICUT_OP_UV, .mode = 0, .inputs = {}, .data = 0, .count = 0},
                                       {.op = LUMICUT_OP_IMAGE, .mode = 0, .inputs = {0, 0, 0}, .data = 0, .count = 0}};
  const auto refused_program = [&](const std::function<void(lumicut_texture&, lumicut_program&)>& spoil,
                                   lumicut_result code, const char* text) {
    auto t = make<lumicut_texture>();
    auto p = make<lumicut_program>();
    p.instructions = steps, p.instruction_count = 1, t.program = &p;
    spoil(t, p);
    EXPECT_CODE(lumicut_scene_set_textures(s.get(), &t, 1), code, text);
  };
  refused_program([](auto& t, auto&) { t.width = 2; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].width: 2 is not 0");
  refused_program([&](auto& t, auto&) { t.pixels = pixels; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].pixels: is not NULL");
  refused_program([](auto&, auto& p) { p.instruction_count = 0; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].program.instructions: there is none");
  refused_program([](auto&, auto& p) { p.instruction_count = 2000; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].program.instruction_count: 2000 is more than 1024");
  refused_program([](auto&, auto& p) { p.instructions = nullptr; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].program.instructions: is NULL");
  refused_program([](auto&, auto& p) { p.table_count = 3; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].program.table: is NULL");
  refused_program([](auto&, auto& p) { p.instruction_count = 2; }, LUMICUT_INVALID_ARGUMENT,
                  "lumicut_texture[0].program.instructions[1].data: 0 is no texture");
  refused_program([](auto&, auto& p) { p.struct_size = 8192; }, LUMICUT_INVALID_ARGUMENT, "lumicut_program");

  const float values[300 * 4] = {};
  const auto refused_attribute = [&](const std::function<void(lumicut_mesh&, lumicut_attribute(&)[2])>& spoil,
                                     const char* text) {
    const Geometry walls = geometry();
    auto m = walls.mesh();
    lumicut_attribute a[2] = {make<lumicut_attribute>(), make<lumicut_attribute>()};
    for (auto& each : a) each.components = 1, each.domain = LUMICUT_OF_INSTANCES, each.values = values;
    a[1].id = 1;
    m.attributes = a, m.attribute_count = 2;
    spoil(m, a);
    EXPECT_CODE(lumicut_scene_add_mesh(s.get(), &m, nullptr), LUMICUT_INVALID_ARGUMENT, text);
  };
  refused_attribute([](auto&, auto& a) { a[1].id = 0; }, "lumicut_attribute[1].id: 0 is that of an earlier one");
  refused_attribute([](auto&, auto& a) { a[0].components = 5; }, "lumicut_attribute[0].components: 5");
  refused_attribute([](auto&, auto& a) { a[0].domain = 3; }, "lumicut_attribute[0].domain: 3");
  refused_attribute([](auto&, auto& a) { a[1].values = nullptr; }, "lumicut_attribute[1].values: is NULL");
  refused_attribute([](auto& m, auto&) { m.attributes = nullptr; }, "lumicut_mesh.attributes: is NULL");
  refused_attribute([](auto& m, auto&) { m.attribute_count = 300; }, "lumicut_mesh.attribute_count: 300");

  const auto refused_camera = [&](const std::function<void(lumicut_camera&)>& spoil, const char* text) {
    auto c = camera();
    spoil(c);
    EXPECT_CODE(lumicut_scene_set_camera(s.get(), &c), LUMICUT_INVALID_ARGUMENT, text);
  };
  refused_camera([](auto& c) { c.fov_y = 4; }, "lumicut_camera.fov_y: 4");
  refused_camera([](auto& c) { c.to_world[3] = kNan; }, "lumicut_camera.to_world[3]: nan is not finite");
  refused_camera([](auto& c) { c.to_world[10] = 0; }, "lumicut_camera.to_world: column 2 is 0");
  refused_camera([](auto& c) { c.to_world[1] = 1; }, "lumicut_camera.to_world: axes are not orthogonal");
  refused_camera([](auto& c) { c.orthographic = 1; }, "lumicut_camera.height: 0");
  refused_camera([](auto& c) { c.near_clip = 2, c.far_clip = 1; },
                 "lumicut_camera.far_clip: 1 is not beyond near_clip 2");
  refused_camera([](auto& c) { c.lens_radius = 1; }, "lumicut_camera.focus_distance: 0");
  refused_camera([](auto& c) { c.panorama = 6; }, "lumicut_camera.panorama: 6");
  refused_camera([](auto& c) { c.panorama = LUMICUT_EQUIRECTANGULAR, c.orthographic = 1; }, "lumicut_camera.panorama");
  refused_camera([](auto& c) { c.panorama = LUMICUT_EQUIRECTANGULAR, c.latitude[1] = 2; },
                 "lumicut_camera.latitude[1]: 2");
  refused_camera([](auto& c) { c.panorama = LUMICUT_EQUIRECTANGULAR, c.longitude[0] = -kInf; },
                 "lumicut_camera.longitude[0]: -inf");
  refused_camera([](auto& c) { c.panorama = LUMICUT_EQUIRECTANGULAR, c.lens_radius = 1, c.focus_distance = 1; },
                 "lumicut_camera.lens_radius: 1");
  refused_camera([](auto& c) { c.panorama = LUMICUT_FISHEYE_EQUIDISTANT; }, "lumicut_camera.fisheye_fov: 0");
  refused_camera([](auto& c) { c.panorama = LUMICUT_FISHEYE_EQUISOLID, c.fisheye_fov = 3; },
                 "lumicut_camera.fisheye_lens: 0");
  refused_camera([](auto& c) { c.panorama = LUMICUT_FISHEYE_EQUISOLID, c.fisheye_fov = 3, c.fisheye_lens = 1; },
                 "lumicut_camera.sensor[0]: 0");
  refused_camera([](auto& c) { c.pixel_aspect = -1; }, "lumicut_camera.pixel_aspect: -1");
  refused_camera([](auto& c) { c.shift[1] = kInf; }, "lumicut_camera.shift[1]: inf");

  auto e = make<lumicut_environment>();
  e.color[0] = -1;
  EXPECT_CODE(lumicut_scene_set_environment(s.get(), &e), LUMICUT_INVALID_ARGUMENT, "lumicut_environment.color[0]: -1");
  e.color[0] = 1, e.world_to_map[0] = 2;
  EXPECT_CODE(lumicut_scene_set_environment(s.get(), &e), LUMICUT_INVALID_ARGUMENT,
              "lumicut_environment.world_to_map: is no rotation");

  auto t = make<lumicut_trace>();
  EXPECT_CODE(lumicut_scene_set_trace(s.get(), &t), LUMICUT_INVALID_ARGUMENT, "lumicut_trace.intersect: is NULL");
}

TEST(Errors, FieldsOfDevicesAndRendersAreCheckedByNameAndValue) {
  auto d = make<lumicut_device_desc>();
  lumicut_device none = nullptr;
  d.abi_major = LUMICUT_ABI_MAJOR + 1;
  EXPECT_CODE(lumicut_device_create(&d, &none), LUMICUT_UNSUPPORTED, "lumicut_device_desc.abi_major: 2");
  d.abi_major = LUMICUT_ABI_MAJOR, d.threads = -1;
  EXPECT_CODE(lumicut_device_create(&d, &none), LUMICUT_INVALID_ARGUMENT, "lumicut_device_desc.threads: -1");
  d.threads = 1, d.verbosity = 4;
  EXPECT_CODE(lumicut_device_create(&d, &none), LUMICUT_INVALID_ARGUMENT, "lumicut_device_desc.verbosity: 4");

  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 10);
  const auto refused = [&](const std::function<void(lumicut_render_desc&)>& spoil, lumicut_result code,
                           const char* text) {
    auto f = frame();
    spoil(f);
    lumicut_render r = nullptr;
    EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &r), code, text);
    EXPECT_EQ(r, nullptr);
  };
  refused([](auto& f) { f.width = 0; }, LUMICUT_INVALID_ARGUMENT, "lumicut_render_desc.width: 0 is not in [1, 65536]");
  refused([](auto& f) { f.height = 1u << 20; }, LUMICUT_INVALID_ARGUMENT, "lumicut_render_desc.height: 1048576");
  refused([](auto& f) { f.samples = 1u << 20; }, LUMICUT_INVALID_ARGUMENT, "lumicut_render_desc.samples: 1048576");
  refused([](auto& f) { f.tile_size = 3; }, LUMICUT_INVALID_ARGUMENT, "lumicut_render_desc.tile_size: 3");
  refused([](auto& f) { f.tile_size = 65536; }, LUMICUT_INVALID_ARGUMENT,
          "lumicut_render_desc.tile_size: 65536 with 1");
  refused([](auto& f) { f.crop[2] = 100, f.crop[3] = 10; }, LUMICUT_INVALID_ARGUMENT,
          "lumicut_render_desc.crop: (0, 0, 100, 10)");
  refused([](auto& f) { f.crop[0] = 4, f.crop[2] = 4, f.crop[3] = 10; }, LUMICUT_INVALID_ARGUMENT,
          "lumicut_render_desc.crop");
  refused([](auto& f) { f.width = f.height = 65536; }, LUMICUT_OUT_OF_MEMORY, "65536 x 65536 pixels needs");
}

TEST(Errors, TextsBelongToTheThreadThatCalled) {
  EXPECT_EQ(lumicut_cancel(nullptr), LUMICUT_INVALID_ARGUMENT);
  const std::string mine = lumicut_last_error();
  std::string fresh = "?", theirs;
  std::thread([&] {
    fresh = lumicut_last_error();
    lumicut_device none = nullptr;
    lumicut_integrator_create(none, "exhaustive", nullptr);
    theirs = lumicut_last_error();
  }).join();
  EXPECT_EQ(fresh, "");
  EXPECT_NE(theirs, mine);
  EXPECT_EQ(lumicut_last_error(), mine);
}

TEST(Errors, FailedCallsLeaveTheirObjectsAsTheyWere) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device);
  const auto before = render(i, s);

  auto m = materials();
  m[2].diffuse[0] = kNan;
  EXPECT_NE(lumicut_scene_set_materials(s.get(), m.data(), m.size()), LUMICUT_OK);
  auto mesh = geometry().mesh();
  mesh.indices = nullptr;
  EXPECT_NE(lumicut_scene_add_mesh(s.get(), &mesh, nullptr), LUMICUT_OK);
  std::vector<float> positions = geometry().positions;
  positions.back() = kInf;
  EXPECT_NE(lumicut_scene_update_mesh(s.get(), 0, positions.data(), nullptr, nullptr), LUMICUT_OK);
  EXPECT_NE(lumicut_scene_update_mesh(s.get(), 1, nullptr, nullptr, nullptr), LUMICUT_OK);
  auto l = lamp();
  l.value = kNan;
  EXPECT_NE(lumicut_scene_set_lights(s.get(), &l, 1), LUMICUT_OK);
  auto c = camera();
  c.fov_y = 0;
  EXPECT_NE(lumicut_scene_set_camera(s.get(), &c), LUMICUT_OK);
  EXPECT_NE(lumicut_integrator_set(i.get(), "vpls", "many"), LUMICUT_OK);
  EXPECT_NE(lumicut_integrator_set(i.get(), "vpls", "-4"), LUMICUT_OK);
  EXPECT_NE(lumicut_integrator_set(i.get(), "no_such", "1"), LUMICUT_OK);
  EXPECT_EQ(i.value("vpls"), "400");
  lumicut_vpl vpl{};
  vpl.intensity[0] = -1;
  EXPECT_CODE(lumicut_integrator_set_lights(i.get(), &vpl, 1), LUMICUT_INVALID_ARGUMENT,
              "lumicut_vpl[0].intensity[0]: -1");

  EXPECT_EQ(render(i, s), before) << "the scene asks for no new commit, and nothing in it has changed";
}

TEST(Errors, TheLogHearsWhatItAskedFor) {
  struct Heard {
    std::mutex mutex;
    std::vector<std::pair<int, std::string>> lines;
  } heard;
  const auto log = [](void* user, int32_t level, const char* text) {
    auto& h = *static_cast<Heard*>(user);
    const std::lock_guard lock(h.mutex);
    h.lines.emplace_back(level, text);
  };
  {
    const api::Device device(1, log, &heard, 2);
    const api::Scene s = scene(device);
  }
  ASSERT_GE(heard.lines.size(), 2u);
  EXPECT_EQ(heard.lines[0].first, 2);
  EXPECT_NE(heard.lines[0].second.find("Lumicut"), std::string::npos);
  EXPECT_NE(heard.lines[1].second.find("34 triangles"), std::string::npos) << heard.lines[1].second;
  heard.lines.clear();
  {
    const api::Device device(1, log, &heard, 0);
    const api::Scene s = scene(device);
  }
  EXPECT_TRUE(heard.lines.empty()) << heard.lines[0].second;
}

TEST(Errors, ThereAreNoExtensionsYet) {
  EXPECT_EQ(lumicut_get_extension("lumicut.anything"), nullptr);
  EXPECT_EQ(lumicut_get_extension(nullptr), nullptr);
  uint32_t major = 9, minor = 9;
  EXPECT_STREQ(lumicut_version(&major, &minor), LUMICUT_VERSION_TEXT);
  EXPECT_EQ(major, uint32_t{LUMICUT_ABI_MAJOR});
  EXPECT_EQ(minor, uint32_t{LUMICUT_ABI_MINOR});
}

}  // namespace
