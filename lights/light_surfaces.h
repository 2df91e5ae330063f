// Rectangles and disks that emit, as rays meet them. The camera sees few lights, but paths that leave surfaces do well to:
// close to a light, samples of its area alone are all noise. [Veach, Guibas 1995] And lamps with a radius that the
// camera sees.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>

#include "scene/scene.h"

namespace lumicut {

class LightSurfaces final : private HitFilter {
 public:
  // Whose rays meet them. Of the camera: what it sees alone. By way of mirrors and glass from the camera: lamps and suns
  // with a radius too, which nothing else would show there. Paths, which left a surface that lights are sampled at:
  // lights that samples cannot stand for alone, and those lamps and suns too, for what comes by way of mirrors and glass;
  // of them seen under less than a degree to either side a part (kLeastSine).
  enum class RaysOf { camera, mirrors, paths };
  LightSurfaces(const Scene& scene, RaysOf rays);
  bool empty() const { return lights_.empty() && lamps_.empty() && suns_.empty(); }

  struct Hit {
    uint32_t light;  // of the scene
    float t, cosine;
    Rgb radiance;
    bool by_rays;  // those find it that leave points where lights are sampled too
  };
  // Lights that shine against a ray of unit direction, between its origin and `far`; rectangles and disks nearest first.
  template <typename Fn>
  void for_each_hit(const Vec3f& origin, const Vec3f& direction, float far, Fn&& fn) const {
    float near = 0.0f;
    Hit hit;
    for (int i = 0; i < kMostLights && !lights_.empty() && next(origin, direction, near, far, hit); ++i)
      if (max_component(hit.radiance) > 0.0f) fn(hit);
    for (const uint32_t lamp : lamps_)
      if (meet_lamp(lamp, origin, direction, far, hit) && max_component(hit.radiance) > 0.0f) fn(hit);
    for (const uint32_t sun : suns_)
      if (far == std::numeric_limits<float>::infinity() && meet_sun(sun, direction, hit)) fn(hit);
  }

 private:
  static float area(const Light& light);
  static bool has(const Light& light) { return light.type == LightType::rectangle || light.type == LightType::disk; }
  static constexpr int kMostLights = 64;  // along one ray
  // Paths that left a surface meet a small lamp in a mirror seldom, as a dot: none is brighter than that of a lamp under
  // this sine to either side, of one degree. What is above it is lost.
  static constexpr float kLeastSine = 0.0174524f;
  bool next(const Vec3f& origin, const Vec3f& direction, float& near, float far, Hit& hit) const;
  bool meet_lamp(uint32_t lamp, const Vec3f& origin, const Vec3f& direction, float far, Hit& hit) const;
  bool meet_sun(uint32_t sun, const Vec3f& direction, Hit& hit) const;
  bool passes(const CandidateHit& hit) const override;

  // Of a lamp or sun that is seen under that sine, squared.
  float share_of(float sine2) const { return of_paths_ ? std::min(1.0f, sine2 / (kLeastSine * kLeastSine)) : 1.0f; }

  const Scene& scene_;
  const bool of_paths_;
  std::vector<uint32_t> lights_;
  std::vector<uint32_t> lamps_, suns_;  // with a radius
  std::vector<Vec3f> positions_;
  std::vector<uint32_t> indices_;
  std::unique_ptr<Accel> accel_;
};

}  // namespace lumicut
