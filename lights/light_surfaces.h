// Rectangles and disks that emit, as rays meet them. The camera does not see lights, but paths that leave surfaces do
// well to: close to a light, samples of its area alone are all noise. [Veach, Guibas 1995]
#pragma once

#include <memory>

#include "scene/scene.h"

namespace lumicut {

class LightSurfaces final : private HitFilter {
 public:
  explicit LightSurfaces(const Scene& scene);
  bool empty() const { return lights_.empty(); }

  struct Hit {
    uint32_t light;  // of the scene
    float t, cosine;
    Rgb radiance;
  };
  // Lights that shine against a ray of unit direction, between its origin and `far`; nearest first.
  template <typename Fn>
  void for_each_hit(const Vec3f& origin, const Vec3f& direction, float far, Fn&& fn) const {
    float near = 0.0f;
    Hit hit;
    for (int i = 0; i < kMostLights && next(origin, direction, near, far, hit); ++i)
      if (max_component(hit.radiance) > 0.0f) fn(hit);
  }

 private:
  static float area(const Light& light);
  static bool has(const Light& light) { return light.type == LightType::rectangle || light.type == LightType::disk; }
  static constexpr int kMostLights = 64;  // along one ray
  bool next(const Vec3f& origin, const Vec3f& direction, float& near, float far, Hit& hit) const;
  bool passes(uint32_t mesh, uint32_t prim, float u, float v) const override;

  const Scene& scene_;
  std::vector<uint32_t> lights_;
  std::vector<Vec3f> positions_;
  std::vector<uint32_t> indices_;
  std::unique_ptr<Accel> accel_;
};

}  // namespace lumicut
