// Vectors of kLanes points in Highway's types, and masks as bits.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_BSDF_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_LANES_INL_H_
#undef LUMICUT_BSDF_LANES_INL_H_
#else
#define LUMICUT_BSDF_LANES_INL_H_
#endif

#include "bsdf/shade_points.h"
#include "core/vec.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;
using DU = hn::RebindToUnsigned<D>;

struct V3 {
  V x, y, z;
};

HWY_INLINE V Dot(const V3& a, const V3& b) { return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x))); }
HWY_INLINE V3 Load3(D d, const float (&a)[3][kLanes], size_t i) {
  return {hn::Load(d, a[0] + i), hn::Load(d, a[1] + i), hn::Load(d, a[2] + i)};
}
HWY_INLINE V3 Set3(D d, const Vec3f& v) { return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)}; }
HWY_INLINE V3 Load3(D d, const std::vector<float> (&a)[3], size_t i) {
  return {hn::LoadU(d, a[0].data() + i), hn::LoadU(d, a[1].data() + i), hn::LoadU(d, a[2].data() + i)};
}
HWY_INLINE V Load1(D d, const float (&a)[kLanes], size_t i) { return hn::Load(d, a + i); }
HWY_INLINE V Load1(D d, const std::vector<float>& a, size_t i) { return hn::LoadU(d, a.data() + i); }
HWY_INLINE hn::Vec<DU> Load1(DU d, const uint32_t (&a)[kLanes], size_t i) { return hn::Load(d, a + i); }
HWY_INLINE hn::Vec<DU> Load1(DU d, const std::vector<uint32_t>& a, size_t i) { return hn::LoadU(d, a.data() + i); }

// One SurfacePoint in all lanes, in place of ShadePoints or a PointBlock.
HWY_INLINE V3 Load3(D d, const Vec3f& v, size_t) { return Set3(d, v); }
HWY_INLINE V Load1(D d, float v, size_t) { return hn::Set(d, v); }
HWY_INLINE hn::Vec<DU> Load1(DU d, uint32_t v, size_t) { return hn::Set(d, v); }

// A glossy lobe's numbers, as SurfacePoint has them.
struct LobeNumbers {
  V shape, ior;
};
// What a glossy lobe is evaluated at: unit vectors, and the light's cosines to normal and mirror direction.
struct LobeDirections {
  const V3 &normal, &mirror, &to_light;
  V cosine, beta;
};
// What it is bounded over: lights of at most `cosine` to the normal and `beta` to the mirror direction, shapes from
// `low` to `high` and indices likewise, views of at least `view_cosine` to the normal.
struct LobeCone {
  V cosine, beta, low, high, ior_low, ior_high, view_cosine;
};
// lobe · (specular·(1 − fresnel) + grazing·fresnel), without the cosine. 1/sr
struct LobeValue {
  V lobe, fresnel;
};

// Bits [i, i + Lanes(d)) of `bits`, and back.
HWY_INLINE hn::Mask<D> MaskOf(D d, uint32_t bits, size_t i) {
  const uint8_t bytes[8] = {static_cast<uint8_t>(bits >> i), static_cast<uint8_t>(bits >> i >> 8)};
  return hn::LoadMaskBits(d, bytes);
}
HWY_INLINE uint32_t BitsOf(D d, hn::Mask<D> mask, size_t i) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return (bytes[0] | static_cast<uint32_t>(bytes[1]) << 8) << i;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
