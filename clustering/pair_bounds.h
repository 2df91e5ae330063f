// Upper bounds of what a cluster of lights can give to any point of a cluster of points. [thesis Eq. 3.4; Walter et al.
// 2006 sec. 3.4]
#pragma once

#include "bsdf/lobes.h"
#include "clustering/light_tree.h"

namespace lumicut {

// kLanes clusters of points, structure of arrays: everything that a bound of a pair reads.
struct alignas(64) PointNodes {
  float center[3][kLanes], half[3][kLanes];  // box of positions
  // Frames of the cones of normals and of mirror directions (axis last: normal, mirror), and their half-angles.
  float normal[3][kLanes], tangent[3][kLanes], bitangent[3][kLanes], normal_cos[kLanes], normal_sin[kLanes];
  float mirror[3][kLanes], mirror_tangent[3][kLanes], mirror_bitangent[3][kLanes], mirror_cos[kLanes],
      mirror_sin[kLanes];
  float diffuse[3][kLanes];  // largest of the points, channel by channel
  float falloff[kLanes];     // least of the points
  // Largest k of bsdf/burley.h, at least 0, and least cosine to the viewer of the points that are Burley's or Oren and Nayar's.
  float burley_rise[kLanes], view_cosine[kLanes];
  float slope[kLanes], again[kLanes];  // largest of bsdf/oren_nayar.h
  float radius2[kLanes];               // squared half diagonal of the box
  // What bounds read of the points that have one of the lobes of bsdf/lobes.h.
  struct OfLobe {
    float specular[3][kLanes], grazing[3][kLanes];  // largest, channel by channel
    float shape_low[kLanes], shape_high[kLanes];    // least and largest
    float ior_low[kLanes], ior_high[kLanes];
    float view_cosine[kLanes];  // least cosine of the normal to the viewer
  } of_lobe[kLobeCount];
  uint32_t has_lobe = 0;      // bits of the lobes that some point has
  uint32_t used = 0;          // bits of the lanes that hold points; the others hold copies
  Lobes lobes = Lobes::none;  // of any of the points

  // Lane `lane` becomes the cluster of points [first, first + count) of `points`, count > 0.
  void set(size_t lane, const ShadePoints& points, size_t first, size_t count);
  // Lanes from `lane` on become copies of the one before.
  void pad(size_t lane);
};

// For each lane: an upper bound of the luminance of the radiance that any way of summing the node's lights can give to
// any point of the cluster, visibility taken as 1. The distance is that of the boxes, never
// below the lights' least clamp. Conservative: tested against all pairs; 0 only where no light reaches any point.
void pair_bounds(const LightNode& node, const PointNodes& nodes, float* bounds);

// For each lane: squared distance of the boxes of positions over the squared clamp distance's floor; directional lights
// are infinitely far.
void pair_distances2(const LightNode& node, const PointNodes& nodes, float* distances2);

}  // namespace lumicut
