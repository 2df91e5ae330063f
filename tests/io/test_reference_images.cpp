// Every image method against stored exhaustive references, through the C ABI alone, as a host would.
// The references are the exhaustive sum, which is itself held by analytic tests (tests/integrators/test_exhaustive.cpp)
// and, where the data is there, by another program's images (docs/benchmarks.md). ref.json names command, commit and
// seed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "film/metrics.h"
#include "io/image_file.h"
#include "io/scene_json.h"
#include "io/scene_upload.h"
#include "tests/support/backends.h"

namespace lumicut::io {
namespace {

std::string folder(const std::string& scene) {
  const char* root = std::getenv("LUMICUT_SOURCE_DIR");
  return std::string(root != nullptr ? root : ".") + "/reference_images/" + scene;
}

struct Reference {
  std::vector<float> pixels;
  uint32_t width = 0, height = 0, vpls = 0;
};

Reference read_reference(const std::string& scene) {
  Reference r;
  std::ifstream file(folder(scene) + "/ref.json");
  const auto json = nlohmann::json::parse(file);
  r.vpls = json.at("vpls");
  const Image image = read_image(folder(scene) + "/ref.exr");
  r.width = static_cast<uint32_t>(image.width), r.height = static_cast<uint32_t>(image.height);
  r.pixels = image.find("radiance")->pixels;
  return r;
}

std::vector<float> render(const Library& library, const std::string& scene, const Reference& like,
                          const std::string& integrator,
                          const std::vector<std::pair<std::string, std::string>>& parameters,
                          const lumicut_scene_desc& scene_desc) {
  const Api& api = library.api();
  Handle<lumicut_device> device(api);
  lumicut_device_desc device_desc{};
  device_desc.struct_size = sizeof(device_desc);
  device_desc.abi_major = LUMICUT_ABI_MAJOR;
  check(api, api.device_create(&device_desc, device.out()), "device");
  Handle<lumicut_scene> handle(api);
  check(api, api.scene_create(device.get(), &scene_desc, handle.out()), "scene");
  upload_scene(api, handle.get(), read_scene(folder(scene) + "/" + scene + ".json"));
  check(api, api.scene_commit(handle.get()), "commit");
  Handle<lumicut_integrator> method(api);
  check(api, api.integrator_create(device.get(), integrator.c_str(), method.out()), "integrator");
  check(api, api.integrator_set(method.get(), "vpls", std::to_string(like.vpls).c_str()), "vpls");
  for (const auto& [name, value] : parameters)
    check(api, api.integrator_set(method.get(), name.c_str(), value.c_str()), name);
  lumicut_render_desc desc{};
  desc.struct_size = sizeof(desc);
  desc.width = like.width, desc.height = like.height;
  Handle<lumicut_render> job(api);
  check(api, api.render_start(method.get(), handle.get(), &desc, job.out()), "render");
  lumicut_status status{};
  status.struct_size = sizeof(status);
  do check(api, api.render_wait(job.get(), 1000, &status), "render");
  while (status.state == LUMICUT_RUNNING);
  std::vector<float> pixels(size_t{3} * like.width * like.height);
  check(api, api.render_read(job.get(), "radiance", nullptr, pixels.data()), "read");
  return pixels;
}

class ReferenceImages : public testing::TestWithParam<std::string> {
 protected:
  // The references were traced by Embree's fast rays.
  Metrics measure(const std::string& integrator, const std::vector<std::pair<std::string, std::string>>& parameters,
                  const char* accel = "embree", uint32_t robust = LUMICUT_FAST) {
    static const Library library;
    const Reference reference = read_reference(GetParam());
    lumicut_scene_desc scene_desc{};
    scene_desc.struct_size = sizeof(scene_desc);
    scene_desc.accel = accel, scene_desc.robust = robust;
    const std::vector<float> image = render(library, GetParam(), reference, integrator, parameters, scene_desc);
    MetricOptions options;
    options.flip = false;
    return compare_images({image, reference.width, reference.height},
                          {reference.pixels, reference.width, reference.height}, options);
  }
};

TEST_P(ReferenceImages, ExhaustiveIsUnchanged) {
  SKIP_WITHOUT_EMBREE();
  const Metrics m = measure("exhaustive", {});
  // Another instruction set rounds otherwise, and an edge pixel or a light path may fall to the other side.
  EXPECT_LT(m.mean_relative_error, 2e-3);
  EXPECT_LT(m.rmse, 0.02);
  EXPECT_EQ(m.bad_pixels, 0u);
}

TEST_P(ReferenceImages, TheDefaultAccelDiffersInPixelsOnEdgesAlone) {
  const Metrics m = measure("exhaustive", {}, nullptr, 0);
  // In the Cornell box three rays of 6,912 pixels meet the edge of wall and floor, and fast rays slip through it there.
  EXPECT_LT(m.p99_relative_error, 1e-3);
  EXPECT_LT(m.rmse, 0.02);
  EXPECT_EQ(m.bad_pixels, 0u);
}

TEST_P(ReferenceImages, LightcutsKeepsItsErrorParameter) {
  SKIP_WITHOUT_EMBREE();
  for (const auto& [error, limit] : {std::pair{"0.02", 0.02}, {"0.005", 0.005}}) {
    const Metrics m = measure("lightcuts", {{"error", error}});
    EXPECT_LT(m.mean_relative_error, limit + 2e-3) << error;  // and what ExhaustiveIsUnchanged allows
    // Errors of either sign spread over the image: a few times the mean, and no sharp edges of their own.
    EXPECT_LT(m.rmse, 4 * limit) << error;
    EXPECT_LT(m.lmse, 2 * limit) << error;
    EXPECT_LT(m.p99_relative_error, 6 * limit + 0.01) << error;
    EXPECT_EQ(m.bad_pixels, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, ReferenceImages, testing::Values("cornell_box", "indirect_room", "court"),
                         [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace lumicut::io
