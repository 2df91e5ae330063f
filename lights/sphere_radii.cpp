#include "lights/sphere_radii.h"

#include <array>

#include "core/parallel.h"
#include "geometry/ball_query_tree.h"

namespace lumicut {

void make_spheres(std::span<Vpl> lights, float scale, float scene_radius, const Progress* progress) {
  if (lights.empty()) return;
  const float least = kLeastSphere * scene_radius, largest = kLargestSphere * scene_radius;
  std::vector<double> places(3 * lights.size());
  for (size_t i = 0; i < lights.size(); ++i)
    for (int k = 0; k < 3; ++k) places[3 * i + static_cast<size_t>(k)] = static_cast<double>(lights[i].position[k]);
  const BallQueryTree tree(places, 3, progress);
  parallel_chunks(lights.size(), 1024, [&](size_t begin, size_t end) {
    if (progress != nullptr) progress->check();
    BallQueryTree::Scratch scratch;
    std::array<uint32_t, kSphereNeighbour + 1> index;  // with the light itself
    std::array<double, kSphereNeighbour + 1> dist2;
    for (size_t i = begin; i < end; ++i) {
      const size_t found = tree.nearest(&places[3 * i], index.size(), index.data(), dist2.data(), scratch);
      const float distance = found == index.size() ? static_cast<float>(std::sqrt(dist2.back())) : largest;
      lights[i].kind = VplKind::sphere;
      lights[i].radius() = scale * std::clamp(distance, least, largest);
    }
  });
}

}  // namespace lumicut
