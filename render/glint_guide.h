// Where rays of compensation look for light that gloss, a mirror or glass throws: where light paths of the same iteration
// came from that were thrown to places nearby. [Jensen 1995: importance driven path tracing by photons]
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/progress.h"
#include "core/vec.h"
#include "geometry/ball_query_tree.h"
#include "lights/vpl.h"

namespace lumicut {

class GlintGuide {
 public:
  static constexpr size_t kNearest = 16;

  // The glints outlive this. Throws Error(cancelled).
  GlintGuide(std::span<const Glint> glints, const Progress* progress);

  // Of one place: lobes [Fisher 1953] around the directions that its nearest glints came from.
  class Directions {
   public:
    bool empty() const { return count_ == 0; }
    // `choice`, `u`, `v` in [0, 1).
    Vec3f sample(float choice, float u, float v) const;
    float pdf(const Vec3f& direction) const;  // per steradian

   private:
    friend class GlintGuide;
    size_t count_ = 0;
    std::array<Vec3f, kNearest> directions_;
    std::array<float, kNearest> weights_, concentrations_;  // weights: sum 1
  };
  // Empty where fewer than two are known that come from above `normal` and from further than they lie apart.
  Directions at(const Vec3f& position, const Vec3f& normal, BallQueryTree::Scratch& scratch) const;

 private:
  std::span<const Glint> glints_;
  BallQueryTree tree_;
};

}  // namespace lumicut
