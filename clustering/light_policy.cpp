#include "clustering/light_policy.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/light_policy.cpp"
#include <hwy/foreach_target.h>
// foreach_target comes first.
#include <hwy/highway.h>

#include "accel/agglomerate-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Features: -lo and hi of positions in scene diagonals, -lo and hi of unit directions, intensity in means.
struct LightPolicy {
  static constexpr bool kNonDecreasing = true;
  static constexpr int kFeatures = 13;
  static constexpr int kOrderDims = 6;
  size_t features() const { return 13; }
  size_t key_features() const { return 12; }  // without a box the cost is 0, whatever the intensities
  void merge(const float* a, const float* b, float* out) const {
    for (int f = 0; f < 12; ++f) out[f] = std::max(a[f], b[f]);
    out[12] = a[12] + b[12];
  }
  void order_point(const float* a, float* point) const {
    for (int axis = 0; axis < 3; ++axis) {
      point[axis] = a[3 + axis] - a[axis];
      point[3 + axis] = (a[9 + axis] - a[6 + axis]) * (1.0f / 16.0f);
    }
  }
  template <class D>
  struct Query {
    hn::Vec<D> f[13];
  };
  template <class D>
  HWY_INLINE Query<D> query(D d, const float* a) const {
    Query<D> q;
    for (int f = 0; f < 13; ++f) q.f[f] = hn::Set(d, a[f]);
    return q;
  }
  template <class D>
  HWY_INLINE hn::Vec<D> diagonal2(D d, const hn::Vec<D>* a, const float* b) const {
    const auto x = hn::Add(hn::Max(a[0], hn::Load(d, b)), hn::Max(a[3], hn::Load(d, b + 24)));
    const auto y = hn::Add(hn::Max(a[1], hn::Load(d, b + 8)), hn::Max(a[4], hn::Load(d, b + 32)));
    const auto z = hn::Add(hn::Max(a[2], hn::Load(d, b + 16)), hn::Max(a[5], hn::Load(d, b + 40)));
    return hn::Add(hn::Mul(x, x), hn::Add(hn::Mul(y, y), hn::Mul(z, z)));
  }
  template <class D>
  HWY_INLINE hn::Vec<D> cost(D d, const Query<D>& a, const float* b) const {
    const auto l2 = diagonal2(d, a.f, b);
    const auto s2 = hn::Min(hn::Mul(diagonal2(d, a.f + 6, b + 48), hn::Set(d, 0.25f)), hn::Set(d, 1.0f));
    const auto size2 = hn::Add(l2, hn::Mul(s2, hn::Set(d, 1.0f / 256.0f)));
    return hn::Mul(hn::Add(a.f[12], hn::Load(d, b + 96)), hn::Mul(size2, size2));
  }
};

std::vector<Merge> lights_of_kind(std::span<const LightLeaf> lights, float scale, Strategy strategy,
                                  Progress* progress) {
  const LightPolicy policy;
  agglomeration::Core<LightPolicy> core(policy, lights.size(), strategy == Strategy::parallel, progress);
  double sum = 0;
  for (const LightLeaf& light : lights) sum += light.intensity;
  const double mean = lights.empty() ? 0 : sum / static_cast<double>(lights.size());
  for (size_t i = 0; i < lights.size(); ++i) {
    const LightLeaf& light = lights[i];
    const Vec3f p = light.kind == VplKind::directional ? Vec3f{} : light.position * scale;
    const Vec3f n = light.kind == VplKind::omni ? Vec3f{} : light.normal;
    float* f = core.leaf(i);
    for (int axis = 0; axis < 3; ++axis) {
      f[axis] = -p[axis], f[3 + axis] = p[axis];
      f[6 + axis] = -n[axis], f[9 + axis] = n[axis];
    }
    f[12] = mean > 0 ? std::max(static_cast<float>(light.intensity / mean), 1e-6f) : 1.0f;
  }
  return core.run(strategy);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {

HWY_EXPORT(lights_of_kind);

std::vector<Merge> agglomerate_lights(std::span<const LightLeaf> lights, float scene_diagonal, Strategy strategy,
                                      Progress* progress) {
  if (lights.size() >= 0x7fffffffu) throw Error(ErrorCode::unsupported, "agglomerate_lights: more than 2^31 lights");
  if (!(scene_diagonal >= 0.0f && std::isfinite(scene_diagonal)))
    fail_argument("agglomerate_lights: scene_diagonal is " + std::to_string(scene_diagonal));
  float reach = 0.0f;
  for (size_t i = 0; i < lights.size(); ++i) {
    const LightLeaf& light = lights[i];
    const std::string name = "agglomerate_lights: light ";
    if (light.kind != lights[0].kind)
      fail_argument(name + std::to_string(i) + " is of kind " + std::to_string(static_cast<int>(light.kind)) +
                    ", light 0 of kind " + std::to_string(static_cast<int>(lights[0].kind)));
    if (!(light.intensity >= 0.0f && std::isfinite(light.intensity)))
      fail_argument(name + std::to_string(i) + ": intensity is " + std::to_string(light.intensity));
    if (light.kind != VplKind::directional) {
      if (!is_finite(light.position)) fail_argument(name + std::to_string(i) + ": position is not finite");
      reach = std::max(reach, max_component(max(light.position, -light.position)));
    }
    // NaN fails too.
    if (light.kind != VplKind::omni && !(length2(light.normal) <= 1.1f))
      fail_argument(name + std::to_string(i) + ": normal is not a unit vector");
  }
  // Lights far out of the scene are placed on a coarser scale, so that no cost overflows.
  const float unit = std::max(scene_diagonal, reach * 1e-6f);
  const float scale = unit > 0.0f ? 1.0f / unit : 1.0f;
  return HWY_DYNAMIC_DISPATCH(lights_of_kind)(lights, std::isfinite(scale) ? scale : 1.0f, strategy, progress);
}

}  // namespace lumicut
#endif  // HWY_ONCE
