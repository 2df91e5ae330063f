// A texture atlas and bounding boxes of face clusters. [Carr & Hart 2004, Fig. 1 and sec. 1: what the clusters are for]
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/face_mesh.h"
#include "geometry/point2.h"

namespace lumicut {

struct TextureAtlas {
  std::vector<std::array<Point2, 3>> corners;  // by face, in the unit square
  double scale = 0;                            // of the square's units a unit of the mesh: the same for all charts
  double used = 0;                             // share of the square that charts' triangles cover
  double shrink = 0;       // mean over the surface of 1 - area in the chart / area of the face: what projection loses
  size_t turned_away = 0;  // faces that look away from their chart, and may lie over others of it
  size_t charts = 0;
};

// Each cluster is projected along its mean normal, turned so that its box is least, and packed in rows. `gap`: between
// charts, in the square's units (0 to .1). The plainest atlas there is: no chart is unfolded.
TextureAtlas make_texture_atlas(const FaceMesh& mesh, std::span<const uint32_t> labels, double gap);

// Wavefront OBJ with the atlas as texture coordinates.
std::string obj_of(const FaceMesh& mesh, const TextureAtlas& atlas);

struct ClusterBox {
  uint32_t label;
  Vec3d lo, hi;
};
// Of the clusters that have faces, by label.
std::vector<ClusterBox> cluster_boxes(const FaceMesh& mesh, std::span<const uint32_t> labels);

}  // namespace lumicut
