// Images to the last bit: what changes the code and not the picture is held to that here. A change that is meant to change
// images says so and puts the hashes that this test prints in the place of these.
//
// Hashes are those of GCC's optimised code on processors with AVX2 or AVX-512 and our own BVH: with fewer instructions, with another
// compiler or on Embree images round otherwise (docs/progressive.md); there the test is skipped. They tell that an image
// is another, not which is right: that is what all the other tests are for.
#include <cstring>
#include <functional>
#include <set>

#include "full_host.h"
#include "hwy/highway.h"

namespace {

using namespace box;

struct Golden {
  const char* name;
  std::function<void(Host&)> change;
  uint64_t hash;
};

void PrintTo(const Golden& golden, std::ostream* out) { *out << golden.name; }

std::function<void(Host&)> by(const char* integrator, std::map<std::string, std::string> parameters = {},
                              const std::function<void(Host&)>& change = {}) {
  return [=](Host& h) {
    h.integrator = integrator;
    for (const auto& [name, value] : parameters) h.parameters[name] = value;
    if (change) change(h);
  };
}

void glass(Host& h) {
  h.materials[4].transmission = 0.8f, h.materials[4].ior = 1.45f, h.materials[4].metallic = 0;
  h.materials[4].roughness = 0, h.materials[4].coat = 0;
}

void rough_glass(Host& h) {
  glass(h);
  h.materials[4].roughness = 0.5f;
}

void sharp_gloss(Host& h) { h.materials[4].roughness = 0.25f, h.materials[4].coat = 0; }

void mirror(Host& h) { h.materials[4].metallic = 1, h.materials[4].roughness = 0.02f, h.materials[4].coat = 0; }

void phong(Host& h) {
  h.materials[4].flags = 0, h.materials[4].shininess = 40, h.materials[4].specular[1] = 0.3f;
  h.materials[4].metallic = h.materials[4].coat = h.materials[4].coat_roughness = h.materials[4].roughness = 0;
}

const Golden kGolden[] = {
    {"exhaustive", by("exhaustive"), 0x97f0969898fc4584},
    {"lightcuts", by("lightcuts", {{"error", "0.1"}}), 0x1a9843755eb45162},
    {"multidimensional", by("multidimensional_lightcuts", {{"error", "0.1"}}), 0x5b41fa4aaccf48f6},
    {"light_slice", by("light_slice", {{"columns", "40"}}), 0x625bff827acefb53},
    {"row_column_sampling", by("row_column_sampling", {{"columns", "40"}}), 0xc81b7d65010c9422},
    {"stochastic_lightcuts", by("stochastic_lightcuts"), 0x61e98b58c6062d42},
    {"wspd", by("wspd"), 0xcfa66ce8b177c25f},
    {"illumination_cut", by("illumination_cut"), 0x528d8b17630369d6},
    {"illumination_cut_unbiased", by("illumination_cut", {{"visibility", "unbiased"}}), 0x2724f6f5aa7d0f21},
    {"path_tracer", by("path_tracer", {{"samples", "8"}}), 0xa92627392fbda488},
    {"compensated", by("lightcuts", {{"compensate", "true"}}), 0x927057e16a576586},
    {"compensated_exhaustive", by("exhaustive", {{"compensate", "true"}}), 0x14e051d4efb8a61d},
    {"importance", by("lightcuts", {{"importance", "true"}, {"compensate", "true"}}), 0x38f381d866a45902},
    {"trace_gloss", by("lightcuts", {{"trace_gloss", "true"}, {"compensate", "true"}}, sharp_gloss),
     0x337fed13343d204e},
    {"spheres", by("exhaustive", {{"virtual_lights", "spheres"}}), 0xdb953b7f8a60fba2},
    {"spheres_lightcuts", by("lightcuts", {{"virtual_lights", "spheres"}, {"compensate", "true"}}), 0x83751d63464b8ac4},
    {"glass", by("lightcuts", {{"compensate", "true"}}, glass), 0xc6f8d165a248b720},
    {"glass_path_tracer", by("path_tracer", {{"samples", "8"}}, glass), 0x6ac004c830888837},
    {"rough_glass", by("exhaustive", {{"compensate", "true"}}, rough_glass), 0x4719075ac90ed757},
    {"mirror", by("lightcuts", {{"compensate", "true"}}, mirror), 0x4eb463fcaff3b221},
    {"mirror_path_tracer", by("path_tracer", {{"samples", "8"}}, mirror), 0x8e9e606c0ad896dd},
    {"phong", by("lightcuts", {{"compensate", "true"}}, phong), 0x3f9bbbc5872dd055},
    {"phong_path_tracer", by("path_tracer", {{"samples", "8"}}, phong), 0x8c8f608f57d21fd2},
    {"groups",
     by("lightcuts", {{"compensate", "true"}}, [](Host& h) { h.lights[1].group = 3, h.frame.flags = LUMICUT_GROUPS; }),
     0xdc64f2826ea4cbf2},
    {"host_lights", by("exhaustive", {}, [](Host& h) { h.host_lights = true; }), 0xcc3bd8d81ce45885},
    {"lens_and_samples",
     by("exhaustive", {},
        [](Host& h) {
          h.camera.lens_radius = 0.05f, h.camera.focus_distance = 2;
          h.frame.samples = 3, h.frame.passes = 1, h.frame.flags = LUMICUT_ILLUMINANCE;
        }),
     0x969ae56d47f10963},
};

class GoldenImages : public testing::TestWithParam<Golden> {};

TEST_P(GoldenImages, AreUnchanged) {
#if defined(__clang__) || !defined(__OPTIMIZE__)
  GTEST_SKIP() << "the code of another compiler, or of none that optimises, rounds otherwise";
#endif
  const int64_t targets = hwy::SupportedTargets() & HWY_TARGETS;
  if ((targets & -targets) > HWY_AVX2) GTEST_SKIP() << "this processor has no fused multiply-adds";
  const api::Device device(2);
  Host host;
  host.accel = "bvh";
  host.parameters["vpls"] = "200";
  host.frame.width = 32, host.frame.height = 24;
  GetParam().change(host);
  const api::Render r(host.method(device), host.scene(device), host.frame);
  r.wait();
  uint64_t hash = 14695981039346656037u;  // FNV-1a
  for (uint32_t i = 0;; ++i) {
    auto channel = make<lumicut_channel_info>();
    if (lumicut_get_channel_info(i, &channel) != LUMICUT_OK) break;
    if (channel.name == std::string("residual")) break;  // from here on 0 without LUMICUT_DENOISE
    for (const float value : r.read(channel.name)) {
      uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof(bits));
      hash = (hash ^ bits) * 1099511628211u;
    }
  }
  EXPECT_EQ(hash, GetParam().hash) << std::hex << "    0x" << hash << " now, of \"" << GetParam().name << "\"";
}

TEST(GoldenImages, AreOfEveryIntegrator) {
  std::set<std::string> of;
  for (const Golden& golden : kGolden) {
    Host host;
    golden.change(host);
    of.insert(host.integrator);
  }
  for (const auto& integrator : api::integrators()) EXPECT_EQ(of.count(integrator.id), 1u) << integrator.id;
}

INSTANTIATE_TEST_SUITE_P(Of, GoldenImages, testing::ValuesIn(kGolden),
                         [](const auto& golden) { return std::string(golden.param.name); });

}  // namespace
