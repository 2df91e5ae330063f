#include "io/scene_defaults.h"

#include <algorithm>
#include <numbers>

#include "io/sky.h"

namespace lumicut::io {

void set_camera(SceneData& scene, const Vec& eye, const Vec& back, const Vec& up) {
  lumicut_camera& camera = scene.camera;
  camera.struct_size = sizeof(camera);
  const Vec z = unit(back), x = unit(cross(up, z)), y = cross(z, x);
  for (size_t r = 0; r < 3; ++r) {
    const double row[4] = {x[r], y[r], z[r], eye[r]};
    for (size_t c = 0; c < 4; ++c) camera.to_world[4 * r + c] = static_cast<float>(row[c]);
  }
}

void frame_scene(SceneData& scene) {
  Vec low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  const auto add = [&](const Mesh& mesh, const Affine& m) {
    for (size_t p = 0; p < mesh.positions.size(); p += 3) {
      const Vec q = m.point({mesh.positions[p], mesh.positions[p + 1], mesh.positions[p + 2]});
      for (size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], q[k]), high[k] = std::max(high[k], q[k]);
    }
  };
  for (const Mesh& mesh : scene.meshes) {
    if (mesh.transforms.empty()) add(mesh, {});
    for (size_t t = 0; t < mesh.transforms.size(); t += 12) {
      Affine m;
      std::copy_n(&mesh.transforms[t], 12, m.m.begin());
      add(mesh, m);
    }
  }
  const Vec middle = (low + high) * 0.5, half = (high - low) * 0.5;
  const double radius = std::max(length(half), 1e-6), fov = 0.7;
  const Vec towards = unit({0.5, 0.4, 1});
  set_camera(scene, middle + towards * (1.05 * radius / std::sin(fov / 2)), towards, {0, 1, 0});
  scene.camera.fov_y = static_cast<float>(fov);
}

bool is_lit(const SceneData& scene) {
  if (!scene.lights.empty() || scene.environment) return true;
  for (const Mesh& mesh : scene.meshes)
    for (const uint32_t material : mesh.materials) {
      const auto& e = scene.materials[material].values.emission;
      if (e[0] + e[1] + e[2] > 0) return true;
    }
  return false;
}

void add_sky(SceneData& scene) {
  Sky sky;
  sky.sun_elevation = 50, sky.sun_azimuth = -60;
  Texture map;
  map.file = "sky";
  map.width = 512, map.height = 256, map.channels = 3;
  map.floats = sky.map(map.height, {0.2, 0.2, 0.2}, true);
  scene.textures.push_back(std::move(map));
  lumicut_environment environment{};
  environment.struct_size = sizeof(environment);
  for (float& c : environment.color) c = 1;
  environment.texture = static_cast<int32_t>(scene.textures.size());
  const float up[9] = {1, 0, 0, 0, 0, -1, 0, 1, 0};  // z is up in the map
  std::copy(up, up + 9, environment.world_to_map);
  scene.environment = environment;
  lumicut_light sun{};
  sun.struct_size = sizeof(sun);
  sun.type = LUMICUT_SUN, sun.value = 1, sun.radius = static_cast<float>(0.2666 * std::numbers::pi / 180);
  const auto irradiance = sky.sun_irradiance(), towards = sky.sun_direction();
  store(sun.color, irradiance);
  store(sun.direction, Vec{towards[0], towards[2], -towards[1]} * -1.0);
  scene.lights.push_back(sun);
  scene.light_names.emplace_back("sky");
}

}  // namespace lumicut::io
