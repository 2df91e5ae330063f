#include "accel/bvh.h"

#include <chrono>
#include <cmath>
#include <string>

#include "accel/validate.h"
#include "core/error.h"
#include "core/parallel.h"

namespace lumicut {
namespace {

struct Primitive {
  uint32_t mesh, prim;
};

struct Built {
  Tree tree;
  WideBvh wide;
};

Built build_meshes(const AccelGeometry& geometry, std::span<const uint32_t> meshes, const AccelOptions& options,
                   const BuildOptions& build, Progress* progress, bool number_through) {
  std::vector<Primitive> primitives;
  std::vector<uint32_t> number;  // of each primitive, counted through all meshes
  size_t count = 0;
  for (const uint32_t m : meshes) count += geometry.meshes[m].triangle_count;
  if (count > 0x1fffffffull)
    throw Error(ErrorCode::unsupported, "bvh: " + std::to_string(count) + " triangles are more than 2^29-1");
  primitives.reserve(count);
  uint32_t through = 0;
  for (const uint32_t m : meshes)
    for (uint32_t i = 0; i < geometry.meshes[m].triangle_count; ++i, ++through) {
      // No ray sees a mesh whose mask is 0. Leaving it out spares rays with all mask bits the test.
      if (geometry.meshes[m].mask == 0 || !in_range(triangle_of(geometry.meshes[m], i))) continue;
      primitives.push_back({m, i});
      if (number_through) number.push_back(through);
    }
  std::vector<Aabb> boxes(primitives.size());
  std::vector<float> areas(primitives.size());
  parallel_chunks(primitives.size(), 16384, [&](size_t begin, size_t end) {
    if (progress != nullptr) progress->check();
    for (size_t i = begin; i < end; ++i) {
      const Triangle t = triangle_of(geometry.meshes[primitives[i].mesh], primitives[i].prim);
      boxes[i].extend(t.v0), boxes[i].extend(t.v1), boxes[i].extend(t.v2);
      areas[i] = 0.5f * length(cross(t.v1 - t.v0, t.v2 - t.v0));
    }
  });
  Built built;
  built.tree = build_tree(boxes, build, progress);
  const bool robust = options.robust;
  built.wide = collapse(
      built.tree, areas, 4,
      [&](LeafBlock& block, int lane, uint32_t i) {
        const MeshView& mesh = geometry.meshes[primitives[i].mesh];
        const Triangle t = triangle_of(mesh, primitives[i].prim);
        const Vec3f rows[3] = {t.v0, robust ? t.v1 : t.v1 - t.v0, robust ? t.v2 : t.v2 - t.v0};
        for (int k = 0; k < 3; ++k)
          for (int axis = 0; axis < 3; ++axis) block.v[k][axis][lane] = rows[k][axis];
        block.prim[lane] = primitives[i].prim, block.geom[lane] = primitives[i].mesh;
        block.extent[lane] = max_component(boxes[i].extent());
      },
      progress);
  if (number_through)
    for (uint32_t& prim : built.tree.prims) prim = number[prim];
  return built;
}

// Box of the transformed vertices of a mesh: tighter than the transformed box.
Aabb world_box(const MeshView& mesh, const Transform& to_world) {
  Aabb box;
  for (size_t i = 0; i < mesh.triangle_count; ++i) {
    const Triangle t = triangle_of(mesh, i);
    if (!in_range(t)) continue;
    for (const Vec3f& v : {t.v0, t.v1, t.v2}) box.extend(to_world.point(v));
  }
  if (box.empty()) return box;
  // Margin for rounding in the transformation of rays.
  const Vec3f reach = max(max(box.hi, -box.lo), Vec3f{}) * 1e-6f;
  return {box.lo - reach, box.hi + reach};
}

}  // namespace

std::unique_ptr<Bvh> Bvh::from_geometry(const AccelGeometry& geometry, const AccelOptions& options, Progress* progress,
                                        bool keep_tree) {
  const auto start = std::chrono::steady_clock::now();
  validate(geometry, progress);
  const BuildOptions build = build_options_of(options.builder);
  std::unique_ptr<Bvh> bvh(new Bvh);
  bool filters = false;
  for (const MeshView& mesh : geometry.meshes) {
    const int filtered = (mesh.has_cutout ? kFilterAll | kFilterLight : 0) | (mesh.passes_light ? kFilterLight : 0);
    bvh->filtered_.push_back(static_cast<uint8_t>(filtered));
    bvh->mesh_masks_.push_back(mesh.mask);
    filters |= filtered != 0;
    bvh->scene_.masks |= mesh.mask != 0xffffffffu;
  }
  bvh->scene_.robust = options.robust;
  bvh->scene_.filter = filters ? geometry.filter : nullptr;
  bvh->scene_.filtered = bvh->filtered_.data();
  bvh->scene_.mesh_masks = bvh->mesh_masks_.data();
  AccelInfo& info = bvh->info_;
  if (geometry.instances.empty()) {
    std::vector<uint32_t> all(geometry.meshes.size());
    for (uint32_t m = 0; m < all.size(); ++m) all[m] = m, info.triangles += geometry.meshes[m].triangle_count;
    Built built = build_meshes(geometry, all, options, build, progress, keep_tree);
    bvh->top_ = std::move(built.wide);
    const TreeCost cost = cost_of(built.tree);
    info.expected_boxes = cost.boxes, info.expected_tris = cost.tris, info.expected_cost = cost.cost;
    info.nodes = built.tree.nodes.size();
    if (!built.tree.nodes.empty()) info.bounds = built.tree.nodes[0].box();
    if (keep_tree) bvh->tree_ = std::move(built.tree);
  } else {
    bvh->meshes_.resize(geometry.meshes.size());
    bvh->instances_.resize(geometry.instances.size());
    const Inverses inverses = invert_instances(geometry);
    bvh->scene_.limits = inverses.limits;
    std::vector<uint8_t> made(geometry.meshes.size(), 0);
    std::vector<Aabb> boxes;
    std::vector<uint32_t> ids;
    for (uint32_t i = 0; i < geometry.instances.size(); ++i) {
      const InstanceView& instance = geometry.instances[i];
      TraceScene::Instance& out = bvh->instances_[i];
      if (progress != nullptr) progress->check();
      if (!inverses.of[i]) continue;
      out.inverse = *inverses.of[i];
      if (made[instance.mesh] == 0) {
        made[instance.mesh] = 1;
        Built built = build_meshes(geometry, {&instance.mesh, 1}, options, build, progress, false);
        info.triangles += geometry.meshes[instance.mesh].triangle_count;
        info.nodes += built.tree.nodes.size();
        bvh->meshes_[instance.mesh] = std::move(built.wide);
      }
      out.bvh = &bvh->meshes_[instance.mesh];
      if (out.bvh->root == kEmptyChild) continue;
      const Aabb box = world_box(geometry.meshes[instance.mesh], instance.to_world);
      // Instances out of range are left out, as triangles are.
      if (box.empty() || !(max_component(max(box.hi, -box.lo)) <= kHugeCoordinate)) continue;
      boxes.push_back(box);
      ids.push_back(i);
    }
    Tree tree = build_tree(boxes, build, progress);
    const TreeCost cost = cost_of(tree);
    info.expected_boxes = cost.boxes, info.expected_tris = cost.tris, info.expected_cost = cost.cost;
    info.nodes += tree.nodes.size();
    if (!tree.nodes.empty()) info.bounds = tree.nodes[0].box();
    std::vector<float> areas(boxes.size());
    for (size_t i = 0; i < boxes.size(); ++i) areas[i] = boxes[i].half_area();
    bvh->top_ = collapse(tree, areas, 1, nullptr, progress);
    // Leaf words hold the index of an instance.
    const auto renumber = [&](uint32_t& word) {
      if (word != kEmptyChild && (word & kLeafBit) != 0) word = kLeafBit | ids[word & ~kLeafBit];
    };
    renumber(bvh->top_.root);
    for (size_t n = 0; n < bvh->top_.nodes.size(); ++n)
      for (uint32_t& word : bvh->top_.nodes[n].child) renumber(word);
    bvh->scene_.instanced = true;
    bvh->scene_.instances = bvh->instances_;
  }
  bvh->scene_.top = &bvh->top_;
  info.bytes = bvh->top_.bytes() + bvh->instances_.size() * sizeof(TraceScene::Instance);
  for (const WideBvh& mesh : bvh->meshes_) info.bytes += mesh.bytes();
  info.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return bvh;
}

std::unique_ptr<Bvh> Bvh::from_boxes(std::span<const Aabb> boxes, const AccelOptions& options, Progress* progress,
                                     bool keep_tree) {
  const auto start = std::chrono::steady_clock::now();
  const BuildOptions build = build_options_of(options.builder);
  if (boxes.size() > 0x1fffffffull)
    throw Error(ErrorCode::unsupported, "bvh: " + std::to_string(boxes.size()) + " boxes are more than 2^29-1");
  for (size_t i = 0; i < boxes.size(); ++i) {
    const Aabb& b = boxes[i];
    if (is_finite(b.lo) && is_finite(b.hi) && !b.empty() && max_component(max(b.hi, -b.lo)) <= kHugeCoordinate)
      continue;
    fail_argument("box " + std::to_string(i) + " is inverted or not finite: (" + std::to_string(b.lo.x) + ", " +
                  std::to_string(b.lo.y) + ", " + std::to_string(b.lo.z) + ") to (" + std::to_string(b.hi.x) + ", " +
                  std::to_string(b.hi.y) + ", " + std::to_string(b.hi.z) + ")");
  }
  std::unique_ptr<Bvh> bvh(new Bvh);
  Tree tree = build_tree(boxes, build, progress);
  std::vector<float> areas(boxes.size());
  for (size_t i = 0; i < boxes.size(); ++i) areas[i] = boxes[i].half_area();
  bvh->top_ = collapse(
      tree, areas, 4,
      [&](LeafBlock& block, int lane, uint32_t i) {
        for (int axis = 0; axis < 3; ++axis)
          block.v[0][axis][lane] = boxes[i].lo[axis], block.v[1][axis][lane] = boxes[i].hi[axis];
        block.prim[lane] = i, block.geom[lane] = 0;
      },
      progress);
  bvh->scene_.boxes = true;
  bvh->scene_.top = &bvh->top_;
  AccelInfo& info = bvh->info_;
  const TreeCost cost = cost_of(tree);
  info.triangles = boxes.size(), info.nodes = tree.nodes.size(), info.bytes = bvh->top_.bytes();
  info.expected_boxes = cost.boxes, info.expected_tris = cost.tris, info.expected_cost = cost.cost;
  if (!tree.nodes.empty()) info.bounds = tree.nodes[0].box();
  if (keep_tree) bvh->tree_ = std::move(tree);
  info.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return bvh;
}

}  // namespace lumicut
