// Where virtual lights matter to a camera: paths from it say which places light its picture, and light paths and lights
// are started and kept by that. [Georgiev and Slusallek 2010: Russian roulette on the contribution; importance from
// importons as in Peter and Pietrek 1998, whose density it is, smoothed over neighbours]
// All of it is chance alone: each light's mean over seeds is the same, whatever the importance says.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/progress.h"
#include "geometry/ball_query_tree.h"
#include "lights/discrete_distribution.h"
#include "scene/scene.h"

namespace lumicut {

class LightSampler;
struct VplOptions;

// Of the whole frame, whatever part of it is rendered.
struct FrameSize {
  uint32_t width = 0, height = 0;
  bool operator==(const FrameSize&) const = default;
};

class CameraImportance {
 public:
  // No light is kept with a smaller chance, and so none weighs more than one over it.
  static constexpr float kLeastChance = 1.0f / 32.0f;
  // What chance takes of the light of lights without extent has a variance of at most this share of its square; where
  // there are at most as many as one over it, all are kept.
  static constexpr double kDeltaVariance = 1.0 / 256.0;
  // Emitters are chosen by power for this share of all choices.
  static constexpr double kByPower = 0.125;

  // Of the scene's camera. `options`: of the light paths to come; their seed is that of a whole render. Deterministic.
  // Throws Error(cancelled).
  CameraImportance(const Scene& scene, const LightSampler& emitters, const VplOptions& options, FrameSize frame,
                   Progress& progress);

  // Chance with which a virtual light of a light path is kept that lies there and shines to the normal's side.
  float keep(const Vec3f& position, const Vec3f& normal, BallQueryTree::Scratch& scratch) const;
  // Chances of all emitters to start a light path.
  const DiscreteDistribution& path_starts() const { return path_starts_; }
  // How many lights a light path leaves, roughly.
  double lights_of_path() const { return lights_of_path_; }
  // Chances of emitters with extent to have a virtual light for their direct light.
  const DiscreteDistribution& direct() const { return direct_; }
  // Chance with which each of LightSampler::delta_lights() is kept.
  const std::vector<float>& keep_delta() const { return keep_delta_; }

 private:
  static constexpr size_t kNeighbours = 12;
  // Ends of camera paths, by the axis nearest to the side that they came from: +x, -x, +y, ...
  struct Importons {
    std::vector<Vec3f> places;
    std::vector<float> weights;
    std::unique_ptr<const BallQueryTree> tree;
  };
  struct CameraPoint {
    SurfacePoint point;
    float weight;
  };

  std::vector<CameraPoint> trace_camera_paths(const Scene& scene, FrameSize frame, uint64_t seed, Progress& progress);
  void weigh_path_starts(const Scene& scene, const LightSampler& emitters, const VplOptions& options,
                         const std::vector<std::vector<uint32_t>>& groups, Progress& progress);
  // What each emitter gives directly.
  static std::vector<double> root_mean_squares(const Scene& scene, const LightSampler& emitters, uint64_t seed,
                                               const std::vector<CameraPoint>& points,
                                               const std::vector<std::vector<uint32_t>>& groups, Progress& progress);
  void weigh_direct(const LightSampler& emitters, const std::vector<double>& learned);
  // Contribution of a light at the place, for each unit of its intensity, up to a factor that is the same everywhere.
  float density(const Vec3f& position, const Vec3f& normal, BallQueryTree::Scratch& scratch) const;

  std::array<Importons, 6> importons_;
  float typical_ = 0.0f;  // density at lights that matter; 0: none was found, and all are kept
  double lights_of_path_ = 0.0;
  DiscreteDistribution path_starts_, direct_;
  std::vector<float> keep_delta_;
};

}  // namespace lumicut
