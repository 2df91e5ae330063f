// lumicut.hpp: all of the ABI through its classes, on a table of functions that count their calls.
#include <cstring>

#include "box_scene.h"
#include "lumicut/lumicut_state.h"

namespace {

using namespace box;

template <auto F>
struct Counted;
template <typename R, typename... A, R (*F)(A...)>
struct Counted<F> {
  static inline int calls = 0;
  static R call(A... arguments) {
    ++calls;
    return F(arguments...);
  }
};

const api::Functions& counted() {
#define LUMICUT_COUNTED(name) &Counted<&lumicut_##name>::call,
  static const api::Functions functions = {LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_COUNTED)};
#undef LUMICUT_COUNTED
  return functions;
}

// Calls every member of every class.
void lead_a_hosts_life() {
  const api::Functions& f = counted();
  EXPECT_EQ(api::version(f).abi_minor, uint32_t{LUMICUT_ABI_MINOR});
  EXPECT_EQ(api::integrators(f).size(), integrator_ids().size());
  EXPECT_EQ(api::params("lightcuts", f).size(), api::params("lightcuts").size());
  EXPECT_NE(api::extension<lumicut_state_extension>(LUMICUT_STATE_EXTENSION, f), nullptr);

  const api::Device device(f, 1);
  const Geometry g = geometry();
  auto triangles = make<lumicut_accel_desc>();
  triangles.positions = g.positions.data(), triangles.position_count = g.positions.size() / 3;
  triangles.indices = g.indices.data(), triangles.triangle_count = g.indices.size() / 3;
  const api::Accel accel(device, triangles);
  EXPECT_EQ(accel.primitives().size(), accel.info().primitive_count);
  EXPECT_EQ(accel.node(0).count, 0u) << "the root is no leaf";
  lumicut_rayhit rays[1] = {};
  rays[0].ray = {0, 0, 1, 0, 0, 0, -1, 0, 10, ~0u, 0, 0};
  lumicut_ray shadow = rays[0].ray;
  accel.intersect(rays);
  EXPECT_NE(rays[0].hit.geom_id, LUMICUT_NO_ID);
  accel.occluded({&shadow, 1});
  EXPECT_LT(shadow.tfar, 0);

  api::Scene s(device);
  auto texture = make<lumicut_texture>();
  const unsigned char texel[3] = {200, 200, 200};
  texture.width = texture.height = 1, texture.channels = 3, texture.pixels = texel;
  s.set_textures({texture});
  s.set_materials(materials());
  const uint32_t id = s.add_mesh(g.mesh());
  const float angles[2] = {0, 3}, values[2] = {1, 1};
  auto profile = make<lumicut_profile>();
  profile.vertical_count = 2, profile.horizontal_count = 1;
  profile.vertical = angles, profile.horizontal = angles, profile.values = values;
  s.set_profiles({profile});
  s.set_lights({lamp()});
  auto environment = make<lumicut_environment>();
  environment.color[0] = 0.1f;
  s.set_environment(environment);
  s.clear_environment();
  s.set_camera(camera());
  auto trace = make<lumicut_trace>();
  trace.intersect = [](void*, lumicut_rayhit*, uint64_t) {};
  trace.occluded = [](void*, lumicut_ray*, uint64_t) {};
  s.set_trace(trace);
  s.clear_trace();
  s.commit();
  s.update_mesh(id, g.positions.data(), nullptr, nullptr);
  s.commit();
  s.cancel();
  EXPECT_NE(s.stats_json().find("seconds"), std::string::npos);
  EXPECT_NE(s.status().state, LUMICUT_FAILED);

  api::Integrator i(device, "exhaustive");
  EXPECT_EQ(i.set("vpls", "50").apply("seed=3").value("seed"), "3");
  EXPECT_THROW(i.value("no_such"), api::Exception);
  i.prepare(s);
  i.set_lights(i.lights());
  i.set_vpls(i.vpls());
  i.prepare(s);
  EXPECT_EQ(i.lights_view().size(), i.lights().size());
  lumicut_point p{};
  p.position[2] = -1.9f;
  p.normal[2] = p.geometric_normal[2] = p.to_viewer[2] = 1;
  EXPECT_EQ(i.shade({p}).size(), 3u);

  auto desc = frame(16, 16);
  desc.flags = LUMICUT_CHECKPOINTS | LUMICUT_GROUPS;
  const api::Render r(i, s, desc);
  r.wait();
  auto tile = make<lumicut_tile>();
  EXPECT_TRUE(r.next_tile(tile));
  EXPECT_EQ(r.groups(), std::vector<uint32_t>{0});
  EXPECT_FALSE(r.checkpoint().empty());
  const auto whole = r.read("radiance"), part = r.read("radiance", tile);
  EXPECT_EQ(whole.size(), 3u * 16 * 16);
  EXPECT_TRUE(std::equal(part.begin(), part.begin() + 3, whole.begin() + 3 * (tile.y0 * 16 + tile.x0)));
  const api::Render copy = r;
  EXPECT_EQ(copy.get(), r.get());
}

TEST(Wrapper, EveryFunctionOfTheAbiIsCalledThroughIt) {
  lead_a_hosts_life();
#define LUMICUT_EXPECT_CALLED(name) EXPECT_GT(Counted<&lumicut_##name>::calls, 0) << "lumicut_" #name;
  LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_EXPECT_CALLED)
#undef LUMICUT_EXPECT_CALLED
}

TEST(Wrapper, HandlesGiveBackAllThatTheyTook) {
  const int before = Counted<&lumicut_retain>::calls;
  const int released = Counted<&lumicut_release>::calls;
  {
    const api::Device device(counted(), 1);
    api::Handle<lumicut_device> copy = device, moved = std::move(copy);
    EXPECT_FALSE(copy);
    copy = moved;
    EXPECT_EQ(copy.get(), device.get());
    moved.reset();
    EXPECT_FALSE(moved);
    EXPECT_THROW(moved.functions(), api::Exception);
  }
  EXPECT_EQ(Counted<&lumicut_release>::calls - released, 1 + Counted<&lumicut_retain>::calls - before);
}

TEST(Wrapper, ErrorsCarryCodeAndText) {
  const api::Device device(1);
  try {
    const api::Integrator none(device, "no_such");
    FAIL() << "no error";
  } catch (const api::Exception& e) {
    EXPECT_EQ(e.code(), LUMICUT_INVALID_ARGUMENT);
    EXPECT_NE(std::string(e.what()).find("no_such"), std::string::npos) << e.what();
  }
  try {
    api::check(api::linked(), lumicut_cancel(nullptr), "cancel");
    FAIL() << "no error";
  } catch (const api::Exception& e) {
    EXPECT_STREQ(e.what(), "cancel: handle: is NULL");
  }
  EXPECT_THROW(api::Handle<lumicut_render>().cancel(), api::Exception);
  EXPECT_THROW(api::Handle<lumicut_scene>(api::linked()).status(), api::Exception);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device, 10);
  i.prepare(s);
  std::vector<lumicut_point> points(2);
  std::vector<float> little(5);
  EXPECT_THROW(i.shade(points, little), api::Exception);
}

TEST(Wrapper, TablesThatLackAFunctionOrHaveAnotherMajorAreRefused) {
  const auto refusal = [](auto find) -> std::string {
    try {
      api::load(find);
    } catch (const api::Exception& e) {
      EXPECT_EQ(e.code(), LUMICUT_UNSUPPORTED);
      return e.what();
    }
    return "none";
  };
  EXPECT_EQ(refusal([](const char* name) -> void* {
              return std::strcmp(name, "lumicut_render_wait") == 0 ? nullptr : reinterpret_cast<void*>(&lumicut_cancel);
            }),
            "lacks the function lumicut_render_wait");
  const char* (*const version)(uint32_t*, uint32_t*) = [](uint32_t* major, uint32_t* minor) {
    return *major = 2, *minor = 7, "2.7.0";
  };
  EXPECT_EQ(refusal([&](const char*) { return reinterpret_cast<void*>(version); }),
            "has version 2.7 of the ABI; 1 is needed");
}

}  // namespace
