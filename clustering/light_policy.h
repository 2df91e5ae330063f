// Clusters of lights: the dissimilarity of Lightcuts, for the agglomerative core. [Walter et al. 2008, Eq. 2]
//   d(A, B) = I·(L² + c²·S²)²
// of A∪B: I is the summed intensity, L the diagonal of the box of positions, c a sixteenth of the scene's diagonal, and S
// the sine of the half-angle of the cone of directions.
// Departs from the paper:
// - Eq. 2 prints (1 − S)², which rewards wide cones and breaks Eq. 1. S² is what the text around it describes.
// - S is the radius of the sphere around the box of unit directions, at most 1: the sine itself for narrow cones. The
//   sine of the cone through that sphere can fall when the box grows (a test shows it), and Eq. 1 would not hold.
// - A light counts with at least a millionth of the mean intensity, so that black lights cluster by place too.
#pragma once

#include <span>
#include <vector>

#include "accel/agglomerate.h"
#include "lights/vpl.h"

namespace lumicut {

struct LightLeaf {
  Vec3f position{};  // ignored for directional lights
  Vec3f normal{};    // unit; ignored for omni lights
  VplKind kind = VplKind::omni;
  float intensity = 0.0f;  // luminance, or any other measure; not below 0
};

// One tree of lights of one kind; see accel/agglomerate.h for what comes back. Costs are in units of (scene diagonal)⁴
// times the mean intensity. Lights at one place with one normal are joined first, in balanced subtrees: they cost
// nothing. `scene_diagonal`: of the scene's box, in the unit of the positions; above 0, or 0 when all lights share a
// place. Throws Error naming light, field and value on bad input, on kinds that differ, and Error(cancelled).
std::vector<Merge> agglomerate_lights(std::span<const LightLeaf> lights, float scene_diagonal, Strategy strategy,
                                      Progress* progress = nullptr);

// d(A, B) by Eq. 2 as above, from the joint boxes of positions and of unit directions and the joint intensity: for
// tests and for trees built otherwise.
inline float light_dissimilarity(float intensity, const Aabb& positions, const Aabb& directions, float scene_diagonal) {
  const float c2 = scene_diagonal * scene_diagonal / 256.0f;
  const float s2 = std::min(1.0f, 0.25f * directions.diagonal2());
  const float size2 = positions.diagonal2() + c2 * s2;
  return intensity * size2 * size2;
}

}  // namespace lumicut
