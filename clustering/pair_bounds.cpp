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

HWY_INLINE LobeCone ConeOf(D d, const PointNodes::OfLobe& own, size_t i, V cosine, V beta) {
  return {cosine,
          beta,
          hn::Load(d, own.shape_low + i),
          hn::Load(d, own.shape_high + i),
          hn::Load(d, own.ior_low + i),
          hn::Load(d, own.ior_high + i),
          hn::Load(d, own.view_cosine + i)};
}
// A point has one lobe: the largest of their bounds.
template <LaneLobe L, LaneLobe... Rest>
HWY_INLINE V3 LargestGloss(LobeList<L, Rest...>, D d, const PointNodes& nodes, size_t i, V cosine, V beta, V steep) {
  V3 largest{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  if constexpr (sizeof...(Rest) > 0) largest = LargestGloss(LobeList<Rest...>{}, d, nodes, i, cosine, beta, steep);
  constexpr uint32_t kPlace = place_in<L>(LaneLobes{});
  if ((nodes.has_lobe >> kPlace & 1) == 0) return largest;
  const PointNodes::OfLobe& own = nodes.of_lobe[kPlace];
  const LobeValue bound = BoundOfLobe<L>(d, ConeOf(d, own, i, cosine, beta), steep);
  V3 color = Load3(d, own.specular, i);
  if constexpr (L::kFresnel) color = BoundOfColor(d, color, Load3(d, own.grazing, i), bound.fresnel);
  const V3 gloss{hn::Mul(color.x, bound.lobe), hn::Mul(color.y, bound.lobe), hn::Mul(color.z, bound.lobe)};
  if constexpr (sizeof...(Rest) == 0) return gloss;
  return {hn::Max(largest.x, gloss.x), hn::Max(largest.y, gloss.y), hn::Max(largest.z, gloss.z)};
}

struct PairKernel {
  template <VplKind kKind, Lobes kLobes>
  static HWY_INLINE void Run(const LightNode& node, const PointNodes& nodes, float* HWY_RESTRICT bounds) {
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
          geometry = hn::Div(
              one, hn::Max(hn::Max(Dist2(d, to_center, half), hn::Set(d, node.least_distance2)), hn::Set(d, 1e-30f)));
        }
        if constexpr (kKind == VplKind::oriented || kKind == VplKind::lobed || kKind == VplKind::spot ||
                      kKind == VplKind::sphere) {
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
          } else if constexpr (kKind == VplKind::lobed) {
            geometry = hn::Mul(geometry, BoundOfLobed(d, node, WidenByCone(d, c, cos_half, sin_half)));
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
        const V3 mirror = Load3(d, nodes.mirror, i);
        V beta;
        if constexpr (kKind == VplKind::directional)
          beta = WidenByCone(d, hn::Neg(Dot(mirror, axis)), cos_half, sin_half);
        else
          beta = CosineToBox(d, to_center, half, Load3(d, nodes.mirror_tangent, i), Load3(d, nodes.mirror_bitangent, i),
                             mirror);
        beta = WidenByCone(d, beta, hn::Load(d, nodes.mirror_cos + i), hn::Load(d, nodes.mirror_sin + i));
        if constexpr (kLobes == Lobes::cosine) {
          const PointNodes::OfLobe& own = nodes.of_lobe[kCosineLobe];
          const V3 specular = Load3(d, own.specular, i);
          const V lobe = BoundOfLobe<CosineLobe>(d, ConeOf(d, own, i, cosine, beta), steep).lobe;
          f = {hn::MulAdd(specular.x, lobe, f.x), hn::MulAdd(specular.y, lobe, f.y), hn::MulAdd(specular.z, lobe, f.z)};
        } else {
          const V3 gloss = LargestGloss(LaneLobes{}, d, nodes, i, cosine, beta, steep);
          const V even = BoundOfDiffuse(d, hn::Load(d, nodes.falloff + i), hn::Load(d, nodes.burley_rise + i),
                                        hn::Load(d, nodes.slope + i), hn::Load(d, nodes.again + i),
                                        hn::Load(d, nodes.view_cosine + i), cosine, steep);
          f = {hn::MulAdd(f.x, even, gloss.x), hn::MulAdd(f.y, even, gloss.y), hn::MulAdd(f.z, even, gloss.z)};
        }
      }
      hn::StoreU(BoundOfLuminance(d, f, geometry, node.intensity), d, bounds + i);
    }
  }
};

void PairBounds(const LightNode& node, const PointNodes& nodes, float* bounds) {
  RunKernel<PairKernel>(node.kind, nodes.lobes, node, nodes, bounds);
}

void PairDistances2(const LightNode& node, const PointNodes& nodes, float* HWY_RESTRICT distances2) {
  const D d;
  for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const V3 to_center = Sub3(Set3(d, node.center), Load3(d, nodes.center, i));
    const V3 half = Add3(Set3(d, node.half), Load3(d, nodes.half, i));
    hn::StoreU(hn::Max(Dist2(d, to_center, half), hn::Set(d, node.least_distance2)), d, distances2 + i);
  }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(PairBounds);
HWY_EXPORT(PairDistances2);

void pair_bounds(const LightNode& node, const PointNodes& nodes, float* bounds) {
  HWY_DYNAMIC_DISPATCH(PairBounds)(node, nodes, bounds);
}

void pair_distances2(const LightNode& node, const PointNodes& nodes, float* distances2) {
  if (node.kind == VplKind::directional) {
    std::fill(distances2, distances2 + kLanes, std::numeric_limits<float>::infinity());
    return;
  }
  HWY_DYNAMIC_DISPATCH(PairDistances2)(node, nodes, distances2);
}

void PointNodes::set(size_t lane, const ShadePoints& points, size_t first, size_t count) {
  constexpr float kMost = std::numeric_limits<float>::infinity();
  struct Sum {
    Rgb specular{}, grazing{};
    float low = kMost, high = 0.0f, ior_low = kMost, ior_high = 0.0f, view = 1.0f;
  } sums[kLobeCount];
  Aabb box, normals, mirrors;
  Rgb kd{};
  float least_falloff = kMost, rise = 0.0f, view = 1.0f, steepest = 0.0f, most_again = 0.0f;
  bool burley = false;
  const auto at = [](const std::vector<float>(&a)[3], size_t i) { return Vec3f{a[0][i], a[1][i], a[2][i]}; };
  for (size_t i = first; i < first + count; ++i) {
    box.extend(points.position_at(i));
    normals.extend(points.normal_at(i));
    kd = max(kd, at(points.diffuse, i));
    least_falloff = std::min(least_falloff, points.falloff[i]);
    if (points.retro[i] > 0.0f || points.dim[i] > 0.0f) {
      burley = true, rise = std::max(rise, points.retro[i] - points.dim[i]);
      view = std::min(view, dot(points.normal_at(i), at(points.mirror, i)));
    }
    if (points.slope[i] > 0.0f) {
      steepest = std::max(steepest, points.slope[i]), most_again = std::max(most_again, points.again[i]);
      view = std::min(view, dot(points.normal_at(i), at(points.mirror, i)));
    }
    const Rgb specular = at(points.specular, i), grazing = at(points.grazing, i);
    if (!(max_component(specular) > 0.0f || max_component(grazing) > 0.0f)) continue;
    const Vec3f m = at(points.mirror, i);
    mirrors.extend(m);
    Sum& s = sums[points.lobe[i]];
    s.specular = max(s.specular, specular), s.grazing = max(s.grazing, grazing);
    s.low = std::min(s.low, points.shape[i]), s.high = std::max(s.high, points.shape[i]);
    s.ior_low = std::min(s.ior_low, points.ior[i]), s.ior_high = std::max(s.ior_high, points.ior[i]);
    s.view = std::min(s.view, dot(points.normal_at(i), m));
    has_lobe |= 1u << points.lobe[i];
  }
  if (has_lobe != 0) lobes = std::max(lobes, has_lobe == 1u << kCosineLobe ? Lobes::cosine : Lobes::all);
  if (least_falloff > 0.0f || burley || steepest > 0.0f) lobes = Lobes::all;
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
  put(diffuse, kd);
  falloff[lane] = least_falloff, burley_rise[lane] = rise, view_cosine[lane] = view;
  slope[lane] = steepest, again[lane] = most_again;
  for (uint32_t k = 0; k < kLobeCount; ++k) {
    const bool some = sums[k].low < kMost;
    put(of_lobe[k].specular, sums[k].specular), put(of_lobe[k].grazing, sums[k].grazing);
    // Any finite numbers where no point has the lobe: its colours are 0.
    of_lobe[k].shape_low[lane] = some ? sums[k].low : 1.0f, of_lobe[k].shape_high[lane] = some ? sums[k].high : 1.0f;
    of_lobe[k].ior_low[lane] = some ? sums[k].ior_low : 1.5f,
    of_lobe[k].ior_high[lane] = some ? sums[k].ior_high : 1.5f;
    of_lobe[k].view_cosine[lane] = sums[k].view;
  }
}

void PointNodes::pad(size_t lane) {
  const auto copy = [lane](float(&a)[kLanes]) { std::fill(a + lane, a + kLanes, a[lane - 1]); };
  const auto copy3 = [&copy](float(&a)[3][kLanes]) { copy(a[0]), copy(a[1]), copy(a[2]); };
  for (auto* a : {&center, &half, &normal, &tangent, &bitangent, &mirror, &mirror_tangent, &mirror_bitangent, &diffuse})
    copy3(*a);
  for (auto* a : {&normal_cos, &normal_sin, &mirror_cos, &mirror_sin, &radius2, &falloff, &burley_rise, &view_cosine,
                  &slope, &again})
    copy(*a);
  for (OfLobe& own : of_lobe) {
    copy3(own.specular), copy3(own.grazing);
    copy(own.shape_low), copy(own.shape_high), copy(own.ior_low), copy(own.ior_high), copy(own.view_cosine);
  }
}

}  // namespace lumicut
#endif
