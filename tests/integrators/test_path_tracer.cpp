// The path tracer against closed forms, and virtual lights with their clamp compensated against the path tracer.
#include <gtest/gtest.h>

#include "tests/support/render.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kPi = 3.14159265f;

Camera inside_looking_along_y() {
  Camera camera;
  camera.position = {0, -0.9f, 0};
  camera.right = {1, 0, 0}, camera.forward = {0, 1, 0}, camera.up = {0, 0, 1};
  camera.tan_half_fov_y = 0.7f;
  return camera;
}

// A closed box that emits and reflects evenly: radiance is emission / (1 − albedo) everywhere.
std::unique_ptr<Scene> furnace(float albedo, float emission) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material m = test::diffuse(albedo, albedo, albedo);
  m.emission = {emission, emission, emission};
  scene->set_materials({m});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  scene->add_mesh(std::move(mesh));
  scene->set_camera(inside_looking_along_y());
  Progress progress;
  scene->commit(progress);
  return scene;
}

std::vector<double> region_means(const std::vector<Rgb>& image, uint32_t width, uint32_t height, uint32_t parts) {
  std::vector<double> means(size_t{parts} * parts, 0.0);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      means[(y * parts / height) * parts + x * parts / width] +=
          luminance(image[size_t{y} * width + x]) * parts * parts / (double{static_cast<double>(width)} * height);
  return means;
}

TEST(PathTracer, RadianceInAFurnaceIsTheGeometricSum) {
  const auto scene = furnace(0.5f, 1.0f);
  const auto image =
      test::render(*scene, "path_tracer", {}, {{"samples", "64"}, {"max_depth", "64"}}, {.width = 32, .height = 24})
          .radiance;
  // 49,152 paths with a spread of about the mean: .5 % is one standard deviation.
  EXPECT_NEAR(test::mean_luminance(image), 2.0, 0.03);
}

TEST(PathTracer, DirectLightOfADiskIsTheClosedForm) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.5f, 0.5f, 0.5f)});
  Mesh mesh;
  test::add_quad(mesh, {-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}, 0);
  scene->add_mesh(std::move(mesh));
  Light disk;
  disk.type = LightType::disk;
  disk.position = {0, 0, 2};
  disk.u = {2, 0, 0}, disk.v = {0, -2, 0};  // radius 1, shines down
  disk.value = {3, 3, 3};
  scene->set_lights({disk});
  Camera camera;
  camera.position = {0, 0, 1};
  camera.right = {1, 0, 0}, camera.up = {0, 1, 0}, camera.forward = {0, 0, -1};
  camera.tan_half_fov_y = 0.01f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  const auto image = test::render(*scene, "path_tracer", {}, {{"samples", "400"}}, {.width = 8, .height = 8}).radiance;
  // Irradiance below the middle of a Lambertian disk: π L r²/(r² + h²); radiance: albedo/π of it.
  const double expected = 0.5 / kPi * (kPi * 3.0 / (1 + 4));
  EXPECT_NEAR(test::mean_luminance(image) / expected, 1.0, 0.01);  // 25,600 samples of 20 % spread: 0.13 %
}

// Emission seen by rays alone, by light samples alone and by both must agree.
TEST(PathTracer, AnEmissiveMeshGivesWhatARectangleLampGives) {
  const auto image = [](bool mesh_light) {
    auto scene = std::make_unique<Scene>(Scene::Config{});
    Material glossy = test::diffuse(0.3f, 0.3f, 0.3f), lamp = test::diffuse(0, 0, 0);
    glossy.specular = {0.5f, 0.5f, 0.5f};
    glossy.shininess = 200.0f;
    lamp.emission = {5, 5, 5};
    scene->set_materials({glossy, lamp});
    Mesh mesh;
    test::add_quad(mesh, {-3, -3, 0}, {3, -3, 0}, {3, 3, 0}, {-3, 3, 0}, 0);
    if (mesh_light) test::add_quad(mesh, {-1, -1, 1}, {-1, 1, 1}, {1, 1, 1}, {1, -1, 1}, 1);
    scene->add_mesh(std::move(mesh));
    if (!mesh_light) {
      Light l;
      l.type = LightType::rectangle;
      l.position = {0, 0, 1};
      l.u = {2, 0, 0}, l.v = {0, -2, 0};
      l.value = {5, 5, 5};
      scene->set_lights({l});
    }
    Camera camera;
    camera.position = {0, -4, 0.9f};
    camera.right = {1, 0, 0}, camera.forward = normalize(Vec3f{0, 1, -0.3f});
    camera.up = cross(camera.right, camera.forward);
    camera.tan_half_fov_y = 0.2f;
    scene->set_camera(camera);
    Progress progress;
    scene->commit(progress);
    return test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(4096))}},
                        {.width = 32, .height = 16})
        .radiance;
  };
  const auto a = image(true), b = image(false);
  // Rows that see the floor alone, in four parts.
  const auto ra = region_means(a, 32, 16, 4), rb = region_means(b, 32, 16, 4);
  for (size_t i = 8; i < 16; ++i)
    EXPECT_NEAR(ra[i] / rb[i], 1.0, test::trimmed_noise(0.03)) << i;  // about 1 % of noise each
}

// A mirror on one wall, a rough metal block under a rough clear coat, a glass block: light by way of all of them.
std::unique_ptr<Scene> shiny_room() {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  Material mirror, metal, glass;
  mirror.lobe = metal.lobe = glass.lobe = LobeModel::ggx;
  mirror.diffuse = {0.9f, 0.9f, 0.9f}, mirror.metallic = 1.0f, mirror.roughness = 0.0f;
  metal.diffuse = {0.8f, 0.6f, 0.3f}, metal.metallic = 1.0f, metal.roughness = 0.5f;
  metal.coat = 1.0f, metal.coat_roughness = 0.4f, metal.coat_ior = 1.8f;
  glass.diffuse = {0.9f, 1.0f, 0.9f}, glass.transmission = 1.0f, glass.roughness = 0.0f, glass.ior = 1.5f;
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), mirror, metal, glass});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  mesh.triangle_materials[8] = mesh.triangle_materials[9] = 1;
  test::add_box(mesh, {-0.6f, 0.1f, -1.0f}, {-0.1f, 0.6f, -0.3f}, 2, false);
  test::add_box(mesh, {0.2f, -0.3f, -0.95f}, {0.6f, 0.2f, -0.5f}, 3, false);
  scene->add_mesh(std::move(mesh));
  Light lamp;
  lamp.type = LightType::rectangle;
  lamp.position = {0, 0, 0.9f};
  lamp.u = {0.8f, 0, 0}, lamp.v = {0, -0.8f, 0};  // shines down
  lamp.value = {5, 5, 5};
  scene->set_lights({lamp});
  scene->set_camera(inside_looking_along_y());
  Progress progress;
  scene->commit(progress);
  return scene;
}

TEST(Compensation, MirrorsMetalAndGlassShowWhatThePathTracerShows) {
  const auto scene = shiny_room();
  const auto truth = test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(48))}},
                                  {.width = 32, .height = 24, .samples = 64})
                         .radiance;
  constexpr int kPasses = static_cast<int>(test::trimmed(48));
  std::vector<Rgb> mean(truth.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    const auto image = test::render(*scene, "lightcuts", test::lights_of(*scene, 1000, 50 + pass),
                                    {{"compensate", "true"}, {"seed", std::to_string(50 + pass)}},
                                    {.width = 32, .height = 24, .samples = 8})
                           .radiance;
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += image[i] / float{kPasses};
  }
  EXPECT_NEAR(test::mean_luminance(mean) / test::mean_luminance(truth), 1.0, test::trimmed_noise(0.015));
  const auto found = region_means(mean, 32, 24, 3), expected = region_means(truth, 32, 24, 3);
  for (size_t i = 0; i < found.size(); ++i)
    EXPECT_NEAR(found[i], expected[i], test::trimmed_noise(0.03) * test::mean_luminance(truth))
        << "part " << i;  // caustics are noise in both: about 1 %
}

// What the clamp takes away comes back: in the mean over many sets of lights the image is the path tracer's.
TEST(Compensation, VirtualLightsMeanThePathTracersImage) {
  const auto scene = test::make_room();
  const auto truth =
      test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(96))}, {"max_depth", "32"}},
                   {.width = 32, .height = 24, .samples = 64})
          .radiance;
  constexpr int kPasses = static_cast<int>(test::trimmed(24));
  std::vector<Rgb> mean(truth.size()), clamped(truth.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    const VplSet vpls = test::lights_of(*scene, 1500, 100 + pass);
    // A clamp of 0.35 in a room of side 2: a loss nobody can miss.
    test::Settings settings{{"clamp_distance", "0.35"}, {"seed", std::to_string(100 + pass)}};
    const test::RenderOptions options{.width = 32, .height = 24, .samples = 4};
    const auto cut = test::render(*scene, "exhaustive", vpls, settings, options).radiance;
    settings.emplace_back("compensate", "true");
    const auto full = test::render(*scene, "exhaustive", vpls, settings, options).radiance;
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += full[i] / float{kPasses}, clamped[i] += cut[i] / float{kPasses};
  }
  EXPECT_LT(test::mean_luminance(clamped) / test::mean_luminance(truth), 0.95);
  const auto expected = region_means(truth, 32, 24, 4);
  EXPECT_NEAR(test::mean_luminance(mean) / test::mean_luminance(truth), 1.0, test::trimmed_noise(0.01));
  const auto found = region_means(mean, 32, 24, 4);
  for (size_t i = 0; i < found.size(); ++i)
    EXPECT_NEAR(found[i], expected[i], test::trimmed_noise(0.025) * test::mean_luminance(truth))
        << "part " << i;  // noise of both: up to 0.8 %
}

// A yard of two walls beneath a sky of three tones and a patch of sun, its ground of sharp gloss: half of a metal, half of
// a dielectric.
std::unique_ptr<Scene> yard() {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  std::vector<float> sky(size_t{32} * 16 * 3);
  for (size_t y = 0; y < 16; ++y)
    for (size_t x = 0; x < 32; ++x)
      for (size_t c = 0; c < 3; ++c)
        sky[(y * 32 + x) * 3 + c] = y >= 8 ? 0.1f : y == 3 && x == 7 ? 60.0f : 0.4f + 0.05f * static_cast<float>(x % 8);
  scene->set_textures({Texture(32, 16, 3, Texture::Format::float32, {}, sky.data())});
  Environment environment;
  environment.color = {1, 1, 1}, environment.texture = 0;
  scene->set_environment(environment);
  Material metal = test::diffuse(0.7f, 0.6f, 0.5f), lacquer = test::diffuse(0.2f, 0.3f, 0.4f);
  metal.lobe = lacquer.lobe = LobeModel::ggx, metal.specular = lacquer.specular = {1, 1, 1};
  metal.metallic = 1, metal.roughness = 0.22f, lacquer.roughness = 0.3f;
  scene->set_materials({test::diffuse(0.6f, 0.5f, 0.4f), metal, lacquer});
  Mesh mesh;
  test::add_quad(mesh, {-1, -1, -0.5f}, {0, -1, -0.5f}, {0, 1, -0.5f}, {-1, 1, -0.5f}, 1);
  test::add_quad(mesh, {0, -1, -0.5f}, {1, -1, -0.5f}, {1, 1, -0.5f}, {0, 1, -0.5f}, 2);
  test::add_quad(mesh, {-1, 1, -0.5f}, {1, 1, -0.5f}, {1, 1, 0.5f}, {-1, 1, 0.5f}, 0);
  test::add_quad(mesh, {-1, -1, -0.5f}, {-1, 1, -0.5f}, {-1, 1, 0.5f}, {-1, -1, 0.5f}, 0);
  scene->add_mesh(std::move(mesh));
  test::commit_seen_from(*scene, {0, -2.4f, 0.4f}, 0.5f);
  return scene;
}

// What rays bring and what virtual lights keep (suns in the sky, a part of rougher gloss) is all light, once.
TEST(Compensation, TracedGlossMeansThePathTracersImage) {
  const auto scene = yard();
  const auto truth =
      test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(64))}, {"max_depth", "32"}},
                   {.width = 32, .height = 24, .samples = 64})
          .radiance;
  constexpr int kPasses = static_cast<int>(test::trimmed(24));
  std::vector<Rgb> traced(truth.size());
  double by_pass = 0, of_lights = 0;
  std::vector<Rgb> before[2];
  for (int pass = 0; pass < kPasses; ++pass) {
    const VplSet vpls = test::lights_of(*scene, 1500, 100 + pass);
    EXPECT_GT(vpls.of_sky, 100u);
    for (const bool trace : {false, true}) {
      const auto image =
          test::render(
              *scene, "exhaustive", vpls,
              {{"seed", std::to_string(100 + pass)}, {"compensate", "true"}, {"trace_gloss", trace ? "true" : "false"}},
              {.width = 32, .height = 24, .samples = 4})
              .radiance;
      for (size_t i = 0; trace && i < traced.size(); ++i) traced[i] += image[i] / float{kPasses};
      // What neighbours share shows in blocks.
      if (pass > 0) {
        const auto a = region_means(image, 32, 24, 8), b = region_means(before[trace], 32, 24, 8);
        for (size_t i = 0; i < a.size(); ++i) (trace ? by_pass : of_lights) += (a[i] - b[i]) * (a[i] - b[i]);
      }
      before[trace] = image;
    }
  }
  EXPECT_LT(by_pass, 0.6 * of_lights) << "blots of virtual lights differ more between passes";
  EXPECT_NEAR(test::mean_luminance(traced) / test::mean_luminance(truth), 1.0, test::trimmed_noise(0.01));
  const auto found = region_means(traced, 32, 24, 4), expected = region_means(truth, 32, 24, 4);
  for (size_t i = 0; i < found.size(); ++i)
    EXPECT_NEAR(found[i], expected[i], test::trimmed_noise(0.025) * test::mean_luminance(truth)) << "part " << i;
}

// Spheres clamp nothing, so compensation brings the gloss alone: what is reflected evenly must not come twice.
TEST(Compensation, SpheresMeanThePathTracersImageAsTheyShrink) {
  const auto scene = test::make_room();
  const double truth = test::mean_luminance(
      test::render(*scene, "path_tracer", {}, {{"samples", std::to_string(test::trimmed(64))}, {"max_depth", "32"}},
                   {.width = 32, .height = 24, .samples = 64})
          .radiance);
  constexpr int kPasses = static_cast<int>(test::trimmed(12));
  const auto mean = [&](float scale, bool compensate) {
    double sum = 0;
    for (uint64_t pass = 0; pass < kPasses; ++pass)
      sum += test::mean_luminance(test::render(*scene, "exhaustive", test::lights_of(*scene, 1000, 100 + pass, scale),
                                               {{"clamp_distance", "0.35"},
                                                {"compensate", compensate ? "true" : "false"},
                                                {"virtual_lights", scale > 0.0f ? "spheres" : "points"},
                                                {"seed", std::to_string(100 + pass)}},
                                               {.width = 32, .height = 24, .samples = 2})
                                      .radiance);
    return sum / kPasses / truth;
  };
  const double points = mean(0.0f, false), alone = mean(1.0f, false), full = mean(1.0f, true), small = mean(0.2f, true);
  RecordProperty("of the path tracer", "points " + std::to_string(points) + ", spheres " + std::to_string(alone) +
                                           ", compensated " + std::to_string(full) + ", small ones " +
                                           std::to_string(small));
  std::printf("of the path tracer: points %.4f, spheres %.4f, compensated %.4f, small ones %.4f\n", points, alone, full,
              small);
  // Twelve sets of a thousand lights know the mean to about 1 %. Spheres of 0.17 in a room of side 2 lose light in its
  // corners; were any counted twice, it would be 5 % too much (the test above).
  EXPECT_NEAR(small, 1.0, test::trimmed_noise(0.015));
  EXPECT_NEAR(full, 0.97, test::trimmed_noise(0.03));
  EXPECT_LT(alone, full);
  EXPECT_LT(points, alone);
}

}  // namespace
}  // namespace lumicut
