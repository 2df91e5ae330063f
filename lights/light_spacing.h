// How densely virtual lights lie: what the radius of virtual spherical lights and the clamp of point lights follow.
// [Hašan et al. 2009, sec. 4: the tenth nearest light]
#pragma once

#include <span>
#include <vector>

#include "core/progress.h"
#include "geometry/ball_query_tree.h"
#include "lights/vpl.h"

namespace lumicut {

class LightSpacing {
 public:
  static constexpr size_t kNeighbour = 10;

  // Of lights that have a position. `lonely`: the distance where there are less than two lights. The lights may go.
  // Throws Error(cancelled).
  LightSpacing(std::span<const Vpl> lights, float lonely, const Progress* progress);

  // Distance within which kNeighbour lights lie around a place; where there are fewer, as if they lay as densely
  // further out.
  float at(const Vec3f& position, BallQueryTree::Scratch& scratch) const;
  // The same around light i, itself and the `beside` lights before and after it not counted, for which the others stand
  // in. Of lights that were drawn independently both have one distribution (Mecke's formula), so that what a clamp takes
  // from them and what is given back elsewhere add up to all. Lights of one path are no such lights (they often lie in the
  // lamp that it started in), and stand beside each other.
  float of_light(size_t i, size_t beside, BallQueryTree::Scratch& scratch) const;

 private:
  float distance(const double* place, size_t itself, BallQueryTree::Scratch& scratch) const;

  std::vector<double> places_;
  float lonely_;
  BallQueryTree tree_;
};

}  // namespace lumicut
