// Where a scene's geometry lies and at what sizes. The bounding sphere of a whole scene says little of it: one forgotten
// object far away makes it a thousand times larger. What needs a length or aims at the scene asks this instead.
#pragma once

#include <span>
#include <vector>

#include "core/aabb.h"

namespace lumicut {

class SceneExtent {
 public:
  // A sphere around a part of the geometry, with the share of attention it gets.
  struct Part {
    Vec3f center;
    float radius, share;
  };

  SceneExtent() = default;
  // `boxes`: of the triangles, or of groups of them.
  explicit SceneExtent(std::vector<Aabb> boxes);

  // At most about twice kMostParts, which together hold all geometry; shares add up to 1. Things of one size (within a
  // factor of four) have as many parts as those of another, where there are so many: a distant ground of a few triangles
  // or a dome takes no more attention than a room.
  std::span<const Part> parts() const { return parts_; }
  // Where most of the parts lie, weighted by their shares: a distant object does not move it.
  const Vec3f& center() const { return center_; }
  // Typical distance of geometry from there: that of a plain room's walls. 1 without geometry.
  float radius() const { return radius_; }

  static constexpr size_t kMostParts = 64;

 private:
  void add_parts(std::vector<Aabb> boxes, size_t most);
  void add_surroundings();
  std::vector<Part> parts_;
  Vec3f center_{};
  float radius_ = 1.0f;
};

}  // namespace lumicut
