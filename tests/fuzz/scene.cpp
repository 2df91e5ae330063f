// Scene files with what they refer to: read, handed to the library, and rendered as a few pixels.
#include "io/scene_json.h"

#include "io/file_error.h"
#include "io/image_file.h"
#include "io/library.h"
#include "io/scene_upload.h"
#include "lumicut/lumicut.hpp"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

namespace {

// What the seeds refer to.
void write_companions(const fuzz::Folder& folder) {
  folder.write("a.mtl", "newmtl a\nKd .5 .5 .5\n");
  folder.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n");
  folder.write("a.ies", "TILT=NONE\n1 1000 1 3 1 1 2 0 0 0\n1 1 60\n0 45 90\n0\n100 50 10\n");
  io::write_png(folder / "a.png", std::vector<uint8_t>(3 * 4 * 4, 128), 4, 4, 3);
  io::Image sky;
  sky.width = 4, sky.height = 2;
  sky.layers.push_back({"radiance", 3, std::vector<float>(3 * 4 * 2, 1.0f)});
  io::write_exr(folder / "a.exr", sky, true);
}

// A host that gives up after a while; a render that does not hear of it meets libFuzzer's time limit.
void render(const api::Device& device, const api::Scene& scene, const char* method) {
  api::Integrator integrator(device, method);
  integrator.set("vpls", "24");
  if (method == std::string("path_tracer")) integrator.set("samples", "1");
  auto desc = api::make<lumicut_render_desc>();
  desc.width = desc.height = 4;
  const api::Render job(integrator, scene, desc);
  lumicut_result result = lumicut_render_wait(job.get(), 200, nullptr);
  lumicut_cancel(job.get());
  if (result == LUMICUT_OK) result = lumicut_render_wait(job.get(), LUMICUT_FOREVER, nullptr);
  if (result == LUMICUT_INTERNAL) fuzz::finding(lumicut_last_error());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  static const api::Device device(1);
  [[maybe_unused]] static const bool once = (write_companions(folder), true);
  try {
    const io::SceneData data_of_scene = io::read_scene(folder.write("scene.json", fuzz::text_of(data, size)));
    if (data_of_scene.triangle_count() > 5000) return 0;
    api::Scene scene(device);
    io::upload_scene(api::linked(), scene.get(), data_of_scene);
    scene.commit();
    static const auto methods = api::integrators();
    render(device, scene, methods[size % methods.size()].id);
  } catch (const io::FileError&) {
  } catch (const api::Exception& error) {
    if (error.code() == LUMICUT_INTERNAL) fuzz::finding(error.what());
  }
  return 0;
}
