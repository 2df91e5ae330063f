// Agglomeration of boxes and of balls: their policies, and the checks of input.
#include "accel/agglomerate.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "accel/agglomerate.cpp"
#include <hwy/foreach_target.h>
// foreach_target comes first.
#include <hwy/highway.h>

#include "accel/agglomerate-inl.h"
#include "accel/agglomerate/area_policy-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// d = radius of the smallest ball around both: (|c1 - c2| + r1 + r2) / 2, or the greater radius where one ball contains
// the other. [Omohundro 1989] Features: centre, -centre, radius. Unlike in other policies, features may decrease when
// clusters merge, since the centre moves. The bound over a node holds all the same: it takes the minima of existing
// clusters. Eq. 1 holds because the ball of A∪C contains the ball of A; merged radii are rounded up so that it does in
// floating point too.
struct BallPolicy {
  static constexpr bool kNonDecreasing = true;
  static constexpr int kFeatures = 0;
  static constexpr int kOrderDims = 8;  // the first eight dimensions; more improve the order little
  int dimension;
  size_t features() const { return static_cast<size_t>(2 * dimension + 1); }
  size_t key_features() const { return features(); }
  void merge(const float* a, const float* b, float* out) const {
    const int n = dimension;
    const double ra = a[2 * n], rb = b[2 * n];
    double dist2 = 0;
    for (int i = 0; i < n; ++i) dist2 += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
    const double dist = std::sqrt(dist2);
    // If each contains the other, the choice must not depend on the order of a and b.
    const bool a_holds = dist + rb <= ra, b_holds = dist + ra <= rb;
    if (a_holds || b_holds) {
      const bool take_a = a_holds && !(b_holds && std::lexicographical_compare(a, a + 2 * n + 1, b, b + 2 * n + 1));
      std::copy_n(take_a ? a : b, 2 * n + 1, out);
      return;
    }
    const double r = 0.5 * (dist + ra + rb);
    double reach_a = 0, reach_b = 0;
    for (int i = 0; i < n; ++i) {
      const double along_a = (r - ra) / dist, along_b = (r - rb) / dist;
      // Symmetric in a and b.
      const double c = 0.5 * ((a[i] + (double{b[i]} - a[i]) * along_a) + (b[i] + (double{a[i]} - b[i]) * along_b));
      out[i] = static_cast<float>(c);
      out[n + i] = -out[i];
      reach_a += (out[i] - double{a[i]}) * (out[i] - double{a[i]});
      reach_b += (out[i] - double{b[i]}) * (out[i] - double{b[i]});
    }
    const double reach = std::max(std::sqrt(reach_a) + ra, std::sqrt(reach_b) + rb);
    out[2 * n] = std::nextafter(static_cast<float>(reach), std::numeric_limits<float>::infinity());
  }
  void order_point(const float* a, float* point) const {
    for (int i = 0; i < kOrderDims; ++i) point[i] = i < dimension ? a[i] : 0.0f;
  }
  template <class D>
  struct Query {
    const float* a;
  };
  template <class D>
  HWY_INLINE Query<D> query(D, const float* a) const {
    return {a};
  }
  template <class D>
  HWY_INLINE hn::Vec<D> cost(D d, const Query<D>& query, const float* b) const {
    const float* a = query.a;
    const int n = dimension;
    auto dist2 = hn::Zero(d);
    for (int i = 0; i < n; ++i) {
      const auto above = hn::Sub(hn::Load(d, b + 8 * i), hn::Set(d, a[i]));
      const auto below = hn::Sub(hn::Load(d, b + 8 * (n + i)), hn::Set(d, a[n + i]));
      const auto apart = hn::Max(hn::Max(above, below), hn::Zero(d));
      dist2 = hn::Add(dist2, hn::Mul(apart, apart));
    }
    const auto ra = hn::Set(d, a[2 * n]), rb = hn::Load(d, b + 8 * (2 * n));
    const auto both = hn::Mul(hn::Add(hn::Sqrt(dist2), hn::Add(ra, rb)), hn::Set(d, 0.5f));
    return hn::Max(both, hn::Max(ra, rb));
  }
};
static_assert(agglomeration::ClusterPolicy<BallPolicy>);

// A dissimilarity of the caller's: one call for up to eight clusters, without SIMD.
struct CallerPolicy {
  static constexpr bool kNonDecreasing = true;  // agglomerate_by() refuses strategies where it is not
  static constexpr bool kUntrusted = true;
  static constexpr int kFeatures = 0;
  static constexpr int kOrderDims = 8;
  const Dissimilarity& by;

  size_t features() const { return by.features; }
  size_t key_features() const { return by.key_features == 0 ? by.features : by.key_features; }
  void merge(const float* a, const float* b, float* out) const {
    by.merge(a, b, out);
    for (size_t f = 0; f < by.features; ++f)
      if (!(out[f] >= std::max(a[f], b[f]) && out[f] < std::numeric_limits<float>::infinity()))
        fail_argument("agglomerate: feature " + std::to_string(f) + " of a joint cluster is " + std::to_string(out[f]) +
                      ", not finite or below " + std::to_string(std::max(a[f], b[f])) + " of a part");
  }
  void order_point(const float* a, float* point) const {
    std::fill_n(point, kOrderDims, 0.0f);
    if (by.order) return by.order(a, point);
    std::copy_n(a, std::min<size_t>(by.features, kOrderDims), point);
  }
  template <class D>
  struct Query {
    const float* a;
  };
  template <class D>
  HWY_INLINE Query<D> query(D, const float* a) const {
    return {a};
  }
  template <class D>
  HWY_NOINLINE hn::Vec<D> cost(D d, const Query<D>& query, const float* b) const {
    HWY_ALIGN float costs[8];
    float rows[8 * agglomeration::kMaxFeatures], of_rows[8];
    size_t count = 0, lane_of[8];
    for (size_t lane = 0; lane < hn::Lanes(d); ++lane) {
      costs[lane] = std::numeric_limits<float>::infinity();
      if (b[lane] == costs[lane]) continue;  // no cluster
      for (size_t f = 0; f < by.features; ++f) rows[count * by.features + f] = b[8 * f + lane];
      lane_of[count++] = lane;
    }
    if (count > 0) by.cost(query.a, rows, count, of_rows);
    for (size_t i = 0; i < count; ++i) {
      if (std::isnan(of_rows[i])) fail_argument("agglomerate: a cost is NaN");
      costs[lane_of[i]] = std::min(of_rows[i], std::numeric_limits<float>::max());
    }
    return hn::Load(d, costs);
  }
};
static_assert(agglomeration::ClusterPolicy<CallerPolicy>);

std::vector<Merge> caller(const Dissimilarity& by, std::span<const float> leaves, Strategy strategy,
                          Progress* progress) {
  const CallerPolicy policy{by};
  const size_t n = leaves.size() / by.features;
  agglomeration::Core<CallerPolicy> core(policy, n, strategy == Strategy::parallel, progress);
  for (size_t i = 0; i < n; ++i)
    std::copy_n(leaves.begin() + static_cast<std::ptrdiff_t>(i * by.features), by.features, core.leaf(i));
  std::vector<Merge> merges = core.run(strategy);
  if (merges.size() + 1 < n) fail_argument(agglomeration::kInconsistent);
  return merges;
}

std::vector<Merge> boxes(std::span<const Aabb> input, float scale, float inflate, Strategy strategy,
                         Progress* progress) {
  const agglomeration::AreaPolicy policy;
  agglomeration::Core<agglomeration::AreaPolicy> core(policy, input.size(), strategy == Strategy::parallel, progress);
  core.for_chunks(input.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* f = core.leaf(i);
      for (int axis = 0; axis < 3; ++axis) {
        f[axis] = -(input[i].lo[axis] * scale);
        f[3 + axis] = input[i].hi[axis] * scale + inflate;
      }
    }
  });
  return core.run(strategy);
}

std::vector<Merge> balls(std::span<const float> centres, std::span<const float> radii, int dimension, Strategy strategy,
                         Progress* progress) {
  const BallPolicy policy{dimension};
  agglomeration::Core<BallPolicy> core(policy, radii.size(), strategy == Strategy::parallel, progress);
  for (size_t i = 0; i < radii.size(); ++i) {
    float* f = core.leaf(i);
    for (int a = 0; a < dimension; ++a) {
      f[a] = centres[i * static_cast<size_t>(dimension) + static_cast<size_t>(a)];
      f[dimension + a] = -f[a];
    }
    f[2 * dimension] = radii[i];
  }
  return core.run(strategy);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {

HWY_EXPORT(boxes);
HWY_EXPORT(balls);
HWY_EXPORT(caller);

std::vector<Merge> agglomerate_boxes(std::span<const Aabb> input, Strategy strategy, Progress* progress) {
  if (input.size() >= 0x7fffffffu) throw Error(ErrorCode::unsupported, "agglomerate: more than 2^31 boxes");
  Aabb all;
  for (size_t i = 0; i < input.size(); ++i) {
    const Aabb& b = input[i];
    // NaN fails too.
    if (b.empty() || !(max_component(max(-b.lo, b.hi)) < 1e19f))
      fail_argument("agglomerate_boxes: box " + std::to_string(i) + " is empty, not finite, or reaches past 1e19");
    all.extend(b);
  }
  const float size = input.empty() ? 0.0f : max_component(all.extent());
  // A power of two: exact, and keeps products of sides in range.
  const float scale = size > 1e-30f ? std::exp2(-std::floor(std::log2(size))) : 1.0f;
  return HWY_DYNAMIC_DISPATCH(boxes)(input, scale, 1e-7f, strategy, progress);
}

std::vector<Merge> agglomerate_balls(std::span<const float> centres, std::span<const float> radii, int dimension,
                                     Strategy strategy, Progress* progress) {
  if (dimension < 1 || dimension > 16)
    fail_argument("agglomerate_balls: dimension is " + std::to_string(dimension) + ", not 1 to 16");
  if (centres.size() != radii.size() * static_cast<size_t>(dimension))
    fail_argument("agglomerate_balls: " + std::to_string(centres.size()) + " coordinates for " +
                  std::to_string(radii.size()) + " balls of dimension " + std::to_string(dimension));
  if (radii.size() >= 0x7fffffffu) throw Error(ErrorCode::unsupported, "agglomerate: more than 2^31 balls");
  for (size_t i = 0; i < centres.size(); ++i)
    if (!(std::abs(centres[i]) < 1e18f))
      fail_argument("agglomerate_balls: centres[" + std::to_string(i) + "] is " + std::to_string(centres[i]));
  for (size_t i = 0; i < radii.size(); ++i)
    if (!(radii[i] >= 0.0f && radii[i] < 1e18f))
      fail_argument("agglomerate_balls: radii[" + std::to_string(i) + "] is " + std::to_string(radii[i]));
  return HWY_DYNAMIC_DISPATCH(balls)(centres, radii, dimension, strategy, progress);
}

std::vector<Merge> agglomerate_by(const Dissimilarity& dissimilarity, std::span<const float> leaves, Strategy strategy,
                                  Progress* progress) {
  const Dissimilarity& d = dissimilarity;
  if (d.features < 1 || d.features > 64)
    fail_argument("agglomerate: " + std::to_string(d.features) + " features, not 1 to 64");
  if (d.key_features > d.features)
    fail_argument("agglomerate: key_features is " + std::to_string(d.key_features) + " of " +
                  std::to_string(d.features) + " features");
  if (!d.merge || !d.cost) fail_argument("agglomerate: no function to merge, or none of costs");
  if (!d.non_decreasing && (strategy == Strategy::locally_ordered || strategy == Strategy::parallel))
    fail_argument(
        "agglomerate: locally ordered strategies need a dissimilarity that never falls as clusters grow (Eq. 1)");
  if (leaves.size() % d.features != 0)
    fail_argument("agglomerate: " + std::to_string(leaves.size()) + " numbers are no rows of " +
                  std::to_string(d.features) + " features");
  if (leaves.size() / d.features >= 0x7fffffffu)
    throw Error(ErrorCode::unsupported, "agglomerate: more than 2^31 leaves");
  for (size_t i = 0; i < leaves.size(); ++i)
    if (!std::isfinite(leaves[i]))
      fail_argument("agglomerate: feature " + std::to_string(i % d.features) + " of leaf " +
                    std::to_string(i / d.features) + " is " + std::to_string(leaves[i]));
  return HWY_DYNAMIC_DISPATCH(caller)(d, leaves, strategy, progress);
}

Strategy strategy_of(const std::string& name) {
  if (name == "naive") return Strategy::naive;
  if (name == "heap") return Strategy::heap;
  if (name == "local") return Strategy::locally_ordered;
  if (name == "parallel") return Strategy::parallel;
  fail_argument("strategy '" + name + "' is none of naive, heap, local, parallel");
}

}  // namespace lumicut
#endif  // HWY_ONCE
