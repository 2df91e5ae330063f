// Level 1: rays against triangles or boxes.
#include <cstddef>

#include "accel/bvh.h"
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/descriptors.h"
#include "plugin/objects.h"

using namespace lumicut;

static_assert(sizeof(lumicut_ray) == sizeof(Ray) && offsetof(lumicut_ray, tfar) == offsetof(Ray, tfar) &&
              offsetof(lumicut_ray, flags) == offsetof(Ray, flags));
static_assert(sizeof(lumicut_hit) == sizeof(Hit) && offsetof(lumicut_hit, geom_id) == offsetof(Hit, geom) &&
              offsetof(lumicut_hit, inst_id) == offsetof(Hit, inst));
static_assert(sizeof(lumicut_rayhit) == sizeof(RayHit) && offsetof(lumicut_rayhit, hit) == offsetof(RayHit, hit));

namespace {

void check_array(const FieldValidator& c, const char* name, const void* array, const char* count_name, uint64_t count) {
  c.integer(count_name, count, 0, 0xfffffffeu);
  if (count > 0 && array == nullptr)
    c.fail(name, std::string("is NULL, but ") + count_name + " is " + number_text(count));
}

void copy_triangles(const lumicut_accel_desc& in, const FieldValidator& c, lumicut_accel_t& accel) {
  const uint64_t stride = in.position_stride == 0 ? 12 : in.position_stride;
  if (stride < 12 || stride > 4096) c.fail("position_stride", number_text(stride) + " is neither 0 nor in [12, 4096]");
  accel.positions.resize(in.position_count);
  const auto* bytes = reinterpret_cast<const unsigned char*>(in.positions);
  for (uint64_t i = 0; i < in.position_count; ++i, bytes += stride) {
    float p[3];
    std::memcpy(p, bytes, sizeof(p));
    for (int k = 0; k < 3; ++k) c.finite("positions", p[k], static_cast<int64_t>(3 * i) + k);
    accel.positions[i] = {p[0], p[1], p[2]};
  }
  if (in.triangle_count > 0) accel.indices.assign(in.indices, in.indices + 3 * in.triangle_count);
  for (size_t i = 0; i < accel.indices.size(); ++i)
    if (accel.indices[i] >= in.position_count)
      c.fail("indices",
             number_text(uint64_t{accel.indices[i]}) + " is not below position_count " + number_text(in.position_count),
             static_cast<int64_t>(i));
}

// Small batches run on the host's own thread; large ones on the device's.
template <typename T, typename Fn>
void trace(lumicut_accel_t& accel, T* rays, uint64_t count, const Fn& fn) {
  constexpr size_t kChunk = 4096;
  if (count == 0) return;
  if (rays == nullptr) fail_argument("rays: NULL, but count is " + number_text(count));
  if (count <= kChunk) return fn(std::span<T>(rays, count));
  accel.device->arena.run([&] {
    parallel_chunks(count, kChunk, [&](size_t begin, size_t end) { fn(std::span<T>(rays + begin, end - begin)); });
  });
}

const Tree& tree_of(lumicut_accel accel, const char* caller) {
  const Bvh* const bvh = object(accel).bvh;
  if (bvh == nullptr) fail_unsupported(std::string(caller) + ": \"embree\" does not show its nodes");
  return bvh->tree();
}

}  // namespace

lumicut_result lumicut_accel_build(lumicut_device device, const lumicut_accel_desc* desc, lumicut_accel* accel) {
  return guard([&] {
    lumicut_device_t& d = object(device);
    const lumicut_accel_desc in = read(desc);
    const FieldValidator c("lumicut_accel_desc");
    if (accel == nullptr) fail_argument("lumicut_accel_build: accel is NULL");
    const Scene::Config config = to_accel("lumicut_accel_desc", in.robust, in.kind, in.builder);
    const std::string& kind = config.accel;
    const AccelOptions options{config.robust, config.builder};
    check_array(c, "positions", in.positions, "position_count", in.position_count);
    check_array(c, "indices", in.indices, "triangle_count", in.triangle_count);
    check_array(c, "boxes", in.boxes, "box_count", in.box_count);
    if (in.box_count > 0 && in.triangle_count > 0)
      c.fail("boxes", "are given beside triangles; one accel holds one of them");
    if (kind == "embree" && in.box_count > 0) c.fail_unknown("boxes", "\"embree\" holds triangles alone");

    auto made = std::make_unique<lumicut_accel_t>();
    made->device = Ref(d);
    const auto keep_bvh = [&](std::unique_ptr<Bvh> bvh) {
      made->bvh = bvh.get();
      made->accel = std::move(bvh);
    };
    if (in.box_count > 0) {
      std::vector<Aabb> boxes(in.box_count);
      for (uint64_t i = 0; i < in.box_count; ++i) {
        const float* const b = in.boxes + 6 * i;
        boxes[i] = {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
      }
      d.arena.run([&] { keep_bvh(Bvh::from_boxes(boxes, options, nullptr, true)); });
    } else {
      copy_triangles(in, c, *made);
      AccelGeometry geometry;
      geometry.meshes.push_back(
          {made->positions.data(), made->positions.size(), made->indices.data(), in.triangle_count});
      d.arena.run([&] {
        if (kind == "bvh")
          keep_bvh(Bvh::from_geometry(geometry, options, nullptr, true));
        else
          made->accel = make_accel(kind, geometry, options);
      });
      if (made->bvh != nullptr) {  // it keeps triangles of its own
        made->positions = std::vector<Vec3f>();
        made->indices = std::vector<uint32_t>();
      }
    }
    *accel = made.release();
  });
}

lumicut_result lumicut_accel_get_info(lumicut_accel accel, lumicut_accel_info* info) {
  return guard([&] {
    const lumicut_accel_t& a = object(accel);
    const AccelInfo i = a.accel->info();
    lumicut_accel_info out{};
    out.node_count = a.bvh == nullptr ? 0 : static_cast<uint32_t>(a.bvh->tree().nodes.size());
    out.primitive_count = i.triangles;
    out.bytes = i.bytes;
    out.build_seconds = i.build_seconds;
    out.expected_boxes = i.expected_boxes;
    out.expected_primitives = i.expected_tris;
    out.expected_cost = i.expected_cost;
    for (int k = 0; k < 3 && !i.bounds.empty(); ++k) out.lower[k] = i.bounds.lo[k], out.upper[k] = i.bounds.hi[k];
    write(info, out);
  });
}

lumicut_result lumicut_accel_get_node(lumicut_accel accel, uint32_t index, lumicut_accel_node_info* node) {
  return guard([&] {
    const HugeArray<TreeNode>& nodes = tree_of(accel, "lumicut_accel_get_node").nodes;
    if (index >= nodes.size())
      fail_argument("lumicut_accel_get_node: index " + number_text(uint64_t{index}) + " is out of range: there are " +
                    number_text(uint64_t{nodes.size()}) + " nodes");
    const TreeNode& n = nodes[index];
    lumicut_accel_node_info out{};
    out.left = n.leaf() ? LUMICUT_NO_ID : n.first;
    out.right = n.leaf() ? LUMICUT_NO_ID : n.first + 1;
    out.first = n.leaf() ? n.first : 0;
    out.count = n.count;
    for (int k = 0; k < 3; ++k) out.lower[k] = n.lo[k], out.upper[k] = n.hi[k];
    write(node, out);
  });
}

lumicut_result lumicut_accel_get_primitives(lumicut_accel accel, const uint32_t** ids, uint64_t* count) {
  return guard([&] {
    const std::vector<uint32_t>& prims = tree_of(accel, "lumicut_accel_get_primitives").prims;
    if (ids == nullptr || count == nullptr) fail_argument("lumicut_accel_get_primitives: ids or count is NULL");
    *ids = prims.data();
    *count = prims.size();
  });
}

lumicut_result lumicut_accel_intersect(lumicut_accel accel, lumicut_rayhit* rays, uint64_t count) {
  return guard([&] {
    lumicut_accel_t& a = object(accel);
    trace(a, reinterpret_cast<RayHit*>(rays), count, [&](std::span<RayHit> part) { a.accel->intersect(part); });
  });
}

lumicut_result lumicut_accel_occluded(lumicut_accel accel, lumicut_ray* rays, uint64_t count) {
  return guard([&] {
    lumicut_accel_t& a = object(accel);
    trace(a, reinterpret_cast<Ray*>(rays), count, [&](std::span<Ray> part) { a.accel->occluded(part); });
  });
}
