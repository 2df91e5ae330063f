// Gloss that is left to rays: near its mirror direction a smooth surface sees few virtual lights of bounced light, each as
// a blot; a ray by the lobe finds a place that all of them light. [Davidovič et al. 2010 split
// light transport likewise, into what a global solution shows well and what is gathered locally]
#pragma once

#include <algorithm>
#include <cmath>

#include "bsdf/point_bsdf.h"
#include "scene/scene.h"

namespace lumicut {

// Up to the one α rays bring all (a roughness of .35), from the other on none (.55).
inline constexpr float kTracedAlpha = 0.12f, kLeftAlpha = 0.3f;
// The α of a cosine lobe about as wide.
inline float alpha_of_exponent(float n) { return std::sqrt(2.0f / (n + 2.0f)); }

// Share of the glossy lobe's bounced light that rays bring.
inline float traced_gloss(const SurfacePoint& p) {
  if (!(max_component(p.specular) > 0.0f || max_component(p.grazing) > 0.0f)) return 0.0f;
  const float alpha = p.lobe == kCosineLobe ? alpha_of_exponent(p.shape) : p.shape;
  const float x = std::clamp((kLeftAlpha - alpha) / (kLeftAlpha - kTracedAlpha), 0.0f, 1.0f);
  return x * x * (3.0f - 2.0f * x);
}

// Whether any surface may have such a share; where, textures may decide.
inline bool may_trace_gloss(const Scene& scene) {
  return std::any_of(scene.materials().begin(), scene.materials().end(), [](const Material& m) {
    if (m.lobe != LobeModel::ggx)
      return max_component(m.specular) > 0.0f && alpha_of_exponent(m.shininess) < kLeftAlpha;
    return m.roughness * m.roughness < kLeftAlpha || m.roughness_texture >= 0 ||
           (m.rough_coat() && m.coat_alpha() < kLeftAlpha);
  });
}

// The points without that share: what virtual lights of bounced light shade.
inline ShadePoints without_traced_gloss(const ShadePoints& points) {
  ShadePoints rest;
  rest.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    SurfacePoint p = points.get(i);
    const float left = 1.0f - traced_gloss(p);
    p.specular *= left, p.grazing *= left;
    rest.push(p);
  }
  rest.finish();
  return rest;
}

// Of what a sample towards the direction carries: the part, for each channel, that is of this share.
inline Rgb traced_part(const SurfacePoint& p, const Vec3f& direction) {
  const float share = traced_gloss(p);
  if (!(share > 0.0f)) return {};
  SurfacePoint gloss = p;
  gloss.diffuse = {};
  const Rgb all = reflectance(p, direction), of_gloss = reflectance(gloss, direction) * share;
  const auto part = [](float x, float whole) { return whole > 0.0f ? std::min(1.0f, x / whole) : 0.0f; };
  return {part(of_gloss.x, all.x), part(of_gloss.y, all.y), part(of_gloss.z, all.z)};
}

}  // namespace lumicut
