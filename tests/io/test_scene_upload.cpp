#include "io/scene_upload.h"

#include <cstring>

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

// A library that writes down what it is told.
struct Recorder {
  uint64_t textures = 0, materials = 0, lights = 0, vertices = 0, triangles = 0, meshes = 0, transforms = 0;
  bool environment = false, camera = false;
  uint32_t texture_format = 99;
  const float* normals = nullptr;
  lumicut_result answer = LUMICUT_OK;
} recorder;

Api fake() {
  recorder = {};
  Api api;
  api.scene_set_textures = [](lumicut_scene, const lumicut_texture* t, uint64_t n) -> lumicut_result {
    recorder.textures = n, recorder.texture_format = t->format;
    return recorder.answer;
  };
  api.scene_set_materials = [](lumicut_scene, const lumicut_material* m, uint64_t n) -> lumicut_result {
    EXPECT_EQ(m->struct_size, sizeof(lumicut_material));
    recorder.materials = n;
    return LUMICUT_OK;
  };
  api.scene_add_mesh = [](lumicut_scene, const lumicut_mesh* m, uint32_t*) -> lumicut_result {
    EXPECT_EQ(m->struct_size, sizeof(lumicut_mesh));
    ++recorder.meshes;
    recorder.vertices += m->vertex_count, recorder.triangles += m->triangle_count,
        recorder.transforms += m->transform_count;
    recorder.normals = m->normals;
    return LUMICUT_OK;
  };
  api.scene_set_lights = [](lumicut_scene, const lumicut_light*, uint64_t n) -> lumicut_result {
    return recorder.lights = n, LUMICUT_OK;
  };
  api.scene_set_environment = [](lumicut_scene, const lumicut_environment*) -> lumicut_result {
    return recorder.environment = true, LUMICUT_OK;
  };
  api.scene_set_camera = [](lumicut_scene, const lumicut_camera*) -> lumicut_result {
    return recorder.camera = true, LUMICUT_OK;
  };
  api.last_error = [] { return "lumicut_texture[0].width: 0 is not in 1 to 65536"; };
  return api;
}

SceneData example() {
  SceneData data;
  data.textures.push_back({"a.png", 1, 1, 3, LUMICUT_SRGB, {1, 2, 3}, {}, {}});
  data.materials.push_back({"grey", default_material()});
  Mesh mesh;
  mesh.name = "meshes[0]";
  mesh.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  mesh.indices = {0, 1, 2};
  mesh.materials = {0};
  mesh.transforms.assign(24, 0.0f);
  data.meshes.push_back(mesh);
  data.lights.resize(2);
  return data;
}

TEST(SceneUpload, EverythingReachesTheLibrary) {
  SceneData data = example();
  data.environment.emplace();
  upload_scene(fake(), nullptr, data);
  EXPECT_EQ(recorder.textures, 1u);
  EXPECT_EQ(recorder.texture_format, uint32_t{LUMICUT_UINT8});
  EXPECT_EQ(recorder.materials, 1u);
  EXPECT_EQ(recorder.meshes, 1u);
  EXPECT_EQ(recorder.vertices, 3u);
  EXPECT_EQ(recorder.triangles, 1u);
  EXPECT_EQ(recorder.transforms, 2u);
  EXPECT_EQ(recorder.lights, 2u);
  EXPECT_EQ(recorder.normals, nullptr);
  EXPECT_TRUE(recorder.environment && recorder.camera);
}

TEST(SceneUpload, ARefusalCarriesTheLibrarysText) {
  const Api api = fake();
  recorder.answer = LUMICUT_OUT_OF_MEMORY;
  try {
    upload_scene(api, nullptr, example());
    FAIL() << "no error";
  } catch (const LibraryError& error) {
    EXPECT_EQ(error.code(), LUMICUT_OUT_OF_MEMORY);
    expect_in(error.what(), {"textures", "width: 0"});
  }
  EXPECT_EQ(recorder.meshes, 0u);
}

TEST(Library, AMissingLibrarySaysWhereItWasSought) {
  setenv("LUMICUT_LIBRARY", "/nowhere/liblumicut.so", 1);
  try {
    const Library library;
    FAIL() << "no error";
  } catch (const LibraryError& error) {
    expect_in(error.what(), {"/nowhere/liblumicut.so", "LUMICUT_LIBRARY"});
  }
  unsetenv("LUMICUT_LIBRARY");
}

TEST(Library, AStrangeLibraryIsRefused) {
  setenv("LUMICUT_LIBRARY", "libm.so.6", 1);
  try {
    const Library library;
    FAIL() << "no error";
  } catch (const LibraryError& error) {
    expect_in(error.what(), {"libm.so.6", "lacks", "lumicut_"});
  }
  unsetenv("LUMICUT_LIBRARY");
}

}  // namespace
}  // namespace lumicut::io
