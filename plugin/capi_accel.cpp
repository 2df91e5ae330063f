// Level 1: rays against triangles or boxes.
#include <cstddef>

#include "plugin/check.h"
#include "plugin/descriptors.h"
#include "plugin/objects.h"

using namespace lumicut;

static_assert(sizeof(lumicut_ray) == sizeof(Ray) && offsetof(lumicut_ray, tfar) == offsetof(Ray, tfar) &&
              offsetof(lumicut_ray, flags) == offsetof(Ray, flags));
static_assert(sizeof(lumicut_hit) == sizeof(Hit) && offsetof(lumicut_hit, geom_id) == offsetof(Hit, geom) &&
              offsetof(lumicut_hit, inst_id) == offsetof(Hit, inst));
static_assert(sizeof(lumicut_rayhit) == sizeof(RayHit) && offsetof(lumicut_rayhit, hit) == offsetof(RayHit, hit));

namespace {

void check_array(const Checked& c, const char* name, const void* array, const char* count_name, uint64_t count) {
  c.integer(count_name, count, 0, 0xfffffffeu);
  if (count > 0 && array == nullptr)
    c.fail(name, std::string("is NULL, but ") + count_name + " is " + number_text(count));
}

void copy_triangles(const lumicut_accel_desc& in, const Checked& c, lumicut_accel_t& accel) {
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

}  // namespace

lumicut_result lumicut_accel_build(lumicut_device device, const lumicut_accel_desc* desc, lumicut_accel* accel) {
  return guard([&] {
    lumicut_device_t& d = object(device);
    const lumicut_accel_desc in = read(desc);
    const Checked c("lumicut_accel_desc");
    if (accel == nullptr) fail_argument("lumicut_accel_build: accel is NULL");
    c.integer("robust", in.robust, 0, 1);
    check_array(c, "positions", in.positions, "position_count", in.position_count);
    check_array(c, "indices", in.indices, "triangle_count", in.triangle_count);
    check_array(c, "boxes", in.boxes, "box_count", in.box_count);
    if (in.box_count > 0 && in.triangle_count > 0)
      c.fail("boxes", "are given beside triangles; one accel holds one of them");
    const std::string kind = in.kind == nullptr ? "agglomerative" : in.kind;
    if (kind == "embree" && in.box_count > 0) c.fail_unknown("boxes", "\"embree\" holds triangles alone");
    if (kind == "embree" && in.builder != nullptr) c.fail_unknown("builder", "\"embree\" has one builder of its own");

    auto made = std::make_unique<lumicut_accel_t>();
    made->device = Ref(d);
    copy_triangles(in, c, *made);
    AccelGeometry geometry;
    geometry.meshes.push_back(
        {made->positions.data(), made->positions.size(), made->indices.data(), in.triangle_count});
    d.arena.run([&] {
      made->accel = make_accel(kind, geometry, {in.robust != 0, in.builder == nullptr ? "" : in.builder});
    });
    *accel = made.release();
  });
}

lumicut_result lumicut_accel_get_info(lumicut_accel accel, lumicut_accel_info* info) {
  return guard([&] {
    const AccelInfo i = object(accel).accel->info();
    lumicut_accel_info out{};
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

lumicut_result lumicut_accel_get_node(lumicut_accel accel, uint32_t, lumicut_accel_node_info*) {
  return guard([&] {
    object(accel);
    fail_unsupported("lumicut_accel_get_node: this kind does not show its nodes");
  });
}

lumicut_result lumicut_accel_get_primitives(lumicut_accel accel, const uint32_t**, uint64_t*) {
  return guard([&] {
    object(accel);
    fail_unsupported("lumicut_accel_get_primitives: this kind does not show its nodes");
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
