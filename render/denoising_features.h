// What guides a denoiser: albedo, normal and depth of the first surface on a camera ray's way that is no mirror and no
// smooth glass. Those are followed, always along the lobe that shows most, so that nothing here is noisy but the camera's
// samples. [the auxiliary images of Open Image Denoise, which asks for just that]
#pragma once

#include <vector>

#include "core/stats.h"
#include "scene/scene.h"

namespace lumicut {

struct DenoisingFeatures {
  Rgb albedo{};
  Vec3f normal{};      // unit; 0 where nothing is hit
  float depth = 0.0f;  // along the camera's axis, as if mirrors were windows

  DenoisingFeatures& operator+=(const DenoisingFeatures& o) {
    albedo += o.albedo, normal += o.normal, depth += o.depth;
    return *this;
  }
};

class FeatureTracer {
 public:
  // `pixels`: how many there are sums for.
  FeatureTracer(const Scene& scene, size_t pixels) : scene_(scene), sums_(pixels) {}

  // Rays that go on by way of mirrors and glass: of one thread, until follow().
  struct Way {
    uint32_t pixel;
    RayHit ray;
    Rgb throughput;
    Rgb absorption;
    float cosine, travelled;
    DenoisingFeatures seen;
    bool found;  // normal and depth
  };

  // A camera ray of pixel `pixel` that met nothing, or a surface; `cosine`: to the camera's axis.
  void miss(uint32_t pixel, const Vec3f& direction);
  void hit(uint32_t pixel, const SurfaceInteraction& at, float cosine, std::vector<Way>& ways);
  // Follows them to their ends. Pixels of other threads' ways are others.
  void follow(std::vector<Way> ways, const Progress& progress, Counters& counters);

  const DenoisingFeatures& sum(size_t pixel) const { return sums_[pixel]; }

 private:
  // What the surface adds; true: the way goes on.
  bool add(const SurfaceInteraction& at, Way& way) const;

  const Scene& scene_;
  std::vector<DenoisingFeatures> sums_;
};

}  // namespace lumicut
