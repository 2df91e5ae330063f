#include "io/scene_data.h"

#include <algorithm>
#include <cmath>

namespace lumicut::io {

double SceneData::surface_offset() const {
  double lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY}, largest = 0;
  const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  for (const auto& mesh : meshes) {
    const size_t instances = std::max<size_t>(1, mesh.transforms.size() / 12);
    for (size_t t = 0; t < instances; ++t) {
      const float* m = mesh.transforms.empty() ? identity : &mesh.transforms[t * 12];
      for (size_t i = 0; i + 2 < mesh.positions.size(); i += 3)
        for (size_t k = 0; k < 3; ++k) {
          const float* p = &mesh.positions[i];
          const double x =
              double{m[k * 4]} * p[0] + double{m[k * 4 + 1]} * p[1] + double{m[k * 4 + 2]} * p[2] + m[k * 4 + 3];
          lower[k] = std::min(lower[k], x), upper[k] = std::max(upper[k], x), largest = std::max(largest, std::abs(x));
        }
    }
  }
  double diagonal2 = 0;
  for (size_t k = 0; k < 3; ++k) diagonal2 += upper[k] > lower[k] ? (upper[k] - lower[k]) * (upper[k] - lower[k]) : 0;
  return std::max(2e-5 * 0.5 * std::sqrt(diagonal2), 4e-6 * largest);
}

lumicut_material default_material() {
  lumicut_material m{};
  m.struct_size = sizeof(m);
  m.opacity = 1;
  m.shininess = 1;
  for (float& c : m.diffuse) c = 0.5f;
  return m;
}

}  // namespace lumicut::io
