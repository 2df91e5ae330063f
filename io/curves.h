// Curves as thin as hair: cubic and quadratic splines as tubes and ribbons of triangles.
#pragma once

#include <cstdint>
#include <vector>

#include "io/affine.h"
#include "io/scene_builder.h"

namespace lumicut::io {

struct CurvePoint {
  Vec place;
  double radius = 0;
  Vec normal{0, 0, 0};  // of ribbons; 0 on tubes
};
using Strand = std::vector<CurvePoint>;
inline constexpr size_t kMostCurvePoints = 20000000;  // of one file

// Straight pieces that lie within a quarter of the radius of the curve through Bézier control points; radii and normals are
// linear between the ends. `degree` 2 or 3; points: degree + 1 and degree more for each further segment.
Strand bezier_strand(const Strand& points, size_t degree);
// The Bézier control points of a uniform B-spline of at least degree + 1 points. Its radii are a spline as well.
Strand bezier_of_bspline(const Strand& points, size_t degree);

// Where the points have no normals: prisms under smooth normals, on the average of all views as wide as round tubes, of
// twelve sides, or of three where there are many. uv: 0 to 1 along the strand, and across it as it is seen.
Geometry curve_geometry(const std::vector<Strand>& strands);

}  // namespace lumicut::io
