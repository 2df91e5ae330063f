#include "accel/embree_accel.h"

#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <mutex>
#include <new>
#include <thread>

#include "accel/embree_api.h"
#include "accel/validate.h"
#include "core/error.h"

namespace lumicut {
namespace {

static_assert(sizeof(Ray) == sizeof(RTCRay) && offsetof(Ray, tfar) == offsetof(RTCRay, tfar));
// Embree 4.3 has a further field (instPrimID) after these, which is not read here.
static_assert(sizeof(Hit) <= sizeof(RTCHit) && offsetof(Hit, inst) == offsetof(RTCHit, instID));
static_assert(offsetof(RayHit, hit) == offsetof(RTCRayHit, hit));

// State that Embree's callbacks write during a build, from any thread. They may report lack of memory, so they must not
// allocate.
struct DeviceState {
  std::mutex mutex;
  RTCError code = RTC_ERROR_NONE;
  char text[256] = "";
  std::atomic<int64_t> bytes{0};
  Progress* progress = nullptr;
};

void on_error(void* user, RTCError code, const char* text) {
  auto& state = *static_cast<DeviceState*>(user);
  const std::lock_guard lock(state.mutex);
  if (state.code != RTC_ERROR_NONE) return;
  state.code = code;
  std::snprintf(state.text, sizeof(state.text), "%s", text != nullptr ? text : "");
}

bool on_memory(void* user, ssize_t bytes, bool) {
  static_cast<DeviceState*>(user)->bytes.fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

// Returning false stops the build.
bool on_progress(void* user, double) {
  const auto& state = *static_cast<DeviceState*>(user);
  return state.progress == nullptr || !state.progress->cancelled();
}

struct FilterUser {
  const HitFilter* filter = nullptr;
  uint32_t mesh = 0;
};

// Of one ray or a packet, which Embree has taken to the mesh's space.
CandidateHit candidate(const RTCFilterFunctionNArguments* args, uint32_t mesh, unsigned i) {
  const unsigned n = args->N;
  CandidateHit hit{mesh,
                   RTCHitN_instID(args->hit, n, i, 0),
                   RTCHitN_primID(args->hit, n, i),
                   RTCHitN_u(args->hit, n, i),
                   RTCHitN_v(args->hit, n, i),
                   {RTCRayN_dir_x(args->ray, n, i), RTCRayN_dir_y(args->ray, n, i), RTCRayN_dir_z(args->ray, n, i)}};
  if ((RTCRayN_flags(args->ray, n, i) & kFromLight) != 0) hit.dir = -hit.dir;
  return hit;
}
void on_filter(const RTCFilterFunctionNArguments* args) {
  const auto& user = *static_cast<const FilterUser*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] != 0 && user.filter->passes(candidate(args, user.mesh, i))) args->valid[i] = 0;
}
// Of occlusion queries.
void on_light_filter(const RTCFilterFunctionNArguments* args) {
  const auto& user = *static_cast<const FilterUser*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] != 0 && user.filter->passes_light(candidate(args, user.mesh, i))) args->valid[i] = 0;
}

// Embree binds an allocator of each building thread to the scene's. When memory runs out during that, it stays bound to
// a scene allocator that is then freed, and the thread's next build writes there. So after memory ran out once, each
// build runs on a new thread.
std::atomic<bool> threads_spoiled{false};

class EmbreeAccel final : public Accel {
 public:
  EmbreeAccel(const AccelGeometry& geometry, const AccelOptions& options, Progress* progress) {
    const auto start = std::chrono::steady_clock::now();
    state_.progress = progress;
    // No threads of Embree's own: the build runs on the caller's arena. No cache for tessellation, which is not used:
    // if its allocation fails, Embree never releases a lock that the next device waits for.
    device_ = rtcNewDevice("start_threads=0,set_affinity=0,tessellation_cache_size=0");
    if (device_ == nullptr) {
      if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
      throw Error(ErrorCode::internal, "embree: no device can be made here");
    }
    rtcSetDeviceErrorFunction(device_, on_error, &state_);
    rtcSetDeviceMemoryMonitorFunction(device_, on_memory, &state_);
    try {
      if (threads_spoiled)
        build_apart(geometry, options);
      else
        build(geometry, options);
    } catch (const std::bad_alloc&) {
      threads_spoiled = true;
      release();
      throw;
    } catch (...) {
      release();
      throw;
    }
    state_.progress = nullptr;
    info_.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  ~EmbreeAccel() override { release(); }
  EmbreeAccel(const EmbreeAccel&) = delete;
  EmbreeAccel& operator=(const EmbreeAccel&) = delete;

  AccelInfo info() const override { return info_; }

  void intersect(std::span<RayHit> rays) const override {
    embree::Context context(false);
    RTCRayHit local{};  // aligned to 16 bytes for Embree; the caller's array may not be
    for (RayHit& r : rays) {
      r.hit = {};
      if (!is_traceable(r.ray, limits_)) continue;
      std::memcpy(static_cast<void*>(&local), &r, sizeof(r));
      local.ray.tnear = std::max(local.ray.tnear, 0.0f);
      context.intersect(scene_, &local);
      local.ray.tnear = r.ray.tnear;
      if (local.hit.geomID != RTC_INVALID_GEOMETRY_ID) std::memcpy(static_cast<void*>(&r), &local, sizeof(r));
    }
  }

  void occluded(std::span<Ray> rays) const override {
    embree::Context context(false);
    RTCRay local;
    for (Ray& r : rays) {
      if (!is_traceable(r, limits_)) continue;
      std::memcpy(&local, &r, sizeof(local));
      local.tnear = std::max(local.tnear, 0.0f);
      context.occluded(scene_, &local);
      r.tfar = local.tfar;
    }
  }

  void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz, size_t n,
                           uint8_t* out) const override {
    const Vec3f light = origin.light;
    const bool directional = origin.directional;
    embree::Context context(coherent_);
    constexpr size_t kWidth = 16;
    Packet<kWidth> packet;
    const bool sound = within(light, directional ? limits_.direction : limits_.origin);
    const float limit = directional ? limits_.origin : limits_.direction;
    // Common fields are written once: Embree modifies tfar only.
    for (size_t i = 0; i < kWidth; ++i) {
      for (int axis = 0; axis < 3; ++axis) packet.org[axis][i] = packet.dir[axis][i] = light[axis];
      packet.tnear[i] = packet.time[i] = 0.0f;
      packet.mask[i] = origin.mask, packet.flags[i] = origin.ray_flags(), packet.id[i] = 0;
    }
    const float reach = directional ? std::numeric_limits<float>::infinity() : 0x1.fffffep-1f;
    for (size_t begin = 0; begin < n; begin += kWidth) {
      const size_t count = std::min(kWidth, n - begin);
      alignas(64) float x[kWidth], y[kWidth], z[kWidth];
      if (count == kWidth) {
        for (size_t i = 0; i < kWidth; ++i) x[i] = px[begin + i], y[i] = py[begin + i], z[i] = pz[begin + i];
      } else {
        for (size_t i = 0; i < kWidth; ++i) {
          const size_t at = begin + std::min(i, count - 1);
          x[i] = px[at], y[i] = py[at], z[i] = pz[at];
        }
      }
      if (directional) {
        for (size_t i = 0; i < kWidth; ++i) packet.org[0][i] = x[i], packet.org[1][i] = y[i], packet.org[2][i] = z[i];
      } else {
        for (size_t i = 0; i < kWidth; ++i)
          packet.dir[0][i] = x[i] - light.x, packet.dir[1][i] = y[i] - light.y, packet.dir[2][i] = z[i] - light.z;
      }
      const float(&changing)[3][kWidth] = directional ? packet.org : packet.dir;
      for (size_t i = 0; i < kWidth; ++i) {
        const bool valid = i < count && sound && within({changing[0][i], changing[1][i], changing[2][i]}, limit);
        packet.valid[i] = valid ? -1 : 0;
        packet.tfar[i] = reach;
      }
      context.occluded16(packet.valid, scene_, reinterpret_cast<RTCRay16*>(packet.org));
      for (size_t i = 0; i < count; ++i)
        out[begin + i] = packet.valid[i] != 0 && packet.tfar[i] == -std::numeric_limits<float>::infinity();
    }
  }

 private:
  // RTCRayN: twelve arrays in RTCRay's order.
  template <size_t N>
  struct alignas(64) Packet {
    float org[3][N], tnear[N], dir[3][N], time[N], tfar[N];
    uint32_t mask[N], id[N], flags[N];
    int valid[N];
  };

  void check() const {
    if (state_.code == RTC_ERROR_NONE) return;
    if (state_.code == RTC_ERROR_CANCELLED) throw Error(ErrorCode::cancelled, "cancelled");
    if (state_.code == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw Error(ErrorCode::internal, std::string("embree: ") + state_.text);
  }

  RTCScene new_scene(const AccelOptions& options) {
    scenes_.reserve(scenes_.size() + 1);
    const RTCScene scene = rtcNewScene(device_);
    check();
    scenes_.push_back(scene);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(scene, options.robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcSetSceneProgressMonitorFunction(scene, on_progress, &state_);
    return scene;
  }

  void commit(RTCScene scene) {
    if (state_.progress != nullptr) state_.progress->check();
    rtcCommitScene(scene);
    check();
    rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
  }

  void add_mesh(RTCScene scene, const AccelGeometry& geometry, uint32_t id) {
    const MeshView& mesh = geometry.meshes[id];
    if (mesh.triangle_count == 0) return;
    const RTCGeometry geom = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    check();
    // Copied: Embree reads 16 bytes at the last position, past the end of a caller's array.
    void* positions =
        rtcSetNewGeometryBuffer(geom, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f), mesh.position_count);
    if (positions != nullptr) std::memcpy(positions, mesh.positions, mesh.position_count * sizeof(Vec3f));
    rtcSetSharedGeometryBuffer(geom, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.indices, 0, 3 * sizeof(uint32_t),
                               mesh.triangle_count);
    rtcSetGeometryMask(geom, mesh.mask);
    if ((mesh.has_cutout || mesh.passes_light) && geometry.filter != nullptr) {
      rtcSetGeometryUserData(geom, &filters_[id]);
      if (mesh.has_cutout) rtcSetGeometryIntersectFilterFunction(geom, on_filter);
      rtcSetGeometryOccludedFilterFunction(geom, on_light_filter);
    }
    rtcCommitGeometry(geom);
    rtcAttachGeometryByID(scene, geom, id);
    rtcReleaseGeometry(geom);
    check();
  }

  void build(const AccelGeometry& geometry, const AccelOptions& options) {
    filters_.resize(geometry.meshes.size());
    for (uint32_t m = 0; m < filters_.size(); ++m) filters_[m] = {geometry.filter, m};
    scene_ = new_scene(options);
    coherent_ = geometry.instances.empty();
    if (geometry.instances.empty()) {
      for (uint32_t m = 0; m < geometry.meshes.size(); ++m) {
        add_mesh(scene_, geometry, m);
        info_.triangles += geometry.meshes[m].triangle_count;
      }
    } else {
      const Inverses inverses = invert_instances(geometry);
      limits_ = inverses.limits;
      std::vector<RTCScene> inner(geometry.meshes.size(), nullptr);
      for (uint32_t i = 0; i < geometry.instances.size(); ++i) {
        const InstanceView& instance = geometry.instances[i];
        if (geometry.meshes[instance.mesh].triangle_count == 0 || !inverses.of[i]) continue;
        if (inner[instance.mesh] == nullptr) {
          inner[instance.mesh] = new_scene(options);
          add_mesh(inner[instance.mesh], geometry, instance.mesh);
          commit(inner[instance.mesh]);
          info_.triangles += geometry.meshes[instance.mesh].triangle_count;
        }
        const RTCGeometry geom = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
        check();
        rtcSetGeometryInstancedScene(geom, inner[instance.mesh]);
        rtcSetGeometryTransform(geom, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, instance.to_world.m);
        rtcSetGeometryMask(geom, 0xffffffffu);  // masks are those of the instanced mesh
        rtcCommitGeometry(geom);
        rtcAttachGeometryByID(scene_, geom, i);
        rtcReleaseGeometry(geom);
        check();
      }
    }
    commit(scene_);
    RTCBounds bounds;
    rtcGetSceneBounds(scene_, &bounds);
    if (bounds.lower_x <= bounds.upper_x) {
      info_.bounds.lo = {bounds.lower_x, bounds.lower_y, bounds.lower_z};
      info_.bounds.hi = {bounds.upper_x, bounds.upper_y, bounds.upper_z};
    }
    info_.bytes = static_cast<uint64_t>(std::max<int64_t>(0, state_.bytes.load()));
  }

  void build_apart(const AccelGeometry& geometry, const AccelOptions& options) {
    std::exception_ptr failure;
    std::thread([&] {
      try {
        tbb::task_arena(1).execute([&] { build(geometry, options); });
      } catch (...) {
        failure = std::current_exception();
      }
    }).join();
    if (failure) std::rethrow_exception(failure);
  }

  void release() {
    for (auto scene = scenes_.rbegin(); scene != scenes_.rend(); ++scene) rtcReleaseScene(*scene);
    scenes_.clear();
    if (device_ != nullptr) rtcReleaseDevice(device_);
    device_ = nullptr;
  }

  DeviceState state_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  // Only without instances, where coherent packets are 1.1 to 1.4 times as fast. With instances, Debian's build of
  // Embree 3.13.5 reads the octants of a coherent packet's rays from uninitialised stack memory (AVX-512) and may not
  // terminate.
  bool coherent_ = false;
  RayLimits limits_;
  std::vector<RTCScene> scenes_;
  std::vector<FilterUser> filters_;
  AccelInfo info_;
};

}  // namespace

bool has_embree() { return true; }

std::unique_ptr<Accel> make_embree_accel(const AccelGeometry& geometry, const AccelOptions& options,
                                         Progress* progress) {
  return std::make_unique<EmbreeAccel>(geometry, options, progress);
}

}  // namespace lumicut
