// The BVH backend: a binary tree over triangles or boxes by any builder (bvh_build.h), collapsed to eight-wide nodes
// and traversed in SIMD (bvh/).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "accel/accel.h"
#include "accel/bvh/traverse.h"
#include "accel/bvh/wide_bvh.h"
#include "accel/bvh_build.h"

namespace lumicut {

class Bvh final : public Accel {
 public:
  // `options.builder`: see build_options_of. Throws as make_accel does. `keep_tree`: for tree() and primitives().
  // Positions and indices are read while this runs and not afterwards; the filter must outlive the Bvh.
  static std::unique_ptr<Bvh> from_geometry(const AccelGeometry& geometry, const AccelOptions& options,
                                            Progress* progress = nullptr, bool keep_tree = false);
  // Rays hit the boxes themselves, which are solid: at the entry, or at tnear for a ray that starts inside. hit.prim is
  // the box, hit.geom 0, hit.ng the side's unit normal (0 inside), u and v 0. Throws Error naming a box that is not
  // finite or inverted.
  static std::unique_ptr<Bvh> from_boxes(std::span<const Aabb> boxes, const AccelOptions& options,
                                         Progress* progress = nullptr, bool keep_tree = false);

  AccelInfo info() const override { return info_; }
  void intersect(std::span<RayHit> rays) const override { trace_closest(scene_, rays); }
  void occluded(std::span<Ray> rays) const override { trace_any(scene_, rays); }
  void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz, size_t n,
                           uint8_t* out) const override {
    trace_points(scene_, origin, px, py, pz, n, out);
  }

  // The binary tree: node 0 is the root, children are adjacent (TreeNode::first, first + 1), and a leaf's
  // primitives are primitives()[first, first + count). Empty without keep_tree, and for geometry with instances.
  // Primitives are numbered consecutively: those of mesh 1 follow those of mesh 0. Triangles that reach
  // past kHugeCoordinate are in no leaf.
  const Tree& tree() const { return tree_; }
  std::span<const uint32_t> primitives() const { return tree_.prims; }

 private:
  Bvh() = default;

  AccelInfo info_;
  Tree tree_;
  TraceScene scene_;
  WideBvh top_;
  std::vector<WideBvh> meshes_;  // by mesh, where there are instances
  std::vector<TraceScene::Instance> instances_;
  std::vector<uint8_t> filtered_;
  std::vector<uint32_t> mesh_masks_;
};

}  // namespace lumicut
