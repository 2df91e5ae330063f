// Cells around random points, one in each cell of a lattice. [Worley 1996, "A Cellular Texture Basis Function"; smooth
// cells and distances to edges: Quilez, "Voronoi edges" and "Smooth Voronoi"]
#pragma once

#include "scene/noise.h"

namespace lumicut {

enum class VoronoiFeature : uint8_t { nearest, second, smooth, edge, radius };
enum class VoronoiMetric : uint8_t { euclidean, manhattan, chebyshev, minkowski };

struct VoronoiOptions {
  int dimensions = 3;
  VoronoiFeature feature = VoronoiFeature::nearest;
  VoronoiMetric metric = VoronoiMetric::euclidean;
  float exponent = 2.0f;    // Minkowski
  float smoothness = 0.0f;  // 0..1/2
  float randomness = 1.0f;  // 0..1: from the lattice itself to anywhere in its cells
};

struct VoronoiCell {
  float distance = 0.0f;
  Rgb color{};
  Vec4f position{};  // of the cell's point
};

// `edge` and `radius` (half the distance of the nearest point to its own neighbour) have a distance alone.
VoronoiCell voronoi(const Vec4f& p, const VoronoiOptions& options);

}  // namespace lumicut
