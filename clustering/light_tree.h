// Binary tree of light clusters, one tree a kind of light. [Walter et al. 2005; Walter et al. 2008 sec. 5]
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"
#include "lights/vpl.h"

namespace lumicut {

inline constexpr uint32_t kNoNode = 0xffffffffu;

// A cluster of lights: everything that a bound or an estimate reads, in two cache lines.
struct LightNode {
  Vec3f center{}, half{};  // of the box of positions; directional: unused
  // Frame of the cone of directions (axis last) and the box's half extents along it.
  Vec3f tangent{1, 0, 0}, bitangent{0, 1, 0}, axis{0, 0, 1};
  Vec3f frame_half{};
  float cos_half = -1.0f, sin_half = 0.0f;  // half-angle of the cone; spots: widened by their own opening
  Rgb intensity{};                          // summed
  uint32_t first_child = kNoNode;           // children are first_child and first_child + 1; kNoNode: a leaf
  uint32_t light = 0;                       // the representative, index into LightTree::lights (slot 0)
  VplKind kind = VplKind::omni;
  float least_distance2 = 0.0f;  // below which none of its lights comes nearer, squared; spheres: least radius²
  float largest_radius = 0.0f;   // spheres alone
  // Lobed lights: of their lobes over Lambert's the part that no cosine decides; what Burley's has more towards the horizon; and what is
  // Oren and Nayar's more, times the cosine, and over it.
  float largest_even = 0.0f, largest_rise = 0.0f, largest_groove = 0.0f, steepest_groove = 0.0f;

  bool leaf() const { return first_child == kNoNode; }
};

class LightTree {
 public:
  // Agglomerative (Eq. 2), or split in the middle of the longest axis: of positions (3D), or of positions and
  // directions scaled by a sixteenth of the scene's diagonal (6D). [Walter et al. 2008 sec. 5: the baselines]
  enum class Method { agglomerative, divisive_3d, divisive_6d };

  struct Options {
    Method method = Method::agglomerative;
    float scene_diagonal = 1.0f;
    uint32_t representatives = 1;  // slots: each an independent choice of representatives
    uint64_t seed = 1;
  };

  // Lights without intensity are left out. Throws Error(cancelled).
  static LightTree build(const std::vector<Vpl>& lights, const Options& options, Progress& progress);

  // Root of each kind's tree, kNoNode where there is none; and those there are.
  const std::vector<uint32_t>& roots() const { return roots_; }
  const LightNode& node(uint32_t i) const { return nodes_[i]; }
  size_t node_count() const { return nodes_.size(); }
  // The lights, reordered as the leaves lie in memory.
  const std::vector<Vpl>& lights() const { return lights_; }
  // Representative of a node in a slot: chosen with probability proportional to luminance; one child has the same.
  uint32_t representative(uint32_t node, uint32_t slot) const {
    return slot == 0 ? nodes_[node].light : slots_[slot - 1][node];
  }
  uint32_t slot_count() const { return static_cast<uint32_t>(slots_.size()) + 1; }
  size_t bytes() const;

 private:
  void add_kind(const std::vector<Vpl>& lights, const std::vector<uint32_t>& members, const Options& options,
                Progress& progress);

  std::vector<LightNode> nodes_;
  std::vector<Vpl> lights_;
  std::vector<uint32_t> roots_;
  std::vector<std::vector<uint32_t>> slots_;
};

}  // namespace lumicut
