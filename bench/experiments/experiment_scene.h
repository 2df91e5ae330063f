// What the experiments render: a scene, its lights, the points that a small image shades, and the exhaustive sum there.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/bvh/meshes.h"
#include "scene/scene.h"
#include "vpl/vpl.h"

namespace lumicut::bench {

struct ExperimentScene {
  std::string name;
  std::unique_ptr<Scene> scene;
  VplSet lights;              // moved off their surfaces
  size_t direct = 0;          // the first of them: on the lamps; the rest is indirect light
  uint32_t side = 0;          // of the square image
  ShadePoints points;         // one a pixel, in Morton order of the image; pixels that see nothing are left out
  std::vector<float> spread;  // of each point: pixels that a unit length on its surface takes in the image (the root of
                              // the area that it takes)
  std::vector<Rgb> reference, reference_indirect;
  float clamp2 = 0.0f;
};

struct View {
  Vec3f eye, at;
  float fov_y;  // degrees
};

// Hits of a square camera.
void add_points(ExperimentScene& s, const View& view, uint32_t side);
// Exhaustive sums of lights [first, last).
std::vector<Rgb> exhaustive(const ExperimentScene& s, size_t first, size_t last);

// "conference" and "kitchen": positions alone of the scenes' meshes, white of albedo .6, our own lamps. Null where the
// mesh is not there.
std::unique_ptr<ExperimentScene> make_room(const std::string& name, uint32_t side, uint32_t direct, uint32_t indirect);
// A closed box, 2 x 2 x 2, with `mesh` (scaled to a height of .8) on its floor, glowing; `lights` on the mesh alone.
std::unique_ptr<ExperimentScene> make_lantern(const BenchMesh& mesh, uint32_t side, uint32_t lights);

// Root of the mean squared difference over the mean of the reference's channels.
double rmse(const std::vector<Rgb>& image, const std::vector<Rgb>& reference);
// Mean of |difference| over max(reference, .001 of its mean), luminance.
double mean_error(const std::vector<Rgb>& image, const std::vector<Rgb>& reference);

}  // namespace lumicut::bench
