// The glossy lobes that a SurfacePoint can have: the one list from which all evaluate, sample and bound them. A new lobe is
// a file of its own, and a name in the list here. docs/extending.md
// Scalar and SIMD forms. The SIMD part is compiled once a target.

// The list, and its files. Each file guards itself: a SIMD target takes the second part of all of them once more.
#include "bsdf/cosine_lobe.h"
#include "bsdf/ggx_reflection.h"

#ifndef LUMICUT_BSDF_LOBES_H_
#define LUMICUT_BSDF_LOBES_H_

#include <concepts>

#include "bsdf/shade_points.h"

// A lobe's place here is SurfacePoint::lobe. A target's namespace has the SIMD counterparts under the same names. The last
// one is the commonest: see ValueOfLobes.
#define LUMICUT_LOBES CosineLobe, GgxReflection

namespace lumicut {

// What a lobe offers in scalar form. It reads normal, mirror, specular, grazing, shape and ior of the point.
template <class L>
concept Lobe = requires(const SurfacePoint& p, const Vec3f& direction, float x) {
  // BRDF towards a unit direction, without the cosine, 1/sr; 0 or more above the horizon. Not asked below it.
  { L::value(p, direction) } -> std::same_as<Rgb>;
  // A unit direction for two numbers in [0, 1); it may lie below the horizon, and is dropped then.
  { L::sample(p, x, x) } -> std::same_as<Vec3f>;
  // (share, point, direction): density of `sample`, 1/sr, times `share`.
  { L::pdf(x, p, direction) } -> std::same_as<float>;
  // Share of the light that it sends back, roughly: by this lobes are chosen.
  { L::albedo(p) } -> std::same_as<Rgb>;
  // (point, cosine, beta): about the largest luminance of the value over directions of at most `cosine` to the normal and
  // `beta` to the mirror direction; above 0 wherever the value is. By this lights are drawn.
  { L::importance(p, x, x) } -> std::same_as<float>;
};

template <class... L>
struct LobeList {
  static constexpr uint32_t kCount = sizeof...(L);
};
template <class L, class... All>
consteval uint32_t place_in(LobeList<All...>) {
  uint32_t place = 0;
  bool found = false;
  ((found = found || std::same_as<L, All>, place += found ? 0 : 1), ...);
  return place;
}

using ScalarLobes = LobeList<LUMICUT_LOBES>;
inline constexpr uint32_t kLobeCount = ScalarLobes::kCount;
// SurfacePoint::lobe of points with this lobe.
template <Lobe L>
inline constexpr uint32_t kLobe = place_in<L>(ScalarLobes{});
static_assert(kLobe<CosineLobe> == kCosineLobe, "kernels have a fast path for it");

// Calls `fn` with an object of the type that `lobe` is the place of.
template <class Fn, Lobe First, Lobe... Rest>
auto with_lobe(LobeList<First, Rest...>, uint32_t lobe, const Fn& fn) {
  if constexpr (sizeof...(Rest) == 0)
    return fn(First{});
  else
    return lobe == 0 ? fn(First{}) : with_lobe(LobeList<Rest...>{}, lobe - 1, fn);
}
template <class Fn>
auto with_lobe(const SurfacePoint& p, const Fn& fn) {
  return with_lobe(ScalarLobes{}, p.lobe, fn);
}

}  // namespace lumicut

#endif

#ifdef HWY_TARGET_INCLUDE
#if defined(LUMICUT_BSDF_LOBES_SIMD_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_BSDF_LOBES_SIMD_
#undef LUMICUT_BSDF_LOBES_SIMD_
#else
#define LUMICUT_BSDF_LOBES_SIMD_
#endif

#include "bsdf/bump_shadow.h"
#include "bsdf/burley.h"
#include "bsdf/lambert.h"
#include "bsdf/lanes-inl.h"
#include "bsdf/oren_nayar.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// What a lobe offers in SIMD form. The structs of directions and values stand in bsdf/lanes-inl.h.
template <class L>
concept LaneLobe = requires(D d, V x, const LobeNumbers& of, const LobeDirections& at, const LobeCone& cone) {
  // Counterpart of the scalar value, and its largest over a cone of directions and a range of shapes. A bound never lies
  // below a value; slack for rounding is its own business.
  { L::Value(d, of, at) } -> std::same_as<LobeValue>;
  { L::Bound(d, cone) } -> std::same_as<LobeValue>;
  // Whether its colour goes from `specular` to `grazing`; else fresnel is 0.
  requires std::same_as<decltype(L::kFresnel), const bool>;
  // Whether the bound is that of value · cosine, over the cone's cosine; else of the value alone.
  requires std::same_as<decltype(L::kBoundOverCosine), const bool>;
  // For integrals over cones. Where it lies: round about the mirror direction and within 90 degrees of it; else as wide
  // across the plane of incidence as half vectors lead it, down to the horizon. And how far from the mirror direction it
  // is high, as a versine.
  requires std::same_as<decltype(L::kAroundMirror), const bool>;
  { L::Width(d, x) } -> std::same_as<V>;
};

using LaneLobes = LobeList<LUMICUT_LOBES>;

// How the diffuse part of each lane depends on angles.
struct DiffuseShape {
  V falloff, retro, dim;
  bool burley;  // of some lane
  bool bent;    // of any point; else `smooth` is 0
  V3 smooth;
  bool grooved;  // any point; else both are 0
  V slope, again;
};
template <class Points>
HWY_INLINE DiffuseShape LoadDiffuse(D d, const Points& points, size_t p) {
  const V retro = Load1(d, points.retro, p), dim = Load1(d, points.dim, p);
  const V zero = hn::Zero(d);
  DiffuseShape shape{Load1(d, points.falloff, p),
                     retro,
                     dim,
                     !hn::AllFalse(d, hn::Gt(hn::Add(retro, dim), zero)),
                     points.bent(),
                     {zero, zero, zero},
                     points.grooved(),
                     zero,
                     zero};
  if (shape.bent) shape.smooth = Load3(d, points.smooth, p);
  if (shape.grooved) shape.slope = Load1(d, points.slope, p), shape.again = Load1(d, points.again, p);
  return shape;
}
// n·m, n·l, m·l; and where any point is bent s·n and s·l.
struct DiffuseCosines {
  V view, light, beta, smooth_normal, smooth_light;
};
// Of Lambert's part.
HWY_INLINE V DiffuseFactor(D d, const DiffuseShape& s, const DiffuseCosines& c) {
  V factor = DiffuseFalloff(d, s.falloff, c.light);
  if (s.burley) factor = hn::Mul(factor, BurleyFactor(d, s.retro, s.dim, c.view, c.light, c.beta));
  if (s.grooved) factor = hn::Mul(factor, OrenNayarFactor(d, s.slope, s.again, c.view, c.light, c.beta));
  return s.bent ? hn::Mul(factor, BumpShadow(d, c.light, c.smooth_normal, c.smooth_light)) : factor;
}
// Bound of it over lights of at most `cosine` and views of at least `view`, where the rest of a product is bounded with the
// light's cosine over `steep`. `rise`: the largest k of bsdf/burley.h, at least 0; slope, again: largest.
HWY_INLINE V BoundOfDiffuse(D d, V falloff, V rise, V slope, V again, V view, V cosine, V steep) {
  V even = BoundOfDiffuseFalloff(d, falloff, cosine);
  const auto grooved = hn::Gt(slope, hn::Zero(d));
  if (!hn::AllFalse(d, grooved)) {
    const V facets = BoundOfOrenNayarFactor(d, slope, again, view, cosine, steep);
    even = hn::IfThenElse(grooved, hn::Mul(even, hn::Max(hn::Set(d, 1.0f), facets)), even);
  }
  const auto rises = hn::Gt(rise, hn::Zero(d));
  if (hn::AllFalse(d, rises)) return even;
  const V retro = BoundOfBurleyFactor(d, rise, view, cosine, steep);
  return hn::IfThenElse(rises, hn::Mul(even, retro), even);
}

// What the lobes of each lane are, and their numbers. Loops ask once which lobes the lanes have.
struct LobeShape {
  LobeNumbers of;
  DiffuseShape diffuse;
  hn::Vec<DU> lobe;
  bool some[LaneLobes::kCount];
};
template <class L>
HWY_INLINE hn::Mask<D> IsLobe(D d, hn::Vec<DU> lobe) {
  const DU du;
  return hn::RebindMask(d, hn::Eq(lobe, hn::Set(du, place_in<L>(LaneLobes{}))));
}
template <class... L>
HWY_INLINE LobeShape ShapeOfAny(LobeList<L...>, D d, const LobeNumbers& of, const DiffuseShape& diffuse,
                                hn::Vec<DU> lobe) {
  return {of, diffuse, lobe, {!hn::AllFalse(d, IsLobe<L>(d, lobe))...}};
}

// The lanes' shapes at points [p, p + Lanes(d)), as far as `kLobes` needs them.
template <Lobes kLobes, class Points>
HWY_INLINE LobeShape LoadShape(D d, const Points& points, size_t p) {
  const DU du;
  if constexpr (kLobes == Lobes::all)
    return ShapeOfAny(LaneLobes{}, d, {Load1(d, points.shape, p), Load1(d, points.ior, p)}, LoadDiffuse(d, points, p),
                      Load1(du, points.lobe, p));
  else {
    const V zero = hn::Zero(d);
    return {{kLobes == Lobes::cosine ? Load1(d, points.shape, p) : hn::Zero(d), hn::Zero(d)},
            {zero, zero, zero, false, false, {zero, zero, zero}, false, zero, zero},
            hn::Zero(du),
            {}};
  }
}

template <bool kAskLast, LaneLobe L, LaneLobe... Rest>
HWY_INLINE LobeValue ValueOfAny(LobeList<L, Rest...>, D d, const LobeShape& s, const LobeDirections& at) {
  LobeValue value{hn::Zero(d), hn::Zero(d)};
  if constexpr (sizeof...(Rest) > 0) value = ValueOfAny<kAskLast>(LobeList<Rest...>{}, d, s, at);
  if ((kAskLast || sizeof...(Rest) > 0) && !s.some[place_in<L>(LaneLobes{})]) return value;
  const LobeValue own = L::Value(d, s.of, at);
  if constexpr (sizeof...(Rest) == 0) return own;
  const auto here = IsLobe<L>(d, s.lobe);
  return {hn::IfThenElse(here, own.lobe, value.lobe), hn::IfThenElse(here, own.fresnel, value.fresnel)};
}
// Each lane's lobe, the last of the list first: it needs no choice between lanes. `kAskLast`: whether it is skipped where no
// lane has it; in a loop over directions that costs more than it saves.
template <Lobes kLobes, bool kAskLast = true>
HWY_INLINE LobeValue ValueOfLobes(D d, const LobeShape& s, const LobeDirections& at) {
  if constexpr (kLobes == Lobes::cosine)
    return CosineLobe::Value(d, s.of, at);
  else
    return ValueOfAny<kAskLast>(LaneLobes{}, d, s, at);
}

template <LaneLobe L>
HWY_INLINE LobeValue BoundOfLobe(D d, const LobeCone& cone, V steep) {
  LobeValue bound = L::Bound(d, cone);
  if constexpr (L::kBoundOverCosine) bound.lobe = hn::Mul(bound.lobe, steep);
  return bound;
}
template <LaneLobe L, LaneLobe... Rest>
HWY_INLINE LobeValue BoundOfAny(LobeList<L, Rest...>, D d, const LobeShape& s, const LobeCone& cone, V steep) {
  LobeValue bound{hn::Zero(d), hn::Zero(d)};
  if constexpr (sizeof...(Rest) > 0) bound = BoundOfAny(LobeList<Rest...>{}, d, s, cone, steep);
  if (!s.some[place_in<L>(LaneLobes{})]) return bound;
  const LobeValue own = BoundOfLobe<L>(d, cone, steep);
  if constexpr (sizeof...(Rest) == 0) return own;
  const auto here = IsLobe<L>(d, s.lobe);
  return {hn::IfThenElse(here, own.lobe, bound.lobe), hn::IfThenElse(here, own.fresnel, bound.fresnel)};
}
// Bound of each lane's lobe, where the rest of a product is bounded with the cone's cosine over `steep`.
template <Lobes kLobes>
HWY_INLINE LobeValue BoundOfLobes(D d, const LobeShape& s, const LobeCone& cone, V steep) {
  if constexpr (kLobes == Lobes::cosine)
    return BoundOfLobe<CosineLobe>(d, cone, steep);
  else
    return BoundOfAny(LaneLobes{}, d, s, cone, steep);
}

// specular + (grazing − specular)·fresnel, where that is more.
HWY_INLINE V3 BoundOfColor(D d, const V3& specular, const V3& grazing, V fresnel) {
  const auto one = [&](V s, V g) { return hn::MulAdd(hn::Max(hn::Zero(d), hn::Sub(g, s)), fresnel, s); };
  return {one(specular.x, grazing.x), one(specular.y, grazing.y), one(specular.z, grazing.z)};
}

// Where each lane's lobe lies, for integrals over cones.
struct LobeExtent {
  hn::Mask<D> around_mirror;
  V width;
};
template <LaneLobe L>
HWY_INLINE void SelectExtent(D d, const LobeShape& s, LobeExtent& extent) {
  const auto here = IsLobe<L>(d, s.lobe);
  if constexpr (L::kAroundMirror) extent.around_mirror = hn::Or(extent.around_mirror, here);
  extent.width = hn::IfThenElse(here, L::Width(d, s.of.shape), extent.width);
}
template <class... L>
HWY_INLINE LobeExtent ExtentOfAny(LobeList<L...>, D d, const LobeShape& s) {
  LobeExtent extent{hn::FirstN(d, 0), hn::Zero(d)};
  (SelectExtent<L>(d, s, extent), ...);
  return extent;
}
template <Lobes kLobes>
HWY_INLINE LobeExtent ExtentOfLobes(D d, const LobeShape& s) {
  if constexpr (kLobes == Lobes::cosine)
    return {hn::FirstN(d, hn::Lanes(d)), CosineLobe::Width(d, s.of.shape)};
  else
    return ExtentOfAny(LaneLobes{}, d, s);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
#endif
