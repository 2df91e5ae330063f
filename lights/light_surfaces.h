// Rectangles and disks that emit, as rays meet them. The camera sees few lights, but paths that leave surfaces do well to:
// close to a light, samples of its area alone are all noise. [Veach, Guibas 1995] And lamps with a radius that the
// camera sees.
#pragma once

#include <algorithm>
#include <limits>

#include "lights/light_boxes.h"
#include "scene/scene.h"

namespace lumicut {

class LightSurfaces {
 public:
  // Whose rays meet them. Of the camera: what it sees alone. By way of mirrors and glass from the camera: lamps and suns
  // with a radius too, which nothing else would show there. Paths, which left a surface that lights are sampled at:
  // lights that samples cannot stand for alone, and those lamps and suns too, for what comes by way of mirrors and glass;
  // of them seen under less than a degree to either side a part (kLeastSine).
  enum class RaysOf { camera, mirrors, paths };
  LightSurfaces(const Scene& scene, RaysOf rays);
  bool empty() const { return panels_.empty() && lamps_.empty() && suns_.empty(); }

  struct Hit {
    uint32_t light;  // of the scene
    float t, cosine;
    Rgb radiance;
    bool by_rays;  // those find it that leave points where lights are sampled too
  };
  // Lights that shine against a ray of unit direction, between its origin and `far`.
  template <typename Fn>
  void for_each_hit(const Vec3f& origin, const Vec3f& direction, float far, Fn&& fn) const {
    for_each_panel(origin, direction, far, fn);
    Hit hit;
    lamp_boxes_.for_each(origin, direction, far, [&](uint32_t i) {
      if (meet_lamp(lamps_[i], origin, direction, far, hit) && max_component(hit.radiance) > 0.0f) fn(hit);
    });
    for (const uint32_t sun : suns_)
      if (far == std::numeric_limits<float>::infinity() && meet_sun(sun, direction, hit)) fn(hit);
  }
  // Rectangles and disks alone: no other is `by_rays`.
  template <typename Fn>
  void for_each_panel(const Vec3f& origin, const Vec3f& direction, float far, Fn&& fn) const {
    Hit hit;
    panel_boxes_.for_each(origin, direction, far, [&](uint32_t i) {
      if (meet_panel(panels_[i], origin, direction, far, hit) && max_component(hit.radiance) > 0.0f) fn(hit);
    });
  }

 private:
  static float area(const Light& light);
  static bool has(const Light& light) { return light.type == LightType::rectangle || light.type == LightType::disk; }
  // Paths that left a surface meet a small lamp in a mirror seldom, as a dot: none is brighter than that of a lamp under
  // this sine to either side, of one degree. What is above it is lost.
  static constexpr float kLeastSine = 0.0174524f;
  bool meet_panel(uint32_t panel, const Vec3f& origin, const Vec3f& direction, float far, Hit& hit) const;
  bool meet_lamp(uint32_t lamp, const Vec3f& origin, const Vec3f& direction, float far, Hit& hit) const;
  bool meet_sun(uint32_t sun, const Vec3f& direction, Hit& hit) const;
  std::vector<Aabb> boxes_of_panels() const;
  std::vector<Aabb> boxes_of_lamps() const;

  // Of a lamp or sun that is seen under that sine, squared.
  float share_of(float sine2) const { return of_paths_ ? std::min(1.0f, sine2 / (kLeastSine * kLeastSine)) : 1.0f; }

  const Scene& scene_;
  const bool of_paths_;
  std::vector<uint32_t> panels_;        // rectangles and disks
  std::vector<uint32_t> lamps_, suns_;  // with a radius
  LightBoxes panel_boxes_, lamp_boxes_;
};

}  // namespace lumicut
