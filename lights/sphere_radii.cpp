#include "lights/sphere_radii.h"

#include "core/parallel.h"
#include "lights/light_spacing.h"

namespace lumicut {

void make_spheres(std::span<Vpl> lights, float scale, float typical_radius, const Progress* progress) {
  if (lights.empty()) return;
  const float least = kLeastSphere * typical_radius;
  const LightSpacing spacing(lights, kLonelySphere * typical_radius, progress);
  parallel_chunks(lights.size(), 1024, [&](size_t begin, size_t end) {
    if (progress != nullptr) progress->check();
    BallQueryTree::Scratch scratch;
    for (size_t i = begin; i < end; ++i) {
      lights[i].kind = VplKind::sphere;
      lights[i].radius() = scale * std::max(spacing.of_light(i, 0, scratch), least);
    }
  });
}

}  // namespace lumicut
