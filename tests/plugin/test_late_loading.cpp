// A host that loads the library while it runs, as Blender and Python do: then the C library makes a thread's variables
// at their first use, and ends the process where there is no memory for them.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <thread>

#include "failing_memory.h"
#include "lumicut/lumicut.hpp"

namespace {

TEST(LateLoading, AThreadsFirstErrorNeedsNoMemory) {
  const char* const tree = std::getenv("LUMICUT_BINARY_DIR");
  ASSERT_NE(tree, nullptr);
  void* const library = dlopen((std::string(tree) + "/lib/liblumicut.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << dlerror();
  const auto cancel = reinterpret_cast<decltype(&lumicut_cancel)>(dlsym(library, "lumicut_cancel"));
  const auto last_error = reinterpret_cast<decltype(&lumicut_last_error)>(dlsym(library, "lumicut_last_error"));
  ASSERT_TRUE(cancel != nullptr && last_error != nullptr);
  lumicut_result result = LUMICUT_OK;
  std::string text, later;
  std::thread([&] {
    const char* now = nullptr;
    failing_memory::arm(0, true);
    {
      const failing_memory::Scope scope;
      result = cancel(nullptr);
      now = last_error();
    }
    failing_memory::disarm();
    text = now;
    cancel(nullptr);
    later = last_error();
  }).join();
  EXPECT_NE(result, LUMICUT_OK);
  EXPECT_NE(text.find("out of memory"), std::string::npos) << text;
  EXPECT_EQ(later, "handle: is NULL");
}

TEST(LateLoading, TheWrapperRendersWithATableOfFunctions) {
  const char* const tree = std::getenv("LUMICUT_BINARY_DIR");
  ASSERT_NE(tree, nullptr);
  void* const library = dlopen((std::string(tree) + "/lib/liblumicut.so").c_str(), RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << dlerror();
  namespace api = lumicut::api;
  const api::Functions functions = api::load([&](const char* name) { return dlsym(library, name); });
  const api::Device device(functions, 1);
  api::Scene scene(device);
  auto grey = api::make<lumicut_material>();
  grey.diffuse[0] = grey.diffuse[1] = grey.diffuse[2] = 0.5f;
  scene.set_materials({grey});
  const float corners[] = {-2, 0, -2, 2, 0, -2, 2, 0, 2, -2, 0, 2};
  const uint32_t triangles[] = {0, 2, 1, 0, 3, 2};
  auto floor = api::make<lumicut_mesh>();
  floor.positions = corners, floor.vertex_count = 4, floor.indices = triangles, floor.triangle_count = 2;
  scene.add_mesh(floor);
  auto lamp = api::make<lumicut_light>();
  lamp.unit = LUMICUT_WATT, lamp.value = 100, lamp.position[1] = 2;
  lamp.color[0] = lamp.color[1] = lamp.color[2] = 1;
  scene.set_lights({lamp});
  auto camera = api::make<lumicut_camera>();
  camera.to_world[0] = camera.to_world[5] = camera.to_world[10] = 1;
  camera.to_world[7] = 1, camera.to_world[11] = 5, camera.fov_y = 0.8f;
  scene.set_camera(camera);
  scene.commit();
  api::Integrator integrator(device, "lightcuts");
  integrator.set("vpls", "50");
  auto frame = api::make<lumicut_render_desc>();
  frame.width = frame.height = 16;
  const api::Render render(integrator, scene, frame);
  render.wait();
  double sum = 0;
  for (const float v : render.read("radiance")) sum += v;
  EXPECT_GT(sum, 0);
  EXPECT_THROW(integrator.set("vpls", "none"), api::Exception);
}

}  // namespace
