// Gloss that is left to rays: near its mirror direction a smooth surface sees few virtual lights of bounced light and of
// the sky, each as a blot; a ray by the lobe finds a place that all of them light, or the sky itself. [Davidovič et al. 2010 split
// light transport likewise, into what a global solution shows well and what is gathered locally]
#pragma once

#include <algorithm>
#include <cmath>

#include "bsdf/point_bsdf.h"
#include "scene/scene.h"

namespace lumicut {

// Up to the one α rays bring all (a roughness of .22), from the other on none (.35).
inline constexpr float kTracedAlpha = 0.05f, kLeftAlpha = 0.12f;
// And where rays follow the lobe with such a chance: seldom, they would bring more noise than blots are.
inline constexpr float kTracedShare = 0.2f, kLeftShare = 0.05f;
// The α of a cosine lobe about as wide.
inline float alpha_of_exponent(float n) { return std::sqrt(2.0f / (n + 2.0f)); }

// Share of the glossy lobe's light, bounced or of the sky, that rays bring.
inline float traced_gloss(const SurfacePoint& p) {
  if (!(max_component(p.specular) > 0.0f || max_component(p.grazing) > 0.0f)) return 0.0f;
  const auto smooth = [](float x, float none, float all) {
    x = std::clamp((x - none) / (all - none), 0.0f, 1.0f);
    return x * x * (3.0f - 2.0f * x);
  };
  const float of_alpha = smooth(p.lobe == kCosineLobe ? alpha_of_exponent(p.shape) : p.shape, kLeftAlpha, kTracedAlpha);
  return of_alpha > 0.0f ? of_alpha * smooth(PointBsdf(p).glossy_share(), kLeftShare, kTracedShare) : 0.0f;
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

// The point without that share: what virtual lights of such light shade.
inline SurfacePoint without_traced_gloss(SurfacePoint p) {
  const float left = 1.0f - traced_gloss(p);
  p.specular *= left, p.grazing *= left;
  return p;
}

// The part of the sky that rays bring: without suns and lamps, which they would meet by chance.
class EvenSky {
 public:
  explicit EvenSky(const Scene& scene) : scene_(scene) {
    const Environment& sky = scene.environment();
    const Rgb mean = sky.texture < 0 ? Rgb{1, 1, 1} : scene.textures()[sky.texture].average();
    if (!sky.reach.limited()) brightest_ = kBrightest * luminance(sky.color * mean);
  }
  bool has(const Vec3f& direction) const {
    return brightest_ > 0.0f && luminance(scene_.environment_radiance(direction)) <= brightest_;
  }

 private:
  static constexpr float kBrightest = 2.0f;  // over the mean of the map
  const Scene& scene_;
  float brightest_ = 0.0f;
};

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
