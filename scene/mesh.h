// Triangles, what shades them, and where they stand.
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/material.h"

namespace lumicut {

// Numbers on a mesh that texture programs ask for.
enum class AttributeDomain : uint8_t { vertex, triangle, instance };

struct MeshAttribute {
  uint32_t id = 0;
  uint32_t components = 3;  // 1..4; 12 of instances: an affine map
  AttributeDomain domain = AttributeDomain::vertex;
  std::vector<float> values;
  LUMICUT_FIELDS(MeshAttribute, id, components, domain, values)
};

struct Mesh {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  // empty: flat
  std::vector<Vec2f> uvs;      // empty: 0
  std::vector<uint32_t> indices;
  std::vector<uint32_t> triangle_materials;  // empty: `material` for all
  std::vector<Transform> instances;          // empty: one, as it is
  std::vector<MeshAttribute> attributes;     // each of another id
  uint32_t material = 0;
  uint32_t mask = 0xffffffffu;  // RayKind: of the rays that see it
  uint32_t group = 0;
  LUMICUT_FIELDS(Mesh, positions, normals, uvs, indices, triangle_materials, instances, attributes, material, mask,
                 group)

  size_t triangle_count() const { return indices.size() / 3; }
  uint32_t material_of(uint32_t triangle) const {
    return triangle_materials.empty() ? material : triangle_materials[triangle];
  }
  const MeshAttribute* attribute(uint32_t id) const {
    for (const MeshAttribute& a : attributes)
      if (a.id == id) return &a;
    return nullptr;
  }
};

}  // namespace lumicut
