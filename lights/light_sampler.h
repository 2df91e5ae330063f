// All that emits in a scene, as one distribution: chosen by power, sampled in position and direction. [Keller 1997]
#pragma once

#include <optional>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"
#include "core/rng.h"
#include "lights/discrete_distribution.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

// What finds the light of an emissive mesh: samples stand for it where diffuse rays see it, and rays that leave a point
// that lights are sampled at find it too where glossy and shadow rays see it as well.
enum class MeshLight : uint8_t { by_samples, by_samples_and_rays, by_rays };
MeshLight mesh_light(const Mesh& mesh);

// Where a light path starts.
struct EmittedRay {
  Vec3f origin, direction;  // unit
  Rgb flux{};               // W that the path carries, already divided by its probability
  uint32_t group = 0;
  uint32_t emitter = 0;  // as LightSampler counts all
  // Of a disk that faces what it lights: from there light falls by d²/(d² + r²).
  Vec3f disk_centre{};
  float disk_radius = 0.0f;
  bool shadows = true;
  LightReach reach{};
};

// A virtual light that stands for emitters that are not points.
struct DirectSample {
  Vpl vpl;
  bool seen_by_rays = false;  // paths may find it too: a mesh, the environment, a rectangle or disk [light_surfaces.h]
  float offset = 0.0f;        // how far shadow rays end before its surface
  double density = 0.0;       // of what rays find: for each unit of area, or for each steradian of the environment
};

// Form of an emitter with extent.
struct EmitterShape {
  enum class Kind : uint8_t { triangle, rectangle, disk, sphere } kind;
  Vec3f corner;  // sphere: its centre
  Vec3f u, v;    // edges from there; a disk is the ellipse within their parallelogram
  Vec3f normal;  // unit, the side that emits; sphere: none
  float area;
  float radius = 0;  // sphere
  bool both_sides = false;
  Aabb bounds() const;
  // A place of its plane from the corner, in units of the edges.
  Vec2f along_edges(const Vec3f& at) const;
};

// Radiance of a rectangle or disk at the cosine to its axis, above 0; `value`: Scene::light_value.
Rgb light_radiance(const Light& light, const Rgb& value, float cosine);

class LightSampler {
 public:
  // Throws Error(cancelled) where `progress` is.
  explicit LightSampler(const Scene& scene, const Progress* progress = nullptr);
  bool empty() const { return power_.empty(); }

  // Lights without extent: one VPL each, exactly.
  const std::vector<Vpl>& delta_lights() const { return delta_; }
  // Which of all emitters each of them is (emitter_count()); kNoId: it has no power.
  const std::vector<uint32_t>& delta_emitters() const { return delta_emitter_; }
  // True where some emitter beside the environment has extent, and so needs many VPLs for its direct light.
  bool has_extended() const { return extended_ < sampler_.size(); }
  // Those emitters by number; what they are, empty for suns and for lamps with a radius but even spheres; and how large a part of the surface (m², one side) each of
  // `count` VPLs stands for. `s`: of shape(i), here and below.
  size_t extended_count() const { return sampler_.size() - extended_; }
  std::optional<EmitterShape> shape(size_t i) const;
  double cell(size_t i, const EmitterShape& s, uint64_t count, const DiscreteDistribution* chances = nullptr) const;
  // The place `at` on its surface as a virtual light, seen from `from`, that stands for the area `area`; ends of shadow
  // rays stand off it by `offset`.
  Vpl place_on(size_t i, const EmitterShape& s, const Vec3f& at, const Vec3f& from, float area, float& offset) const;
  // Their numbers: of a light, of a triangle in an instance of its mesh. Empty where it is none.
  std::optional<size_t> emitter_of_light(uint32_t light) const;
  std::optional<size_t> emitter_of_triangle(uint32_t mesh, uint32_t triangle, uint32_t instance) const;
  // One of `count` VPLs that stand for these emitters' direct light; `u` in [0,1) chooses the emitter by power, or by
  // other chances: of each of these emitters, here and in cell().
  Vpl sample_direct(double u, uint64_t count, Rng& rng, const DiscreteDistribution* chances = nullptr) const;
  // True where some mesh emits.
  bool has_meshes() const { return has_meshes_; }
  bool has_environment() const { return environment_share_ > 0.0; }
  // Of the power of environment and extended emitters.
  double environment_share() const { return environment_share_; }
  // VPL i of `count` that stand for the environment: stratified over its importance (a Hammersley set, jittered,
  // through the map's row and column distributions).
  Vpl environment_light(uint64_t i, uint64_t count, uint64_t seed) const;
  // `chances`: of all emitters, in place of their power.
  EmittedRay sample_ray(Rng& rng, const DiscreteDistribution* chances = nullptr) const;
  // All emitters, of which those with extent are the last: their number, a place within each (empty where it is
  // infinitely far), and chances by power.
  size_t emitter_count() const { return sampler_.size(); }
  std::optional<Vec3f> place_of(size_t emitter) const;
  double power_of(size_t emitter) const { return power_.sum(emitter, emitter + 1); }
  // One of those with extent as a virtual light, by chance.
  DirectSample sample_extended(size_t i, Rng& rng) const;
  // One VPL that stands for the direct light of environment and extended emitters, where there are any.
  DirectSample sample_light(Rng& rng) const;
  // Whether rays that leave a point that lights are sampled at may find extended emitter i. Spheres and suns are not there
  // for rays.
  bool found_by_rays(size_t i) const { return sampler_[extended_ + i].found_by_rays; }
  // Density with which sample_light draws a place on an emissive mesh, on a rectangle or disk, for each unit of area, and
  // a direction towards the environment, for each steradian.
  double mesh_density(const SurfaceHit& surface) const;
  double light_density(uint32_t light) const;
  double environment_density(const Vec3f& towards) const;
  // Emitted by all, W of luminance.
  double power() const { return power_.total(); }
  size_t bytes() const;

 private:
  enum class Kind : uint8_t { point, spot, profile, sphere, soft, rectangle, disk, sun, environment, triangle };
  // A sphere around all geometry.
  struct Surroundings {
    Vec3f center;
    float radius = 0.0f;  // 0: there is none
  };
  struct Emitter {
    Kind kind;
    uint32_t index;     // light, or mesh
    uint32_t instance;  // triangle
    uint32_t triangle;
    bool found_by_rays = false;  // of those with extent
    bool far = false;            // a lamp that all geometry is far from
  };
  struct Surface {  // a sampled point of an emitting surface
    Vec3f position, normal;
    Rgb radiance;
    float area_pdf;
    float offset;  // of rays from there
  };

  void add_lights(std::vector<double>& weights, const Progress* progress);
  double environment_power(const Progress* progress);
  void add_triangles(std::vector<double>& weights, const Progress* progress);
  void add_programmed(uint32_t material, const Progress* progress);
  // Luminance of what a triangle of an emissive material emits, in the mean over it.
  double mean_emission(const Material& material, uint32_t mesh, uint32_t triangle, uint32_t instance) const;
  bool is_found_by_rays(const Emitter& e) const;
  Surface sample_surface(const Emitter& e, Rng& rng) const;
  // A sample of an emitter with extent as a virtual light that stands for `weight` of it; a sun's has no area_pdf: 0.
  struct ExtendedSample {
    Vpl vpl;
    float area_pdf, offset;
  };
  static void spread(const Light& light, Vpl& v);
  ExtendedSample extended_light(const Emitter& e, float weight, Rng& rng) const;
  // Luminance of a rectangle or disk, in the mean over it.
  double mean_value(const Light& light) const;
  // Of sample_light: density of a place whose emission has this luminance on average.
  double area_density(double emission) const;
  // Direction towards the environment, its radiance and density per steradian, from u and v in [0,1).
  Vec3f sample_environment(double u, double v, Rgb& radiance, float& pdf) const;
  // Direction in which light of a sun travels.
  Vec3f sample_sun(const Light& light, Rng& rng) const;
  // Marks the lamps that are far from all geometry, whose paths are few by power and aimed at it.
  void find_far_lamps(std::vector<double> weights);
  // Where a path of that emitter starts, by its own directions; of a lamp that is far, by where geometry is.
  EmittedRay ray_from(const Emitter& e, Rng& rng) const;
  EmittedRay aimed_ray(const Emitter& e, Rng& rng) const;
  EmittedRay distant_ray(const Vec3f& travel, const Rgb& irradiance, Rng& rng) const;
  Vec3f offset(const Surface& s) const { return s.position + s.normal * s.offset; }

  const Scene& scene_;
  // Those without extent, the environment, and from extended_ on those that need VPLs: one distribution of them all.
  std::vector<Emitter> sampler_;
  size_t extended_ = 0;
  double environment_share_ = 0.0;
  bool has_meshes_ = false;
  DiscreteDistribution power_;
  DiscreteDistribution path_power_;  // in its place for the starts of paths; empty where no lamp is far
  Surroundings geometry_;
  std::vector<Vpl> delta_;
  std::vector<uint32_t> delta_emitter_;
  // Environment: density over texels, rows weighted by the sine of the polar angle.
  DiscreteDistribution texels_;
  // Mean luminance that a triangle with a texture emits, by mesh; empty for meshes without.
  std::vector<std::vector<float>> textured_;
};

}  // namespace lumicut
