// Pieces of the bounds over boxes and cones, in Highway vectors: what bounds.cpp, pair_bounds.cpp and light_cuts.cpp
// share. Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERING_BOUNDS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERING_BOUNDS_INL_H_
#undef LUMICUT_CLUSTERING_BOUNDS_INL_H_
#else
#define LUMICUT_CLUSTERING_BOUNDS_INL_H_
#endif

#include "bsdf/reflectance-inl.h"
#include "clustering/bounds.h"
#include "clustering/kernel_dispatch-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE V Square(V a) { return hn::Mul(a, a); }

// Largest extent of the box with half sizes `half` along the unit vector `a`.
HWY_INLINE V Reach(const V3& a, const V3& half) { return Dot({hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)}, half); }

// Squared distance from the origin to the box with half sizes `half` around `to_center`.
HWY_INLINE V Dist2(D d, const V3& to_center, const V3& half) {
  const V zero = hn::Zero(d);
  const V dx = hn::Max(zero, hn::Sub(hn::Abs(to_center.x), half.x));
  const V dy = hn::Max(zero, hn::Sub(hn::Abs(to_center.y), half.y));
  const V dz = hn::Max(zero, hn::Sub(hn::Abs(to_center.z), half.z));
  return hn::Add(Square(dx), hn::Add(Square(dy), Square(dz)));
}

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

// Largest solid angle over πr² of a node's spheres, from points at `dist2` or farther of their centres: 2/(d²(1+cosα))
// outside of the largest; where some may be entered, (2 + 2√(1−q²))·q²/d² with q = d/r is largest at q² = 8/9.
HWY_INLINE V BoundOfSolidAngle(D d, const LightNode& node, V dist2) {
  const V one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f), r2 = hn::Set(d, node.largest_radius * node.largest_radius);
  dist2 = hn::Max(dist2, hn::Set(d, 1e-30f));
  const V cosine = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, hn::Div(r2, dist2))));
  const V outside = hn::Div(two, hn::Mul(dist2, hn::Add(one, cosine)));
  const float most = 4.0f / std::max(node.least_distance2, 1e-30f);
  const V inside = hn::Min(hn::Div(hn::Set(d, 64.0f / 27.0f), dist2), hn::Set(d, most));
  return hn::IfThenElse(hn::Ge(dist2, r2), hn::Min(outside, hn::Set(d, most)), inside);
}

// Mean of cos² to a direction across the axis of a cone to a sphere, at most: (A − A²/3)/2 of the cone's versine A.
HWY_INLINE V SpheresAcross(D d, const LightNode& node, V dist2) {
  const V one = hn::Set(d, 1.0f);
  const V s2 = hn::Div(hn::Set(d, node.largest_radius * node.largest_radius), hn::Max(dist2, hn::Set(d, 1e-30f)));
  const V a = hn::Div(s2, hn::Add(one, hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, s2)))));
  const V across = hn::Mul(hn::Set(d, 0.5f), hn::NegMulAdd(hn::Mul(a, a), hn::Set(d, 1.0f / 3.0f), a));
  return hn::IfThenElse(hn::Lt(s2, one), across, hn::Set(d, 0.375f));
}

// Root of the mean square of max(0, cos) over cones to spheres whose axes make at most `cosine` with a vector. That
// square has a mean of c² + across·(1 − 3c²), and grows with c from 0 on. Means of products of two cosines are at most
// the product of two such roots [Cauchy, Schwarz]: far nearer than the largest cosines of the cones.
HWY_INLINE V MeanOverSpheres(D d, V cosine, V across) {
  const V c = hn::Min(hn::Set(d, 1.0f), hn::Max(hn::Zero(d), cosine)), c2 = hn::Mul(c, c);
  const V rest = hn::Max(hn::Zero(d), hn::NegMulAdd(hn::Set(d, 3.0f), c2, hn::Set(d, 1.0f)));
  return hn::Sqrt(hn::Max(across, hn::MulAdd(across, rest, c2)));
}

// The box grown by the node's largest sphere: where directions to its spheres lead.
HWY_INLINE V3 GrownBySpheres(D d, const V3& half, const LightNode& node) {
  const V r = hn::Set(d, node.largest_radius);
  return {hn::Add(half.x, r), hn::Add(half.y, r), hn::Add(half.z, r)};
}

// The largest cosine of the node's lobed lights times their lobe, for directions of at most `cosine` to their normals: as
// bsdf/oren_nayar.h and bsdf/burley.h bound it, with the light in the viewer's place, and nothing lost beneath gloss.
HWY_INLINE V BoundOfLobed(D d, const LightNode& node, V cosine) {
  const V c = hn::Max(hn::Zero(d), cosine);
  const V edge = hn::MulAdd(hn::Set(d, node.largest_rise), BurleyEdge(d, c), hn::Set(d, 1.0f));
  const V back = hn::Min(hn::Set(d, node.largest_groove), hn::Mul(hn::Set(d, node.steepest_groove), c));
  return hn::MulAdd(hn::Mul(hn::Set(d, node.largest_even), edge), c, back);
}

// light_node_bounds of one kind of light. Departs from Walter et al.: luminance is bounded through each colour channel
// on its own, so a blue light over a red wall costs nothing; and the cosine to the light's cone and to the surface are
// bounded in their own frames each.
struct BoundsKernel {
  template <VplKind kKind, Lobes kLobes>
  static HWY_INLINE void Run(const LightNode& node, const PointBlock& block, float* HWY_RESTRICT bounds) {
    const D d;
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    constexpr bool kSpheres = kKind == VplKind::sphere;
    const V3 center = Set3(d, node.center), axis = Set3(d, node.axis), places = Set3(d, node.half);
    const V3 half = kSpheres ? GrownBySpheres(d, places, node) : places;
    const V3 frame_half = kSpheres ? GrownBySpheres(d, Set3(d, node.frame_half), node) : Set3(d, node.frame_half);
    const V cos_half = hn::Set(d, node.cos_half), sin_half = hn::Set(d, node.sin_half);
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const V3 normal = Load3(d, block.normal, i);
      V cosine, geometry;  // at the surface; at the light, with the distance
      V steep = one;       // spheres: the largest cosine over the mean one, for lobes that are bounded with it
      V3 to_center = {zero, zero, zero};
      if constexpr (kKind == VplKind::directional) {
        cosine = WidenByCone(d, hn::Neg(Dot(normal, axis)), cos_half, sin_half);
        geometry = one;
      } else {
        const V3 position = Load3(d, block.position, i);
        to_center = {hn::Sub(center.x, position.x), hn::Sub(center.y, position.y), hn::Sub(center.z, position.z)};
        const V dist2 = kSpheres ? Dist2(d, to_center, places) : zero,
                across = kSpheres ? SpheresAcross(d, node, dist2) : zero;
        if constexpr (kSpheres)
          geometry = BoundOfSolidAngle(d, node, dist2);
        else
          geometry = hn::Div(
              one, hn::Max(hn::Max(Dist2(d, to_center, half), hn::Set(d, node.least_distance2)), hn::Set(d, 1e-30f)));
        if constexpr (kKind == VplKind::oriented || kKind == VplKind::lobed || kKind == VplKind::spot || kSpheres) {
          // From the lights to the point: the box turned around.
          const V x = hn::Neg(Dot(to_center, Set3(d, node.tangent))),
                  y = hn::Neg(Dot(to_center, Set3(d, node.bitangent)));
          const V z = hn::Neg(Dot(to_center, axis));
          const V c = LargestCosine(d, x, y, z, frame_half.x, frame_half.y, frame_half.z);
          if constexpr (kSpheres) {
            const V mean = LargestCosine(d, x, y, z, hn::Set(d, node.frame_half.x), hn::Set(d, node.frame_half.y),
                                         hn::Set(d, node.frame_half.z));
            geometry = hn::Mul(geometry, MeanOverSpheres(d, WidenByCone(d, mean, cos_half, sin_half), across));
            geometry = hn::IfThenElseZero(hn::Gt(WidenByCone(d, c, cos_half, sin_half), zero), geometry);
          } else if constexpr (kKind == VplKind::oriented) {
            geometry = hn::Mul(geometry, hn::Max(zero, WidenByCone(d, c, cos_half, sin_half)));
          } else if constexpr (kKind == VplKind::lobed) {
            geometry = hn::Mul(geometry, BoundOfLobed(d, node, WidenByCone(d, c, cos_half, sin_half)));
          } else {
            geometry = hn::IfThenElseZero(hn::Ge(hn::Add(c, hn::Set(d, 1e-5f)), cos_half), geometry);
          }
        }
        const V3 tangent = Load3(d, block.tangent, i), bitangent = Load3(d, block.bitangent, i);
        cosine = CosineToBox(d, to_center, half, tangent, bitangent, normal);
        if constexpr (kSpheres) {
          const V mean = MeanOverSpheres(d, CosineToBox(d, to_center, places, tangent, bitangent, normal), across);
          geometry = hn::IfThenElseZero(hn::Gt(cosine, zero), hn::Mul(geometry, mean));
          steep = hn::Div(hn::Max(zero, cosine), hn::Max(mean, hn::Set(d, 1e-20f)));
        }
      }
      if constexpr (!kSpheres) geometry = hn::Mul(geometry, hn::Max(zero, cosine));
      V3 f = Load3(d, block.diffuse, i);
      if constexpr (kLobes != Lobes::none) {
        const V3 mirror = Load3(d, block.mirror, i), specular = Load3(d, block.specular, i);
        V beta;
        if constexpr (kKind == VplKind::directional)
          beta = WidenByCone(d, hn::Neg(Dot(mirror, axis)), cos_half, sin_half);
        else
          beta = CosineToBox(d, to_center, half, Load3(d, block.mirror_tangent, i), Load3(d, block.mirror_bitangent, i),
                             mirror);
        const LobeShape shape = LoadShape<kLobes>(d, block, i);
        const LobeNumbers& of = shape.of;
        const LobeValue bound = BoundOfLobes<kLobes>(
            d, shape, {cosine, beta, of.shape, of.shape, of.ior, of.ior, Dot(normal, mirror)}, steep);
        V3 color = specular;
        if constexpr (kLobes == Lobes::all) {
          color = BoundOfColor(d, specular, Load3(d, block.grazing, i), bound.fresnel);
          const DiffuseShape& own = shape.diffuse;
          const V rise = hn::Max(zero, hn::Sub(own.retro, own.dim));
          const V even = BoundOfDiffuse(d, own.falloff, rise, own.slope, own.again, Dot(normal, mirror), cosine, steep);
          f = {hn::Mul(f.x, even), hn::Mul(f.y, even), hn::Mul(f.z, even)};
        }
        f = {hn::MulAdd(color.x, bound.lobe, f.x), hn::MulAdd(color.y, bound.lobe, f.y),
             hn::MulAdd(color.z, bound.lobe, f.z)};
      }
      hn::StoreU(BoundOfLuminance(d, f, geometry, node.intensity), d, bounds + i);
    }
  }
};

// light_node_bounds, to be inlined.
HWY_INLINE void NodeBounds(const LightNode& node, const PointBlock& block, float* HWY_RESTRICT bounds) {
  RunKernel<BoundsKernel>(node.kind, block.lobes, node, block, bounds);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
