// Fingerprints: what a file of ours was made for, and whether it arrived whole. Against mistakes, not against intent.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "scene/scene.h"

namespace lumicut {

uint64_t hash_bytes(uint64_t seed, const void* data, size_t size);

template <typename T>
uint64_t hash_array(uint64_t seed, const std::vector<T>& v) {
  return hash_bytes(seed, v.data(), v.size() * sizeof(T));
}

// Of meshes and their instances.
uint64_t geometry_hash(const Scene& scene);
// Of all that an image shows, texels aside: geometry, materials, lamps, environment, camera.
uint64_t scene_hash(const Scene& scene);

}  // namespace lumicut
