// Departs from Walter et al.: luminance is bounded through each colour channel on its own, so a blue lamp over a red
// wall costs nothing; and the cosine to the light's cone and to the surface are bounded in their own frames each.
#include "clusters/bounds.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clusters/bounds.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clusters/bounds-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <VplKind kKind, bool kGlossy>
HWY_INLINE void Bounds(const LightNode& node, const PointBlock& block, float clamp2, float* HWY_RESTRICT bounds) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V3 center = Set3(d, node.center), half = Set3(d, node.half), axis = Set3(d, node.axis);
  const V cos_half = hn::Set(d, node.cos_half), sin_half = hn::Set(d, node.sin_half);
  for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const V3 normal = Load3(d, block.normal, i);
    V cosine, geometry;  // at the surface; at the light, with the distance
    V3 to_center = {zero, zero, zero};
    if constexpr (kKind == VplKind::directional) {
      cosine = WidenByCone(d, hn::Neg(Dot(normal, axis)), cos_half, sin_half);
      geometry = one;
    } else {
      const V3 position = Load3(d, block.position, i);
      to_center = {hn::Sub(center.x, position.x), hn::Sub(center.y, position.y), hn::Sub(center.z, position.z)};
      const V dx = hn::Max(zero, hn::Sub(hn::Abs(to_center.x), half.x));
      const V dy = hn::Max(zero, hn::Sub(hn::Abs(to_center.y), half.y));
      const V dz = hn::Max(zero, hn::Sub(hn::Abs(to_center.z), half.z));
      const V dist2 = hn::Add(Square(dx), hn::Add(Square(dy), Square(dz)));
      geometry = hn::Div(one, hn::Max(hn::Max(dist2, hn::Set(d, clamp2)), hn::Set(d, 1e-30f)));
      if constexpr (kKind == VplKind::oriented || kKind == VplKind::spot) {
        // From the lights to the point: the box turned around.
        const V x = hn::Neg(Dot(to_center, Set3(d, node.tangent))),
                y = hn::Neg(Dot(to_center, Set3(d, node.bitangent)));
        const V z = hn::Neg(Dot(to_center, axis));
        const V c = LargestCosine(d, x, y, z, hn::Set(d, node.frame_half.x), hn::Set(d, node.frame_half.y),
                                  hn::Set(d, node.frame_half.z));
        if constexpr (kKind == VplKind::oriented) {
          geometry = hn::Mul(geometry, hn::Max(zero, WidenByCone(d, c, cos_half, sin_half)));
        } else {
          geometry = hn::IfThenElseZero(hn::Ge(hn::Add(c, hn::Set(d, 1e-5f)), cos_half), geometry);
        }
      }
      cosine = CosineToBox(d, to_center, half, Load3(d, block.tangent, i), Load3(d, block.bitangent, i), normal);
    }
    geometry = hn::Mul(geometry, hn::Max(zero, cosine));
    V3 f = Load3(d, block.diffuse, i);
    if constexpr (kGlossy) {
      const V3 mirror = Load3(d, block.mirror, i), specular = Load3(d, block.specular, i);
      V beta;
      if constexpr (kKind == VplKind::directional)
        beta = WidenByCone(d, hn::Neg(Dot(mirror, axis)), cos_half, sin_half);
      else
        beta = CosineToBox(d, to_center, half, Load3(d, block.mirror_tangent, i), Load3(d, block.mirror_bitangent, i),
                           mirror);
      const V lobe = BoundOfLobe(d, beta, hn::Load(d, block.shininess + i));
      f = {hn::MulAdd(specular.x, lobe, f.x), hn::MulAdd(specular.y, lobe, f.y), hn::MulAdd(specular.z, lobe, f.z)};
    }
    hn::StoreU(BoundOfLuminance(d, f, geometry, node.intensity), d, bounds + i);
  }
}

template <VplKind kKind>
HWY_INLINE void BoundsOfKind(const LightNode& node, const PointBlock& block, float clamp2, float* bounds) {
  block.glossy ? Bounds<kKind, true>(node, block, clamp2, bounds) : Bounds<kKind, false>(node, block, clamp2, bounds);
}

void LightNodeBounds(const LightNode& node, const PointBlock& block, float clamp2, float* bounds) {
  switch (node.kind) {
    case VplKind::omni:
      return BoundsOfKind<VplKind::omni>(node, block, clamp2, bounds);
    case VplKind::oriented:
      return BoundsOfKind<VplKind::oriented>(node, block, clamp2, bounds);
    case VplKind::directional:
      return BoundsOfKind<VplKind::directional>(node, block, clamp2, bounds);
    case VplKind::spot:
      return BoundsOfKind<VplKind::spot>(node, block, clamp2, bounds);
  }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightNodeBounds);

void light_node_bounds(const LightNode& node, const PointBlock& block, float clamp2, float* bounds) {
  HWY_DYNAMIC_DISPATCH(LightNodeBounds)(node, block, clamp2, bounds);
}

void PointBlock::load(const ShadePoints& points, size_t first) {
  glossy = points.glossy();
  for (size_t i = 0; i < kLanes; ++i) {
    const SurfacePoint p = points.get(first + i);
    const Frame n(p.normal), m(p.mirror);
    for (int k = 0; k < 3; ++k) {
      position[k][i] = p.position[k];
      normal[k][i] = p.normal[k], tangent[k][i] = n.t[k], bitangent[k][i] = n.b[k];
      mirror[k][i] = p.mirror[k], mirror_tangent[k][i] = m.t[k], mirror_bitangent[k][i] = m.b[k];
      diffuse[k][i] = p.diffuse[k], specular[k][i] = p.specular[k];
    }
    shininess[i] = p.shininess;
  }
}

}  // namespace lumicut
#endif
