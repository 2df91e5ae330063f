// Upper bounds of what a cluster of lights can give to points. [Walter et al. 2005 sec. 4.1; Walter et al. 2006
// sec. 3.4]
#pragma once

#include "bsdf/shade_points.h"
#include "clustering/light_tree.h"

namespace lumicut {

// kLanes points, with frames around normal and mirror direction: what the bounds of a light node are evaluated against.
struct alignas(64) PointBlock {
  float position[3][kLanes];
  float normal[3][kLanes], tangent[3][kLanes], bitangent[3][kLanes];
  float mirror[3][kLanes], mirror_tangent[3][kLanes], mirror_bitangent[3][kLanes];
  float diffuse[3][kLanes], specular[3][kLanes], grazing[3][kLanes];
  float shape[kLanes], ior[kLanes], falloff[kLanes], retro[kLanes], dim[kLanes];
  float slope[kLanes], again[kLanes];  // where any point is grooved
  float smooth[3][kLanes];             // where any point is bent
  uint32_t lobe[kLanes];
  Lobes lobes = Lobes::none;  // of any of the points
  bool any_bent = false, any_grooved = false;
  bool bent() const { return any_bent; }
  bool grooved() const { return any_grooved; }

  // Points [first, first + kLanes) of `points`, first a multiple of kLanes.
  void load(const ShadePoints& points, size_t first);
};

// For each point: an upper bound of the luminance of the radiance that any way of summing the node's lights can give
// (each light's own, or the representative's at the summed intensity), visibility taken as 1.
// Conservative: tested against all pairs; 0 only where no light of the node reaches.
void light_node_bounds(const LightNode& node, const PointBlock& block, float* bounds);

}  // namespace lumicut
