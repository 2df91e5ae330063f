#include "plugin/host_trace.h"

#include "accel/host_accel.h"
#include "plugin/check.h"
#include "plugin/descriptors.h"

namespace lumicut {

namespace {

class HostTrace final : public Accel {
 public:
  HostTrace(const lumicut_trace& host, const AccelGeometry& geometry)
      : host_(host),
        instanced_(!geometry.instances.empty()),
        first_(geometry.meshes.size(), 0),
        count_(geometry.meshes.size(), 0) {
    // A mesh's instances lie together, in the order of its transforms.
    for (size_t i = geometry.instances.size(); i-- > 0;) {
      const uint32_t mesh = geometry.instances[i].mesh;
      first_[mesh] = static_cast<uint32_t>(i);
      ++count_[mesh];
    }
    inner_ = make_host_accel({intersect_batches, occluded_batches, this}, geometry);
  }

  AccelInfo info() const override { return inner_->info(); }
  void intersect(std::span<RayHit> rays) const override { inner_->intersect(rays); }
  void occluded(std::span<Ray> rays) const override { inner_->occluded(rays); }
  void occluded_from_point(const BundleOrigin& origin, const float* px, const float* py, const float* pz, size_t n,
                           uint8_t* occluded) const override {
    inner_->occluded_from_point(origin, px, py, pz, n, occluded);
  }

 private:
  static void intersect_batches(void* user, RayHit* rays, size_t n) {
    const auto& self = *static_cast<const HostTrace*>(user);
    for (size_t begin = 0; begin < n; begin += self.host_.batch) {
      const size_t count = std::min<size_t>(self.host_.batch, n - begin);
      self.host_.intersect(self.host_.user, reinterpret_cast<lumicut_rayhit*>(rays + begin), count);
    }
    for (size_t i = 0; i < n; ++i)
      if (rays[i].hit.geom != kNoId) self.set_instance(rays[i].hit);
  }

  static void occluded_batches(void* user, Ray* rays, size_t n) {
    const auto& self = *static_cast<const HostTrace*>(user);
    for (size_t begin = 0; begin < n; begin += self.host_.batch) {
      const size_t count = std::min<size_t>(self.host_.batch, n - begin);
      self.host_.occluded(self.host_.user, reinterpret_cast<lumicut_ray*>(rays + begin), count);
    }
  }

  // The host's inst_id counts a mesh's own transforms; the only instance of a mesh needs no id.
  void set_instance(Hit& hit) const {
    if (hit.geom >= first_.size()) return;  // refused behind, with the range
    const uint32_t count = instanced_ ? count_[hit.geom] : 1;
    const uint32_t index = hit.inst == kNoId && count == 1 ? 0 : hit.inst;
    if (index >= count)
      fail_argument("lumicut_trace.intersect: inst_id " + number_text(uint64_t{hit.inst}) + " is out of range: mesh " +
                    number_text(uint64_t{hit.geom}) + " has " + number_text(uint64_t{count}) + " instances");
    hit.inst = instanced_ ? first_[hit.geom] + index : kNoId;
  }

  const lumicut_trace host_;
  const bool instanced_;
  std::vector<uint32_t> first_, count_;
  std::unique_ptr<Accel> inner_;
};

}  // namespace

Scene::AccelFactory host_trace(const lumicut_trace& in) {
  const FieldValidator c("lumicut_trace");
  if (in.intersect == nullptr) c.fail("intersect", "is NULL");
  if (in.occluded == nullptr) c.fail("occluded", "is NULL");
  lumicut_trace host = in;
  if (host.batch == 0) host.batch = 65536;
  return [host](const AccelGeometry& geometry) { return std::make_unique<HostTrace>(host, geometry); };
}

}  // namespace lumicut
