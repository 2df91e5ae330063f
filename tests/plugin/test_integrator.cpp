// Level 3: parameters that tell of themselves, lights in and out, and shading of a host's points.
#include <cstring>
#include <map>
#include <numbers>
#include <set>
#include <sstream>
#include <thread>

#include "full_host.h"
#include "lumicut/lumicut_state.h"
#include "tests/support/trimmed.h"

namespace {

using namespace box;
constexpr double kPi = std::numbers::pi;

TEST(Integrators, TellTheirParametersAndTakeTheirDefaults) {
  const api::Device device(1);
  std::set<std::string> ids;
  auto info = make<lumicut_integrator_info>();
  for (uint32_t n = 0; lumicut_get_integrator_info(n, &info) == LUMICUT_OK; ++n) {
    SCOPED_TRACE(info.id);
    EXPECT_TRUE(ids.insert(info.id).second);
    EXPECT_STRNE(info.label, "");
    EXPECT_STRNE(info.description, "");
    api::Integrator i(device, info.id);
    auto p = make<lumicut_param_info>();
    uint32_t params = 0;
    for (; lumicut_get_param_info(info.id, params, &p) == LUMICUT_OK; ++params) {
      SCOPED_TRACE(p.id);
      EXPECT_STRNE(p.label, "");
      EXPECT_STRNE(p.description, "");
      EXPECT_EQ(i.value(p.id), p.default_text);
      i.set(p.id, p.default_text);
      if (p.type == LUMICUT_FLOAT || p.type == LUMICUT_INT) {
        const double v = std::stod(p.default_text);
        EXPECT_GE(v, p.minimum);
        EXPECT_LE(v, p.maximum);
      } else if (p.type == LUMICUT_CHOICE) {
        EXPECT_NE(std::string(p.choices).find(p.default_text), std::string::npos);
      }
    }
    EXPECT_EQ(params, info.param_count);
  }
  EXPECT_EQ(ids.count("exhaustive"), 1u);
  EXPECT_CODE(lumicut_get_param_info("no_such", 0, nullptr), LUMICUT_INVALID_ARGUMENT, "\"no_such\" is not known");
  lumicut_integrator none = nullptr;
  EXPECT_CODE(lumicut_integrator_create(device.get(), "no_such", &none), LUMICUT_INVALID_ARGUMENT, "exhaustive");
}

std::map<std::string, lumicut_integrator_info> infos() {
  std::map<std::string, lumicut_integrator_info> all;
  for (const auto& info : api::integrators()) all[info.id] = info;
  return all;
}

TEST(Integrators, EveryTraitIsWhatTheIntegratorDoes) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const auto* state = api::extension<lumicut_state_extension>(LUMICUT_STATE_EXTENSION);
  ASSERT_NE(state, nullptr);
  for (const auto& [id, info] : infos()) {
    SCOPED_TRACE(id);
    const auto has = [t = info.traits](uint32_t trait) { return (t & trait) != 0; };
    EXPECT_NE(info.traits, 0u) << "0 is for libraries that do not tell";
    EXPECT_EQ(info.reserved, 0u);
    std::set<std::string> listed;
    for (const auto& p : api::params(id)) listed.insert(p.id);
    EXPECT_EQ(has(LUMICUT_VIRTUAL_LIGHTS), listed.count("vpls") == 1);
    EXPECT_EQ(has(LUMICUT_COMPENSATION), listed.count("compensate") == 1);
    api::Integrator i(device, id.c_str());
    if (has(LUMICUT_VIRTUAL_LIGHTS)) i.set("vpls", "50");
    i.prepare(s);
    EXPECT_EQ(has(LUMICUT_VIRTUAL_LIGHTS), !i.lights().empty());
    uint64_t size = 0;
    EXPECT_EQ(state->save(i.get(), nullptr, &size), has(LUMICUT_SAVED_STATE) ? LUMICUT_OK : LUMICUT_UNSUPPORTED);
    auto grouped = frame(8, 8);
    grouped.flags = LUMICUT_GROUPS;
    if (has(LUMICUT_LIGHT_GROUPS)) {
      const api::Render r(i, s, grouped);
      r.wait();
      EXPECT_EQ(r.groups(), std::vector<uint32_t>{0});
    } else {
      EXPECT_THROW(api::Render(i, s, grouped), api::Exception);
    }
  }
}

TEST(Integrators, AllLightsMeansTheSumOfEachLightAlone) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  lumicut_point p{};
  p.position[2] = -1.9f;
  p.normal[2] = p.geometric_normal[2] = p.to_viewer[2] = 1;
  size_t found = 0;
  for (const auto& [id, info] : infos()) {
    SCOPED_TRACE(id);
    if ((info.traits & LUMICUT_ALL_LIGHTS) == 0) continue;
    ++found;
    api::Integrator i = integrator(device, 50, id.c_str());
    i.set("clamp_distance", "0.1");  // without it the clamp of each follows how densely they lie
    i.prepare(s);
    const auto lights = i.lights();
    const float all = i.shade({p})[0];
    double sum = 0;
    for (const lumicut_vpl& light : lights) {
      i.set_lights({light});
      i.prepare(s);
      sum += i.shade({p})[0];
    }
    EXPECT_GT(all, 0);
    EXPECT_NEAR(all, sum, 1e-5 * sum) << "single precision adds in another order";
  }
  EXPECT_GT(found, 0u);
}

TEST(Integrators, SuggestedParametersAreTaken) {
  const api::Device device(1);
  std::map<std::string, int> suggestions;
  for (const auto& [id, info] : infos()) {
    SCOPED_TRACE(id);
    for (const auto& [quality, preset] : {std::pair{"interactive", info.interactive},
                                          {"preview", info.preview},
                                          {"draft", info.draft},
                                          {"good", info.good},
                                          {"reference", info.reference}}) {
      ASSERT_NE(preset, nullptr);
      if (*preset == 0) continue;
      ++suggestions[quality];
      api::Integrator i(device, id.c_str());
      i.apply(preset);
      std::set<std::string> listed;
      for (const auto& p : api::params(id)) listed.insert(p.id);
      std::istringstream pairs(preset);
      for (std::string pair; pairs >> pair;) {
        const std::string name = pair.substr(0, pair.find('='));
        EXPECT_EQ(listed.count(name), 1u) << name;
        const std::string value = pair.substr(name.size() + 1);
        EXPECT_EQ(i.value(name.c_str()), value == "true" ? "1" : value);
      }
    }
  }
  EXPECT_EQ(suggestions.size(), 5u) << "each quality has an integrator";
  EXPECT_THROW(api::Integrator(device, "lightcuts").apply("error"), api::Exception);
}

// A host of ABI 1.3 has 40 bytes for it.
TEST(Integrators, HostsThatKnowNoTraitsGetTheRest) {
  lumicut_integrator_info old;
  std::memset(static_cast<void*>(&old), 0x5a, sizeof(old));
  old.struct_size = offsetof(lumicut_integrator_info, traits);
  EXPECT_EQ(old.struct_size, 40u);
  ASSERT_EQ(lumicut_get_integrator_info(0, &old), LUMICUT_OK);
  EXPECT_STREQ(old.id, "exhaustive");
  EXPECT_EQ(old.traits, 0x5a5a5a5au) << "is the host's own memory";
}

// Hosts may set the parameters of virtual lights on any integrator. One without such lights does not list them, warns,
// and renders the same.
TEST(Integrators, ThePathTracerListsWhatItUsesAndIgnoresWhatVirtualLightsNeed) {
  std::set<std::string> listed;
  auto p = make<lumicut_param_info>();
  for (uint32_t n = 0; lumicut_get_param_info("path_tracer", n, &p) == LUMICUT_OK; ++n) listed.insert(p.id);
  EXPECT_EQ(listed, (std::set<std::string>{"seed", "max_depth", "samples"}));

  std::string warnings;
  const auto log = [](void* user, int32_t, const char* text) { *static_cast<std::string*>(user) += text; };
  const api::Device device(1, log, &warnings, 1);
  const api::Scene s = scene(device);
  const auto image = [&](const api::Integrator& i) {
    auto f = make<lumicut_render_desc>();
    f.width = 16, f.height = 12;
    const api::Render r(i, s, f);
    r.wait();
    return r.read("radiance");
  };
  const auto plain = image(api::Integrator(device, "path_tracer").set("samples", "4"));
  EXPECT_EQ(warnings, "");
  api::Integrator i(device, "path_tracer");
  i.set("samples", "4").set("max_depth", "32");
  for (const auto& [name, value] : {std::pair{"vpls", "5"},
                                    {"direct_share", "1"},
                                    {"environment_vpls", "3"},
                                    {"clamp_relative", "0.9"},
                                    {"clamp_distance", "2"},
                                    {"virtual_lights", "spheres"},
                                    {"sphere_scale", "3"},
                                    {"compensate", "true"}}) {
    warnings.clear();
    i.set(name, value);
    EXPECT_EQ(warnings, std::string("parameter ") + name + " has no effect: path_tracer has no virtual lights");
    EXPECT_EQ(image(i), plain) << name;
  }
  EXPECT_CODE(lumicut_integrator_set(i.get(), "vpls", "0"), LUMICUT_INVALID_ARGUMENT, "vpls: 0 is not in");
  EXPECT_CODE(lumicut_integrator_set(i.get(), "error", "0.1"), LUMICUT_INVALID_ARGUMENT, "no parameter \"error\"");
}

template <typename T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

TEST(Integrators, LightsThatGoOutComeInAgainUnchanged) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator first = integrator(device);
  const auto image = render(first, s);
  const auto lights = first.vpls();
  EXPECT_GT(lights.lights.size(), 300u);
  EXPECT_TRUE(same_bytes(lights.lights, first.lights()));
  api::Integrator second = integrator(device, 7);
  second.set_vpls(lights);
  EXPECT_EQ(render(second, s), image);
  const auto again = second.vpls();
  EXPECT_TRUE(same_bytes(again.lights, lights.lights));
  EXPECT_TRUE(same_bytes(again.origins, lights.origins));
  EXPECT_EQ(again.light_paths, lights.light_paths);
  EXPECT_EQ(again.emitter_samples, lights.emitter_samples);
  second.set_vpls({});
  second.set("vpls", "400");
  EXPECT_EQ(render(second, s), image) << "traced again";
}

// With an environment, a measured lamp, and an emitter that is black in places: samples there give no light.
TEST(Integrators, LightsOfEveryKindOfEmitterTellWhereTheyComeFrom) {
  const api::Device device(2);
  Host host;
  host.parameters["vpls"] = "400";
  host.frame.passes = 1, host.frame.flags = 0;
  host.materials[4].emission_texture = 2, host.materials[4].emission[0] = 30;
  host.materials[0].flags |= LUMICUT_OREN_NAYAR, host.materials[0].roughness = 0.8f;
  std::fill_n(host.texels[1].begin(), host.texels[1].size() / 2, 0.0f);
  const api::Scene s = host.scene(device);
  for (const char* id : {"exhaustive", "lightcuts"}) {
    host.integrator = id;
    const api::Integrator first = host.method(device);
    const auto image = render(first, s, host.frame);
    const auto set = first.vpls();
    std::map<uint32_t, uint64_t> of;
    for (size_t i = 0; i < set.origins.size(); ++i) {
      const lumicut_vpl_origin& o = set.origins[i];
      ++of[o.source];
      EXPECT_EQ(o.area > 0, o.source == LUMICUT_SOURCE_AREA);
      EXPECT_EQ(o.offset > 0, set.lights[i].kind == LUMICUT_VPL_ORIENTED) << "of what lies on a surface";
    }
    EXPECT_TRUE(std::any_of(set.origins.begin(), set.origins.end(), [](const auto& o) { return o.slope > 0; }));
    EXPECT_GT(of[LUMICUT_SOURCE_PATH], 100u);
    EXPECT_GT(of[LUMICUT_SOURCE_POINT], 1u) << "the lamp, and the environment";
    EXPECT_GT(of[LUMICUT_SOURCE_AREA], 10u);
    EXPECT_GT(set.emitter_samples, of[LUMICUT_SOURCE_AREA]);
    EXPECT_GT(set.light_paths, 0u);
    api::Integrator second(device, id);
    second.set_vpls(set);
    EXPECT_EQ(render(second, s, host.frame), image);
  }
}

TEST(Integrators, LightsWithoutOriginsAreAHostsOwn) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator first = integrator(device);
  const auto image = render(first, s);
  auto set = first.vpls();
  api::Integrator second = integrator(device);
  second.set_lights(set.lights);
  const auto own = render(second, s);
  EXPECT_NE(own, image);
  for (const lumicut_vpl_origin& o : second.vpls().origins) {
    EXPECT_EQ(o.source, uint32_t{LUMICUT_SOURCE_PATH});
    EXPECT_EQ(o.offset, 0);
    EXPECT_EQ(o.area, 0);
  }
  set.origins.clear(), set.emitter_samples = 0;
  second.set_vpls(set);
  EXPECT_EQ(render(second, s), own);
}

TEST(Integrators, LightsOfEmittersArePutFirst) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  const api::Integrator first = integrator(device);
  const auto image = render(first, s);
  const auto set = first.vpls();
  auto mixed = set;  // those of light paths first
  const auto direct = std::count_if(set.origins.begin(), set.origins.end(),
                                    [](const auto& o) { return o.source != LUMICUT_SOURCE_PATH; });
  std::rotate(mixed.lights.begin(), mixed.lights.begin() + direct, mixed.lights.end());
  std::rotate(mixed.origins.begin(), mixed.origins.begin() + direct, mixed.origins.end());
  api::Integrator second = integrator(device);
  second.set_vpls(mixed);
  EXPECT_EQ(render(second, s), image);
  EXPECT_TRUE(same_bytes(second.vpls().lights, set.lights));
}

TEST(Integrators, OriginsAreCheckedByNameAndValue) {
  const api::Device device(1);
  api::Integrator i(device, "exhaustive");
  api::VplSet good;
  good.lights.resize(3);
  good.origins.resize(3);
  good.origins[1].source = LUMICUT_SOURCE_AREA, good.origins[1].offset = 0.1f, good.origins[1].area = 2;
  good.emitter_samples = 1;
  i.set_vpls(good);
  const auto refused = [&](auto spoil, const char* text) {
    auto set = good;
    spoil(set);
    try {
      i.set_vpls(set);
      ADD_FAILURE() << "taken: " << text;
    } catch (const api::Exception& error) {
      EXPECT_EQ(error.code(), LUMICUT_INVALID_ARGUMENT);
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  refused([](auto& s) { s.origins[2].source = 3; }, "lumicut_vpl_origin[2].source: 3 is not in [0, 2]");
  refused([](auto& s) { s.origins[2].offset = NAN; }, "lumicut_vpl_origin[2].offset: nan");
  refused([](auto& s) { s.origins[2].offset = INFINITY; }, "lumicut_vpl_origin[2].offset: inf");
  refused([](auto& s) { s.origins[0].offset = -1; }, "lumicut_vpl_origin[0].offset: -1");
  refused([](auto& s) { s.origins[1].area = -2; }, "lumicut_vpl_origin[1].area: -2");
  refused([](auto& s) { s.origins[1].area = INFINITY; }, "lumicut_vpl_origin[1].area: inf");
  refused([](auto& s) { s.origins[1].area = 0; }, "lumicut_vpl_origin[1].area: is 0");
  refused([](auto& s) { s.origins[2].area = 3; }, "lumicut_vpl_origin[2].area: 3 is not 0");
  refused([](auto& s) { s.origins[2].slope = 1.5f; }, "lumicut_vpl_origin[2].slope: 1.5");
  refused([](auto& s) { s.origins[2].again = NAN; }, "lumicut_vpl_origin[2].again: nan");
  refused([](auto& s) { s.origins[2].retro = 3; }, "lumicut_vpl_origin[2].retro: 3");
  refused([](auto& s) { s.origins[2].dim = -1; }, "lumicut_vpl_origin[2].dim: -1");
  refused([](auto& s) { s.origins[2].falloff = 1.5f; }, "lumicut_vpl_origin[2].falloff: 1.5");
  refused([](auto& s) { s.origins[1].dim = 0.5f; },
          "lumicut_vpl_origin[1].slope: with retro, dim and falloff is a lobe, but");
  const auto rough = [](auto& s) {
    s.lights[2].kind = LUMICUT_VPL_ORIENTED, s.lights[2].normal[2] = 1, s.origins[2].slope = 1;
    s.origins[2].mirror[2] = 1, s.origins[2].lobe_mean = 1;
  };
  auto taken = good;
  rough(taken);
  i.set_vpls(taken);
  refused([&](auto& s) { rough(s), s.origins[2].mirror[2] = 0.5f; }, "lumicut_vpl_origin[2].mirror: has length 0.5");
  refused([&](auto& s) { rough(s), s.origins[2].lobe_mean = 0; }, "lumicut_vpl_origin[2].lobe_mean: 0");
  refused([](auto& s) { s.lights[2].intensity[0] = -1; }, "lumicut_vpl[2].intensity[0]: -1");
  refused([](auto& s) { s.emitter_samples = 0; }, "lumicut_vpl_set.emitter_samples: 0 is less than the 1 lights");
  refused([](auto& s) { s.origins.clear(); }, "lumicut_vpl_set.emitter_samples: is 1, but origins is NULL");
  refused([](auto& s) { s.origins.pop_back(); }, "origins: 2 of 3 lights");

  const lumicut_lights_extension& extension = api::lights_extension();
  EXPECT_EQ(extension.struct_size, sizeof(lumicut_lights_extension));
  auto set = make<lumicut_vpl_set>();
  set.count = 2;
  EXPECT_CODE(extension.set(i.get(), &set), LUMICUT_INVALID_ARGUMENT, "count is 2");
  set.reserved = 1;
  EXPECT_CODE(extension.set(i.get(), &set), LUMICUT_UNSUPPORTED, "lumicut_vpl_set.reserved");
  EXPECT_CODE(extension.set(i.get(), nullptr), LUMICUT_INVALID_ARGUMENT, "lumicut_vpl_set: is NULL");
  EXPECT_CODE(extension.get(i.get(), nullptr), LUMICUT_INVALID_ARGUMENT, "lumicut_vpl_set: is NULL");
  EXPECT_CODE(extension.get(i.get(), &set), LUMICUT_INVALID_STATE, "not prepared");
}

TEST(Integrators, HostLightsAreCheckedByNameAndValue) {
  const api::Device device(1);
  const api::Integrator i(device, "exhaustive");
  lumicut_vpl good{};
  good.kind = LUMICUT_VPL_ORIENTED;
  good.normal[2] = 1;
  good.intensity[0] = 1;
  const auto refused = [&](auto spoil, lumicut_result code, const char* text) {
    std::vector<lumicut_vpl> lights(3, good);
    spoil(lights[2]);
    EXPECT_CODE(lumicut_integrator_set_lights(i.get(), lights.data(), lights.size()), code, text);
  };
  refused([](auto& l) { l.kind = 5; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].kind: 5 is not in [0, 4]");
  refused([](auto& l) { l.position[1] = NAN; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].position[1]: nan");
  refused([](auto& l) { l.normal[2] = 0; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].normal: has length 0, not 1");
  refused([](auto& l) { l.intensity[2] = -1; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].intensity[2]: -1");
  refused([](auto& l) { l.intensity[2] = INFINITY; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].intensity[2]: inf");
  refused([](auto& l) { l.kind = LUMICUT_VPL_SPOT, l.cos_outer = 2; }, LUMICUT_INVALID_ARGUMENT,
          "lumicut_vpl[2].cos_outer: 2");
  refused([](auto& l) { l.profile = 1; }, LUMICUT_INVALID_ARGUMENT, "lumicut_vpl[2].profile");
  EXPECT_CODE(lumicut_integrator_set_lights(i.get(), nullptr, 2), LUMICUT_INVALID_ARGUMENT, "count is 2");
}

TEST(Integrators, SpheresGoOutAndComeInAgainWithTheirRadii) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator first = integrator(device), points = integrator(device);
  first.set("virtual_lights", "spheres");
  const auto image = render(first, s);
  EXPECT_NE(image, render(points, s));
  const auto set = first.vpls();
  const auto& lights = set.lights;
  uint64_t spheres = 0, others = 0;
  for (const lumicut_vpl& l : lights) (l.kind == LUMICUT_VPL_SPHERE ? spheres : others) += 1;
  EXPECT_GT(spheres, 100u);
  EXPECT_GT(others, 50u) << "lamps are what they were";
  for (const char* setting : {"spheres", "points"}) {  // the host's own lights are what they are
    api::Integrator second = integrator(device, 7);
    second.set_vpls(set);
    second.set("virtual_lights", setting);
    EXPECT_EQ(render(second, s), image);
  }
  first.set("sphere_scale", "2");
  render(first, s);
  const auto wider = first.lights();
  ASSERT_EQ(wider.size(), lights.size());
  for (size_t i = 0; i < lights.size(); ++i)
    if (lights[i].kind == LUMICUT_VPL_SPHERE) {
      EXPECT_FLOAT_EQ(wider[i].cos_outer, 2 * lights[i].cos_outer);
    }
}

TEST(Integrators, SpheresOnRoughSurfacesGoOutWithoutALobeAndComeInAgain) {
  const api::Device device(2);
  api::Scene s = scene(device, false);
  s.set_materials(rough_materials());
  s.commit();
  api::Integrator first = integrator(device), second = integrator(device);
  first.set("virtual_lights", "spheres");
  const auto image = render(first, s);
  const auto set = first.vpls();
  for (const lumicut_vpl_origin& o : set.origins) EXPECT_EQ(o.slope, 0) << "a lobe is of oriented lights alone";
  second.set_vpls(set);
  EXPECT_EQ(render(second, s), image);
}

TEST(Integrators, PointsOfAHostAreNotTakenForSpheres) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device);
  lumicut_vpl light{};
  light.kind = LUMICUT_VPL_ORIENTED, light.normal[2] = 1, light.intensity[0] = 1;
  i.set_lights({light});
  i.set("virtual_lights", "spheres");
  EXPECT_CODE(lumicut_integrator_prepare(i.get(), s.get()), LUMICUT_INVALID_ARGUMENT, "parameter virtual_lights");
  light.kind = LUMICUT_VPL_SPHERE;
  for (const float radius : {0.0f, -1.0f, NAN, INFINITY}) {
    light.cos_outer = radius;
    EXPECT_CODE(lumicut_integrator_set_lights(i.get(), &light, 1), LUMICUT_INVALID_ARGUMENT,
                "lumicut_vpl[0].cos_outer");
  }
  light.cos_outer = 0.2f;
  i.set_lights({light});
  i.prepare(s);
}

TEST(Integrators, AMillionHostLightsAreTaken) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator i(device, "exhaustive");
  std::vector<lumicut_vpl> lights(1000000);
  for (auto& l : lights) l.position[1] = 0.9f, l.position[2] = -1, l.intensity[0] = 1e-6f;
  i.set_lights(lights);
  i.prepare(s);
  EXPECT_EQ(i.lights().size(), lights.size());
}

// One point of a floor at the origin, seen from above.
struct Floor {
  explicit Floor(const api::Device& device) : scene(device) {
    auto m = make<lumicut_material>();
    m.diffuse[0] = m.diffuse[1] = m.diffuse[2] = 0.5f;
    scene.set_materials({m});
    mesh.quad({{{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}}}, 0);
    scene.add_mesh(mesh.mesh());
  }
  static lumicut_point point(float x = 0) {
    lumicut_point p{};
    p.position[0] = x;
    p.normal[1] = p.geometric_normal[1] = p.to_viewer[1] = 1;
    return p;
  }
  // Direct light of one light: nothing bounces.
  double radiance(const api::Device& device, const lumicut_light& light, const lumicut_point& p = point()) {
    scene.set_lights({light});
    scene.commit();
    api::Integrator i(device, "exhaustive");
    i.set("max_depth", "0").set("vpls", "20000").set("clamp_relative", "0");
    i.prepare(scene);
    return i.shade({p})[0];
  }
  Geometry mesh;
  api::Scene scene;
};

lumicut_light above(uint32_t type, float height, float watt) {
  auto l = make<lumicut_light>();
  l.type = type, l.unit = LUMICUT_WATT, l.value = watt;
  l.color[0] = l.color[1] = l.color[2] = 1;
  l.position[1] = height;
  l.direction[1] = -1;
  return l;
}

constexpr double kBrdf = 0.5 / kPi;
// Single precision, and points that stand off the floor by a 1e-4 of the distance or less.
constexpr double kExact = 1e-3;

TEST(Units, PointLampsOfPWattShineWithPOver4PiPerSteradian) {
  const api::Device device(1);
  Floor f(device);
  const double expected = kBrdf * 30 / (4 * kPi) / 4;
  EXPECT_NEAR(f.radiance(device, above(LUMICUT_POINT, 2, 30)), expected, kExact * expected);
  auto l = above(LUMICUT_POINT, 2, 30);
  l.unit = LUMICUT_RADIOMETRIC;
  EXPECT_NEAR(f.radiance(device, l), kBrdf * 30 / 4, kExact * kBrdf * 30 / 4);
}

TEST(Units, SpotsShineAsPointLampsTimesTheirProfile) {
  const api::Device device(1);
  Floor f(device);
  auto l = above(LUMICUT_SPOT, 2, 30);
  l.angle = 1.2f;
  const double on_axis = kBrdf * 30 / (4 * kPi) / 4;
  EXPECT_NEAR(f.radiance(device, l), on_axis, kExact * on_axis);
  // At x the cosine is 2/√(4+x²); inside a soft edge smoothstep((c − cos h)/((1 − cos h)·blend)).
  l.blend = 0.7f;
  for (const bool cosine : {false, true}) {
    l.spot_cosine = cosine;
    for (const float x : {0.2f, 0.6f, 0.9f, 1.3f, 1.4f}) {
      const double d2 = 4 + double{x} * x, c = 2 / std::sqrt(d2), h = std::cos(0.6);
      const double t = std::clamp((c - h) / ((1 - h) * 0.7), 0.0, 1.0);
      const double expected = kBrdf * 30 / (4 * kPi) * t * t * (3 - 2 * t) * (cosine ? c : 1.0) * c / d2;
      EXPECT_NEAR(f.radiance(device, l, Floor::point(x)), expected, kExact * on_axis) << x;
    }
  }
}

TEST(Units, SunsGiveTheirValueAsIrradianceInBothUnits) {
  const api::Device device(1);
  Floor f(device);
  auto l = above(LUMICUT_SUN, 0, 3);
  EXPECT_NEAR(f.radiance(device, l), kBrdf * 3, kExact * kBrdf * 3);
  l.unit = LUMICUT_RADIOMETRIC;
  EXPECT_NEAR(f.radiance(device, l), kBrdf * 3, kExact * kBrdf * 3);
  l.direction[0] = 1;  // 45 degrees, not normalised
  EXPECT_NEAR(f.radiance(device, l), kBrdf * 3 * std::sqrt(0.5), kExact * kBrdf * 3);
}

TEST(Units, AreaLampsOfPWattHaveRadiancePOver4Area) {
  const api::Device device(1);
  Floor f(device);
  for (const uint32_t type : {uint32_t{LUMICUT_RECTANGLE}, uint32_t{LUMICUT_DISK}}) {
    auto l = above(type, 5, 80);
    l.u[0] = 0.2f, l.v[2] = 0.1f;
    // Far away a light of radiance P/(4A) and area A shines with P/4, whatever its shape. 0.2 % for its size at
    // distance 5.
    const double expected = kBrdf * 80 / 4 / 25;
    EXPECT_NEAR(f.radiance(device, l), expected, 2e-3 * expected);
    // Scaled with its object in the world, the light keeps its power.
    l.u[0] = 0.02f;
    EXPECT_NEAR(f.radiance(device, l), expected, 2e-3 * expected);
    l.unit = LUMICUT_RADIOMETRIC, l.value = 7;
    const double area = 0.02 * 0.1 * (type == LUMICUT_DISK ? kPi / 4 : 1.0);
    EXPECT_NEAR(f.radiance(device, l), kBrdf * 7 * area / 25, 2e-3 * kBrdf * 7 * area / 25);
  }
}

TEST(Units, SpreadNarrowsAreaLampsAndKeepsTheirFlux) {
  const api::Device device(1);
  Floor f(device);
  auto l = above(LUMICUT_RECTANGLE, 5, 80);
  l.u[0] = 0.02f, l.v[2] = 0.02f;
  l.spread = 1.5f;
  const double a = (kPi - 1.5) / 2, n = 2 / (2 + (2 * a - kPi) * std::tan(a));
  for (const float x : {0.0f, 2.0f, 4.0f, 6.0f}) {
    const double d2 = 25 + double{x} * x, c = 5 / std::sqrt(d2), tangent = x / 5;
    const double expected = kBrdf * 80 / 4 * n * std::max(0.0, 1 - tangent * std::tan(a)) * c * c / d2;
    EXPECT_NEAR(f.radiance(device, l, Floor::point(x)), expected, 2e-3 * kBrdf * 80 / 4 / 25 * n) << x;
  }
}

TEST(Units, ProfilesGiveTheIlluminanceOfTheirTable) {
  const api::Device device(1);
  Floor f(device);
  // Every 15 degrees down to 75, quarters apart.
  const float kDegree = static_cast<float>(kPi / 180);
  std::vector<float> vertical, horizontal, values;
  for (int v = 0; v <= 75; v += 15) vertical.push_back(static_cast<float>(v) * kDegree);
  for (int h = 0; h <= 360; h += 90) horizontal.push_back(static_cast<float>(h) * kDegree);
  const auto table = [](int v, int h) { return 10.0f + static_cast<float>((h % 4 + 1) * (75 - v)); };
  for (int h = 0; h <= 4; ++h)
    for (int v = 0; v <= 75; v += 15) values.push_back(table(v, h));
  auto p = make<lumicut_profile>();
  p.vertical_count = static_cast<uint32_t>(vertical.size()),
  p.horizontal_count = static_cast<uint32_t>(horizontal.size());
  p.vertical = vertical.data(), p.horizontal = horizontal.data(), p.values = values.data();
  f.scene.set_profiles({p});
  auto l = above(LUMICUT_POINT, 2, 3);
  l.unit = LUMICUT_RADIOMETRIC, l.profile = 1, l.tangent[0] = 5;
  // Down is -y and angle 0 at +x, so 90 degrees lie at x × -y = -z.
  const double direction[4][2] = {{1, 0}, {0, -1}, {-1, 0}, {0, 1}};
  for (int h = 0; h < 4; ++h)
    for (int v = 15; v <= 60; v += 15) {
      const double c = std::cos(v * kDegree), r = 2 * std::tan(v * kDegree);
      auto at = Floor::point();
      at.position[0] = static_cast<float>(r * direction[h][0]),
      at.position[2] = static_cast<float>(r * direction[h][1]);
      const double expected = kBrdf * 3 * table(v, h) * c * c * c / 4;  // I cosθ / d²
      EXPECT_NEAR(f.radiance(device, l, at), expected, 2e-3 * expected) << v << " " << h;
    }
  auto far = Floor::point(2 * std::tan(80 * kDegree));
  EXPECT_EQ(f.radiance(device, l, far), 0.0f) << "beyond the table";
}

TEST(Units, ProfilesThatMakeNoSenseAreNamed) {
  const api::Device device(1);
  Floor f(device);
  const float vertical[2] = {0, 1}, horizontal[1] = {0}, values[2] = {1, 2};
  auto good = make<lumicut_profile>();
  good.vertical_count = 2, good.horizontal_count = 1;
  good.vertical = vertical, good.horizontal = horizontal, good.values = values;
  const auto refused = [&](auto spoil, const char* text) {
    auto p = good;
    spoil(p);
    EXPECT_CODE(lumicut_scene_set_profiles(f.scene.get(), &p, 1), LUMICUT_INVALID_ARGUMENT, text);
  };
  refused([](auto& p) { p.vertical_count = 1; }, "lumicut_profile[0].vertical_count: 1");
  refused([](auto& p) { p.values = nullptr; }, "lumicut_profile[0].values: is NULL");
  const float falling[2] = {1, 0}, negative[2] = {1, -2};
  refused([&](auto& p) { p.vertical = falling; }, "vertical[1] = 0");
  refused([&](auto& p) { p.values = negative; }, "value[1] = -2");
  f.scene.set_profiles({good});
  auto l = above(LUMICUT_POINT, 2, 3);
  l.profile = 2;
  EXPECT_CODE(lumicut_scene_set_lights(f.scene.get(), &l, 1), LUMICUT_INVALID_ARGUMENT,
              "lumicut_light[0].profile: 2 is out of range");
  l.profile = 1, l.tangent[1] = 3;
  EXPECT_CODE(lumicut_scene_set_lights(f.scene.get(), &l, 1), LUMICUT_INVALID_ARGUMENT, "tangent: is parallel");
  l.type = LUMICUT_SUN;
  EXPECT_CODE(lumicut_scene_set_lights(f.scene.get(), &l, 1), LUMICUT_INVALID_ARGUMENT, "a sun has none");
}

std::vector<lumicut_point> room_points(size_t n) {
  std::vector<lumicut_point> points(n);
  for (size_t i = 0; i < n; ++i) {
    auto& p = points[i];
    p = {};
    p.position[0] = -0.9f + 1.8f * static_cast<float>(i % 97) / 97;
    p.position[1] = -1;
    p.position[2] = -0.1f - 1.8f * static_cast<float>(i / 97 % 89) / 89;
    p.normal[1] = p.geometric_normal[1] = 1;
    p.to_viewer[1] = 0.6f, p.to_viewer[2] = 0.8f;
    p.material = i % 5 == 0 ? 3 : 0;
    p.pixel = static_cast<uint32_t>(i / 3);
  }
  return points;
}

TEST(Integrators, EmissionWithoutAreaLightsNothing) {
  const api::Device device(1);
  Host host;
  host.lights.clear(), host.profiles.clear();
  host.environment = make<lumicut_environment>();
  for (size_t v = 3; v < host.panel.positions.size(); ++v) host.panel.positions[v] = host.panel.positions[v % 3];
  const api::Scene s = host.scene(device);
  for (const std::string& id : integrator_ids())
    for (const char* compensate : {"false", "true"}) {
      SCOPED_TRACE(id);
      const api::Integrator i = integrator(device, 100, id.c_str());
      lumicut_integrator_set(i.get(), "compensate", compensate);  // not every one has it
      for (const float value : render(i, s, frame(16, 12))) EXPECT_EQ(value, 0.0f);
    }
}

TEST(Shade, ManyThreadsAtOnceGetWhatOneGets) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  for (const std::string& id : integrator_ids()) {
    SCOPED_TRACE(id);
    api::Integrator i = integrator(device, 150, id.c_str());
    i.prepare(s);
    const auto points = room_points(lumicut::test::trimmed(9000));
    const auto expected = i.shade(points);
    EXPECT_GT(mean(expected), 0);
    std::vector<std::vector<float>> got(6);
    std::vector<std::thread> threads;
    for (auto& g : got) threads.emplace_back([&] { g = i.shade(points); });
    for (auto& t : threads) t.join();
    for (const auto& g : got) EXPECT_EQ(g, expected);
  }
}

// A rough clear coat is a point of its own within the library: hosts get one radiance a point all the same.
TEST(Shade, ACoatAddsItsLobeToItsPointAndFramesShowTheSame) {
  const api::Device device(2);
  const auto floor = [&](float coat) {
    api::Scene s(device);
    auto m = make<lumicut_material>();
    m.flags = LUMICUT_GGX;
    m.diffuse[0] = m.diffuse[1] = m.diffuse[2] = 0.3f, m.roughness = 0.8f;
    auto plain = m;
    m.coat = coat, m.coat_roughness = 0.15f, m.coat_ior = 1.8f;
    s.set_materials({m, plain});
    Geometry g;
    g.quad({{{-1, -1, 0}, {0, -1, 0}, {0, 1, 0}, {-1, 1, 0}}}, 0);
    g.quad({{{0, -1, 0}, {1, -1, 0}, {1, 1, 0}, {0, 1, 0}}}, 1);
    s.add_mesh(g.mesh());
    auto l = make<lumicut_light>();
    l.type = LUMICUT_POINT, l.value = 3;
    l.color[0] = l.color[1] = l.color[2] = 1.0f;
    l.position[2] = 2;
    s.set_lights({l});
    auto c = make<lumicut_camera>();
    c.to_world[0] = c.to_world[5] = c.to_world[10] = 1, c.to_world[11] = 2;
    c.orthographic = 1, c.height = 2;
    s.set_camera(c);
    s.commit();
    return s;
  };
  constexpr uint32_t kSide = 8;
  std::vector<lumicut_point> points;
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    auto p = lumicut_point{};
    const auto at = [](uint32_t k) { return (static_cast<float>(k) + 0.5f) * (2.0f / kSide) - 1.0f; };
    p.position[0] = at(i % kSide), p.position[1] = -at(i / kSide);
    p.normal[2] = p.geometric_normal[2] = p.to_viewer[2] = 1;
    p.material = p.position[0] < 0 ? 0 : 1;
    p.pixel = i;
    points.push_back(p);
  }
  const auto shaded = [&](float coat, const char* id) {
    const api::Scene s = floor(coat);
    api::Integrator i = integrator(device, 50, id);
    i.prepare(s);
    const auto radiance = i.shade(points);
    auto f = frame(kSide, kSide);
    f.flags = LUMICUT_ILLUMINANCE;
    const api::Render r(i, s, f);
    r.wait();
    const auto image = r.read("radiance");
    for (size_t k = 0; k < radiance.size(); ++k) EXPECT_NEAR(image[k], radiance[k], 1e-3f * radiance[k]) << id;
    return std::pair(radiance, r.read("illuminance"));
  };
  for (const char* id : {"exhaustive", "lightcuts", "illumination_cut"}) {
    SCOPED_TRACE(id);
    const auto [with, lux_with] = shaded(1.0f, id);
    const auto [without, lux_without] = shaded(0.0f, id);
    for (size_t k = 0; k < points.size(); ++k) {
      if (points[k].material == 1) {
        EXPECT_EQ(with[3 * k], without[3 * k]) << "its neighbour has no coat";
      }
      EXPECT_NEAR(lux_with[k], lux_without[k], 1e-4f * lux_without[k]) << "light that arrives, not the lobes";
    }
    // The pixel nearest to the mirror image of the light, and one far from it.
    const size_t near = 3 * (3 * kSide + 3), far = 0;
    EXPECT_GT(with[near], 1.2f * without[near]);
    EXPECT_LT(with[far], without[far]) << "what the coat reflects elsewhere is missing here";
  }
}

TEST(Shade, RefusesPointsThatCannotBe) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device, 20);
  float radiance[9] = {5, 5, 5, 5, 5, 5, 5, 5, 5};
  EXPECT_CODE(lumicut_integrator_shade(i.get(), room_points(3).data(), 3, radiance), LUMICUT_INVALID_STATE,
              "not prepared");
  i.prepare(s);
  const auto refused = [&](auto spoil, const char* text) {
    auto points = room_points(3);
    spoil(points[1]);
    EXPECT_CODE(lumicut_integrator_shade(i.get(), points.data(), 3, radiance), LUMICUT_INVALID_ARGUMENT, text);
    for (const float r : radiance) EXPECT_EQ(r, 5);
  };
  refused([](auto& p) { p.position[2] = NAN; }, "lumicut_point[1].position[2]: nan");
  refused([](auto& p) { p.normal[1] = 2; }, "lumicut_point[1].normal: has length 2, not 1");
  refused([](auto& p) { p.geometric_normal[0] = INFINITY; }, "lumicut_point[1].geometric_normal[0]: inf");
  refused([](auto& p) { p.to_viewer[1] = p.to_viewer[2] = 0; }, "lumicut_point[1].to_viewer");
  refused([](auto& p) { p.u = NAN; }, "lumicut_point[1].u: nan");
  refused([](auto& p) { p.material = 4; }, "lumicut_point[1].material: 4 is out of range: the scene has 4 materials");
  EXPECT_EQ(lumicut_integrator_shade(i.get(), nullptr, 0, nullptr), LUMICUT_OK);
}

TEST(Shade, ASceneThatChangedAsksForANewPreparation) {
  const api::Device device(2);
  api::Scene s = scene(device);
  api::Integrator i = integrator(device, 50);
  i.prepare(s);
  const auto points = room_points(10);
  const auto before = i.shade(points);
  s.set_lights({});
  EXPECT_THROW(i.shade(points), api::Exception);
  s.commit();
  float radiance[30];
  EXPECT_CODE(lumicut_integrator_shade(i.get(), points.data(), 10, radiance), LUMICUT_INVALID_STATE,
              "was changed since");
  i.prepare(s);
  EXPECT_EQ(mean(i.shade(points)), 0);
  s.set_lights({lamp()});
  s.commit();
  i.prepare(s);
  EXPECT_EQ(i.shade(points), before);
}

TEST(Prepare, IsDoneOnceUntilSomethingChanges) {
  const api::Device device(2);
  api::Scene s = scene(device);
  api::Integrator i = integrator(device, 100);
  const auto reused = [&] {
    i.prepare(s);
    return i.stats_json().find("prepare_reused") != std::string::npos;
  };
  EXPECT_FALSE(reused());
  EXPECT_TRUE(reused());
  i.set("seed", "5");
  EXPECT_FALSE(reused());
  i.set("seed", "5");
  EXPECT_TRUE(reused());
  s.set_lights({lamp()});
  s.commit();
  EXPECT_FALSE(reused());
  i.set_lights(i.lights());
  EXPECT_FALSE(reused());
  EXPECT_TRUE(reused());
  const api::Scene other = scene(device);
  i.prepare(other);
  EXPECT_EQ(i.stats_json().find("prepare_reused"), std::string::npos);
}

}  // namespace
