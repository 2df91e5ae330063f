// Light of a virtual sphere at vectors of points: the integral over the cone of directions to it. [Hašan et al. 2009]
//   I/(πr²) ∫_Ω f(x, ω) cosθx cosθl dω, by fixed directions, so that neighbours agree and no noise is left.
// Departs: the paper draws directions at random. Here the diffuse part has a closed form where the whole cone lies
// above both horizons, and 18 directions elsewhere; lobes are integrated along rays from the mirror direction, whose
// ends in the cone are known. And the cone opens steadily from the hemisphere at the sphere's surface to all directions
// at its centre, where the paper jumps to all: no edge is seen. docs/integrators/virtual_spherical_lights.md
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_CLUSTERING_SPHERE_INTEGRAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_CLUSTERING_SPHERE_INTEGRAL_INL_H_
#undef LUMICUT_CLUSTERING_SPHERE_INTEGRAL_INL_H_
#else
#define LUMICUT_CLUSTERING_SPHERE_INTEGRAL_INL_H_
#endif

#include "clustering/light_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {hn::NegMulAdd(a.z, b.y, hn::Mul(a.y, b.z)), hn::NegMulAdd(a.x, b.z, hn::Mul(a.z, b.x)),
          hn::NegMulAdd(a.y, b.x, hn::Mul(a.x, b.y))};
}

// Directions to the sphere: within the angle α of `axis`. Angles are kept as versines, 1 − cos, which do not cancel
// where they are small.
struct SphereCone {
  V3 axis;
  V versine, sine2;  // of α
  V geometry;        // solid angle over πr²
  hn::Mask<D> open;  // α passes π/2: the point is inside
};

HWY_INLINE SphereCone ConeOfSphere(D d, const Vpl& light, const V3& position, const V3& normal) {
  const V one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f), r2 = hn::Set(d, light.radius() * light.radius());
  const V3 center = Set3(d, light.position);
  const V3 v{hn::Sub(center.x, position.x), hn::Sub(center.y, position.y), hn::Sub(center.z, position.z)};
  const V dist2 = hn::Max(Dot(v, v), hn::Set(d, 1e-30f)), inverse = hn::Div(one, hn::Sqrt(dist2));
  SphereCone c;
  const auto centred = hn::Lt(dist2, hn::Mul(r2, hn::Set(d, 1e-12f)));
  c.axis = {hn::IfThenElse(centred, normal.x, hn::Mul(v.x, inverse)),
            hn::IfThenElse(centred, normal.y, hn::Mul(v.y, inverse)),
            hn::IfThenElse(centred, normal.z, hn::Mul(v.z, inverse))};
  c.open = hn::Lt(dist2, r2);
  c.sine2 = hn::Div(hn::Min(r2, dist2), hn::Max(r2, dist2));
  const V wide = hn::Add(one, hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, c.sine2))));
  c.versine = hn::IfThenElse(c.open, wide, hn::Div(c.sine2, wide));
  c.geometry = hn::IfThenElse(c.open, hn::Div(hn::Mul(two, wide), r2), hn::Div(two, hn::Mul(dist2, wide)));
  return c;
}

// True where some direction of the cone makes an acute angle with a vector at `cosine` to its axis.
HWY_INLINE hn::Mask<D> RisesAbove(D d, const SphereCone& c, V cosine) {
  return hn::Or(c.open, hn::Or(hn::Gt(cosine, hn::Zero(d)), hn::Lt(hn::Mul(cosine, cosine), c.sine2)));
}
// True where all do.
HWY_INLINE hn::Mask<D> LiesAbove(D d, const SphereCone& c, V cosine) {
  return hn::AndNot(c.open, hn::And(hn::Gt(cosine, hn::Zero(d)), hn::Ge(hn::Mul(cosine, cosine), c.sine2)));
}

// Gauss's places of three rings in the cone, by versine, and six directions of each, turned half a step in the second.
constexpr float kRing[3] = {0.11270167f, 0.5f, 0.88729833f}, kRingWeight[3] = {5.0f / 18, 8.0f / 18, 5.0f / 18};
constexpr float kTurn[2][6][2] = {{{0.96592583f, 0.25881905f},
                                   {0.25881905f, 0.96592583f},
                                   {-0.70710678f, 0.70710678f},
                                   {-0.96592583f, -0.25881905f},
                                   {-0.25881905f, -0.96592583f},
                                   {0.70710678f, -0.70710678f}},
                                  {{0.70710678f, 0.70710678f},
                                   {-0.25881905f, 0.96592583f},
                                   {-0.96592583f, 0.25881905f},
                                   {-0.70710678f, -0.70710678f},
                                   {0.25881905f, -0.96592583f},
                                   {0.96592583f, -0.25881905f}}};

// Mean over the cone of cosθx·cosθl and the diffuse part's factor, where `facing` is the light's normal turned around. The
// rings integrate squares of directions exactly: they and the closed form go over into each other.
template <bool kShaped, bool kCosine>
HWY_INLINE V MeanOfCosines(D d, const SphereCone& c, const V3& normal, const V3& facing, const V3& mirror,
                           const DiffuseShape& shape) {
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  const V na = Dot(normal, c.axis), la = kCosine ? Dot(facing, c.axis) : one;
  auto above = LiesAbove(d, c, na);
  if constexpr (kCosine) above = hn::And(above, LiesAbove(d, c, la));
  if constexpr (kShaped)
    above = hn::And(above, hn::Eq(hn::Add(hn::Add(shape.falloff, shape.slope), hn::Add(shape.retro, shape.dim)), zero));
  if (!(kShaped && shape.bent) && hn::AllTrue(d, above)) {
    // Means of cos and cos² to the axis.
    const V first = hn::NegMulAdd(half, c.versine, one);
    if constexpr (!kCosine) return hn::Mul(na, first);
    const V second = hn::MulAdd(hn::Mul(c.versine, c.versine), hn::Set(d, 1.0f / 3.0f), hn::Sub(one, c.versine));
    const V across = hn::Mul(half, hn::Sub(one, second));
    return hn::MulAdd(Dot(normal, facing), across, hn::Mul(hn::Mul(na, la), hn::Sub(second, across)));
  }
  // A frame that turns with the surface, so that it does not jump between neighbours.
  V3 t{hn::NegMulAdd(na, c.axis.x, normal.x), hn::NegMulAdd(na, c.axis.y, normal.y),
       hn::NegMulAdd(na, c.axis.z, normal.z)};
  const V length2 = Dot(t, t);
  const auto upright = hn::Lt(length2, hn::Set(d, 1e-10f));
  const V inverse = hn::Div(one, hn::Sqrt(hn::Max(length2, hn::Set(d, 1e-10f))));
  const V sign = hn::IfThenElse(hn::Lt(c.axis.z, zero), hn::Set(d, -1.0f), one);
  const V k = hn::Div(hn::Neg(one), hn::Add(sign, c.axis.z)), xk = hn::Mul(c.axis.x, k);
  t = {hn::IfThenElse(upright, hn::MulAdd(hn::Mul(sign, c.axis.x), xk, one), hn::Mul(t.x, inverse)),
       hn::IfThenElse(upright, hn::Mul(sign, hn::Mul(c.axis.y, xk)), hn::Mul(t.y, inverse)),
       hn::IfThenElse(upright, hn::Neg(hn::Mul(sign, c.axis.x)), hn::Mul(t.z, inverse))};
  const V3 b = Cross(c.axis, t);
  const V nt = Dot(normal, t), nb = Dot(normal, b), lt = Dot(facing, t), lb = Dot(facing, b);
  V nm = zero, ma = zero, mt = zero, mb = zero, sn = zero, sa = zero, st = zero, sb = zero;
  if constexpr (kShaped) {
    if (shape.burley || shape.grooved)
      nm = Dot(normal, mirror), ma = Dot(mirror, c.axis), mt = Dot(mirror, t), mb = Dot(mirror, b);
    if (shape.bent) {
      sn = Dot(shape.smooth, normal), sa = Dot(shape.smooth, c.axis);
      st = Dot(shape.smooth, t), sb = Dot(shape.smooth, b);
    }
  }
  V sum = zero;
  for (size_t ring = 0; ring < 3; ++ring) {
    const V versine = hn::Mul(c.versine, hn::Set(d, kRing[ring])), cosine = hn::Sub(one, versine);
    const V sine = hn::Sqrt(hn::Max(zero, hn::Mul(versine, hn::Sub(hn::Set(d, 2.0f), versine))));
    V of_ring = zero;
    for (const auto& turn : kTurn[ring % 2]) {
      const V x = hn::Mul(sine, hn::Set(d, turn[0])), y = hn::Mul(sine, hn::Set(d, turn[1]));
      const V cx = hn::Max(zero, hn::MulAdd(cosine, na, hn::MulAdd(x, nt, hn::Mul(y, nb))));
      V both = cx;
      if constexpr (kCosine)
        both = hn::Mul(cx, hn::Max(zero, hn::MulAdd(cosine, la, hn::MulAdd(x, lt, hn::Mul(y, lb)))));
      if constexpr (kShaped) {
        DiffuseCosines cosines{nm, cx, zero, sn, zero};
        if (shape.burley || shape.grooved) cosines.beta = hn::MulAdd(cosine, ma, hn::MulAdd(x, mt, hn::Mul(y, mb)));
        if (shape.bent) cosines.smooth_light = hn::MulAdd(cosine, sa, hn::MulAdd(x, st, hn::Mul(y, sb)));
        both = hn::Mul(both, DiffuseFactor(d, shape, cosines));
      }
      of_ring = hn::Add(of_ring, both);
    }
    sum = hn::MulAdd(of_ring, hn::Set(d, kRingWeight[ring] / 6.0f), sum);
  }
  return sum;
}

// Means over the cone of lobe·cosθx·cosθl: `specular` and `grazing` of LobeSums. Rays leave the mirror direction, in the
// plane of incidence and across it as the lobe is stretched; along each, places are dense as the lobe is high. The
// sum is divided by the cone's solid angle, or by what the rays make of it where that is more: a mean of values in the
// cone, so that bounds over the cone hold for it.
template <Lobes kLobes, bool kCosine>
HWY_INLINE void MeanOfLobe(D d, const SphereCone& c, const V3& normal, const V3& facing, const V3& mirror,
                           const LobeShape& shape, V& specular, V& grazing) {
  constexpr int kRays = 6, kPlaces = 3;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f), tiny = hn::Set(d, 1e-20f);
  const LobeExtent extent = ExtentOfLobes<kLobes>(d, shape);
  const V nm = Dot(normal, mirror), cos_half = hn::Sub(one, c.versine);
  // From the mirror direction to the axis.
  const V3 apart{hn::Sub(mirror.x, c.axis.x), hn::Sub(mirror.y, c.axis.y), hn::Sub(mirror.z, c.axis.z)};
  const V versine = hn::Mul(hn::Set(d, 0.5f), Dot(apart, apart)), cosine = hn::Sub(one, versine);
  const V sine2 = hn::Max(zero, hn::Mul(versine, hn::Sub(two, versine)));
  // In the plane of incidence, and across.
  V3 p{hn::NegMulAdd(nm, mirror.x, normal.x), hn::NegMulAdd(nm, mirror.y, normal.y),
       hn::NegMulAdd(nm, mirror.z, normal.z)};
  const V length2 = Dot(p, p);
  const auto upright = hn::Lt(length2, hn::Set(d, 1e-10f));
  const V inverse = hn::Div(one, hn::Sqrt(hn::Max(length2, hn::Set(d, 1e-10f))));
  const V sign = hn::IfThenElse(hn::Lt(mirror.z, zero), hn::Set(d, -1.0f), one);
  const V k = hn::Div(hn::Neg(one), hn::Add(sign, mirror.z)), xk = hn::Mul(mirror.x, k);
  p = {hn::IfThenElse(upright, hn::MulAdd(hn::Mul(sign, mirror.x), xk, one), hn::Mul(p.x, inverse)),
       hn::IfThenElse(upright, hn::Mul(sign, hn::Mul(mirror.y, xk)), hn::Mul(p.y, inverse)),
       hn::IfThenElse(upright, hn::Neg(hn::Mul(sign, mirror.x)), hn::Mul(p.z, inverse))};
  const V3 q = Cross(mirror, p);
  const V stretch = hn::IfThenElse(extent.around_mirror, one, hn::Max(nm, hn::Set(d, 0.05f)));  // across over along
  // Towards the axis.
  V ex = Dot(c.axis, p), ey = Dot(c.axis, q);
  const V e2 = hn::MulAdd(ex, ex, hn::Mul(ey, ey));
  const auto on_axis = hn::Lt(e2, tiny);
  const V e_inverse = hn::Div(one, hn::Sqrt(hn::Max(e2, tiny)));
  ex = hn::IfThenElse(on_axis, one, hn::Mul(ex, e_inverse)),
  ey = hn::IfThenElseZero(hn::Not(on_axis), hn::Mul(ey, e_inverse));
  const auto holds_mirror = hn::Lt(versine, c.versine), all_around = hn::Or(holds_mirror, c.open);

  // The rays' angle, from the first tangent to the cone to the last, or all around.
  const V sw = hn::Min(one, hn::Sqrt(hn::Div(c.sine2, hn::Max(sine2, tiny))));
  const V cw = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(sw, sw, one))), unstretch = hn::Div(one, stretch);
  V x1 = hn::MulAdd(ex, cw, hn::Mul(ey, sw)), y1 = hn::Mul(hn::NegMulAdd(ex, sw, hn::Mul(ey, cw)), unstretch);
  V x2 = hn::NegMulAdd(ey, sw, hn::Mul(ex, cw)), y2 = hn::Mul(hn::MulAdd(ey, cw, hn::Mul(ex, sw)), unstretch);
  const V l1 = hn::Div(one, hn::Sqrt(hn::MulAdd(x1, x1, hn::Mul(y1, y1))));
  const V l2 = hn::Div(one, hn::Sqrt(hn::MulAdd(x2, x2, hn::Mul(y2, y2))));
  x1 = hn::Mul(x1, l1), y1 = hn::Mul(y1, l1), x2 = hn::Mul(x2, l2), y2 = hn::Mul(y2, l2);
  const V dx = hn::Sub(x2, x1), dy = hn::Sub(y2, y1);
  const V chord = hn::Min(one, hn::Mul(hn::Set(d, 0.5f), hn::Sqrt(hn::MulAdd(dx, dx, hn::Mul(dy, dy)))));
  const V angle = hn::IfThenElse(all_around, hn::Set(d, 6.2831853f), hn::Mul(two, hn::Asin(d, chord)));
  V x = hn::IfThenElse(all_around, one, x1), y = hn::IfThenElseZero(hn::Not(all_around), y1);
  const V step = hn::Mul(angle, hn::Set(d, 1.0f / kRays));
  const V h = hn::Mul(step, hn::Set(d, 0.5f)), h2 = hn::Mul(h, h);  // at most π/6
  const V sin_h = hn::Mul(h, hn::MulAdd(h2, hn::MulAdd(h2, hn::Set(d, 1.0f / 120), hn::Set(d, -1.0f / 6)), one));
  const V cos_h = hn::MulAdd(
      h2, hn::MulAdd(h2, hn::MulAdd(h2, hn::Set(d, -1.0f / 720), hn::Set(d, 1.0f / 24)), hn::Set(d, -0.5f)), one);
  const V sin_step = hn::Mul(two, hn::Mul(sin_h, cos_h)), cos_step = hn::NegMulAdd(two, hn::Mul(sin_h, sin_h), one);
  const auto turn = [&](V c_by, V s_by) {
    const V turned = hn::NegMulAdd(y, s_by, hn::Mul(x, c_by));
    y = hn::MulAdd(y, c_by, hn::Mul(x, s_by)), x = turned;
  };
  turn(cos_h, sin_h);

  V sum = zero, edge = zero, weight = zero;
  for (int ray = 0; ray < kRays; ++ray, turn(cos_step, sin_step)) {
    const V yc = hn::Mul(y, stretch), norm2 = hn::MulAdd(x, x, hn::Mul(yc, yc));
    const V norm = hn::Div(one, hn::Sqrt(norm2)), vx = hn::Mul(x, norm), vy = hn::Mul(yc, norm);
    const V3 v{hn::MulAdd(p.x, vx, hn::Mul(q.x, vy)), hn::MulAdd(p.y, vx, hn::Mul(q.y, vy)),
               hn::MulAdd(p.z, vx, hn::Mul(q.z, vy))};
    // Where the great circle enters and leaves the cone, as versines from the mirror direction.
    const V towards = hn::MulAdd(vx, ex, hn::Mul(vy, ey));
    const V aside = hn::NegMulAdd(vy, ex, hn::Mul(vx, ey)), side2 = hn::Mul(sine2, hn::Mul(aside, aside));
    const V along = hn::Mul(hn::Sqrt(sine2), towards), reach2 = hn::Sub(c.sine2, side2);
    const V reach = hn::Sqrt(hn::Max(zero, reach2)), k2 = hn::Max(hn::Set(d, 1e-9f), hn::Sub(one, side2));
    const V middle = hn::Sub(hn::NegMulAdd(versine, c.versine, hn::Add(versine, c.versine)), side2);
    V from = hn::Max(zero, hn::Div(hn::NegMulAdd(along, reach, middle), k2));
    V to = hn::Div(hn::MulAdd(along, reach, middle), k2);
    const auto wraps = hn::Le(hn::MulAdd(along, cos_half, hn::Mul(cosine, reach)), zero);
    const auto whole = hn::And(c.open, hn::Le(reach2, zero));
    from = hn::IfThenElseZero(hn::Not(hn::Or(holds_mirror, whole)), from);
    to = hn::IfThenElse(hn::Or(wraps, whole), two, to);
    // Not below the horizon of the point, and not behind a lobe round about the mirror direction.
    const V nv = Dot(normal, v);
    const V horizon = hn::Add(one, hn::Div(nv, hn::Sqrt(hn::Max(tiny, hn::MulAdd(nm, nm, hn::Mul(nv, nv))))));
    to = hn::Min(to, hn::IfThenElse(extent.around_mirror, hn::Min(horizon, one), horizon));
    const V range = hn::Sub(to, from);
    const auto crosses = hn::Gt(range, zero);
    if (hn::AllFalse(d, crosses)) continue;
    const V width = hn::IfThenElse(extent.around_mirror, extent.width, hn::Mul(extent.width, norm2));
    const V start = hn::Add(from, width), end = hn::Add(start, range);
    const V share_of_step = hn::Mul(hn::Mul(step, stretch), hn::Set(d, 1.0f / kPlaces));
    const V scale = hn::IfThenElseZero(crosses, hn::Div(hn::Mul(share_of_step, range), norm2));
    for (int place = 0; place < kPlaces; ++place) {
      const float u = (static_cast<float>(place) + 0.5f) / kPlaces;
      const V below = hn::Div(one, hn::MulAdd(range, hn::Set(d, 1.0f - u), start));
      const V b = hn::MulAdd(hn::Mul(range, hn::Set(d, u)), hn::Mul(start, below), from);
      const V w = hn::Mul(hn::Mul(scale, hn::Mul(start, below)), hn::Mul(end, below));  // solid angle
      weight = hn::Add(weight, w);
      const V c_b = hn::Sub(one, b), s_b = hn::Sqrt(hn::Max(zero, hn::Mul(b, hn::Sub(two, b))));
      const V3 to_light{hn::MulAdd(mirror.x, c_b, hn::Mul(v.x, s_b)), hn::MulAdd(mirror.y, c_b, hn::Mul(v.y, s_b)),
                        hn::MulAdd(mirror.z, c_b, hn::Mul(v.z, s_b))};
      const V cos_x = hn::Max(zero, hn::MulAdd(nm, c_b, hn::Mul(nv, s_b)));
      V both = hn::Mul(w, cos_x);
      if constexpr (kCosine) both = hn::Mul(both, hn::Max(zero, Dot(facing, to_light)));
      const LobeValue value = ValueOfLobes<kLobes, false>(d, shape, {normal, mirror, to_light, cos_x, c_b});
      if constexpr (kLobes == Lobes::cosine) {
        sum = hn::MulAdd(both, value.lobe, sum);
      } else {
        const V lobe = hn::Mul(value.lobe, both);
        sum = hn::MulAdd(lobe, hn::Sub(one, value.fresnel), sum);
        edge = hn::MulAdd(lobe, value.fresnel, edge);
      }
    }
  }
  const V share = hn::Div(one, hn::Max(weight, hn::Max(tiny, hn::Mul(hn::Set(d, 6.2831853f), c.versine))));
  specular = hn::Mul(sum, share), grazing = hn::Mul(edge, share);
}

// What a sphere of intensity 1 gives through the parts of a point's reflectance: geometry, cosines and all. `kCosine`
// false: it shines as brightly to all sides. `axis`: to its centre. [Hašan et al. 2009, Eq. 5]
template <Lobes kLobes, bool kCosine, class Points>
HWY_INLINE LobeSums SphereLobes(D d, const Vpl& light, const Points& points, size_t p, const V3& position,
                                const V3& normal, V3& axis) {
  const V zero = hn::Zero(d);
  const SphereCone cone = ConeOfSphere(d, light, position, normal);
  axis = cone.axis;
  const V3 light_normal = Set3(d, light.normal);
  const V3 facing{hn::Neg(light_normal.x), hn::Neg(light_normal.y), hn::Neg(light_normal.z)};
  LobeSums parts{zero, zero, zero};
  const V na = Dot(normal, axis);
  auto lit = RisesAbove(d, cone, na);
  if constexpr (kCosine) lit = hn::And(lit, RisesAbove(d, cone, Dot(facing, axis)));
  if (hn::AllFalse(d, lit)) return parts;
  V3 mirror{zero, zero, zero};
  if constexpr (kLobes != Lobes::none) mirror = Load3(d, points.mirror, p);
  const LobeShape shape = LoadShape<kLobes>(d, points, p);
  const V even = MeanOfCosines<kLobes == Lobes::all, kCosine>(d, cone, normal, facing, mirror, shape.diffuse);
  parts.diffuse = hn::IfThenElseZero(lit, hn::Mul(cone.geometry, even));
  if constexpr (kLobes != Lobes::none) {
    if (kLobes == Lobes::cosine && hn::AllFalse(d, hn::And(lit, RisesAbove(d, cone, Dot(mirror, axis))))) return parts;
    V specular, grazing;
    MeanOfLobe<kLobes, kCosine>(d, cone, normal, facing, mirror, shape, specular, grazing);
    // Where the cone is narrower than rounding resolves, the lobe is that of its axis.
    const auto narrow = hn::Lt(cone.sine2, hn::Set(d, 1e-8f));
    if (!hn::AllFalse(d, narrow)) {
      const LobeSums at = LobesTowards<kLobes>(d, normal, mirror, shape, axis);
      V both = hn::Max(zero, na);
      if constexpr (kCosine) both = hn::Mul(both, hn::Max(zero, Dot(facing, axis)));
      specular = hn::IfThenElse(narrow, hn::Mul(both, at.specular), specular);
      grazing = hn::IfThenElse(narrow, hn::Mul(both, at.grazing), grazing);
    }
    parts.specular = hn::IfThenElseZero(lit, hn::Mul(cone.geometry, specular));
    parts.grazing = hn::IfThenElseZero(lit, hn::Mul(cone.geometry, grazing));
  }
  return parts;
}

// The same as radiance for intensity 1.
template <Lobes kLobes, bool kCosine, class Points>
HWY_INLINE V3 SphereRadiance(D d, const Vpl& light, const Points& points, size_t p, const V3& position,
                             const V3& normal, V3& axis) {
  const LobeSums parts = SphereLobes<kLobes, kCosine>(d, light, points, p, position, normal, axis);
  const V3 diffuse = Load3(d, points.diffuse, p);
  V3 f{hn::Mul(diffuse.x, parts.diffuse), hn::Mul(diffuse.y, parts.diffuse), hn::Mul(diffuse.z, parts.diffuse)};
  const auto add = [&f](const V3& color, V part) {
    f = {hn::MulAdd(color.x, part, f.x), hn::MulAdd(color.y, part, f.y), hn::MulAdd(color.z, part, f.z)};
  };
  if constexpr (kLobes != Lobes::none) add(Load3(d, points.specular, p), parts.specular);
  if constexpr (kLobes == Lobes::all) add(Load3(d, points.grazing, p), parts.grazing);
  return f;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
