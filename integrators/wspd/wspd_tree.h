// Well-separated pairs of virtual lights, kept in a compressed octree: all clusterings of the lights that points may
// need, before any point is known. [Bus, Mustafa and Biri 2015; thesis ch. 2, Def. 2.1-2.3, Alg. 1 and 3, Eq. 2.21]
// Departs: a subgroup is lit from its mean, not from its centre light; at most kMaxGroups subgroups a cluster; lights
// that share a finest cell of the octree share a leaf. Distant lights have no distance: they have an octree of
// directions and one clustering for all points. docs/decisions/0007-wspd-blocks.md
#pragma once

#include <array>
#include <span>
#include <vector>

#include "accel/accel.h"
#include "core/aabb.h"
#include "core/progress.h"
#include "lights/vpl.h"

namespace lumicut {

// A cluster of lights: a node of the octree. Trivial, so that states are saved as they lie.
struct WspdNode {
  static constexpr uint32_t kNone = 0xffffffffu;

  Vec3f center{};                             // of the ball b(C) around the lights; of distant lights: of directions
  float radius = 0.0f;                        // r(C)
  float power = 0.0f;                         // luminance of the summed intensity
  uint32_t first = 0, last = 0;               // lights
  uint32_t first_child = 0, child_count = 0;  // 0: a leaf
  uint32_t parent = kNone;
  uint32_t first_group = 0, group_count = 0;  // subgroups of like normals; none where no pair can use the node
  uint32_t cubemap = kNone;                   // kNone: all its lights reach its ball
  float largest_sphere = 0.0f;                // radius, of its lights that are spheres

  bool leaf() const { return child_count == 0; }
};
static_assert(sizeof(WspdNode) == 56);

// Directions of a cubemap: six faces of 6 x 6 cells. [thesis sec. 2.3]
inline constexpr size_t kCubeSide = 6, kCubeCells = 6 * kCubeSide * kCubeSide;
using Cubemap = std::array<uint8_t, kCubeCells>;  // R of Eq. 2.21, times 255
size_t cube_cell(const Vec3f& direction);
Vec3f cube_direction(size_t cell);  // unit, of the cell's centre

class WspdTree {
 public:
  static constexpr size_t kMaxGroups = 32;

  struct Options {
    float separation = 0.25f;        // ε of Def. 2.1
    float normal_threshold = 0.01f;  // of Alg. 3: distance between unit normals
    uint64_t seed = 1;
    const Accel* accel = nullptr;             // null: no cubemaps
    float epsilon = 0.0f;                     // the scene's: smaller clusters have no visibility of their own
    const LightProfiles* profiles = nullptr;  // those that the lights name; null: none do
  };

  // Lights without intensity are left out. Throws Error(cancelled), Error(out_of_memory) at more than 2^32 pairs.
  static WspdTree build(const std::vector<Vpl>& lights, const Options& options, Progress& progress);

  const std::vector<Vpl>& lights() const { return lights_; }  // reordered
  const std::vector<WspdNode>& nodes() const { return nodes_; }
  const WspdNode& node(uint32_t i) const { return nodes_[i]; }
  // Clusters that form pairs with the node's.
  std::span<const uint32_t> pairs(uint32_t node) const {
    return {pairs_.data() + pair_begin_[node], pairs_.data() + pair_begin_[node + 1]};
  }
  size_t pair_count() const { return pairs_.size() / 2; }  // {w, v} and {v, w} are one
  // What the node's lights are taken for: one light a subgroup, with its summed intensity. A leaf's only light is
  // exact.
  std::span<const Vpl> groups(const WspdNode& n) const { return {groups_.data() + n.first_group, n.group_count}; }
  // Clusters of the distant lights, the same for all points.
  const std::vector<uint32_t>& distant() const { return distant_; }
  // Root of the octree of positions; kNone where no light has one.
  uint32_t root() const { return root_; }

  // Leaf of a light that shares the smallest node around `p` with it: an approximate nearest light. [thesis sec. 2.2]
  // Needs a root.
  uint32_t near_leaf(const Vec3f& p) const;

  // Share of the cluster's light that leaves its ball along `direction` (any length). [thesis Eq. 2.21]
  float local_visibility(const WspdNode& n, const Vec3f& direction) const {
    return n.cubemap == WspdNode::kNone ? 1.0f
                                        : static_cast<float>(cubemaps_[n.cubemap][cube_cell(direction)]) / 255.0f;
  }

  size_t bytes() const;
  size_t cubemap_count() const { return cubemaps_.size(); }

  void save(std::vector<uint8_t>& out) const;
  // Throws Error(invalid_argument) where the bytes do not hold a tree, or one whose lights name other profiles; all
  // indices are checked.
  static WspdTree load(std::span<const uint8_t> bytes, const LightProfiles& profiles = {});

 private:
  struct Cube {
    Vec3f lower{};
    float side = 1.0f;
    std::array<double, 3> shift{};
    uint64_t code(const Vec3f& p) const;  // Morton, 21 bits an axis
  };

  uint32_t add_octree(const std::vector<Vpl>& lights, std::vector<uint32_t> members, bool distant, const Cube& cube);
  void find_balls(Progress& progress);
  void find_pairs(float separation, Progress& progress);
  void find_groups(const Options& options, Progress& progress);
  void find_cubemaps(const Options& options, Progress& progress);
  std::vector<uint8_t> used_nodes() const;
  void check(const LightProfiles& profiles) const;

  Cube cube_;
  std::vector<Vpl> lights_;
  std::vector<uint64_t> codes_;       // of lights with a position, rising
  std::vector<uint32_t> leaf_;        // of each of them
  std::vector<WspdNode> nodes_;       // parents before children
  std::vector<uint64_t> pair_begin_;  // nodes + 1
  std::vector<uint32_t> pairs_;
  std::vector<Vpl> groups_;
  std::vector<Cubemap> cubemaps_;
  std::vector<uint32_t> distant_;
  uint32_t root_ = WspdNode::kNone;
};

// Well-separated: Def. 2.1 for two balls, Def. 2.3.
inline bool well_separated(const WspdNode& a, const WspdNode& b, float separation) {
  return std::max(a.radius, b.radius) < separation * (length(a.center - b.center) - a.radius - b.radius);
}
// The same for a cluster and all points of a box.
inline bool well_separated(const Aabb& box, const WspdNode& n, float separation) {
  return n.radius < separation * (std::sqrt(box.dist2(n.center)) - n.radius);
}

}  // namespace lumicut
