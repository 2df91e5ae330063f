// Random numbers that belong to the place of a point within its scene: the same in any batch, at any scale.
#pragma once

#include <bit>

#include "core/rng.h"
#include "scene/scene.h"

namespace lumicut {

inline Rng rng_at_point(const Scene& scene, const SurfacePoint& point, uint64_t seed, Stage stage) {
  const Vec3f at = (point.position - scene.extent().center()) / scene.extent().radius();
  const auto word = [](float a, float b) {
    return static_cast<uint64_t>(std::bit_cast<uint32_t>(a)) << 32 | std::bit_cast<uint32_t>(b);
  };
  return {seed, stage, word(at.x, at.y), word(at.z, point.normal.x + point.mirror.x)};
}

}  // namespace lumicut
