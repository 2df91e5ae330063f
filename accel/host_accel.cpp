#include "accel/host_accel.h"

#include <optional>
#include <string>

#include "accel/validate.h"
#include "core/error.h"

namespace lumicut {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

class HostAccel final : public Accel {
 public:
  HostAccel(const HostCallbacks& callbacks, const AccelGeometry& geometry)
      : callbacks_(callbacks), geometry_(geometry) {
    for (const MeshView& mesh : geometry.meshes) info_.triangles += mesh.triangle_count;
    info_.bounds = bounds_of(geometry);
    for (const MeshView& mesh : geometry.meshes) passes_light_ |= mesh.passes_light && geometry.filter != nullptr;
    if (passes_light_) inverses_ = invert_instances(geometry).of;
  }

  AccelInfo info() const override { return info_; }

  void intersect(std::span<RayHit> rays) const override {
    if (rays.empty()) return;
    // Local, not per thread: callbacks may trace rays themselves.
    std::vector<float> limits(rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
      rays[i].hit = {};
      limits[i] = rays[i].ray.tfar;
    }
    callbacks_.intersect(callbacks_.user, rays.data(), rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
      RayHit& r = rays[i];
      if (r.hit.geom == kNoId || !is_traceable_to(r.ray, limits[i])) {
        r.hit = {};
        r.ray.tfar = limits[i];
        continue;
      }
      check(r, limits[i]);
      const Triangle t = triangle_of(geometry_.meshes[r.hit.geom], r.hit.prim);
      r.hit.ng = cross(t.v1 - t.v0, t.v2 - t.v0);
    }
  }

  void occluded(std::span<Ray> rays) const override {
    if (rays.empty()) return;
    const std::vector<Ray> asked(passes_light_ ? rays.begin() : rays.end(), rays.end());
    callbacks_.occluded(callbacks_.user, rays.data(), rays.size());
    if (passes_light_) pass_light(asked, rays);
  }

  void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz, size_t n,
                           uint8_t* out) const override {
    if (n == 0) return;
    std::vector<Ray> rays(n);
    for (size_t i = 0; i < n; ++i) {
      const Vec3f p{px[i], py[i], pz[i]};
      rays[i].org = origin.directional ? p : origin.light;
      rays[i].dir = origin.directional ? origin.light : p - origin.light;
      rays[i].tfar = origin.directional ? kInf : 0x1.fffffep-1f;
      rays[i].mask = origin.mask, rays[i].flags = origin.ray_flags();
    }
    HostAccel::occluded(rays);
    for (size_t i = 0; i < n; ++i) out[i] = rays[i].tfar == -kInf;
  }

 private:
  // Opens again the `rays` that are stopped by nothing but glass that light passes: the host knows surfaces alone, so
  // that its closest hits are gone through one by one.
  void pass_light(const std::vector<Ray>& asked, std::span<Ray> rays) const {
    constexpr int kMost = 64;
    std::vector<RayHit> open;
    std::vector<size_t> of;
    for (size_t i = 0; i < rays.size(); ++i)
      if (rays[i].tfar == -kInf) open.push_back({asked[i], {}}), of.push_back(i);
    for (int step = 0; step < kMost && !open.empty(); ++step) {
      intersect(open);
      size_t left = 0;
      for (size_t k = 0; k < open.size(); ++k) {
        RayHit& r = open[k];
        const size_t i = of[k];
        if (r.hit.geom == kNoId) {
          rays[i].tfar = asked[i].tfar;
          continue;
        }
        if (!lets_pass(r)) continue;
        r.ray.tnear = r.ray.tfar * (1.0f + 1e-5f) + 1e-12f, r.ray.tfar = asked[i].tfar;
        if (!(r.ray.tnear < r.ray.tfar)) {
          rays[i].tfar = asked[i].tfar;
          continue;
        }
        open[left] = r, of[left++] = i;
      }
      open.resize(left), of.resize(left);
    }
  }
  bool lets_pass(const RayHit& r) const {
    const Hit& h = r.hit;
    if (!geometry_.meshes[h.geom].passes_light) return false;
    Vec3f dir = r.ray.towards_light();
    if (h.inst != kNoId) {
      if (!inverses_[h.inst]) return false;
      dir = inverses_[h.inst]->vector(dir);
    }
    return geometry_.filter->passes_light({h.geom, h.inst, h.prim, h.u, h.v, dir});
  }

  static bool is_traceable_to(Ray ray, float limit) {
    ray.tfar = limit;
    return is_traceable(ray, {});
  }

  void check(const RayHit& r, float limit) const {
    const auto wrong = [](const std::string& field, const std::string& value, const std::string& range) {
      fail_argument("host intersect: " + field + " is " + value + ", not in " + range);
    };
    const Hit& h = r.hit;
    if (h.geom >= geometry_.meshes.size())
      wrong("hit.geom", std::to_string(h.geom), "[0, " + std::to_string(geometry_.meshes.size()) + ")");
    const size_t triangles = geometry_.meshes[h.geom].triangle_count;
    if (h.prim >= triangles) wrong("hit.prim", std::to_string(h.prim), "[0, " + std::to_string(triangles) + ")");
    if (geometry_.instances.empty() ? h.inst != kNoId : h.inst >= geometry_.instances.size())
      wrong("hit.inst", std::to_string(h.inst),
            geometry_.instances.empty() ? "{no instance}" : "[0, " + std::to_string(geometry_.instances.size()) + ")");
    // Barycentrics may leave the triangle by rounding.
    if (!(h.u >= -1e-3f && h.v >= -1e-3f && h.u + h.v <= 1.002f))
      wrong("hit.u + hit.v", std::to_string(h.u) + " + " + std::to_string(h.v), "the triangle");
    if (!(r.ray.tfar >= r.ray.tnear && r.ray.tfar <= limit))
      wrong("ray.tfar", std::to_string(r.ray.tfar),
            "[" + std::to_string(r.ray.tnear) + ", " + std::to_string(limit) + "]");
  }

  HostCallbacks callbacks_;
  AccelGeometry geometry_;
  bool passes_light_ = false;
  std::vector<std::optional<Transform>> inverses_;  // of the instances, where that is needed
  AccelInfo info_;
};

}  // namespace

std::unique_ptr<Accel> make_host_accel(const HostCallbacks& callbacks, const AccelGeometry& geometry) {
  if (callbacks.intersect == nullptr) fail_argument("host accel: intersect is null");
  if (callbacks.occluded == nullptr) fail_argument("host accel: occluded is null");
  validate(geometry, nullptr);
  return std::make_unique<HostAccel>(callbacks, geometry);
}

}  // namespace lumicut
