// Lights with extent that lie near a place, drawn by solid angle: rectangles, disks, spheres and triangles of emissive
// meshes. Close to a light, the virtual lights that stand for it are clamped; what the clamp takes is sampled by this.
#pragma once

#include <optional>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"
#include "lights/light_sampler.h"

namespace lumicut {

class NearLights {
 public:
  // `lights`: how many virtual lights stand for the direct light of all emitters with extent; `clamp_lights`: so many of
  // them lie within the clamp distance of each; `distance`, above 0: the same for all instead. The sampler outlives this.
  // Throws Error(cancelled).
  NearLights(const LightSampler& sampler, uint64_t lights, double clamp_lights, float distance,
             const Progress& progress, const DiscreteDistribution* chances = nullptr);
  // No light reaches anywhere: nothing is to be sampled.
  bool empty() const { return nodes_.empty(); }
  // Whether any light may be near.
  bool near(const Vec3f& position) const;

  // A place on a near light as a virtual light, weighted by 1/density and by the share that the clamp takes from the
  // virtual lights there.
  struct Sample {
    Vpl vpl;
    float offset;        // how far a shadow ray ends before it
    double density;      // per steradian, seen from the position
    bool found_by_rays;  // spheres are not
  };
  // `choice`, `u`, `v` in [0, 1). Empty where chance finds nothing.
  std::optional<Sample> sample(const Vec3f& position, float choice, float u, float v) const;

  // For rays that find a rectangle, disk or triangle by themselves: the share that the clamp takes at `distance`, and the
  // density with which sample() draws that direction.
  struct Found {
    float lost = 0.0f;
    double density = 0.0;
  };
  Found find_light(const Vec3f& position, uint32_t light, float distance) const;
  Found find_triangle(const Vec3f& position, uint32_t mesh, uint32_t triangle, uint32_t instance, float distance) const;

 private:
  struct Node {
    Aabb box;
    float reach2 = 0.0f;  // largest of its lights
    float power = 0.0f;
    uint32_t first = 0, count = 0;  // leaf: of order_; inner: first child, the other follows, and 0
    uint32_t parent = 0;
  };
  void build(uint32_t node, uint32_t begin, uint32_t end, const Progress& progress);
  static float importance(const Aabb& box, float power, float reach2, const Vec3f& position);
  // The chance of an inner node's first child; empty where the clamp takes nothing from either.
  std::optional<float> share_of_first(const Node& parent, const Vec3f& position) const;
  float emitter_importance(uint32_t slot, const Vec3f& position) const;
  // `density`: the chance of the emitter alone.
  Found found(const Vec3f& position, uint32_t emitter, float distance) const;

  Found with_solid_angle(const Vec3f& position, uint32_t emitter, float distance) const;

  const LightSampler& sampler_;
  std::vector<Node> nodes_;
  std::vector<uint32_t> order_;              // emitters, as the leaves lie
  std::vector<uint32_t> slot_of_, leaf_of_;  // by emitter: its place in order_, its leaf
  std::vector<Aabb> boxes_;                  // by slot
  std::vector<float> reach2_, power_;        // by slot
};

}  // namespace lumicut
