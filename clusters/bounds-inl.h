// Pieces of the bounds over boxes and cones, in Highway vectors: what bounds.cpp and pair_bounds.cpp share.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERS_BOUNDS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERS_BOUNDS_INL_H_
#undef LUMICUT_CLUSTERS_BOUNDS_INL_H_
#else
#define LUMICUT_CLUSTERS_BOUNDS_INL_H_
#endif

#include "core/vec.h"
#include "hwy/highway.h"
#include "scene/shade_points.h"

#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;

struct V3 {
  V x, y, z;
};

HWY_INLINE V Dot(const V3& a, const V3& b) { return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x))); }
HWY_INLINE V3 Load3(D d, const float (&a)[3][kLanes], size_t i) {
  return {hn::Load(d, a[0] + i), hn::Load(d, a[1] + i), hn::Load(d, a[2] + i)};
}
HWY_INLINE V3 Set3(D d, const Vec3f& v) { return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)}; }
HWY_INLINE V Square(V a) { return hn::Mul(a, a); }

// Largest extent of the box with half sizes `half` along the unit vector `a`.
HWY_INLINE V Reach(const V3& a, const V3& half) { return Dot({hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)}, half); }

// Largest cosine that a vector of a box can make with the z axis, from the box's centre and half sizes in a frame whose
// z is the axis: the highest z over the least distance from the axis (below the horizon: the largest).
HWY_INLINE V LargestCosine(D d, V x, V y, V z, V half_x, V half_y, V half_z) {
  const V zero = hn::Zero(d);
  const V top = hn::Add(z, half_z);
  const V ax = hn::Abs(x), ay = hn::Abs(y);
  const V near2 = hn::MulAdd(Square(hn::Max(zero, hn::Sub(ax, half_x))), hn::Set(d, 1.0f),
                             Square(hn::Max(zero, hn::Sub(ay, half_y))));
  const V far2 = hn::Add(Square(hn::Add(ax, half_x)), Square(hn::Add(ay, half_y)));
  const V side2 = hn::IfThenElse(hn::Ge(top, zero), near2, far2);
  const V norm2 = hn::Add(Square(top), side2);
  // A box around the origin holds every direction. Near the horizon cosines cancel: an absolute slack for their
  // rounding.
  const V cosine = hn::IfThenElse(hn::Gt(norm2, hn::Set(d, 1e-30f)),
                                  hn::Div(top, hn::Sqrt(hn::Max(norm2, hn::Set(d, 1e-30f)))), hn::Set(d, 1.0f));
  return hn::Add(cosine, hn::Set(d, 2e-6f));
}

// Cosine of (angle − half-angle), at least 0 degrees: the best any direction of the cone can do.
HWY_INLINE V WidenByCone(D d, V cosine, V cos_half, V sin_half) {
  const V one = hn::Set(d, 1.0f);
  const V sine = hn::Sqrt(hn::Max(hn::Zero(d), hn::NegMulAdd(cosine, cosine, one)));
  const V wide = hn::Add(hn::MulAdd(cosine, cos_half, hn::Mul(sine, sin_half)), hn::Set(d, 2e-6f));
  return hn::IfThenElse(hn::Ge(cosine, cos_half), one, wide);
}

// Largest cosine between `axis` (one of each lane, with its frame) and the directions to the node's box.
HWY_INLINE V CosineToBox(D d, const V3& to_center, const V3& half, const V3& tangent, const V3& bitangent,
                         const V3& axis) {
  return LargestCosine(d, Dot(to_center, tangent), Dot(to_center, bitangent), Dot(to_center, axis),
                       Reach(tangent, half), Reach(bitangent, half), Reach(axis, half));
}

// Rec.709 luminance of what lights of `intensity` give through the factor f · geometry, with a slack of 1e-4 for the
// rounding of all this.
HWY_INLINE V BoundOfLuminance(D d, const V3& f, V geometry, const Rgb& intensity) {
  const V3 weight =
      Set3(d, {0.2126f * 1.0001f * intensity.x, 0.7152f * 1.0001f * intensity.y, 0.0722f * 1.0001f * intensity.z});
  return hn::Mul(geometry, Dot(f, weight));
}

// Largest value of the glossy lobe at the largest cosine `beta` to the mirror direction.
HWY_INLINE V BoundOfLobe(D d, V beta, V shininess) {
  // Rounding of the cosine is magnified by the exponent: a part in 10^6 of slack before it.
  beta = hn::Min(hn::Set(d, 1.0f), hn::MulAdd(beta, hn::Set(d, 1.000001f), hn::Set(d, 1e-6f)));
  const V base = hn::Max(beta, hn::Set(d, 1e-20f));
  const V lobe = hn::Exp(d, hn::Max(hn::Mul(shininess, hn::Log(d, base)), hn::Set(d, -80.0f)));
  return hn::IfThenElseZero(hn::Gt(beta, hn::Zero(d)), lobe);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
