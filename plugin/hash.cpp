#include "plugin/hash.h"

#include <cstring>

#include "core/rng.h"

namespace lumicut {

uint64_t hash_bytes(uint64_t seed, const void* data, size_t size) {
  const auto* bytes = static_cast<const uint8_t*>(data);
  uint64_t h = hash64(seed ^ size);
  for (; size >= 8; size -= 8, bytes += 8) {
    uint64_t word;
    std::memcpy(&word, bytes, 8);
    h = (h ^ word) * 0x9e3779b97f4a7c15ull;
    h ^= h >> 29;
  }
  uint64_t word = 0;
  std::memcpy(&word, bytes, size);
  return hash64(h ^ word);
}

uint64_t geometry_hash(const Scene& scene) {
  uint64_t h = 1;
  for (const Mesh& m : scene.meshes()) h = hash_array(hash_array(hash_array(h, m.positions), m.indices), m.instances);
  return h;
}

uint64_t scene_hash(const Scene& scene) {
  // Field by field: padding holds anything.
  std::vector<float> values;
  const auto add = [&](const Vec3f& v) { values.insert(values.end(), {v.x, v.y, v.z}); };
  for (const Material& m : scene.materials()) {
    add(m.diffuse), add(m.specular), add(m.emission);
    values.insert(values.end(),
                  {m.shininess, m.opacity, static_cast<float>(m.diffuse_texture), static_cast<float>(m.lobe),
                   m.fresnel ? 1.0f : 0.0f, m.roughness, m.metallic, m.ior, m.transmission, m.normal_strength,
                   static_cast<float>(m.normal_texture), static_cast<float>(m.height_texture), m.bump_distance,
                   m.bump_strength, static_cast<float>(m.roughness_texture), static_cast<float>(m.metallic_texture),
                   m.coat, m.coat_roughness, m.coat_ior});
  }
  for (const Light& l : scene.lights()) {
    add(l.value), add(l.position), add(l.direction), add(l.u), add(l.v);
    values.insert(values.end(), {static_cast<float>(l.type), l.radius, l.cos_outer, l.blend_cosine, l.spread});
  }
  add(scene.environment().color);
  const Camera& c = scene.camera();
  add(c.position), add(c.right), add(c.up), add(c.forward);
  values.insert(values.end(), {c.tan_half_fov_y, c.height, c.shift_x, c.shift_y, c.near_clip, c.far_clip,
                               c.pixel_aspect, c.lens_radius, c.focus_distance, c.orthographic ? 1.0f : 0.0f});
  uint64_t h = hash_array(geometry_hash(scene), values);
  for (const Mesh& m : scene.meshes()) h = hash_array(hash_array(h, m.triangle_materials), m.uvs);
  return h;
}

}  // namespace lumicut
