// Small scenes in code, for tests of what lies below the C ABI.
#pragma once

#include <memory>

#include "core/rng.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut::test {

inline Vec3f random_direction(Rng& rng) {
  const float z = 2.0f * rng.next_float() - 1.0f, phi = 6.2831853f * rng.next_float(),
              r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

inline Vec3f random_point(Rng& rng, float half) {
  return {half * (2.0f * rng.next_float() - 1.0f), half * (2.0f * rng.next_float() - 1.0f),
          half * (2.0f * rng.next_float() - 1.0f)};
}

inline void add_quad(Mesh& mesh, Vec3f a, Vec3f b, Vec3f c, Vec3f d, uint32_t material) {
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c, d});
  mesh.indices.insert(mesh.indices.end(), {base, base + 1, base + 2, base, base + 2, base + 3});
  mesh.triangle_materials.insert(mesh.triangle_materials.end(), {material, material});
}

// Axis-aligned box whose faces look outwards, or inwards.
inline void add_box(Mesh& mesh, Vec3f lo, Vec3f hi, uint32_t material, bool inwards) {
  const Vec3f v[8] = {{lo.x, lo.y, lo.z}, {hi.x, lo.y, lo.z}, {hi.x, hi.y, lo.z}, {lo.x, hi.y, lo.z},
                      {lo.x, lo.y, hi.z}, {hi.x, lo.y, hi.z}, {hi.x, hi.y, hi.z}, {lo.x, hi.y, hi.z}};
  const int faces[6][4] = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 4, 7, 3}, {1, 2, 6, 5}};
  for (const auto& f : faces) {
    if (inwards)
      add_quad(mesh, v[f[3]], v[f[2]], v[f[1]], v[f[0]], material);
    else
      add_quad(mesh, v[f[0]], v[f[1]], v[f[2]], v[f[3]], material);
  }
}

inline Material diffuse(float r, float g, float b) {
  Material m;
  m.diffuse = {r, g, b};
  return m;
}

// A quad of one material, and nothing else; committed.
inline void commit_quad(Scene& scene, const Material& material, Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
  scene.set_materials({material});
  Mesh mesh;
  add_quad(mesh, a, b, c, d, 0);
  scene.add_mesh(mesh);
  Progress progress;
  scene.commit(progress);
}

// Commits the scene with a camera whose right is x, and which looks along y unless told otherwise.
inline void commit_seen_from(Scene& scene, Vec3f position, float tan_half_fov_y, const Vec3f& towards = {0, 1, 0}) {
  Camera camera;
  camera.position = position;
  camera.right = {1, 0, 0}, camera.forward = normalize(towards);
  camera.up = normalize(cross(camera.right, camera.forward));
  camera.tan_half_fov_y = tan_half_fov_y;
  scene.set_camera(camera);
  Progress progress;
  scene.commit(progress);
}

// A room of side 2 around the origin (times `scale`) with two blocks, a glossy floor, a coated wall, an upward area
// light and a spot.
inline std::unique_ptr<Scene> make_room(float scale = 1.0f, const std::string& accel = kDefaultAccel) {
  auto scene = std::make_unique<Scene>(Scene::Config{accel, true});
  Material glossy = diffuse(0.3f, 0.3f, 0.3f);
  glossy.specular = {0.4f, 0.4f, 0.4f};
  glossy.shininess = 60.0f;
  Material coated = diffuse(0.7f, 0.15f, 0.1f);
  coated.lobe = LobeModel::ggx;
  coated.specular = {1, 1, 1}, coated.roughness = 0.5f, coated.metallic = 0.3f;
  scene->set_materials({diffuse(0.7f, 0.7f, 0.7f), coated, diffuse(0.1f, 0.6f, 0.2f), glossy});
  Mesh mesh;
  add_box(mesh, Vec3f{-1, -1, -1} * scale, Vec3f{1, 1, 1} * scale, 0, true);
  mesh.triangle_materials[8] = mesh.triangle_materials[9] = 1;
  mesh.triangle_materials[10] = mesh.triangle_materials[11] = 2;
  mesh.triangle_materials[0] = mesh.triangle_materials[1] = 3;
  add_box(mesh, Vec3f{-0.6f, -0.1f, -1.0f} * scale, Vec3f{-0.1f, 0.5f, -0.2f} * scale, 0, false);
  add_box(mesh, Vec3f{0.2f, -0.5f, -1.0f} * scale, Vec3f{0.6f, 0.1f, -0.5f} * scale, 1, false);
  scene->add_mesh(std::move(mesh));
  Light lamp;
  lamp.type = LightType::rectangle;
  lamp.position = Vec3f{0, 0.5f, 0.3f} * scale;
  lamp.u = Vec3f{0.4f, 0, 0} * scale, lamp.v = Vec3f{0, 0.4f, 0} * scale;  // shines at the ceiling
  lamp.value = {20, 18, 15};
  Light spot;
  spot.type = LightType::spot;
  spot.position = Vec3f{0.5f, -0.7f, 0.9f} * scale;
  spot.direction = normalize(Vec3f{-0.4f, 0.6f, -1.0f});
  spot.cos_outer = 0.8f, spot.blend_cosine = 0.1f;
  spot.value = Rgb{2, 2, 3} * (scale * scale);
  scene->set_lights({lamp, spot});
  Camera camera;
  camera.position = Vec3f{0, -0.95f, 0.1f} * scale;
  camera.right = {1, 0, 0}, camera.forward = {0, 1, 0}, camera.up = {0, 0, 1};
  camera.tan_half_fov_y = 0.7f;
  scene->set_camera(camera);
  Progress progress;
  scene->commit(progress);
  return scene;
}

}  // namespace lumicut::test
