// Level 4: a checkpoint belongs to one scene, one integrator and one processor's arithmetic. Each of them is changed in
// one thing at a time.
#include <cstring>
#include <functional>
#include <map>

#include "full_host.h"
#include "hwy/highway.h"
#include "lumicut/lumicut_state.h"
#include "tests/support/backends.h"

namespace {

using namespace box;

struct Change {
  const char* name;
  std::function<void(Host&)> change;
};

Change material(const char* name, std::function<void(lumicut_material&)> change) {
  return {name, [change](Host& h) { change(h.materials[4]); }};
}
Change light(const char* name, std::function<void(lumicut_light&)> change, size_t index = 1) {
  return {name, [change, index](Host& h) { change(h.lights[index]); }};
}

// One for each field of what a host describes of its scene.
std::vector<Change> scene_changes() {
  using M = lumicut_material;
  using L = lumicut_light;
  return {
      // Where there is one accel alone, as the next.
      {"scene.accel", [](Host& h) { h.accel = "agglomerative", h.robust = lumicut::test::kHasEmbree; }},
      {"scene.robust", [](Host& h) { h.robust = false; }},
      {"texture.pixels", [](Host& h) { h.texels[0][7] += 0.125f; }},
      {"texture.pixels of the environment", [](Host& h) { h.texels[3][7] += 0.125f; }},
      {"texture.size", [](Host& h) { h.textures[0].width = 8, h.textures[0].height = 2; }},
      {"texture.channels", [](Host& h) { h.textures[0].channels = 1; }},
      {"texture.flags srgb", [](Host& h) { h.textures[0].flags = LUMICUT_SRGB; }},
      {"texture.flags clamp", [](Host& h) { h.textures[0].flags = LUMICUT_CLAMP; }},
      {"texture.flags nearest", [](Host& h) { h.textures[0].flags = LUMICUT_NEAREST; }},
      {"texture.program",
       [](Host& h) {
         static const lumicut_instruction uv = {.op = LUMICUT_OP_UV, .mode = 0, .inputs = {}, .data = 0, .count = 0};
         static auto program = make<lumicut_program>();
         program.instruction_count = 1, program.instructions = &uv;
         h.textures[0] = make<lumicut_texture>(), h.textures[0].program = &program;
       }},
      {"mesh.attributes",
       [](Host& h) {
         static const float value = 1;
         static auto attribute = make<lumicut_attribute>();
         attribute.components = 1, attribute.domain = LUMICUT_OF_INSTANCES, attribute.values = &value;
         h.transforms.resize(12), h.shape.attributes = &attribute, h.shape.attribute_count = 1;
       }},
      {"texture count", [](Host& h) { h.textures.push_back(h.textures[0]), h.texels.push_back(h.texels[0]); }},
      {"material order", [](Host& h) { std::swap(h.materials[1], h.materials[2]); }},
      {"mesh.positions", [](Host& h) { h.panel.positions[2] -= 0.1f; }},
      {"mesh.indices",
       [](Host& h) { std::rotate(h.panel.indices.begin(), h.panel.indices.begin() + 1, h.panel.indices.begin() + 3); }},
      {"mesh.normals", [](Host& h) { h.normals[0] = -0.1f; }},
      {"mesh.normals left out", [](Host& h) { h.normals.clear(); }},
      {"mesh.uvs", [](Host& h) { h.uvs[2] = 1; }},
      {"mesh.uvs left out", [](Host& h) { h.uvs.clear(); }},
      {"mesh.materials", [](Host& h) { h.panel.materials[1] = 0; }},
      {"mesh.material", [](Host& h) { h.panel.materials.clear(), h.shape.material = 1; }},
      {"mesh.mask", [](Host& h) { h.shape.mask = 2; }},
      {"mesh.group", [](Host& h) { h.shape.group = 7; }},
      {"mesh.transforms", [](Host& h) { h.transforms[3] = 0.1f; }},
      {"mesh.transform_count",
       [](Host& h) {
         h.transforms.insert(h.transforms.end(), {1, 0, 0, 0.3f, 0, 1, 0, 0, 0, 0, 1, 0});
       }},
      {"light count", [](Host& h) { h.lights.pop_back(); }},
      {"profile.values", [](Host& h) { h.profiles[0].values[1] = 0.9f; }},
      {"profile.vertical", [](Host& h) { h.profiles[0].vertical[1] = 1.5f; }},
      {"profile.horizontal",
       [](Host& h) {
         h.profiles[0].horizontal = {0, 6.2831853f};
         h.profiles[0].values = {1, 0.5f, 0.7f, 1, 1, 0.5f, 0.7f, 1};
       }},
      material("material.flags emit both sides", [](M& m) { m.flags |= LUMICUT_EMIT_BOTH_SIDES; }),
      material("material.flags no fresnel",
               [](M& m) { m.flags |= LUMICUT_NO_FRESNEL, m.metallic = m.transmission = 0; }),
      material("material.flags model", [](M& m) { m.flags = LUMICUT_PHONG; }),
      material("material.diffuse", [](M& m) { m.diffuse[2] = 0.25f; }),
      material("material.specular", [](M& m) { m.specular[1] = 0.25f; }),
      material("material.opacity", [](M& m) { m.opacity = 0.5f; }),
      material("material.emission", [](M& m) { m.emission[1] = 0.25f; }),
      material("material.diffuse_texture", [](M& m) { m.diffuse_texture = 2; }),
      material("material.specular_texture", [](M& m) { m.specular_texture = 1; }),
      material("material.opacity_texture", [](M& m) { m.opacity_texture = 1; }),
      material("material.emission_texture", [](M& m) { m.emission_texture = 1; }),
      material("material.roughness", [](M& m) { m.roughness = 0.5f; }),
      material("material.metallic", [](M& m) { m.metallic = 0.5f; }),
      material("material.ior", [](M& m) { m.ior = 1.4f; }),
      material("material.transmission", [](M& m) { m.transmission = 0.25f; }),
      material("material.normal_texture", [](M& m) { m.normal_texture = 1; }),
      material("material.normal_strength", [](M& m) { m.normal_strength = 0.5f; }),
      material("material.translucency_texture", [](M& m) { m.translucency_texture = 1; }),
      material("material.flags (Oren and Nayar)",
               [](M& m) { m.flags = (m.flags & ~uint32_t{LUMICUT_GGX | LUMICUT_BURLEY}) | LUMICUT_OREN_NAYAR; }),
      material("material.flags (Burley)", [](M& m) { m.flags |= LUMICUT_BURLEY; }),
      material("material.flags (bright lobe)", [](M& m) { m.flags |= LUMICUT_BRIGHT_LOBE; }),
      material("material.flags (single scattering)", [](M& m) { m.flags |= LUMICUT_FACETS_ONCE; }),
      material("material.flags (shadows pass)", [](M& m) { m.flags |= LUMICUT_SHADOWS_PASS, m.transmission = 0.5f; }),
      material("material.flags (open glass)",
               [](M& m) { m.flags |= LUMICUT_SHADOWS_PASS | LUMICUT_OPEN_GLASS, m.transmission = 0.5f; }),
      material("material.specular_tint",
               [](M& m) { m.specular_tint[0] = m.specular_tint[1] = 1, m.specular_tint[2] = 0.5f; }),
      material("material.flags (holdout)", [](M& m) { m.flags |= LUMICUT_HOLDOUT; }),
      material("material.absorption", [](M& m) { m.absorption[2] = 0.5f, m.transmission = 0.5f; }),
      material("material.translucency", [](M& m) { m.translucency[1] = 0.25f; }),
      material("material.height_texture", [](M& m) { m.height_texture = 1; }),
      material("material.bump_distance", [](M& m) { m.bump_distance = 0.5f; }),
      material("material.bump_strength", [](M& m) { m.bump_strength = 0.5f; }),
      material("material.roughness_texture", [](M& m) { m.roughness_texture = 1; }),
      material("material.metallic_texture", [](M& m) { m.metallic_texture = 1; }),
      material("material.diffuse_roughness", [](M& m) { m.diffuse_roughness = 0.5f; }),
      material("material.diffuse_roughness_texture", [](M& m) { m.diffuse_roughness_texture = 1; }),
      material("material.flags (diffuse once)", [](M& m) { m.flags |= LUMICUT_DIFFUSE_ONCE; }),
      material("material.coat", [](M& m) { m.coat = 0.5f; }),
      material("material.coat_roughness", [](M& m) { m.coat_roughness = 0.5f; }),
      material("material.coat_ior", [](M& m) { m.coat_ior = 1.4f; }),
      {"material.shininess", [](Host& h) { h.materials[3].shininess = 21; }},
      light("light.unit", [](L& l) { l.unit = LUMICUT_WATT; }),
      light("light.group", [](L& l) { l.group = 9; }),
      light("light.color", [](L& l) { l.color[2] = 0.5f; }),
      light("light.value", [](L& l) { l.value = 3; }),
      light("light.position", [](L& l) { l.position[0] = 0.25f; }),
      light("light.direction", [](L& l) { l.direction[0] = 0.25f; }),
      light("light.profile", [](L& l) { l.profile = 0; }),
      light("light.tangent", [](L& l) { l.tangent[2] = 1; }),
      light(
          "light.u", [](L& l) { l.u[0] = 0.75f; }, 0),
      light(
          "light.v", [](L& l) { l.v[2] = 0.75f; }, 0),
      light(
          "light.spread", [](L& l) { l.spread = 1; }, 0),
      light(
          "light.texture", [](L& l) { l.texture = 1; }, 0),
      light(
          "light.type", [](L& l) { l.type = LUMICUT_DISK; }, 0),
      {"environment.color", [](Host& h) { h.environment.color[0] = 0.3f; }},
      {"environment.texture", [](Host& h) { h.environment.texture = 3; }},
      {"environment.group", [](Host& h) { h.environment.group = 8; }},
      {"environment.world_to_map",
       [](Host& h) {
         const float turned[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
         std::copy(turned, turned + 9, h.environment.world_to_map);
       }},
      {"environment.flags", [](Host& h) { h.environment.flags = LUMICUT_HIDDEN; }},
      {"environment.mask", [](Host& h) { h.environment.mask = LUMICUT_GLOSSY_RAYS; }},
      {"mesh.not_lit_by", [](Host& h) { h.shape.not_lit_by = 1; }},
      {"mesh.not_blocking", [](Host& h) { h.shape.not_blocking = 1; }},
      {"mesh.receivers", [](Host& h) { h.shape.receivers = 1; }},
      {"mesh.blockers", [](Host& h) { h.shape.blockers = 1; }},
      {"no environment", [](Host& h) { h.environment = make<lumicut_environment>(); }},
  };
}

// Spots and bare spheres have fields that the scene above has no use for.
std::vector<Change> spot_changes() {
  return {
      {"light.angle", [](Host& h) { h.lights[1].angle = 1.2f; }},
      {"light.blend", [](Host& h) { h.lights[1].blend = 0.5f; }},
      {"light.spot_cosine", [](Host& h) { h.lights[1].spot_cosine = 1; }},
      {"light.radius", [](Host& h) { h.lights[1].radius = 0.1f; }},
      {"light.flags, disk", [](Host& h) { h.lights[1].flags = LUMICUT_FACING_DISK; }},
      {"light.mask", [](Host& h) { h.lights[1].mask = LUMICUT_DIFFUSE_RAYS; }},
      {"light.receivers", [](Host& h) { h.lights[1].receivers = 1; }},
      {"light.blockers", [](Host& h) { h.lights[1].blockers = 1; }},
      {"light.flags, shadows", [](Host& h) { h.lights[1].flags = LUMICUT_NO_SHADOWS; }},
  };
}

std::vector<Change> camera_changes() {
  using C = lumicut_camera;
  const auto camera = [](const char* name, std::function<void(C&)> change) {
    return Change{name, [change](Host& h) { change(h.camera); }};
  };
  return {
      camera("camera.orthographic", [](C& c) { c.orthographic = 1, c.height = 2; }),
      camera("camera.to_world", [](C& c) { c.to_world[3] += 0.1f; }),
      camera("camera.fov_y", [](C& c) { c.fov_y = 1; }),
      camera("camera.shift x", [](C& c) { c.shift[0] = 0.1f; }),
      camera("camera.shift y", [](C& c) { c.shift[1] = 0.1f; }),
      camera("camera.near_clip", [](C& c) { c.near_clip = 0.1f; }),
      camera("camera.far_clip", [](C& c) { c.far_clip = 3; }),
      camera("camera.pixel_aspect", [](C& c) { c.pixel_aspect = 1.5f; }),
      camera("camera.lens_radius", [](C& c) { c.lens_radius = 0.1f, c.focus_distance = 1; }),
      camera("camera.panorama", [](C& c) { c.panorama = LUMICUT_EQUIRECTANGULAR; }),
      camera("camera.longitude", [](C& c) { c.panorama = LUMICUT_EQUIRECTANGULAR, c.longitude[1] = 1; }),
      camera("camera.fisheye_fov", [](C& c) { c.panorama = LUMICUT_FISHEYE_EQUIDISTANT, c.fisheye_fov = 2; }),
  };
}

std::vector<Change> render_changes() {
  return {
      {"integrator", [](Host& h) { h.integrator = "exhaustive"; }},
      {"parameter vpls", [](Host& h) { h.parameters["vpls"] = "41"; }},
      {"parameter seed", [](Host& h) { h.parameters["seed"] = "2"; }},
      {"parameter error", [](Host& h) { h.parameters["error"] = "0.03"; }},
      {"the host's own virtual lights", [](Host& h) { h.host_lights = true; }},
      {"render.width", [](Host& h) { h.frame.width = 20; }},
      {"render.height", [](Host& h) { h.frame.height = 16; }},
      {"render.samples", [](Host& h) { h.frame.samples = 2; }},
      {"render.crop", [](Host& h) { h.frame.crop[2] = 16, h.frame.crop[3] = 8; }},
      {"render.tile_size", [](Host& h) { h.frame.tile_size = 8; }},
      {"render.confidence", [](Host& h) { h.frame.confidence = 0.9f; }},
      {"render.flags illuminance", [](Host& h) { h.frame.flags |= LUMICUT_ILLUMINANCE; }},
      {"render.filter", [](Host& h) { h.frame.filter = LUMICUT_BLACKMAN_HARRIS; }},
      {"render.lobes", [](Host& h) { h.frame.lobes = LUMICUT_GLOSSY_RAYS; }},
      {"render.occlusion", [](Host& h) { h.frame.occlusion = 2; }},
      {"render.flags, direct", [](Host& h) { h.frame.flags |= LUMICUT_DIRECT; }},
      {"render.filter_width", [](Host& h) { h.frame.filter = LUMICUT_GAUSSIAN, h.frame.filter_width = 2; }},
      {"render.flags denoise", [](Host& h) { h.frame.flags |= LUMICUT_DENOISE; }},
      {"render.flags groups", [](Host& h) { h.frame.flags |= LUMICUT_GROUPS; }},
  };
}

std::vector<Change> virtual_light_changes() {
  using V = lumicut_vpl;
  const auto vpl = [](const char* name, std::function<void(V&)> change) {
    return Change{name, [change](Host& h) { change(h.vpls[0]); }};
  };
  return {
      vpl("vpl.position", [](V& v) { v.position[0] = 0.1f; }),
      vpl("vpl.kind", [](V& v) { v.kind = LUMICUT_VPL_DIRECTIONAL; }),
      vpl("vpl.normal", [](V& v) { v.normal[0] = 0.01f; }),
      vpl("vpl.group", [](V& v) { v.group = 3; }),
      vpl("vpl.intensity", [](V& v) { v.intensity[2] = 1; }),
      {"vpl count", [](Host& h) { h.vpls.push_back(h.vpls[0]); }},
      {"traced lights", [](Host& h) { h.host_lights = false; }},
  };
}

std::vector<uint8_t> checkpoint(const api::Device& device, const Host& host) {
  const api::Scene s = host.scene(device);
  const api::Integrator i = host.method(device);
  const api::Render r(i, s, host.frame);
  r.wait();
  const void* data = nullptr;
  uint64_t size = 0;
  EXPECT_EQ(lumicut_render_checkpoint(r.get(), &data, &size), LUMICUT_OK);
  const auto* bytes = static_cast<const uint8_t*>(data);
  return {bytes, bytes + size};
}

// Why it does not go on; empty: it does.
std::string refusal(const api::Device& device, const Host& host, const std::vector<uint8_t>& from) {
  const api::Scene s = host.scene(device);
  const api::Integrator i = host.method(device);
  auto f = host.frame;
  f.passes = 3;
  f.checkpoint = from.data(), f.checkpoint_size = from.size();
  try {
    const api::Render r(i, s, f);
    r.wait();
  } catch (const api::Exception& e) {
    EXPECT_EQ(e.code(), LUMICUT_INVALID_ARGUMENT);
    return e.what();
  }
  return "";
}

// Each change is refused; with none, and with the same host anew, it goes on.
void expect_refused(const Host& host, const std::vector<Change>& changes) {
  const api::Device device(2);
  const std::vector<uint8_t> from = checkpoint(device, host);
  EXPECT_EQ(refusal(device, host, from), "");
  for (const Change& c : changes) {
    Host other = host;
    c.change(other);
    EXPECT_NE(refusal(device, other, from).find("it was made for another scene, size, integrator or parameters: "),
              std::string::npos)
        << c.name << ": " << refusal(device, other, from);
  }
}

TEST(Resume, IsRefusedWhereAnythingOfTheSceneIsAnother) { expect_refused({}, scene_changes()); }

TEST(Resume, IsRefusedWhereASpotIsAnother) {
  Host host;
  host.lights[1].type = LUMICUT_SPOT, host.lights[1].profile = 0, host.lights[1].angle = 1;
  host.lights[1].radius = 0.05f;
  expect_refused(host, spot_changes());
}

TEST(Resume, IsRefusedWhereTheCameraIsAnother) { expect_refused({}, camera_changes()); }

TEST(Resume, IsRefusedWhereIntegratorOrFrameIsAnother) { expect_refused({}, render_changes()); }

TEST(Resume, IsRefusedWhereTheHostsVirtualLightsAreOthers) {
  Host host;
  host.host_lights = true;
  expect_refused(host, virtual_light_changes());
}

TEST(Resume, SaysWhatIsAnother) {
  const api::Device device(1);
  const Host host;
  const std::vector<uint8_t> from = checkpoint(device, host);
  Host other = host;
  other.frame.width = 20;
  EXPECT_NE(refusal(device, other, from).find("width=16 instead of 20"), std::string::npos);
  other = host, other.materials[1].diffuse[0] = 0.5f;
  EXPECT_NE(refusal(device, other, from).find("other materials"), std::string::npos);
  other = host, other.parameters["vpls"] = "50";
  EXPECT_NE(refusal(device, other, from).find("vpls=40 instead of 50"), std::string::npos);
}

TEST(Resume, DoesNotDependOnThreadsNorOnWhatWasBefore) {
  const Host host;
  const std::vector<uint8_t> from = checkpoint(api::Device(1), host);
  // Profiles are looked up by name: others come first.
  Host other;
  other.profiles[0].values[0] = 0.3f;
  const api::Device device(3);
  const api::Scene before = other.scene(device);
  EXPECT_EQ(refusal(device, host, from), "");
}

TEST(Resume, OfNoBytesAndOfMoreThanAnyMemoryIsRefused) {
  const api::Device device(1);
  const Host host;
  const api::Scene s = host.scene(device);
  const api::Integrator i = host.method(device);
  auto f = host.frame;
  f.checkpoint = "";
  lumicut_render render = nullptr;
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &render), LUMICUT_INVALID_ARGUMENT, "checkpoint_size");
  f.checkpoint_size = uint64_t{1} << 59;  // unread: there is no such memory
  EXPECT_CODE(lumicut_render_start(i.get(), s.get(), &f, &render), LUMICUT_INVALID_ARGUMENT,
              "checkpoint_size: 576460752303423488");
}

TEST(Resume, OfAllPassesGivesTheImageAndItsLights) {
  const api::Device device(2);
  const Host host;
  const api::Scene s = host.scene(device);
  const api::Integrator first = host.method(device);
  std::vector<float> image;
  {
    const api::Render r(first, s, host.frame);
    r.wait();
    image = r.read("radiance");
  }
  const std::vector<uint8_t> from = checkpoint(device, host);
  for (const uint32_t passes : {1u, 2u}) {  // fewer than it holds, and as many
    const api::Integrator i = host.method(device);
    auto f = host.frame;
    f.passes = passes;
    f.checkpoint = from.data(), f.checkpoint_size = from.size();
    const api::Render r(i, s, f);
    const lumicut_status status = r.wait();
    EXPECT_EQ(status.state, LUMICUT_DONE);
    EXPECT_EQ(status.passes_done, 2u);
    EXPECT_EQ(status.tiles_done, 1u);
    EXPECT_EQ(r.read("radiance"), image);
    // Those of the last pass, as after a render that was not broken.
    const auto lights = i.lights(), last = first.lights();
    ASSERT_EQ(lights.size(), last.size());
    EXPECT_EQ(std::memcmp(lights.data(), last.data(), lights.size() * sizeof(lumicut_vpl)), 0);
  }
}

TEST(Resume, AReachedTargetOrNoTimeAddsNoPass) {
  const api::Device device(2);
  const Host host;
  const api::Scene s = host.scene(device);
  const api::Integrator i = host.method(device);
  auto f = host.frame;
  f.passes = 9;
  std::vector<uint8_t> from;
  {
    const api::Render r(i, s, f);
    r.wait();
    const void* data = nullptr;
    uint64_t size = 0;
    ASSERT_EQ(lumicut_render_checkpoint(r.get(), &data, &size), LUMICUT_OK);
    from.assign(static_cast<const uint8_t*>(data), static_cast<const uint8_t*>(data) + size);
  }
  const auto passes = [&](float seconds, float target, uint32_t most = 0) {
    auto rest = host.frame;
    rest.passes = most, rest.max_seconds = seconds, rest.target_error = target;
    rest.checkpoint = from.data(), rest.checkpoint_size = from.size();
    const api::Render r(i, s, rest);
    return r.wait().passes_done;
  };
  EXPECT_EQ(passes(0, 1e5f), 9u);
  EXPECT_EQ(passes(1e-9f, 0), 9u);  // less than it takes to begin
  EXPECT_EQ(passes(600, 0, 10), 10u);
}

// ---- instruction sets: the library asks Highway for the best, which this program shares with it

class BestInstructions {
 public:
  explicit BestInstructions(int64_t best) { hwy::DisableTargets(best - 1); }  // better ones have lower bits
  ~BestInstructions() { hwy::DisableTargets(0); }
};

// What docs/progressive.md promises of all but Embree, whose own choice this leaves as it is. Textures, gloss, coats and two passes with samples of their own are in it.
TEST(InstructionSets, WithFusedMultiplyAddOrWithoutGiveOneImageEach) {
  const api::Device device(2);
  for (const char* accel : lumicut::test::backends())
    for (const std::string& id : integrator_ids()) {
      Host host;
      host.accel = accel;
      host.integrator = id;
      const auto image = [&](int64_t best) {
        const BestInstructions limited(best);
        const api::Scene s = host.scene(device);
        return render(host.method(device), s, host.frame);
      };
      const auto best = image(HWY_AVX2), least = image(HWY_EMU128);
      EXPECT_EQ(image(HWY_AVX3), best) << id;
      EXPECT_EQ(image(HWY_SSE4), least) << id;
      // A path may go elsewhere after a last digit, and the path tracer has but 384 of them here.
      EXPECT_NEAR(mean(least) / mean(best), 1.0, 0.3) << id;
    }
}

TEST(InstructionSets, GoOnWhereTheyRoundAlike) {
  const api::Device device(2);
  Host host;
  std::vector<uint8_t> from[2];
  for (int embree = 0; embree <= int{lumicut::test::kHasEmbree}; ++embree)
    host.accel = embree ? "embree" : "agglomerative", from[embree] = checkpoint(device, host);
  const auto refused = [&](int embree, int64_t best) {
    const BestInstructions limited(best);
    host.accel = embree ? "embree" : "agglomerative";
    return refusal(device, host, from[embree]);
  };
  if ((HWY_TARGETS & HWY_SSE4) == 0) GTEST_SKIP() << "built for one instruction set alone";
  const int64_t targets = hwy::SupportedTargets() & HWY_TARGETS, best = targets & -targets;
  if (best > HWY_AVX2) GTEST_SKIP() << "this processor has no better instructions than SSE4";
  EXPECT_EQ(refused(0, HWY_AVX2), "");
  for (int embree = 0; embree <= int{lumicut::test::kHasEmbree}; ++embree)
    EXPECT_NE(refused(embree, HWY_SSE4).find("this processor renders with SSE4 or older"), std::string::npos)
        << refused(embree, HWY_SSE4);
  // Embree picks its own instructions, and with AVX-512 other ones for reciprocals.
  if (lumicut::test::kHasEmbree && best <= HWY_AVX3) {
    EXPECT_NE(refused(1, HWY_AVX2).find("made with AVX-512 instructions"), std::string::npos) << refused(1, HWY_AVX2);
  }
}

// ---- saved states: what they hold depends on all but the camera

const lumicut_state_extension& state() {
  return *static_cast<const lumicut_state_extension*>(lumicut_get_extension(LUMICUT_STATE_EXTENSION));
}

TEST(StateResume, IsRefusedWhereAnythingOfTheSceneButTheCameraIsAnother) {
  const api::Device device(1);
  Host host;
  host.integrator = "wspd";
  const api::Scene s = host.scene(device);
  api::Integrator i = host.method(device);
  i.prepare(s);
  uint64_t size = 0;
  ASSERT_EQ(state().save(i.get(), nullptr, &size), LUMICUT_OK);
  std::vector<uint8_t> bytes(size);
  ASSERT_EQ(state().save(i.get(), bytes.data(), &size), LUMICUT_OK);
  const auto load = [&](const Host& h) {
    return state().load(h.method(device).get(), h.scene(device).get(), bytes.data(), bytes.size());
  };
  EXPECT_EQ(load(host), LUMICUT_OK) << lumicut_last_error();
  for (const Change& c : scene_changes()) {
    Host other = host;
    c.change(other);
    EXPECT_EQ(load(other), LUMICUT_INVALID_ARGUMENT) << c.name;
    EXPECT_NE(std::string(lumicut_last_error()).find("other geometry, materials or lights"), std::string::npos)
        << c.name << ": " << lumicut_last_error();
  }
  for (const Change& c : camera_changes()) {
    Host other = host;
    c.change(other);
    EXPECT_EQ(load(other), LUMICUT_OK) << c.name << ": " << lumicut_last_error();
  }
}

TEST(StateResume, IsNotSavedOfASceneThatChangedSince) {
  const api::Device device(1);
  Host host;
  host.integrator = "wspd";
  api::Scene s = host.scene(device);
  api::Integrator i = host.method(device);
  i.prepare(s);
  s.set_lights({});
  uint64_t size = 0;
  EXPECT_CODE(state().save(i.get(), nullptr, &size), LUMICUT_INVALID_STATE, "changed");
  s.commit();
  EXPECT_CODE(state().save(i.get(), nullptr, &size), LUMICUT_INVALID_STATE, "changed");
}

}  // namespace
