// Triangles, what shades them, and where they stand.
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/material.h"
#include "scene/ray_kind.h"

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
  uint32_t not_lit_by = 0, not_blocking = 0;  // bits of sets that it is not in [scene/ray_kind.h]
  uint32_t receivers = 0, blockers = 0;       // sets for what it emits; 0: all
  LUMICUT_FIELDS(Mesh, positions, normals, uvs, indices, triangle_materials, instances, attributes, material, mask,
                 group, not_lit_by, not_blocking, receivers, blockers)

  size_t triangle_count() const { return indices.size() / 3; }
  uint32_t material_of(uint32_t triangle) const {
    return triangle_materials.empty() ? material : triangle_materials[triangle];
  }
  // As rays see it.
  uint32_t ray_mask() const {
    const uint32_t kinds = mask & kAllRays;
    return (kinds & kShadowRay) == 0 ? kinds : kinds | (~(not_blocking << kRayKinds) & ~kAllRays);
  }
  const MeshAttribute* attribute(uint32_t id) const {
    for (const MeshAttribute& a : attributes)
      if (a.id == id) return &a;
    return nullptr;
  }
};

}  // namespace lumicut
