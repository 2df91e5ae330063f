// What all GGX lobes share: Smith's height-correlated masking, visible half vectors.
// [Walter et al. 2007; Heitz 2014]
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/vec.h"

namespace lumicut {

// α = roughness². Sharper lobes are specular: rays follow them, for point lights cannot shade them.
inline constexpr float kLeastAlpha = 0.01f;

// Whether a clear coat is specular. `coat`: its share of the surface.
inline bool smooth_coat(float coat, float alpha) { return coat > 0.0f && alpha < kLeastAlpha; }

// √(c²(1 − α²) + α²): cosine times √(1 + tan²·α²), of Smith's masking.
inline float ggx_root(float alpha2, float cosine) { return std::sqrt(cosine * cosine * (1.0f - alpha2) + alpha2); }

// A half vector about +z as seen from `view` (unit, z > 0): by the area it shows. [Heitz 2018]
inline Vec3f sample_visible_normal(const Vec3f& view, float alpha, float u, float v) {
  const Vec3f h = normalize(Vec3f{alpha * view.x, alpha * view.y, view.z});
  const float flat2 = h.x * h.x + h.y * h.y;
  const Vec3f t = flat2 > 1e-12f ? Vec3f{-h.y, h.x, 0.0f} / std::sqrt(flat2) : Vec3f{1.0f, 0.0f, 0.0f};
  const Vec3f b = cross(h, t);
  const float r = std::sqrt(u), phi = 2.0f * std::numbers::pi_v<float> * v;
  const float x = r * std::cos(phi), s = 0.5f * (1.0f + h.z);
  const float y = (1.0f - s) * std::sqrt(std::max(0.0f, 1.0f - x * x)) + s * r * std::sin(phi);
  const Vec3f n = t * x + b * y + h * std::sqrt(std::max(0.0f, 1.0f - x * x - y * y));
  return normalize(Vec3f{alpha * n.x, alpha * n.y, std::max(1e-6f, n.z)});
}

}  // namespace lumicut
