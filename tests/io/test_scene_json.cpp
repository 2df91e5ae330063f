#include "io/scene_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/image_file.h"
#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

void write_white(const std::string& path) {
  Image image;
  image.width = 2, image.height = 1;
  image.layers = {{"radiance", 3, {1, 1, 1, 1, 1, 1}}};
  write_exr(path, image, false);
}

using nlohmann::json;

const char kScene[] = R"({
  "image": {"size": [64, 32], "samples": 4},
  "camera": {"eye": [0, 0, 5], "at": [0, 0, 0], "fov_y": 60},
  "materials": [{"name": "grey", "diffuse": [0.5, 0.5, 0.5]}],
  "meshes": [{"positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "quads": [[0, 1, 2, 3]], "material": "grey"}],
  "lights": [{"type": "point", "position": [0, 0, 2], "value": 10}]
})";

SceneData read(const json& scene) {
  const TemporaryFolder folder;
  return read_scene(folder.write("scene.json", scene.dump()));
}

// The error of the example scene after `change`.
template <typename Change>
std::string error(Change change) {
  json scene = json::parse(kScene);
  change(scene);
  return error_of([&] { read(scene); });
}

template <typename Change>
SceneData changed(Change change) {
  json scene = json::parse(kScene);
  change(scene);
  return read(scene);
}

TEST(SceneJson, ASmallSceneIsReadWhole) {
  const SceneData scene = changed([](json&) {});
  EXPECT_EQ(scene.width, 64u);
  EXPECT_EQ(scene.height, 32u);
  EXPECT_EQ(scene.samples, 4u);
  EXPECT_EQ(scene.triangle_count(), 2u);
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(scene.lights[0].type, uint32_t{LUMICUT_POINT});
  EXPECT_EQ(scene.lights[0].value, 10.0f);
  EXPECT_NEAR(scene.camera.fov_y, M_PI / 3, 1e-6);
  const float expected[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5};
  for (int i = 0; i < 12; ++i) EXPECT_EQ(scene.camera.to_world[i], expected[i]) << i;
  EXPECT_TRUE(scene.warnings.empty());
}

TEST(SceneJson, TheCameraStandsAsItsAxesSay) {
  const SceneData scene = changed([](json& s) {
    s["up"] = "z";
    s["camera"] = {
        {"type", "orthographic"}, {"eye", {3, 0, 0}}, {"at", {0, 0, 0}}, {"height", 4}, {"shift", {0.5, -1}}};
  });
  // Looks along -x with z up: right is +y, back is +x.
  const float expected[12] = {0, 0, 1, 3, 1, 0, 0, 0, 0, 1, 0, 0};
  for (int i = 0; i < 12; ++i) EXPECT_EQ(scene.camera.to_world[i], expected[i]) << i;
  EXPECT_EQ(scene.camera.orthographic, 1u);
  EXPECT_EQ(scene.camera.height, 4.0f);
  EXPECT_EQ(scene.camera.shift[1], -1.0f);
}

TEST(SceneJson, PanoramasHaveTheirAngles) {
  TemporaryFolder folder;
  json scene = json::parse(kScene);
  scene["camera"].erase("fov_y");
  scene["camera"]["type"] = "equirectangular";
  lumicut_camera c = read_scene(folder.write("scene.json", scene.dump())).camera;
  EXPECT_EQ(c.panorama, uint32_t{LUMICUT_EQUIRECTANGULAR});
  EXPECT_NEAR(c.longitude[0], -M_PI, 1e-6);
  EXPECT_NEAR(c.latitude[1], M_PI / 2, 1e-6);
  scene["camera"]["longitude"] = {-90, 45};
  c = read_scene(folder.write("scene.json", scene.dump())).camera;
  EXPECT_NEAR(c.longitude[1], M_PI / 4, 1e-6);
  scene["camera"].erase("longitude");
  scene["camera"]["type"] = "fisheye_equisolid";
  expect_in(error_of([&] { read_scene(folder.write("scene.json", scene.dump())); }), {"camera", "fov"});
  scene["camera"]["fov"] = 180, scene["camera"]["lens"] = 10.5, scene["camera"]["sensor"] = {36, 24};
  c = read_scene(folder.write("scene.json", scene.dump())).camera;
  EXPECT_EQ(c.panorama, uint32_t{LUMICUT_FISHEYE_EQUISOLID});
  EXPECT_NEAR(c.fisheye_fov, M_PI, 1e-6);
  EXPECT_EQ(c.fisheye_lens, 10.5f);
  EXPECT_EQ(c.sensor[0], 36.0f);
  for (const char* key : {"fov", "lens", "sensor"}) scene["camera"].erase(key);
  scene["camera"]["type"] = "mirror_ball", scene["camera"]["shift"] = {0.25, -1};
  c = read_scene(folder.write("scene.json", scene.dump())).camera;
  EXPECT_EQ(c.panorama, uint32_t{LUMICUT_MIRROR_BALL});
  EXPECT_EQ(c.shift[0], 0.25f);
}

TEST(SceneJson, LampsMayFaceWhatTheyLightAndCastNoShadows) {
  TemporaryFolder folder;
  json scene = json::parse(kScene);
  scene["lights"] = {{{"type", "point"}, {"position", {0, 1, 0}}, {"value", 1}, {"radius", 0.5}, {"facing_disk", true}},
                     {{"type", "sun"}, {"direction", {0, -1, 0}}, {"value", 1}, {"shadows", false}}};
  scene["image"]["filter"] = "gaussian", scene["image"]["filter_width"] = 2;
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  EXPECT_EQ(data.lights[0].flags, uint32_t{LUMICUT_FACING_DISK});
  json flat = scene;
  flat["lights"][0].erase("radius");
  const std::string path = folder.write("flat.json", flat.dump());
  expect_in(error_of([&] { read_scene(path); }), {"lights[0].facing_disk", "needs a \"radius\" above 0"});
  EXPECT_EQ(data.lights[1].flags, uint32_t{LUMICUT_NO_SHADOWS});
  EXPECT_EQ(data.filter, uint32_t{LUMICUT_GAUSSIAN});
  EXPECT_EQ(data.filter_width, 2.0f);
}

TEST(SceneJson, MeshesAreHiddenFromKindsOfRays) {
  const auto mask = [](const json& kinds) {
    return changed([&](json& s) { s["meshes"][0]["hidden_from"] = kinds; }).meshes[0].mask;
  };
  EXPECT_EQ(changed([](json&) {}).meshes[0].mask, 0u) << "all see it";
  EXPECT_EQ(mask({"camera", "shadow"}) & 31u,
            uint32_t{LUMICUT_DIFFUSE_RAYS | LUMICUT_GLOSSY_RAYS | LUMICUT_TRANSMISSION_RAYS});
  const uint32_t none = mask({"camera", "diffuse", "glossy", "transmission", "shadow"});
  EXPECT_EQ(none & 31u, 0u);
  EXPECT_NE(none, 0u) << "which would be all";
  expect_in(error([](json& s) {
              s["meshes"][0]["hidden_from"] = {"camera", "shadows"};
            }),
            {"meshes[0].hidden_from[1]", "\"shadows\"", "\"shadow\""});
}

TEST(SceneJson, LightsAndEnvironmentsAreHiddenFromKindsOfRays) {
  const auto light = [](const json& kinds) {
    return changed([&](json& s) {
      s["lights"] = {{{"type", "point"}, {"position", {0, 1, 0}}, {"value", 1}, {"hidden_from", kinds}}};
      s["environment"] = {{"hidden_from", kinds}};
    });
  };
  const SceneData seen = light(json::array()), limited = light({"camera", "diffuse"});
  EXPECT_EQ(seen.lights[0].mask, 31u) << "by the camera too";
  EXPECT_EQ(seen.environment->mask, 0u);
  EXPECT_EQ(limited.lights[0].mask, 31u - LUMICUT_CAMERA_RAYS - LUMICUT_DIFFUSE_RAYS);
  EXPECT_EQ(limited.environment->flags, uint32_t{LUMICUT_HIDDEN});
  EXPECT_EQ(limited.environment->mask, uint32_t{LUMICUT_CAMERA_RAYS | LUMICUT_GLOSSY_RAYS | LUMICUT_TRANSMISSION_RAYS});
  expect_in(error([](json& s) {
              s["lights"] = {{{"type", "rectangle"},
                              {"position", {0, 1, 0}},
                              {"u", {1, 0, 0}},
                              {"v", {0, 1, 0}},
                              {"value", 1},
                              {"visible", true},
                              {"hidden_from", {"diffuse"}}}};
            }),
            {"lights[0].hidden_from", "is not for a visible light"});
}

TEST(SceneJson, LightsAreLinkedToMeshes) {
  const SceneData data = changed([](json& s) {
    s["lights"] = {{{"type", "point"}, {"position", {0, 1, 0}}, {"value", 1}, {"receivers", 32}, {"blockers", 27}}};
    s["meshes"][0]["not_lit_by"] = {1, 32}, s["meshes"][0]["not_blocking"] = {2};
    s["meshes"][0]["receivers"] = 4, s["meshes"][0]["blockers"] = 5;
  });
  EXPECT_EQ(data.lights[0].receivers, 32u);
  EXPECT_EQ(data.lights[0].blockers, 27u);
  EXPECT_EQ(data.meshes[0].not_lit_by, 0x80000001u);
  EXPECT_EQ(data.meshes[0].not_blocking, 2u);
  EXPECT_EQ(data.meshes[0].receivers, 4u);
  EXPECT_EQ(data.meshes[0].blockers, 5u);
  expect_in(error([](json& s) { s["meshes"][0]["not_blocking"] = {28}; }), {"meshes[0].not_blocking[0]", "28"});
}

TEST(SceneJson, ShadowCatchersAndTheLightsThatAreOfThem) {
  const auto point = [](bool catcher) {
    return json{{"type", "point"}, {"position", {0, 1, 0}}, {"value", 1}, {"shadow_catcher", catcher}};
  };
  const SceneData data = changed([&](json& s) {
    s["lights"] = json::array({point(false), point(true)});
    s["meshes"][0]["shadow_catcher"] = true;
  });
  EXPECT_TRUE(data.meshes[0].shadow_catcher);
  EXPECT_EQ(data.lights_of_catchers, std::set<size_t>{1});
  EXPECT_TRUE(data.warnings.empty());
  const SceneData alone = changed([&](json& s) {
    s["lights"] = json::array({point(false)});
    s["meshes"][0]["shadow_catcher"] = true;
  });
  ASSERT_EQ(alone.warnings.lines().size(), 1u);
  EXPECT_NE(alone.warnings.lines()[0].find("no light has \"shadow_catcher\""), std::string::npos);
  expect_in(error([](json& s) {
              s["lights"] = {{{"type", "rectangle"},
                              {"position", {0, 1, 0}},
                              {"u", {1, 0, 0}},
                              {"v", {0, 1, 0}},
                              {"value", 1},
                              {"visible", true},
                              {"shadow_catcher", true}}};
            }),
            {"lights[0].shadow_catcher", "is not for a visible light"});
  expect_in(error([](json& s) { s["meshes"][0]["shadow_catcher"] = 1; }), {"meshes[0].shadow_catcher"});
}

TEST(SceneJson, UnitScaleTurnsLengthsIntoMetresAndNothingElse) {
  const SceneData scene = changed([](json& s) {
    s["unit_scale"] = 0.01;
    s["lights"].push_back(
        {{"type", "rectangle"}, {"position", {0, 300, 0}}, {"u", {100, 0, 0}}, {"v", {0, 0, 50}}, {"value", 7}});
    s["camera"]["near"] = 10;
    s["meshes"][0]["instances"] = {{{"translate", {100, 0, 0}}}, {{"translate", {0, 200, 0}}}};
  });
  EXPECT_NEAR(scene.camera.to_world[11], 0.05, 1e-7);
  EXPECT_NEAR(scene.camera.near_clip, 0.1, 1e-7);
  EXPECT_NEAR(scene.meshes[0].positions[3], 0.01, 1e-8);
  EXPECT_NEAR(scene.meshes[0].transforms[3], 1, 1e-7);
  EXPECT_NEAR(scene.meshes[0].transforms[12 + 7], 2, 1e-7);
  EXPECT_NEAR(scene.lights[0].position[2], 0.02, 1e-8);
  EXPECT_EQ(scene.lights[0].value, 10.0f);
  EXPECT_NEAR(scene.lights[1].u[0], 1, 1e-7);
  EXPECT_EQ(scene.lights[1].value, 7.0f);
}

TEST(SceneJson, OneTransformIsBakedAndAMirrorKeepsTheFront) {
  const SceneData scene = changed([](json& s) {
    s["meshes"][0]["normals"] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    s["meshes"][0]["transform"] = {{"scale", {2, 1, -1}}, {"translate", {0, 0, 3}}};
  });
  const Mesh& mesh = scene.meshes[0];
  EXPECT_TRUE(mesh.transforms.empty());
  EXPECT_EQ(mesh.positions[3], 2.0f);
  EXPECT_EQ(mesh.positions[5], 3.0f);
  EXPECT_EQ(mesh.normals[2], -1.0f);
  EXPECT_EQ(mesh.indices, (std::vector<uint32_t>{0, 2, 1, 0, 3, 2})) << "wound as its turned normals say";
  const SceneData turned = changed([](json& s) {
    s["meshes"][0]["transform"] = {{"rotate", {{"axis", {0, 0, 2}}, {"degrees", 90}}}};
  });
  EXPECT_NEAR(turned.meshes[0].positions[4], 1, 1e-6) << "x turns to y";
}

TEST(SceneJson, VisibleLightsAreMeshesThatEmitAndReflectNothing) {
  const SceneData scene = changed([](json& s) {
    s["lights"] = {{{"type", "rectangle"},
                    {"corner", {0, 2, 0}},
                    {"u", {0, 0, 2}},
                    {"v", {3, 0, 0}},
                    {"value", 5},
                    {"visible", true}},
                   {{"type", "disk"},
                    {"position", {0, 2, 0}},
                    {"u", {2, 0, 0}},
                    {"v", {0, 0, -2}},
                    {"value", 100},
                    {"unit", "watt"},
                    {"visible", true}}};
  });
  EXPECT_TRUE(scene.lights.empty());
  ASSERT_EQ(scene.meshes.size(), 3u);
  const auto area_normal = [](const Mesh& mesh) {  // sum over triangles, y component
    double sum = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const float* a = &mesh.positions[mesh.indices[i] * 3];
      const float* b = &mesh.positions[mesh.indices[i + 1] * 3];
      const float* c = &mesh.positions[mesh.indices[i + 2] * 3];
      sum += 0.5 * (double{b[2] - a[2]} * (c[0] - a[0]) - double{b[0] - a[0]} * (c[2] - a[2]));
    }
    return sum;
  };
  const auto& quad = scene.materials[scene.meshes[1].materials[0]].values;
  EXPECT_EQ(quad.emission[0], 5.0f);
  EXPECT_EQ(quad.diffuse[0] + quad.specular[0], 0.0f);
  EXPECT_EQ(quad.flags, 0u) << "one-sided";
  EXPECT_NEAR(area_normal(scene.meshes[1]), 6, 1e-6) << "u x v points up";
  EXPECT_NEAR(area_normal(scene.meshes[2]), M_PI, 1e-5) << "as large as the disk";
  const auto& disk = scene.materials[scene.meshes[2].materials[0]].values;
  EXPECT_NEAR(disk.emission[0], 100 / (M_PI * M_PI), 1e-4) << "power / (pi area)";
}

TEST(SceneJson, TheEnvironmentTurnsWithUpAndRotation) {
  const auto map = [](const SceneData& scene, double x, double y, double z) {
    const float* m = scene.environment->world_to_map;
    std::array<double, 3> out{};
    for (size_t k = 0; k < 3; ++k) out[k] = m[k * 3] * x + m[k * 3 + 1] * y + m[k * 3 + 2] * z;
    return out;
  };
  SceneData scene = changed([](json& s) { s["environment"] = {{"color", {1, 2, 3}}, {"strength", 2}}; });
  EXPECT_EQ(scene.environment->color[1], 4.0f);
  EXPECT_NEAR(map(scene, 0, 1, 0)[2], 1, 1e-6) << "the world's y is the map's up";
  EXPECT_NEAR(map(scene, 1, 0, 0)[0], 1, 1e-6);
  EXPECT_NEAR(map(scene, 0, 0, -1)[1], 1, 1e-6);
  scene = changed([](json& s) { s["up"] = "z", s["camera"]["up"] = {0, 1, 0}, s["environment"] = {{"rotation", 90}}; });
  EXPECT_NEAR(map(scene, 0, 0, 1)[2], 1, 1e-6);
  // What stood at the map's x now stands at the world's y.
  EXPECT_NEAR(map(scene, 0, 1, 0)[0], 1, 1e-6);
}

TEST(SceneJson, TheEnvironmentMayHaveARotationOfItsOwnAndBeHidden) {
  const json turn = {0, 1, 0, -1, 0, 0, 0, 0, 1};
  SceneData scene = changed([&](json& s) { s["environment"] = {{"world_to_map", turn}, {"hidden", true}}; });
  for (size_t k = 0; k < 9; ++k) EXPECT_EQ(scene.environment->world_to_map[k], turn[k].get<float>());
  EXPECT_EQ(scene.environment->flags, uint32_t{LUMICUT_HIDDEN});
  scene = changed([](json& s) { s["environment"] = {{"hidden", false}}; });
  EXPECT_EQ(scene.environment->flags, 0u);
  json both = json::parse(kScene);
  both["environment"] = {{"world_to_map", turn}, {"rotation", 10}};
  const TemporaryFolder folder;
  const std::string file = folder.write("scene.json", both.dump());
  expect_in(error_of([&] { read_scene(file); }), {"environment", "rotation", "world_to_map"});
}

TEST(SceneJson, ColoursThatMultiplyATextureMayBeAboveOne) {
  const TemporaryFolder folder;
  write_white(folder / "a.exr");
  json scene = json::parse(kScene);
  const size_t first = scene["materials"].size();
  scene["materials"].push_back({{"name", "paper"}, {"diffuse", {1.5, 1, 1}}, {"diffuse_texture", "a.exr"}});
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  EXPECT_EQ(data.materials.at(first).values.diffuse[0], 1.5f);
  scene["materials"][first]["specular"] = {1.5, 1, 1};
  const std::string file = folder.write("scene.json", scene.dump());
  expect_in(error_of([&] { read_scene(file); }), {"specular[0]", "1.5"});
}

TEST(SceneJson, ATextureMaySayThatItEndsAndIsNotFiltered) {
  const TemporaryFolder folder;
  write_white(folder / "a.exr");
  json scene = json::parse(kScene);
  const size_t first = scene["materials"].size();
  scene["materials"].push_back({{"name", "ends"}, {"diffuse_texture", {{"file", "a.exr"}, {"clamp", true}}}});
  scene["materials"].push_back({{"name", "plain"}, {"diffuse_texture", "a.exr"}});
  scene["materials"].push_back({{"name", "sharp"}, {"diffuse_texture", {{"file", "a.exr"}, {"nearest", true}}}});
  const auto flags_of = [&](const SceneData& data, size_t material) {
    return data.textures.at(static_cast<size_t>(data.materials.at(first + material).values.diffuse_texture - 1)).flags;
  };
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  EXPECT_EQ(data.textures.size(), 3u) << "one file, three ways to read it";
  EXPECT_EQ(flags_of(data, 0), uint32_t{LUMICUT_CLAMP});
  EXPECT_EQ(flags_of(data, 1), 0u);
  EXPECT_EQ(flags_of(data, 2), uint32_t{LUMICUT_NEAREST});
  scene["materials"][first]["diffuse_texture"] = {{"file", "a.exr"}, {"mirror", true}};
  const std::string file = folder.write("scene.json", scene.dump());
  expect_in(error_of([&] { read_scene(file); }), {"mirror"});
}

TEST(SceneJson, GgxHasItsOwnParameters) {
  const TemporaryFolder folder;
  json scene = json::parse(kScene);
  scene["materials"].push_back({{"name", "steel"}, {"model", "ggx"}, {"diffuse", {0.6, 0.6, 0.7}}, {"metallic", 1}});
  scene["materials"].push_back({{"name", "pane"},
                                {"model", "ggx"},
                                {"roughness", 0},
                                {"transmission", 1},
                                {"ior", 1.33},
                                {"specular", {0.5, 0.5, 0.5}}});
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  const auto find = [&](const std::string& name) {
    for (const auto& m : data.materials)
      if (m.name == name) return m.values;
    return lumicut_material{};
  };
  const lumicut_material steel = find("steel"), pane = find("pane");
  EXPECT_EQ(steel.flags, uint32_t{LUMICUT_GGX});
  EXPECT_EQ(steel.metallic, 1.0f);
  EXPECT_EQ(steel.roughness, 0.5f);
  EXPECT_EQ(steel.specular[0], 1.0f) << "as the index of refraction has it";
  EXPECT_EQ(pane.roughness, 0.0f);
  EXPECT_EQ(pane.transmission, 1.0f);
  EXPECT_EQ(pane.ior, 1.33f);
  EXPECT_EQ(pane.specular[0], 0.5f);
  scene["materials"].push_back(
      {{"name", "mixed"}, {"model", "ggx"}, {"fresnel", false}, {"specular", {0.2, 0.2, 0.2}}});
  const SceneData more = read_scene(folder.write("scene.json", scene.dump()));
  EXPECT_EQ(more.materials.back().values.flags, uint32_t{LUMICUT_GGX | LUMICUT_NO_FRESNEL});
  const auto wrong = [&](const json& material) {
    json other = json::parse(kScene);
    other["materials"].push_back(material);
    return error_of([&] { read_scene(folder.write("wrong.json", other.dump())); });
  };
  scene["materials"].push_back(
      {{"name", "old"}, {"model", "ggx"}, {"burley", true}, {"specular_tint", {0.5, 0.6, 0.7}}});
  const lumicut_material old = read_scene(folder.write("scene.json", scene.dump())).materials.back().values;
  EXPECT_EQ(old.flags, uint32_t{LUMICUT_GGX | LUMICUT_BURLEY});
  EXPECT_EQ(old.specular_tint[2], 0.7f);
  scene["materials"].push_back(
      {{"name", "window"}, {"model", "ggx"}, {"transmission", 1}, {"roughness", 0}, {"shadows_pass", true}});
  EXPECT_EQ(read_scene(folder.write("scene.json", scene.dump())).materials.back().values.flags,
            uint32_t{LUMICUT_GGX | LUMICUT_SHADOWS_PASS});
  scene["materials"].back()["open_glass"] = true;
  EXPECT_EQ(read_scene(folder.write("scene.json", scene.dump())).materials.back().values.flags,
            uint32_t{LUMICUT_GGX | LUMICUT_SHADOWS_PASS | LUMICUT_OPEN_GLASS});
  scene["materials"].push_back({{"name", "clay"}, {"oren_nayar", "once"}, {"roughness", 0.25}});
  const lumicut_material clay = read_scene(folder.write("scene.json", scene.dump())).materials.back().values;
  EXPECT_EQ(clay.flags, uint32_t{LUMICUT_OREN_NAYAR | LUMICUT_FACETS_ONCE});
  EXPECT_EQ(clay.roughness, 0.25f);
  scene["materials"].push_back(
      {{"name", "glazed"}, {"model", "ggx"}, {"diffuse_roughness", 0.75}, {"diffuse_facets", "once"}});
  const lumicut_material glazed = read_scene(folder.write("scene.json", scene.dump())).materials.back().values;
  EXPECT_EQ(glazed.flags, uint32_t{LUMICUT_GGX | LUMICUT_DIFFUSE_ONCE});
  EXPECT_EQ(glazed.diffuse_roughness, 0.75f);
  for (const auto& [word, flag] :
       {std::pair{"even", 0u}, {"lobe", uint32_t{LUMICUT_BRIGHT_LOBE}}, {"none", uint32_t{LUMICUT_FACETS_ONCE}}}) {
    scene["materials"].push_back({{"name", word}, {"model", "ggx"}, {"multiple_scattering", word}});
    EXPECT_EQ(read_scene(folder.write("scene.json", scene.dump())).materials.back().values.flags,
              uint32_t{LUMICUT_GGX} | flag);
  }
  expect_in(wrong({{"name", "a"}, {"multiple_scattering", "lobe"}}), {"multiple_scattering", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"multiple_scattering", "lobes"}}),
            {"multiple_scattering", "lobes"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"oren_nayar", "often"}}), {"oren_nayar", "not of the model"});
  expect_in(wrong({{"name", "a"}, {"diffuse_roughness", 0.5}}), {"diffuse_roughness", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"diffuse_roughness_texture", "a.exr"}}),
            {"diffuse_roughness_texture", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"diffuse_roughness", 1.5}}), {"diffuse_roughness", "1.5"});
  expect_in(wrong({{"name", "a"}, {"diffuse_facets", "once"}}), {"diffuse_facets", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"diffuse_facets", "twice"}}), {"diffuse_facets", "twice"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"burley", true}, {"diffuse_roughness", 0.5}}),
            {"diffuse_roughness", "must be 0 where \"burley\""});
  expect_in(wrong({{"name", "a"}, {"shadows_pass", true}}), {"shadows_pass", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"shadows_pass", true}}),
            {"shadows_pass", "needs a \"transmission\" above 0"});
  expect_in(wrong({{"name", "a"}, {"open_glass", true}}), {"open_glass", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"transmission", 1}, {"open_glass", true}}),
            {"open_glass", "needs \"shadows_pass\""});
  expect_in(wrong({{"name", "a"},
                   {"model", "ggx"},
                   {"transmission", 1},
                   {"shadows_pass", true},
                   {"open_glass", true},
                   {"absorption", {0, 0, 1}}}),
            {"absorption", "must be 0 where \"open_glass\""});
  expect_in(wrong({{"name", "a"}, {"fresnel", false}}), {"fresnel", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"burley", true}}), {"burley", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"burley", true}, {"fresnel", false}}),
            {"burley", "must be false"});
  expect_in(wrong({{"name", "a"}, {"specular_tint", {1, 1, 1}}}), {"specular_tint", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"specular_tint", {1, 1, 0}}}), {"specular_tint", "0"});
  expect_in(wrong({{"name", "a"}, {"translucency", {0, 0, 1.5}}}), {"translucency", "1.5"});
  expect_in(wrong({{"name", "a"}, {"emission_texture", {{"file", "a.exr"}, {"by_view", true}}}}),
            {"materials[", "emission_texture.by_view", "is for diffuse"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"fresnel", false}, {"metallic", 0.5}}), {"metallic", "must be 0"});
  expect_in(wrong({{"name", "a"}, {"roughness", 0.5}}), {"roughness", "\"ggx\" and of \"oren_nayar\" surfaces alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"shininess", 5}}), {"shininess", "not of the model \"ggx\""});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"roughness", 1.5}}), {"roughness", "1.5"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"ior", 0}}), {"ior", "0"});
  expect_in(wrong({{"name", "a"}, {"coat", 0.5}}), {"coat", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"coat", 2}}), {"coat", "2"});
  expect_in(wrong({{"name", "a"}, {"model", "ggx"}, {"coat_ior", 0.9}}), {"coat_ior", "0.9"});
  expect_in(wrong({{"name", "a"}, {"roughness_texture", "a.exr"}}), {"roughness_texture", "\"ggx\" alone"});
  expect_in(wrong({{"name", "a"}, {"bump_distance", 0}}), {"bump_distance", "0"});
}

TEST(SceneJson, CoatsBumpsAndTexturesOfNumbersAreRead) {
  const TemporaryFolder folder;
  Image image;
  image.width = 2, image.height = 1;
  image.layers = {{"radiance", 3, {0.25f, 0.25f, 0.25f, 0.75f, 0.75f, 0.75f}}};
  write_exr(folder / "a.exr", image, false);
  json scene = json::parse(kScene);
  scene["unit_scale"] = 0.01;
  scene["materials"] = {{{"name", "grey"},
                         {"model", "ggx"},
                         {"coat", 0.8},
                         {"coat_roughness", 0.2},
                         {"coat_ior", 1.6},
                         {"roughness_texture", "a.exr"},
                         {"metallic_texture", {{"file", "a.exr"}, {"nearest", true}}},
                         {"diffuse_roughness_texture", "a.exr"},
                         {"height_texture", "a.exr"},
                         {"bump_distance", -2},
                         {"bump_strength", 0.5}},
                        {{"name", "dent"}, {"height_texture", "a.exr"}}};
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  const lumicut_material &m = data.materials[0].values, &dent = data.materials[1].values;
  EXPECT_EQ(m.coat, 0.8f);
  EXPECT_EQ(m.coat_roughness, 0.2f);
  EXPECT_EQ(m.coat_ior, 1.6f);
  EXPECT_EQ(m.roughness_texture, m.height_texture) << "read once";
  EXPECT_EQ(m.diffuse_roughness_texture, m.roughness_texture);
  EXPECT_NE(m.roughness_texture, m.metallic_texture);
  EXPECT_FLOAT_EQ(m.bump_distance, -0.02f) << "a length: in the file's unit";
  EXPECT_EQ(m.bump_strength, 0.5f);
  EXPECT_FLOAT_EQ(dent.bump_distance, 0.01f) << "one unit of the file unless given";
  EXPECT_EQ(data.textures[static_cast<size_t>(m.height_texture) - 1].flags & LUMICUT_SRGB, 0u);
}

TEST(SceneJson, MaterialsOfAnObjCanBeChangedByName) {
  const TemporaryFolder folder;
  folder.write("m.mtl", "newmtl floor\nKd 0.2 0.2 0.2\nNs 5\n\nnewmtl wall\nKd 0.7 0.7 0.7\n");
  folder.write("a.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl floor\nf 1 2 3\nusemtl wall\nf 1 2 3\n");
  json scene = json::parse(kScene);
  scene["meshes"] = {{{"obj", "a.obj"}, {"materials", {{"floor", {{"specular", {0.3, 0.3, 0.3}}}}, {"wall", "grey"}}}}};
  const SceneData data = read_scene(folder.write("scene.json", scene.dump()));
  const auto& floor = data.materials[data.meshes[0].materials[0]].values;
  EXPECT_EQ(floor.diffuse[0], 0.2f);
  EXPECT_EQ(floor.specular[0], 0.3f);
  EXPECT_EQ(floor.shininess, 5.0f);
  EXPECT_EQ(data.materials[data.meshes[0].materials[1]].name, "grey");
  scene["meshes"][0]["materials"] = {{"flor", "grey"}};
  expect_in(error_of([&] { read_scene(folder.write("scene.json", scene.dump())); }),
            {"meshes[0].materials", "\"flor\"", "\"floor\""});
}

TEST(SceneJson, PathsMayNameEnvironmentVariables) {
  const TemporaryFolder folder;
  folder.write("sub/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  json scene = json::parse(kScene);
  scene["meshes"] = {{{"obj", "${LUMICUT_TEST_FOLDER}/a.obj"}}};
  const std::string file = folder.write("scene.json", scene.dump());
  unsetenv("LUMICUT_TEST_FOLDER");
  expect_in(error_of([&] { read_scene(file); }), {"meshes[0].obj", "LUMICUT_TEST_FOLDER", "not set"});
  setenv("LUMICUT_TEST_FOLDER", (folder / "sub").c_str(), 1);
  EXPECT_EQ(read_scene(file).triangle_count(), 1u);
  setenv("LUMICUT_TEST_FOLDER", "${LUMICUT_TEST_FOLDER}", 1);
  expect_in(error_of([&] { read_scene(file); }), {"LUMICUT_TEST_FOLDER"});
  unsetenv("LUMICUT_TEST_FOLDER");
}

TEST(SceneJson, MessagesDoNotPrintTheValuesOfVariables) {
  const TemporaryFolder folder;
  setenv("LUMICUT_TEST_SECRET", "hunter2", 1);
  setenv("LUMICUT_TEST_PLACE", (folder / "hunter2").c_str(), 1);
  setenv("LUMICUT_TEST_OBJ", (folder / "hunter2/a.obj").c_str(), 1);
  folder.write("hunter2/a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  folder.write("hunter2/a.mtl", "newmtl a\nKd x\n");
  folder.write("hunter2/bad.ies", "no profile");
  const auto message = [&](const char* key, const std::string& value) {
    json scene = json::parse(kScene);
    if (key == std::string("obj")) scene["meshes"] = {{{"obj", value}}};
    if (key == std::string("image")) scene["environment"] = {{"image", value}};
    if (key == std::string("ies"))
      scene["lights"] = {
          {{"type", "point"}, {"position", {0, 1, 0}}, {"ies", value}, {"value", 1}, {"direction", {0, -1, 0}}}};
    return error_of([&] { read_scene(folder.write("scene.json", scene.dump())); });
  };
  for (const auto& [key, value, wanted] :
       {std::array{"obj", "/nowhere/${LUMICUT_TEST_SECRET}", "/nowhere/${LUMICUT_TEST_SECRET}: no such file"},
        std::array{"obj", "./x/../${LUMICUT_TEST_SECRET}/b.obj", "./x/../${LUMICUT_TEST_SECRET}/b.obj: no such file"},
        std::array{"obj", "${LUMICUT_TEST_PLACE}", "${LUMICUT_TEST_PLACE}: is a folder"},
        std::array{"obj", "${LUMICUT_TEST_PLACE}/a.obj", "${LUMICUT_TEST_PLACE}/a.mtl"},
        std::array{"obj", "${LUMICUT_TEST_OBJ}", "${LUMICUT_TEST_OBJ}/../a.mtl"},
        std::array{"image", "${LUMICUT_TEST_PLACE}/none.hdr", "${LUMICUT_TEST_PLACE}/none.hdr: no such texture"},
        std::array{"ies", "${LUMICUT_TEST_PLACE}/bad.ies", "${LUMICUT_TEST_PLACE}/bad.ies"}}) {
    const std::string text = message(key, value);
    expect_in(text, {wanted});
    EXPECT_EQ(text.find("hunter2"), std::string::npos) << text;
  }
  for (const char* name : {"LUMICUT_TEST_SECRET", "LUMICUT_TEST_PLACE", "LUMICUT_TEST_OBJ"}) unsetenv(name);
}

TEST(SceneJson, SyntaxErrorsNameLineAndColumn) {
  const TemporaryFolder folder;
  const auto text_error = [&](const std::string& text) {
    return error_of([&] { read_scene(folder.write("s.json", text)); });
  };
  expect_in(text_error("{\n  \"camera\": {,\n}"), {"s.json", "line 2, column 14"});
  expect_in(text_error(""), {"s.json", "line 1"});
  expect_in(text_error("{\"camera\": NaN}"), {"line 1"});
  expect_in(text_error("{\"unit_scale\": 1e999}"), {"s.json", "1e999"});
  expect_in(text_error("{\"up\": \"y\", \"up\": \"z\"}"), {"\"up\"", "twice"});
  expect_in(text_error(std::string(100000, '[')), {"nested deeper"});
  expect_in(text_error("[1, 2]"), {"s.json", "an object"});
  expect_in(text_error("\xff\xfe{}"), {"s.json", "UTF-16"});
  expect_in(text_error(std::string("{}\n\0", 4)), {"s.json", "line 2, column 1", "zero byte"});
  expect_in(error_of([&] { read_scene(folder / "none.json"); }), {"none.json", "no such file"});
  const std::string whole = kScene;
  for (size_t length = 0; length < whole.size() - 1; ++length)
    expect_in(text_error(whole.substr(0, length)), {"s.json"});
}

TEST(SceneJson, UnknownKeysAreNamedWithTheNearest) {
  expect_in(error([](json& s) { s["ligths"] = json::array(); }), {"scene.json", "\"ligths\"", "\"lights\""});
  expect_in(error([](json& s) { s["camera"]["fov"] = 3; }), {"camera", "\"fov\"", "\"fov_y\""});
  expect_in(error([](json& s) { s["lights"][0]["colour"] = 3; }), {"lights[0]", "\"colour\"", "\"color\""});
  expect_in(error([](json& s) { s["meshes"][0]["xyzzy"] = 3; }), {"meshes[0]", "\"xyzzy\"", "known are"});
}

TEST(SceneJson, MissingKeysAreNamed) {
  expect_in(error([](json& s) { s.erase("camera"); }), {"needs the key \"camera\""});
  expect_in(error([](json& s) { s["camera"].erase("fov_y"); }), {"camera", "\"fov_y\""});
  expect_in(error([](json& s) { s["lights"][0].erase("value"); }), {"lights[0]", "\"value\""});
  expect_in(error([](json& s) {
              s["lights"][0].erase("position");
              s["lights"][0]["positon"] = {0, 0, 0};
            }),
            {"lights[0]", "\"position\"", "\"positon\" misspelt"});
  expect_in(error([](json& s) { s["meshes"][0].erase("positions"); }), {"meshes[0]", "\"obj\"", "\"positions\""});
  expect_in(error([](json& s) { s["meshes"][0].erase("quads"); }), {"meshes[0]", "\"triangles\""});
  expect_in(error([](json& s) { s["meshes"] = json::array(); }), {"neither meshes"});
}

TEST(SceneJson, WrongValuesAreNamedWithPathAndValue) {
  const auto at = [](const char* pointer, json value) {
    return error([&](json& s) { s[json::json_pointer(pointer)] = value; });
  };
  expect_in(at("/camera/fov_y", "wide"), {"camera.fov_y", "\"wide\"", "number"});
  expect_in(at("/camera/fov_y", 180), {"camera.fov_y", "180", "179"});
  expect_in(at("/camera/fov_y", 0), {"camera.fov_y", "0"});
  expect_in(at("/camera/eye", {1, 2}), {"camera.eye", "[1,2]", "3 numbers"});
  expect_in(at("/camera/eye/1", nullptr), {"camera.eye[1]", "null"});
  expect_in(at("/camera/eye/1", 1e35), {"camera.eye[1]", "1e+35"});
  expect_in(at("/camera/at", {0, 0, 5}), {"camera.at", "same point"});
  expect_in(at("/camera/up", {0, 0, 1}), {"camera", "along its own"});
  expect_in(at("/camera/type", "fisheye"), {"camera.type", "fisheye", "perspective, orthographic"});
  expect_in(at("/camera/matrix", {1, 0, 0}), {"camera.matrix", "12 numbers"});
  expect_in(at("/camera/matrix", std::vector<int>(12, 0)), {"camera.matrix", "determinant"});
  expect_in(at("/camera/lens_radius", 1), {"camera", "focus_distance"});
  expect_in(at("/image/size", {0, 10}), {"image.size[0]", "0"});
  expect_in(at("/image/size", {1e6, 10}), {"image.size[0]"});
  expect_in(at("/image/samples", 1.5), {"image.samples", "1.5", "whole"});
  expect_in(at("/image/samples", -1), {"image.samples", "-1"});
  expect_in(at("/image/samples", 18446744073709551615ull), {"image.samples"});
  expect_in(at("/unit_scale", 0), {"unit_scale", "0"});
  expect_in(at("/up", "x"), {"up", "\"x\"", "y, z"});
  expect_in(at("/materials/0/diffuse/2", 1.5), {"materials[0].diffuse[2]", "1.5"});
  expect_in(at("/materials/0/diffuse/2", -0.1), {"materials[0].diffuse[2]", "-0.1"});
  expect_in(at("/materials/0/model", "ward"), {"materials[0].model", "ward", "blinn, phong, ggx"});
  expect_in(at("/materials/0/diffuse_texture", "no.png"),
            {"no.png", "no such texture", "\"grey\"", "materials[0].diffuse_texture"});
  expect_in(at("/materials/1", {{"name", "grey"}}), {"materials[1].name", "already"});
  expect_in(at("/meshes/0/material", "gray"), {"meshes[0].material", "\"gray\"", "\"grey\""});
  expect_in(at("/meshes/0/quads/0/3", 4), {"meshes[0].quads[0][3]", "4", "from 0 to 3"});
  expect_in(at("/meshes/0/quads/0/3", -1), {"meshes[0].quads[0][3]", "-1"});
  expect_in(at("/meshes/0/quads/0/3", 1.5), {"meshes[0].quads[0][3]", "1.5"});
  expect_in(at("/meshes/0/quads/0", {0, 1, 2}), {"meshes[0].quads[0]", "4 vertex numbers"});
  expect_in(at("/meshes/0/quads", json::array()), {"meshes[0]", "no \"triangles\""});
  expect_in(at("/meshes/0/positions", json::array()), {"meshes[0].positions", "empty"});
  expect_in(at("/meshes/0/normals", json::parse("[[0,0,1]]")), {"meshes[0].normals", "1 entries for 4"});
  expect_in(at("/meshes/0/instances", json::array()), {"meshes[0].instances", "empty"});
  expect_in(at("/meshes/0/transform", {{"scale", 0}}), {"meshes[0].transform", "determinant"});
  expect_in(at("/meshes/0/transform", {{"scale", 1e17}, {"translate", {8.9e17, 8.9e17, 8.9e17}}}),
            {"meshes[0]", "9e+17"});
  expect_in(at("/meshes/0/transform", {{"scale", 1e30}, {"translate", {1e30, 0, 0}}}), {"translate", "9e+17"});
  expect_in(at("/meshes/0/group", 70000), {"meshes[0].group", "70000"});
  expect_in(at("/meshes/0", {{"obj", ""}}), {"meshes[0].obj", "empty"});
  expect_in(at("/meshes/0", {{"obj", "none.obj"}}), {"none.obj", "no such file"});
  expect_in(at("/meshes/0", {{"obj", "."}}), {"is a folder"});
  expect_in(at("/meshes", 5), {"meshes", "5", "array"});
  expect_in(at("/meshes/0", 5), {"meshes[0]", "object"});
  expect_in(at("/lights/0/type", "laser"), {"lights[0].type", "laser", "point, spot"});
  expect_in(at("/lights/0/value", -1), {"lights[0].value", "-1"});
  expect_in(at("/lights/0/unit", "lumen"), {"lights[0].unit", "lumen"});
  expect_in(at("/lights/0", json::parse(R"({"type":"sun","value":1,"direction":[0,0,0]})")),
            {"lights[0].direction", "zero"});
  expect_in(
      at("/lights/0", json::parse(R"({"type":"rectangle","value":1,"position":[0,0,0],"u":[1,0,0],"v":[2,0,0]})")),
      {"lights[0].v", "parallel"});
  expect_in(
      at("/lights/0",
         json::parse(
             R"({"type":"rectangle","value":1,"position":[0,0,0],"u":[1,0,0],"v":[0,2,0],"visible":true,"spread":90})")),
      {"lights[0].spread", "visible"});
  expect_in(at("/environment", {{"image", "none.hdr"}}), {"none.hdr", "environment"});
}

TEST(SceneJson, EnvironmentsThatAreNotFiniteNameThePixel) {
  const TemporaryFolder folder;
  Image image;
  image.width = 2, image.height = 1;
  image.layers = {{"radiance", 3, {1, 1, 1, 1, NAN, 1}}};
  write_exr(folder / "sky.exr", image, false);
  json scene = json::parse(kScene);
  scene["environment"] = {{"image", "sky.exr"}};
  const std::string file = folder.write("scene.json", scene.dump());
  expect_in(error_of([&] { read_scene(file); }), {"sky.exr", "pixel (1, 0)", "nan"});
  image.layers[0].pixels[4] = 3;
  write_exr(folder / "sky.exr", image, false);
  const SceneData data = read_scene(file);
  EXPECT_EQ(data.textures.at(0).floats, (std::vector<float>{1, 1, 1, 1, 3, 1}));
  EXPECT_EQ(data.environment->texture, 1);
}

TEST(SceneJson, ProgramsAndAttributesAreRead) {
  const TemporaryFolder folder;
  const float tint[4] = {1, 2, 3, 4};
  folder.write("tint.f32", std::string(reinterpret_cast<const char*>(tint), sizeof(tint)));
  const auto with = [&](const auto& change) {
    json s = json::parse(kScene);
    s["programs"] =
        json::parse(R"([{"name": "p", "steps": [{"op": "position"}, {"op": "vector", "mode": 2, "inputs": [0, [5]]},
      {"op": "ramp", "inputs": [1], "table": [0, 0, 0, 1, 1, 1]}, {"op": "attribute", "attribute": "tint"},
      {"op": "mix", "mode": 2, "inputs": [[0.5], 2, 3]}]}])");
    s["materials"][0]["diffuse_texture"] = json{{"program", "p"}};
    s["meshes"][0]["attributes"] =
        json::parse(R"([{"name": "tint", "domain": "vertices", "components": 1, "file": "tint.f32"}])");
    change(s);
    return read_scene(folder.write("scene.json", s.dump()));
  };
  const SceneData scene = with([](json&) {});
  ASSERT_EQ(scene.textures.size(), 1u);
  ASSERT_TRUE(scene.textures[0].program);
  const Program& p = *scene.textures[0].program;
  ASSERT_EQ(p.instructions.size(), 5u);
  EXPECT_EQ(p.instructions[1].op, uint32_t{LUMICUT_OP_VECTOR});
  EXPECT_EQ(p.instructions[1].inputs[1], -1);
  EXPECT_EQ(p.instructions[2].count, 6u);
  EXPECT_EQ(p.instructions[1].inputs[2], -2) << "left out: 0";
  EXPECT_EQ(p.constants, (std::vector<float>{5, 5, 5, 0, 0, 0, 0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(scene.materials[0].values.diffuse_texture, 1);
  ASSERT_EQ(scene.meshes[0].attributes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].attributes[0].id, p.instructions[3].data);
  EXPECT_EQ(scene.meshes[0].attributes[0].values, (std::vector<float>{1, 2, 3, 4}));

  const auto wrong = [&](const char* pointer, const json& value) {
    return error_of([&] { with([&](json& s) { s[json::json_pointer(pointer)] = value; }); });
  };
  EXPECT_NE(wrong("/programs/0/steps/1/inputs/0", 1).find("programs[0].steps[1].inputs[0]: is 1"), std::string::npos);
  EXPECT_NE(wrong("/programs/0/steps/1/inputs/1", {1, 2}).find("programs[0].steps[1].inputs[1]"), std::string::npos);
  EXPECT_NE(wrong("/programs/0/steps/2/inputs", {1, 1}).find(", but must be an array of at most 1, the inputs of ramp"),
            std::string::npos);
  EXPECT_NE(wrong("/programs/0/steps/1/mode", 27).find("programs[0].steps[1].mode: is 27"), std::string::npos);
  EXPECT_NE(wrong("/programs/0/steps/0/op", "place").find("programs[0].steps[0].op"), std::string::npos);
  EXPECT_NE(wrong("/materials/0/diffuse_texture/program", "q").find("no program \"q\""), std::string::npos);
  EXPECT_NE(wrong("/meshes/0/attributes/0/components", 2).find("holds 4 numbers for 4 vertices of 2 components"),
            std::string::npos);
}

TEST(SceneJson, ScenesOfTheBenchesAreWellFormed) {
  // Their meshes are not part of the project: one triangle stands in for each.
  const TemporaryFolder folder;
  for (const char* name : {"conference", "sponza", "sibenik", "kitchen"}) {
    folder.write(std::string(name) + "/m.mtl", "newmtl floor\nKd 0.5 0.5 0.5\nKe 1 1 1\n");
    folder.write(std::string(name) + "/" + name + ".obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl floor\nf 1 2 3\n");
  }
  folder.write("envmaps/venice_sunset_1k.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x81");
  setenv("LUMICUT_SCENES", (folder / ".").c_str(), 1);
  const char* root = std::getenv("LUMICUT_SOURCE_DIR");
  ASSERT_NE(root, nullptr) << "set by CTest";
  for (const char* name : {"conference", "conference_peer", "sponza", "sibenik", "kitchen"}) {
    const SceneData scene = read_scene(std::string(root) + "/bench/scenes/" + name + ".json");
    EXPECT_EQ(scene.width, 512u);
    EXPECT_EQ(scene.meshes.size(), std::string(name) == "conference_peer" ? 22u : 1u) << "21 visible lamps";
  }
  unsetenv("LUMICUT_SCENES");
}

TEST(SceneJson, ASceneWithoutLightWarns) {
  const SceneData scene = changed([](json& s) { s.erase("lights"); });
  ASSERT_EQ(scene.warnings.lines().size(), 1u);
  expect_in(scene.warnings.lines()[0], {"no light"});
}

TEST(SceneJson, OurOwnScenesAreRead) {
  const char* root = std::getenv("LUMICUT_SOURCE_DIR");
  ASSERT_NE(root, nullptr) << "set by CTest";
  for (const char* name : {"cornell_box", "indirect_room", "court"}) {
    const SceneData scene = read_scene(std::string(root) + "/reference_images/" + name + "/" + name + ".json");
    EXPECT_GT(scene.triangle_count(), 20u) << name;
    EXPECT_TRUE(scene.warnings.empty()) << name << ": " << scene.warnings.lines()[0];
  }
}

// A downlight: 683 cd down, nothing to the sides, twice as much at 90 degrees around as at 0.
const char kLamp[] = "TILT=NONE\n1 1000 1 2 3 1 2 0 0 0\n1 1 60\n0 90\n0 90 180\n683 0\n1366 0\n683 0\n";

TEST(SceneJson, IesFilesBecomeProfilesOfPointLamps) {
  const TemporaryFolder folder;
  folder.write("lamp.ies", kLamp);
  json scene = json::parse(kScene);
  const json lamp = {
      {"type", "point"}, {"position", {0, 0, 2}}, {"value", 3}, {"ies", "lamp.ies"}, {"direction", {0, -2, 0}}};
  json turned = lamp;
  turned["rotation"] = 90;
  json spot = lamp;
  spot["type"] = "spot", spot["angle"] = 60, spot["blend"] = 0.5;
  scene["lights"] = {lamp, turned, spot};
  const SceneData read = read_scene(folder.write("scene.json", scene.dump()));
  ASSERT_EQ(read.profiles.size(), 2u) << "one file used twice is one profile; the spot's cone is cut out of its own";
  ASSERT_EQ(read.lights.size(), 3u);
  EXPECT_EQ(read.lights[0].profile, 1u);
  EXPECT_EQ(read.lights[1].profile, 1u);
  EXPECT_EQ(read.lights[2].profile, 2u);
  EXPECT_EQ(read.lights[2].type, uint32_t{LUMICUT_POINT});
  const Profile& p = read.profiles[0];
  EXPECT_EQ(p.values[0], 1.0f) << "candela over 683";
  EXPECT_EQ(p.horizontal.size(), 5u);
  EXPECT_NEAR(p.horizontal[4], 2 * M_PI, 1e-6);
  // Downwards angle 0 lies at +x; a quarter turn leads to x × -y = -z, counter-clockwise seen from above.
  EXPECT_NEAR(read.lights[0].direction[1], -1, 1e-6);
  EXPECT_NEAR(read.lights[0].tangent[0], 1, 1e-6);
  EXPECT_NEAR(read.lights[1].tangent[2], -1, 1e-6);
  const Profile& cut = read.profiles[1];
  EXPECT_EQ(cut.values[0], 1.0f);
  EXPECT_NEAR(cut.vertical.back(), M_PI / 6, 1e-4);
  EXPECT_NEAR(cut.values[cut.vertical.size() - 1], 0, 1e-6);

  scene["lights"][0].erase("direction");
  expect_in(error_of([&] { read_scene(folder.write("scene.json", scene.dump())); }), {"lights[0]", "direction"});
  scene["lights"][0] = lamp, scene["lights"][0]["radius"] = 0.1;
  expect_in(error_of([&] { read_scene(folder.write("scene.json", scene.dump())); }), {"lights[0].radius", "point"});
  scene["lights"][0] = lamp, scene["lights"][0]["ies"] = "none.ies";
  expect_in(error_of([&] { read_scene(folder.write("scene.json", scene.dump())); }), {"none.ies"});
}

TEST(SceneJson, ASkyIsAMapAndASun) {
  const auto sky = [](const json& keys) {
    return changed([&](json& s) { s["environment"] = {{"sky", keys}, {"strength", 0.5}, {"group", 3}}; });
  };
  const SceneData scene = sky({{"sun_elevation", 30}, {"sun_rotation", 90}, {"turbidity", 2.5}, {"resolution", 32}});
  ASSERT_EQ(scene.textures.size(), 1u);
  EXPECT_EQ(scene.textures[0].width, 64u);
  EXPECT_EQ(scene.textures[0].floats.size(), 64u * 32 * 3);
  ASSERT_EQ(scene.lights.size(), 2u);
  const lumicut_light& sun = scene.lights[1];
  EXPECT_EQ(sun.type, uint32_t{LUMICUT_SUN});
  EXPECT_EQ(sun.group, 3u);
  EXPECT_NEAR(sun.radius, 0.2666 * M_PI / 180, 1e-6);
  // y is up: 90 degrees lie at -z, and the light travels away from there.
  EXPECT_NEAR(sun.direction[1], -0.5, 1e-6);
  EXPECT_NEAR(sun.direction[2], std::sqrt(0.75), 1e-6);
  EXPECT_EQ(sun.value, 0.5f);
  EXPECT_GT(sun.color[0], 50.0f);
  EXPECT_EQ(scene.environment->color[0], 0.5f);
  EXPECT_EQ(scene.environment->texture, 1);
  EXPECT_EQ(sky({{"sun_elevation", 30}, {"sun", false}}).lights.size(), 1u);

  const auto refused = [&](const json& keys) { return error_of([&] { sky(keys); }); };
  expect_in(refused({{"sun_elevation", -3}}), {"environment.sky.sun_elevation", "-3", "below the horizon"});
  expect_in(refused({{"turbidity", 3}}), {"environment.sky", "sun_elevation"});
  expect_in(refused({{"sun_elevation", 30}, {"turbidity", 1}}), {"environment.sky.turbidity", "1"});
  expect_in(error([](json& s) {
              s["environment"] = {{"sky", {{"sun_elevation", 30}}}, {"rotation", 20}};
            }),
            {"environment.sky", "sun_rotation"});
  expect_in(error([](json& s) {
              s["environment"] = {{"sky", {{"sun_elevation", 30}}}, {"image", "a.hdr"}};
            }),
            {"environment.sky", "image"});
}

}  // namespace
}  // namespace lumicut::io
