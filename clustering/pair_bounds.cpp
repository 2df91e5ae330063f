// The box of all vectors between points and lights is the sum of two boxes; cosines are bounded over it in the frames
// of the cones at its ends, and widened by those cones. Departs from the authors' code, which takes one random point's
// normal and mirror direction for all and the distance of circumscribed balls: here every angle and distance is a
// bound.
#include "clustering/pair_bounds.h"

#include "core/cone.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/pair_bounds.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clustering/bounds-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {

HWY_INLINE V3 Add3(const V3& a, const V3& b) { return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)}; }
HWY_INLINE V3 Sub3(const V3& a, const V3& b) { return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)}; }

template <VplKind kKind, Lobes kLobes>
HWY_INLINE void PairBoundsOf(const LightNode& node, const PointNodes& nodes, float clamp2, float* HWY_RESTRICT bounds) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V3 axis = Set3(d, node.axis);
  const V cos_half = hn::Set(d, node.cos_half), sin_half = hn::Set(d, node.sin_half);
  for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const V3 normal = Load3(d, nodes.normal, i);
    V cosine, geometry;            // at the surfaces; at the lights, with the distance
    V steep = one, across = zero;  // spheres: as in bounds-inl.h
    V3 to_center = {zero, zero, zero}, half = {zero, zero, zero}, places = half;
    if constexpr (kKind == VplKind::directional) {
      cosine = WidenByCone(d, hn::Neg(Dot(normal, axis)), cos_half, sin_half);
      geometry = one;
    } else {
      const V3 points_half = Load3(d, nodes.half, i);
      to_center = Sub3(Set3(d, node.center), Load3(d, nodes.center, i));
      half = Add3(Set3(d, node.half), points_half);
      if constexpr (kKind == VplKind::sphere) {
        const V dist2 = Dist2(d, to_center, half);
        geometry = BoundOfSolidAngle(d, node, dist2), across = SpheresAcross(d, node, dist2), places = half;
        half = GrownBySpheres(d, half, node);
      } else {
        geometry = hn::Div(one, hn::Max(hn::Max(Dist2(d, to_center, half), hn::Set(d, clamp2)), hn::Set(d, 1e-30f)));
      }
      if constexpr (kKind == VplKind::oriented || kKind == VplKind::spot || kKind == VplKind::sphere) {
        // From the lights to the points: the box turned around.
        const V3 tangent = Set3(d, node.tangent), bitangent = Set3(d, node.bitangent);
        V3 frame_half = Set3(d, node.frame_half);
        if constexpr (kKind == VplKind::sphere) frame_half = GrownBySpheres(d, frame_half, node);
        const V c = LargestCosine(d, hn::Neg(Dot(to_center, tangent)), hn::Neg(Dot(to_center, bitangent)),
                                  hn::Neg(Dot(to_center, axis)), hn::Add(frame_half.x, Reach(tangent, points_half)),
                                  hn::Add(frame_half.y, Reach(bitangent, points_half)),
                                  hn::Add(frame_half.z, Reach(axis, points_half)));
        if constexpr (kKind == VplKind::sphere) {
          const V mean = LargestCosine(d, hn::Neg(Dot(to_center, tangent)), hn::Neg(Dot(to_center, bitangent)),
                                       hn::Neg(Dot(to_center, axis)),
                                       hn::Add(hn::Set(d, node.frame_half.x), Reach(tangent, points_half)),
                                       hn::Add(hn::Set(d, node.frame_half.y), Reach(bitangent, points_half)),
                                       hn::Add(hn::Set(d, node.frame_half.z), Reach(axis, points_half)));
          geometry = hn::Mul(geometry, MeanOverSpheres(d, WidenByCone(d, mean, cos_half, sin_half), across));
          geometry = hn::IfThenElseZero(hn::Gt(WidenByCone(d, c, cos_half, sin_half), zero), geometry);
        } else if constexpr (kKind == VplKind::oriented) {
          geometry = hn::Mul(geometry, hn::Max(zero, WidenByCone(d, c, cos_half, sin_half)));
        } else {
          geometry = hn::IfThenElseZero(hn::Ge(hn::Add(c, hn::Set(d, 1e-5f)), cos_half), geometry);
        }
      }
      cosine = CosineToBox(d, to_center, half, Load3(d, nodes.tangent, i), Load3(d, nodes.bitangent, i), normal);
    }
    cosine = WidenByCone(d, cosine, hn::Load(d, nodes.normal_cos + i), hn::Load(d, nodes.normal_sin + i));
    if constexpr (kKind == VplKind::sphere) {
      V mean = CosineToBox(d, to_center, places, Load3(d, nodes.tangent, i), Load3(d, nodes.bitangent, i), normal);
      mean = WidenByCone(d, mean, hn::Load(d, nodes.normal_cos + i), hn::Load(d, nodes.normal_sin + i));
      mean = MeanOverSpheres(d, mean, across);
      geometry = hn::IfThenElseZero(hn::Gt(cosine, zero), hn::Mul(geometry, mean));
      steep = hn::Div(hn::Max(zero, cosine), hn::Max(mean, hn::Set(d, 1e-20f)));
    } else {
      geometry = hn::Mul(geometry, hn::Max(zero, cosine));
    }
    V3 f = Load3(d, nodes.diffuse, i);
    if constexpr (kLobes != Lobes::none) {
      const V3 mirror = Load3(d, nodes.mirror, i), specular = Load3(d, nodes.specular, i);
      V beta;
      if constexpr (kKind == VplKind::directional)
        beta = WidenByCone(d, hn::Neg(Dot(mirror, axis)), cos_half, sin_half);
      else
        beta = CosineToBox(d, to_center, half, Load3(d, nodes.mirror_tangent, i), Load3(d, nodes.mirror_bitangent, i),
                           mirror);
      beta = WidenByCone(d, beta, hn::Load(d, nodes.mirror_cos + i), hn::Load(d, nodes.mirror_sin + i));
      const V lobe = BoundOfCosineLobe(d, beta, hn::Load(d, nodes.exponent + i));
      if constexpr (kLobes == Lobes::cosine)
        f = {hn::MulAdd(specular.x, lobe, f.x), hn::MulAdd(specular.y, lobe, f.y), hn::MulAdd(specular.z, lobe, f.z)};
      if constexpr (kLobes == Lobes::ggx) {
        V3 gloss{hn::Mul(specular.x, lobe), hn::Mul(specular.y, lobe), hn::Mul(specular.z, lobe)};
        const V nv = hn::Load(d, nodes.view_cosine + i);
        V ggx =
            BoundOfGgxLobe(d, beta, cosine, hn::Load(d, nodes.alpha2_low + i), hn::Load(d, nodes.alpha2_high + i), nv);
        if constexpr (kKind == VplKind::sphere) ggx = hn::Mul(ggx, steep);
        const V3 share =
            BoundOfSchlick(d, Load3(d, nodes.schlick, i), Load3(d, nodes.grazing, i), BoundOfFresnel(d, beta, nv));
        // A point has one of the two lobes.
        gloss = {hn::Max(gloss.x, hn::Mul(share.x, ggx)), hn::Max(gloss.y, hn::Mul(share.y, ggx)),
                 hn::Max(gloss.z, hn::Mul(share.z, ggx))};
        const V falloff = BoundOfDiffuseFalloff(d, hn::Load(d, nodes.falloff + i), cosine);
        f = {hn::MulAdd(f.x, falloff, gloss.x), hn::MulAdd(f.y, falloff, gloss.y), hn::MulAdd(f.z, falloff, gloss.z)};
      }
    }
    hn::StoreU(BoundOfLuminance(d, f, geometry, node.intensity), d, bounds + i);
  }
}

template <VplKind kKind>
HWY_INLINE void PairBoundsOfKind(const LightNode& node, const PointNodes& nodes, float clamp2, float* bounds) {
  if (nodes.ggx) return PairBoundsOf<kKind, Lobes::ggx>(node, nodes, clamp2, bounds);
  nodes.glossy ? PairBoundsOf<kKind, Lobes::cosine>(node, nodes, clamp2, bounds)
               : PairBoundsOf<kKind, Lobes::none>(node, nodes, clamp2, bounds);
}

void PairBounds(const LightNode& node, const PointNodes& nodes, float clamp2, float* bounds) {
  switch (node.kind) {
    case VplKind::omni:
      return PairBoundsOfKind<VplKind::omni>(node, nodes, clamp2, bounds);
    case VplKind::oriented:
      return PairBoundsOfKind<VplKind::oriented>(node, nodes, clamp2, bounds);
    case VplKind::directional:
      return PairBoundsOfKind<VplKind::directional>(node, nodes, clamp2, bounds);
    case VplKind::spot:
      return PairBoundsOfKind<VplKind::spot>(node, nodes, clamp2, bounds);
    case VplKind::sphere:
      return PairBoundsOfKind<VplKind::sphere>(node, nodes, clamp2, bounds);
  }
}

void PairDistances2(const LightNode& node, const PointNodes& nodes, float clamp2, float* HWY_RESTRICT distances2) {
  const D d;
  for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const V3 to_center = Sub3(Set3(d, node.center), Load3(d, nodes.center, i));
    const V3 half = Add3(Set3(d, node.half), Load3(d, nodes.half, i));
    hn::StoreU(hn::Max(Dist2(d, to_center, half), hn::Set(d, clamp2)), d, distances2 + i);
  }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(PairBounds);
HWY_EXPORT(PairDistances2);

void pair_bounds(const LightNode& node, const PointNodes& nodes, float clamp2, float* bounds) {
  HWY_DYNAMIC_DISPATCH(PairBounds)(node, nodes, clamp2, bounds);
}

void pair_distances2(const LightNode& node, const PointNodes& nodes, float clamp2, float* distances2) {
  if (node.kind == VplKind::directional) {
    std::fill(distances2, distances2 + kLanes, std::numeric_limits<float>::infinity());
    return;
  }
  HWY_DYNAMIC_DISPATCH(PairDistances2)(node, nodes, clamp2, distances2);
}

void PointNodes::set(size_t lane, const ShadePoints& points, size_t first, size_t count) {
  Aabb box, normals, mirrors;
  Rgb kd{}, ks{}, f0{}, f90{};
  constexpr float kMost = std::numeric_limits<float>::infinity();
  float least = kMost, low2 = kMost, high2 = 0.0f, view = 1.0f, least_falloff = kMost;
  for (size_t i = first; i < first + count; ++i) {
    box.extend(points.position_at(i));
    normals.extend(points.normal_at(i));
    kd = max(kd, Rgb{points.diffuse[0][i], points.diffuse[1][i], points.diffuse[2][i]});
    const Rgb s{points.specular[0][i], points.specular[1][i], points.specular[2][i]};
    least_falloff = std::min(least_falloff, points.falloff[i]);
    const Rgb edge{points.grazing[0][i], points.grazing[1][i], points.grazing[2][i]};
    if (!(max_component(s) > 0.0f || max_component(edge) > 0.0f)) continue;
    const Vec3f m{points.mirror[0][i], points.mirror[1][i], points.mirror[2][i]};
    mirrors.extend(m);
    if (const float alpha = points.alpha[i]; alpha > 0.0f) {
      f0 = max(f0, s), f90 = max(f90, edge);
      low2 = std::min(low2, alpha * alpha), high2 = std::max(high2, alpha * alpha);
      view = std::min(view, dot(points.normal_at(i), m));
    } else {
      ks = max(ks, s);
      least = std::min(least, points.exponent[i]);
    }
  }
  const bool shiny = !mirrors.empty();
  glossy = glossy || shiny;
  ggx = ggx || high2 > 0.0f || least_falloff > 0.0f;
  used |= 1u << lane;
  const auto put = [lane](float(&to)[3][kLanes], const Vec3f& v) {
    for (int k = 0; k < 3; ++k) to[k][lane] = v[k];
  };
  const Vec3f middle = box.center(), extent = max(box.hi - middle, middle - box.lo);
  put(center, middle), put(half, extent);
  radius2[lane] = length2(extent);
  const Cone facing = cone_of_direction_box(normals), shine = cone_of_direction_box(mirrors);
  const Frame n(facing.axis), m(shine.axis);
  put(normal, n.n), put(tangent, n.t), put(bitangent, n.b);
  put(mirror, m.n), put(mirror_tangent, m.t), put(mirror_bitangent, m.b);
  normal_cos[lane] = facing.cos_half, normal_sin[lane] = facing.sin_half();
  mirror_cos[lane] = shine.cos_half, mirror_sin[lane] = shine.sin_half();
  put(diffuse, kd), put(specular, ks);
  exponent[lane] = least < kMost ? least : 0.0f;
  put(schlick, f0), put(grazing, f90);
  view_cosine[lane] = view, falloff[lane] = least_falloff;
  alpha2_low[lane] = high2 > 0.0f ? low2 : 1.0f, alpha2_high[lane] = high2 > 0.0f ? high2 : 1.0f;
}

void PointNodes::pad(size_t lane) {
  const auto copy = [lane](float(&a)[kLanes]) { std::fill(a + lane, a + kLanes, a[lane - 1]); };
  for (int k = 0; k < 3; ++k)
    for (auto* a : {&center, &half, &normal, &tangent, &bitangent, &mirror, &mirror_tangent, &mirror_bitangent,
                    &diffuse, &specular, &schlick, &grazing})
      copy((*a)[k]);
  for (auto* a : {&normal_cos, &normal_sin, &mirror_cos, &mirror_sin, &exponent, &radius2, &alpha2_low, &alpha2_high,
                  &view_cosine, &falloff})
    copy(*a);
}

}  // namespace lumicut
#endif
