// Agglomeration: the same tree from every strategy, properties of the policies, and degenerate input.
#include "accel/agglomerate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

#include "accel/agglomerate-inl.h"
#include "clustering/light_policy.h"
#include "core/cone.h"
#include "core/error.h"
#include "tests/accel/meshes.h"
#include "tests/support/trimmed.h"

#include <tbb/task_arena.h>

namespace lumicut {
namespace {

using test::boxes_of;

constexpr Strategy kFast[] = {Strategy::heap, Strategy::locally_ordered, Strategy::parallel};

std::vector<LightLeaf> random_lights(size_t n, VplKind kind, uint64_t seed) {
  Rng rng(seed, Stage::test);
  std::vector<LightLeaf> lights(n);
  for (LightLeaf& l : lights) {
    l.position = test::random_point(rng) * 10.0f;
    l.normal = test::random_direction(rng);
    l.kind = kind;
    l.intensity = rng.next_float() * 3.0f;
  }
  return lights;
}

// Every leaf and every merge but the last is a child once; children come before parents; post-order with the least leaf
// left.
void expect_canonical_tree(const std::vector<Merge>& merges, size_t n) {
  ASSERT_EQ(merges.size(), n > 0 ? n - 1 : 0);
  std::vector<int> used(n + merges.size(), 0);
  std::vector<uint32_t> least(n + merges.size());
  for (uint32_t i = 0; i < n; ++i) least[i] = i;
  for (size_t k = 0; k < merges.size(); ++k) {
    const Merge& m = merges[k];
    ASSERT_LT(m.left, n + k);
    ASSERT_LT(m.right, n + k);
    ++used[m.left], ++used[m.right];
    EXPECT_LT(least[m.left], least[m.right]);
    least[n + k] = least[m.left];
    if (m.right >= n) {
      EXPECT_EQ(m.right, n + k - 1);  // post-order
    }
  }
  for (size_t i = 0; i + 1 < used.size(); ++i) EXPECT_EQ(used[i], 1) << i;
}

int depth_of(const std::vector<Merge>& merges, size_t n) {
  std::vector<int> depth(n + merges.size(), 0);
  for (size_t k = 0; k < merges.size(); ++k) depth[n + k] = 1 + std::max(depth[merges[k].left], depth[merges[k].right]);
  return depth.back();
}

// By Eq. 1 no cluster costs less than what it is made of.
void expect_costs_rise(const std::vector<Merge>& merges, size_t n, float slack = 0.0f) {
  for (const Merge& m : merges)
    for (const uint32_t child : {m.left, m.right})
      if (child >= n) {
        EXPECT_LE(merges[child - n].cost, m.cost * (1.0f + slack));
      }
}

TEST(Agglomerate, AllStrategiesBuildTheGreedyTreeOfRandomBoxes) {
  for (const size_t n : {2u, 3u, 7u, 8u, 9u, 65u, 150u}) {
    const auto boxes = boxes_of(test::random_soup(n, 0.2f, n));
    const auto naive = agglomerate_boxes(boxes, Strategy::naive);
    expect_canonical_tree(naive, n);
    expect_costs_rise(naive, n);
    for (const Strategy s : kFast) EXPECT_EQ(agglomerate_boxes(boxes, s), naive) << n << " " << static_cast<int>(s);
  }
}

TEST(Agglomerate, AllStrategiesBuildTheGreedyTreeOfAMeshWhoseTriangleBoxesTie) {
  // A sphere of few triangles and a lattice: exact ties everywhere.
  test::Mesh lattice;
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 5; ++y)
      for (int z = 0; z < 4; ++z) {
        const Vec3f o{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        lattice.add(o, o + Vec3f{0.25f, 0, 0.25f}, o + Vec3f{0, 0.25f, 0});
      }
  for (const auto& boxes : {boxes_of(test::sphere(8, 12)), boxes_of(lattice)}) {
    const auto naive = agglomerate_boxes(boxes, Strategy::naive);
    expect_canonical_tree(naive, boxes.size());
    for (const Strategy s : kFast) EXPECT_EQ(agglomerate_boxes(boxes, s), naive) << static_cast<int>(s);
  }
}

TEST(Agglomerate, AllStrategiesBuildTheGreedyTreeOfLights) {
  for (const VplKind kind : {VplKind::omni, VplKind::oriented, VplKind::directional}) {
    auto lights = random_lights(150, kind, 3);
    for (size_t i = 0; i < 20; ++i) lights[i].intensity = 0.0f;
    for (size_t i = 30; i < 40; ++i) lights[i].position = lights[30].position, lights[i].normal = lights[30].normal;
    const auto naive = agglomerate_lights(lights, 17.0f, Strategy::naive);
    expect_canonical_tree(naive, lights.size());
    expect_costs_rise(naive, lights.size());
    for (const Strategy s : kFast) EXPECT_EQ(agglomerate_lights(lights, 17.0f, s), naive) << static_cast<int>(s);
  }
}

TEST(Agglomerate, AllStrategiesBuildTheGreedyTreeOfBalls) {
  for (const int dimension : {1, 2, 3, 7, 16}) {
    Rng rng(static_cast<uint64_t>(dimension), Stage::test);
    std::vector<float> centres(static_cast<size_t>(dimension) * 120), radii(120);
    for (float& c : centres) c = rng.next_float();
    for (float& r : radii) r = 0.1f * rng.next_float();
    const auto naive = agglomerate_balls(centres, radii, dimension, Strategy::naive);
    expect_canonical_tree(naive, radii.size());
    expect_costs_rise(naive, radii.size(), 1e-5f);  // radii are rounded
    for (const Strategy s : kFast)
      EXPECT_EQ(agglomerate_balls(centres, radii, dimension, s), naive) << dimension << " " << static_cast<int>(s);
  }
}

// Joint boxes by half their area, as a caller would have them.
Dissimilarity areas() {
  Dissimilarity d;
  d.features = 6;
  d.merge = [](const float* a, const float* b, float* joint) {
    for (int f = 0; f < 6; ++f) joint[f] = std::max(a[f], b[f]);
  };
  d.cost = [](const float* a, const float* others, size_t count, float* costs) {
    for (size_t i = 0; i < count; ++i, others += 6) {
      const float x = std::max(a[0], others[0]) + std::max(a[3], others[3]),
                  y = std::max(a[1], others[1]) + std::max(a[4], others[4]),
                  z = std::max(a[2], others[2]) + std::max(a[5], others[5]);
      costs[i] = x * (y + z) + y * z;
    }
  };
  d.order = [](const float* a, float* point) {
    for (int axis = 0; axis < 3; ++axis) point[axis] = a[3 + axis] - a[axis];
  };
  return d;
}
std::vector<float> rows_of(std::span<const Aabb> boxes) {
  std::vector<float> rows;
  for (const Aabb& b : boxes) {
    for (int axis = 0; axis < 3; ++axis) rows.push_back(-b.lo[axis]);
    for (int axis = 0; axis < 3; ++axis) rows.push_back(b.hi[axis]);
  }
  return rows;
}

TEST(Agglomerate, ByTheCallersDissimilarityAllStrategiesBuildTheGreedyTree) {
  const auto boxes = boxes_of(test::random_soup(1500, 0.05f, 21));
  const std::vector<float> rows = rows_of(boxes);
  Dissimilarity d = areas();
  const auto greedy = agglomerate_by(d, std::span(rows).first(6 * 250), Strategy::naive);
  const auto chain = agglomerate_by(d, rows, Strategy::locally_ordered);
  for (const bool ordered : {true, false}) {
    if (!ordered) d.order = nullptr;
    for (const Strategy s : {Strategy::heap, Strategy::locally_ordered, Strategy::parallel}) {
      EXPECT_EQ(agglomerate_by(d, std::span(rows).first(6 * 250), s), greedy);
      EXPECT_EQ(agglomerate_by(d, rows, s), chain);
    }
  }
}

// Said to be one that may fall.
TEST(Agglomerate, ByADissimilarityThatMayFallTheHeapAloneServes) {
  Dissimilarity d = areas();
  d.non_decreasing = false;
  const std::vector<float> rows = rows_of(boxes_of(test::random_soup(100, 0.05f, 3)));
  EXPECT_EQ(agglomerate_by(d, rows, Strategy::heap), agglomerate_by(d, rows, Strategy::naive));
  EXPECT_THROW(agglomerate_by(d, rows, Strategy::locally_ordered), Error);
  EXPECT_THROW(agglomerate_by(d, rows, Strategy::parallel), Error);
}

TEST(Agglomerate, ADissimilarityThatBreaksItsWordEndsInAnError) {
  const std::vector<float> rows = rows_of(boxes_of(test::random_soup(3000, 0.05f, 4)));
  const auto message = [&](const Dissimilarity& d, Strategy s) -> std::string {
    try {
      agglomerate_by(d, rows, s);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::invalid_argument);
      return e.what();
    }
    return "";
  };
  for (const Strategy s : {Strategy::naive, Strategy::heap, Strategy::locally_ordered, Strategy::parallel}) {
    if (s == Strategy::naive) continue;  // O(N³)
    Dissimilarity d = areas();
    d.cost = [](const float*, const float*, size_t count, float* costs) {
      std::fill_n(costs, count, std::numeric_limits<float>::quiet_NaN());
    };
    EXPECT_NE(message(d, s).find("NaN"), std::string::npos);
    d = areas();
    d.merge = [](const float*, const float*, float* joint) { std::fill_n(joint, 6, -1e9f); };
    EXPECT_NE(message(d, s).find("feature 0 of a joint cluster"), std::string::npos);
    // Not symmetric, and bounds that bound nothing: a tree all the same, or an error; no crash, no hang.
    for (uint64_t seed = 0; seed < 20; ++seed) {
      d = areas();
      d.cost = [seed](const float* a, const float* others, size_t count, float* costs) {
        for (size_t i = 0; i < count; ++i)
          costs[i] = static_cast<float>(
              hash64(std::bit_cast<uint32_t>(a[0]), std::bit_cast<uint32_t>(others[6 * i]) + seed) % 1000);
      };
      message(d, s);
    }
    // What a function throws comes out.
    d.cost = [](const float*, const float*, size_t, float*) { throw std::out_of_range("mine"); };
    EXPECT_THROW(agglomerate_by(d, rows, s), std::out_of_range);
  }
  Dissimilarity d = areas();
  EXPECT_THROW(agglomerate_by(d, std::vector<float>(7), Strategy::heap), Error);
  EXPECT_THROW(agglomerate_by(d, std::vector<float>(6, std::numeric_limits<float>::infinity()), Strategy::heap), Error);
  d.features = 65;
  EXPECT_THROW(agglomerate_by(d, {}, Strategy::heap), Error);
  d.features = 6, d.key_features = 7;
  EXPECT_THROW(agglomerate_by(d, {}, Strategy::heap), Error);
  d.key_features = 0, d.merge = nullptr;
  EXPECT_THROW(agglomerate_by(d, {}, Strategy::heap), Error);
}

TEST(Agglomerate, ParallelBuildsTheSerialTreeOnAnyNumberOfThreads) {
  const auto boxes = boxes_of(test::random_soup(30000, 0.03f, 5));
  const auto serial = agglomerate_boxes(boxes, Strategy::locally_ordered);
  EXPECT_EQ(agglomerate_boxes(boxes, Strategy::heap), serial);
  const auto lights = random_lights(20000, VplKind::oriented, 6);
  const auto serial_lights = agglomerate_lights(lights, 17.0f, Strategy::locally_ordered);
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    arena.execute([&] {
      EXPECT_EQ(agglomerate_boxes(boxes, Strategy::parallel), serial) << threads;
      EXPECT_EQ(agglomerate_lights(lights, 17.0f, Strategy::parallel), serial_lights) << threads;
    });
  }
}

// Regions and shares number their merges by themselves; one box far out leaves all others in one bucket of a split.
TEST(Agglomerate, ParallelBuildsTheSerialTreeOfManyCoincidentBoxes) {
  auto boxes = boxes_of(test::random_soup(24000, 0.03f, 7));
  for (size_t i = 0; i < 24000; ++i)
    for (size_t copy = 0; copy < i % 4; ++copy) boxes.push_back(boxes[i]);
  boxes.push_back({{1e6f, 1e6f, 1e6f}, {1e6f, 1e6f, 1e6f}});
  const auto serial = agglomerate_boxes(boxes, Strategy::locally_ordered);
  EXPECT_EQ(agglomerate_boxes(boxes, Strategy::heap), serial);
  expect_canonical_tree(serial, boxes.size());
  for (const int threads : {1, 3}) {
    tbb::task_arena arena(threads);
    arena.execute([&] { EXPECT_EQ(agglomerate_boxes(boxes, Strategy::parallel), serial) << threads; });
  }
}

TEST(Agglomerate, CostOfAPairOfBoxesIsTheJointHalfArea) {
  // Sides 1, 2, 4 of the joint box, scaled by 1/4 (a power of two) inside: 14/16.
  const Aabb a{{0, 0, 0}, {1, 1, 1}}, b{{0, 1, 3}, {0.5f, 2, 4}};
  const auto merges = agglomerate_boxes(std::vector<Aabb>{a, b}, Strategy::locally_ordered);
  EXPECT_NEAR(merges[0].cost, 14.0f / 16.0f, 1e-5f);  // each side is taken 1e-7 longer
}

TEST(Agglomerate, CostOfAPairOfBallsIsTheRadiusOfTheBallAroundBoth) {
  const float centres[] = {0, 0, 3, 4, 0.5f, 0};
  const float radii[] = {1, 2, 0.25f};
  // The small one lies in the first: radius 1; then (5 + 1 + 2) / 2.
  const auto merges = agglomerate_balls(centres, radii, 2, Strategy::naive);
  EXPECT_EQ(merges[0].left, 0u);
  EXPECT_EQ(merges[0].right, 2u);
  EXPECT_FLOAT_EQ(merges[0].cost, 1.0f);
  EXPECT_NEAR(merges[1].cost, 4.0f, 1e-5f);
}

TEST(Agglomerate, CostOfAPairOfLightsIsWaltersEquationTwo) {
  Rng rng(8, Stage::test);
  for (int i = 0; i < 200; ++i) {
    const auto lights = random_lights(2, VplKind::oriented, static_cast<uint64_t>(i));
    const float diagonal = 20.0f;
    Aabb positions, directions;
    for (const LightLeaf& l : lights) positions.extend(l.position), directions.extend(l.normal);
    const float intensity = lights[0].intensity + lights[1].intensity, mean = intensity / 2;
    const float expected = light_dissimilarity(intensity, positions, directions, diagonal);
    const auto merges = agglomerate_lights(lights, diagonal, Strategy::locally_ordered);
    EXPECT_NEAR(merges[0].cost * mean * std::pow(diagonal, 4.0f), expected, 1e-4f * expected);  // a dozen roundings
  }
}

TEST(Agglomerate, LightDissimilarityNeverFallsAsClustersGrow) {
  Rng rng(9, Stage::test);
  const auto grow = [&](Aabb& p, Aabb& d, float& intensity) {
    p.extend(test::random_point(rng)), d.extend(test::random_direction(rng)), intensity += rng.next_float();
  };
  for (int i = 0; i < 10000; ++i) {
    Aabb p, d;
    float intensity = 0;
    const uint32_t first = 1 + rng.next_below(4);
    for (uint32_t k = 0; k < first; ++k) grow(p, d, intensity);
    const float before = light_dissimilarity(intensity, p, d, 5.0f);
    grow(p, d, intensity);
    EXPECT_GE(light_dissimilarity(intensity, p, d, 5.0f), before);
  }
}

// Why S is the sphere's radius and not the cone's sine: the cone narrows while its box grows.
TEST(Agglomerate, ConeThroughTheSphereAroundABoxMayNarrowAsTheBoxGrows) {
  Aabb ring;
  for (const Vec3f& d : {Vec3f{0.8f, 0.6f, 0}, Vec3f{0.8f, -0.6f, 0}, Vec3f{0.8f, 0, 0.6f}, Vec3f{0.8f, 0, -0.6f}})
    ring.extend(d);
  Aabb with_pole = ring;
  with_pole.extend(Vec3f{1, 0, 0});
  EXPECT_GT(cone_of_direction_box(with_pole).cos_half, cone_of_direction_box(ring).cos_half + 0.02f);
}

TEST(Agglomerate, CoincidentLeavesGiveAShallowTreeInNearlyLinearTime) {
  // A million triangles on one spot, and lights. Quadratic work would take hours.
  constexpr size_t n = test::trimmed(1000000);
  constexpr int depth = std::bit_width(n - 1);
  const std::vector<Aabb> boxes(n, Aabb{{1, 2, 3}, {2, 3, 4}});
  EXPECT_EQ(depth_of(agglomerate_boxes(boxes, Strategy::locally_ordered), n), depth);
  std::vector<LightLeaf> lights(n);
  for (size_t i = 0; i < n; ++i)
    lights[i].kind = VplKind::oriented, lights[i].normal = {0, 0, 1}, lights[i].intensity = static_cast<float>(i % 3);
  EXPECT_EQ(depth_of(agglomerate_lights(lights, 1.0f, Strategy::locally_ordered), n), depth);
}

TEST(Agglomerate, BlackLightsClusterByPlace) {
  auto lights = random_lights(50000, VplKind::oriented, 11);
  for (LightLeaf& l : lights) l.intensity = 0.0f;
  // All ties at 0 would make a chain as deep as there are lights.
  EXPECT_LT(depth_of(agglomerate_lights(lights, 17.0f, Strategy::locally_ordered), lights.size()), 200);
  lights[7].intensity = 1.0f;
  EXPECT_LT(depth_of(agglomerate_lights(lights, 17.0f, Strategy::locally_ordered), lights.size()), 200);
}

TEST(Agglomerate, BoxesWithoutAreaClusterByDistance) {
  std::vector<Aabb> boxes;
  Rng rng(12, Stage::test);
  for (int i = 0; i < 20000; ++i) {
    const Vec3f p{rng.next_float(), 0, 0};
    boxes.push_back({p, p});
  }
  EXPECT_LT(depth_of(agglomerate_boxes(boxes, Strategy::locally_ordered), boxes.size()), 200);
}

TEST(Agglomerate, OneGreatBoxOverManySmallOnesIsNoTrouble) {
  auto boxes = boxes_of(test::random_soup(20000, 0.01f, 13));
  for (int i = 0; i < 200; ++i) boxes.push_back({{-1, -1, -1}, {2 + 0.001f * static_cast<float>(i), 2, 2}});
  const auto merges = agglomerate_boxes(boxes, Strategy::locally_ordered);
  EXPECT_EQ(agglomerate_boxes(boxes, Strategy::parallel), merges);
  expect_costs_rise(merges, boxes.size());
}

TEST(Agglomerate, NoneAndOneLeafGiveNoMerge) {
  for (const Strategy s : {Strategy::naive, Strategy::heap, Strategy::locally_ordered, Strategy::parallel}) {
    EXPECT_TRUE(agglomerate_boxes({}, s).empty());
    EXPECT_TRUE(agglomerate_boxes(std::vector<Aabb>{{{0, 0, 0}, {1, 1, 1}}}, s).empty());
    EXPECT_TRUE(agglomerate_lights({}, 1.0f, s).empty());
    EXPECT_TRUE(agglomerate_lights(random_lights(1, VplKind::omni, 1), 0.0f, s).empty());
    EXPECT_TRUE(agglomerate_balls({}, {}, 3, s).empty());
  }
}

template <typename Fn>
std::string message_of(Fn&& fn, ErrorCode code = ErrorCode::invalid_argument) {
  try {
    fn();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code);
    return e.what();
  }
  return "no error";
}

TEST(Agglomerate, BadLeavesAreNamed) {
  auto lights = random_lights(3, VplKind::oriented, 1);
  const auto run = [&] { agglomerate_lights(lights, 1.0f, Strategy::locally_ordered); };
  lights[1].intensity = -2;
  EXPECT_NE(message_of(run).find("light 1: intensity is -2"), std::string::npos);
  lights[1].intensity = 1, lights[2].position.x = NAN;
  EXPECT_NE(message_of(run).find("light 2: position"), std::string::npos);
  lights[2].position.x = 0, lights[2].normal.z = NAN;
  EXPECT_NE(message_of(run).find("light 2: normal"), std::string::npos);
  lights[2].kind = VplKind::omni;
  EXPECT_NE(message_of(run).find("light 2 is of kind 0"), std::string::npos);
  EXPECT_NE(message_of([] {
              agglomerate_boxes(std::vector<Aabb>{{{0, 0, 0}, {1, 1, 1}}, {}}, Strategy::naive);
            }).find("box 1"),
            std::string::npos);
  EXPECT_NE(message_of([] {
              agglomerate_balls(std::vector<float>{0, 0}, std::vector<float>{-1}, 2, Strategy::naive);
            }).find("radii[0]"),
            std::string::npos);
  EXPECT_NE(message_of([] { agglomerate_balls({}, {}, 17, Strategy::naive); }).find("dimension is 17"),
            std::string::npos);
  EXPECT_NE(message_of([] { strategy_of("fast"); }).find("'fast'"), std::string::npos);
}

TEST(Agglomerate, CancelIsSeenByEveryStrategy) {
  const auto boxes = boxes_of(test::random_soup(300, 0.1f, 1));
  for (const Strategy s : {Strategy::naive, Strategy::heap, Strategy::locally_ordered, Strategy::parallel}) {
    Progress progress;
    progress.cancel();
    message_of([&] { agglomerate_boxes(boxes, s, &progress); }, ErrorCode::cancelled);
    EXPECT_THROW(agglomerate_boxes(boxes, s, &progress), Error);
  }
}

// Distance between weighted centres, which may decrease when clusters merge.
struct CentroidPolicy {
  static constexpr bool kNonDecreasing = false;
  static constexpr int kFeatures = 3;
  static constexpr int kOrderDims = 1;
  size_t features() const { return 3; }
  size_t key_features() const { return 2; }
  void merge(const float* a, const float* b, float* out) const {
    const float centre = (a[0] * a[2] + b[0] * b[2]) / (a[2] + b[2]), weight = a[2] + b[2];
    out[0] = centre, out[1] = -centre, out[2] = weight;
  }
  void order_point(const float* a, float* point) const { point[0] = a[0]; }
  template <class D>
  struct Query {
    float x;
  };
  template <class D>
  Query<D> query(D, const float* a) const {
    return {a[0]};
  }
  template <class D>
  hwy::HWY_NAMESPACE::Vec<D> cost(D d, const Query<D>& a, const float* b) const {
    namespace hn = hwy::HWY_NAMESPACE;
    const auto above = hn::Sub(hn::Load(d, b), hn::Set(d, a.x)), below = hn::Sub(hn::Load(d, b + 8), hn::Set(d, -a.x));
    return hn::Max(hn::Max(above, below), hn::Zero(d));
  }
};

namespace agglomeration = HWY_NAMESPACE::agglomeration;
struct WithoutKey : CentroidPolicy {
  size_t key_features() const = delete;
};
struct WithTooManyFeatures : CentroidPolicy {
  static constexpr int kFeatures = agglomeration::kMaxFeatures + 1;
};
struct WithScalarCost : CentroidPolicy {
  float cost(agglomeration::Lanes8, const Query<agglomeration::Lanes8>&, const float*) const { return 0.0f; }
};
static_assert(agglomeration::ClusterPolicy<CentroidPolicy>);
static_assert(!agglomeration::ClusterPolicy<WithoutKey>);
static_assert(!agglomeration::ClusterPolicy<WithTooManyFeatures>);
static_assert(!agglomeration::ClusterPolicy<WithScalarCost>);

TEST(Agglomerate, LocallyOrderedRefusesADissimilarityThatMayFall) {
  const CentroidPolicy policy;
  const float x[] = {0, 1, 2.1f, 10, 11.5f};
  const auto run = [&](Strategy s) {
    agglomeration::Core<CentroidPolicy> core(policy, std::size(x), false, nullptr);
    for (size_t i = 0; i < std::size(x); ++i) core.leaf(i)[0] = x[i], core.leaf(i)[1] = -x[i], core.leaf(i)[2] = 1;
    return core.run(s);
  };
  EXPECT_NE(message_of([&] { run(Strategy::locally_ordered); }).find("Eq. 1"), std::string::npos);
  EXPECT_NE(message_of([&] { run(Strategy::parallel); }).find("Eq. 1"), std::string::npos);
  const auto naive = run(Strategy::naive);
  EXPECT_EQ(run(Strategy::heap), naive);
  EXPECT_EQ(naive[0].left, 0u);
  EXPECT_EQ(naive[0].right, 1u);
}

}  // namespace
}  // namespace lumicut
