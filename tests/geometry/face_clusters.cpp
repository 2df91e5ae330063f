#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "geometry/texture_atlas.h"
#include "meshes.h"

namespace lumicut {
namespace {

// Non-manifold: a fan of five faces on one edge; degenerate: a face with a repeated corner.
FaceMesh odd_mesh() {
  FaceMesh m = grid_mesh(4, 4, false);
  const auto base = static_cast<uint32_t>(m.vertices.size());
  m.vertices.push_back({0.1, 0.1, 1});
  m.vertices.push_back({0.2, 0.1, 1});
  m.vertices.push_back({0.3, 0.1, 1});
  for (uint32_t k = 0; k < 3; ++k) m.faces.push_back({6, 7, base + k});
  m.faces.push_back({3, 3, 4});
  return m;
}

void bend(FaceMesh& m, uint64_t seed, double reach, double amount) {
  Rng rng(seed, Stage::test);
  const Vec3d at = m.vertices[rng.next_below(static_cast<uint32_t>(m.vertices.size()))];
  const Vec3d by{amount * rng.next_float(), amount * rng.next_float(), amount * rng.next_float()};
  for (Vec3d& v : m.vertices) {
    const double d = length(v - at) / reach;
    if (d < 1) v += by * ((1 - d) * (1 - d));
  }
}

TEST(DualGraph, CountsBordersComponentsAndNonManifoldEdges) {
  const DualGraph torus = dual_graph(torus_mesh(8, 6));
  EXPECT_EQ(torus.boundary_edges, 0u);
  EXPECT_EQ(torus.edge_vertices.size(), 3u * 8 * 6);
  for (uint32_t f = 0; f < 96; ++f) EXPECT_EQ(torus.of(f).size(), 3u);
  const DualGraph grid = dual_graph(grid_mesh(5, 4, false));
  EXPECT_EQ(grid.boundary_edges, 18u);
  const DualGraph two = dual_graph(both(sphere_mesh(5), sphere_mesh(5), 5));
  EXPECT_EQ(two.components, 2u);
  const DualGraph odd = dual_graph(odd_mesh());
  EXPECT_EQ(odd.non_manifold_edges, 1u);
  EXPECT_EQ(dual_graph(FaceMesh()).components, 0u);
}

TEST(FaceKmeans, AllMethodsGiveTheLabelsOfThePlainOneAfterEveryIteration) {
  const FaceMesh meshes[] = {sphere_mesh(14), torus_mesh(40, 18), grid_mesh(25, 25, false),
                             both(sphere_mesh(9), torus_mesh(20, 9), 6), odd_mesh()};
  for (const FaceMesh& start : meshes)
    for (const uint32_t k : {1u, 2u, 7u, 30u})
      for (const double geodesic : {1e-3, 0.3}) {
        FaceMesh mesh = start;
        using Method = FaceKmeansOptions::Method;
        FaceKmeansOptions o;
        o.clusters = k;
        o.geodesic = geodesic;
        o.method = Method::single_heap;
        FaceKmeans plain(mesh, o);
        o.method = Method::nested_heaps;
        FaceKmeans nested(mesh, o);
        o.method = Method::incremental;
        FaceKmeans incremental(mesh, o);
        for (int frame = 0; frame < 4; ++frame) {
          for (int i = 0; i < 40; ++i) {
            const auto state = plain.iterate();
            ASSERT_EQ(nested.iterate(), state);
            ASSERT_EQ(incremental.iterate(), state);
            ASSERT_EQ(nested.labels(), plain.labels());
            ASSERT_EQ(incremental.labels(), plain.labels()) << "k " << k << " frame " << frame << " iteration " << i;
            ASSERT_EQ(incremental.seeds(), plain.seeds());
            if (state != FaceKmeans::State::changed) break;
          }
          bend(mesh, static_cast<uint64_t>(frame) + 1, 0.6, 0.5);
          plain.move(mesh.vertices), nested.move(mesh.vertices), incremental.move(mesh.vertices);
        }
      }
}

// Every cluster is connected: its faces are reached from its seed without leaving it.
TEST(FaceKmeans, ClustersAreConnectedAndHoldTheirSeeds) {
  FaceKmeansOptions o;
  o.clusters = 20;
  FaceKmeans c(torus_mesh(40, 20), o);
  c.run();
  std::vector<uint8_t> reached(c.labels().size(), 0);
  for (uint32_t k = 0; k < c.seeds().size(); ++k) {
    ASSERT_EQ(c.labels()[c.seeds()[k]], k);
    std::vector<uint32_t> stack{c.seeds()[k]};
    reached[c.seeds()[k]] = 1;
    while (!stack.empty()) {
      const uint32_t u = stack.back();
      stack.pop_back();
      for (const uint32_t v : c.graph().of(u))
        if (!reached[v] && c.labels()[v] == k) reached[v] = 1, stack.push_back(v);
    }
  }
  EXPECT_EQ(std::count(reached.begin(), reached.end(), 1), static_cast<std::ptrdiff_t>(reached.size()));
  EXPECT_EQ(c.cluster_count(), 20u);
}

TEST(FaceKmeans, LateIterationsTouchFewFaces) {
  FaceKmeansOptions o;
  o.clusters = 60;
  FaceKmeans c(torus_mesh(80, 40), o);
  c.iterate();
  const size_t all = c.regrown_faces();
  EXPECT_EQ(all, c.labels().size());
  const auto last = c.run();
  EXPECT_GT(last, 3u);
  EXPECT_LT(c.regrown_faces(), all / 4);
  EXPECT_EQ(c.iterate() == FaceKmeans::State::changed, false);
}

TEST(FaceKmeans, MergeSplitAndTeleportKeepTheMethodsEqual) {
  FaceKmeansOptions o;
  o.clusters = 16;
  const FaceMesh mesh = both(torus_mesh(30, 14), grid_mesh(10, 10, false), 5);
  o.method = FaceKmeansOptions::Method::single_heap;
  FaceKmeans plain(mesh, o);
  o.method = FaceKmeansOptions::Method::incremental;
  FaceKmeans fast(mesh, o);
  plain.run(30), fast.run(30);
  ASSERT_EQ(plain.labels(), fast.labels());
  for (int round = 0; round < 6; ++round) {
    const double before = plain.error();
    const bool done = plain.teleport();
    ASSERT_EQ(fast.teleport(), done);
    plain.run(30), fast.run(30);
    ASSERT_EQ(plain.labels(), fast.labels()) << round;
    EXPECT_EQ(plain.cluster_count(), 16u);
    if (!done) break;
    (void)before;
  }
  const uint32_t fresh = plain.split(0);
  ASSERT_NE(fresh, FaceKmeans::kNone);
  plain.run(30);
  EXPECT_EQ(plain.cluster_count(), 17u);
  // The new cluster lies beside the old one or not; some pair touches, and merging gives one less.
  for (uint32_t f = 0; f < plain.labels().size(); ++f)
    for (const uint32_t v : plain.graph().of(f))
      if (plain.labels()[f] != plain.labels()[v]) {
        plain.merge(plain.labels()[f], plain.labels()[v]);
        EXPECT_EQ(plain.cluster_count(), 16u);
        return;
      }
}

// Eq. 9 goes by angles: at lambda 0 the crease of a folded sheet parts two clusters, wherever their seeds are.
TEST(FaceKmeans, ByAnglesBordersLieOnCreases) {
  FaceMesh m = grid_mesh(10, 10, false);
  double lo = m.vertices[0].x, hi = lo;
  for (const Vec3d& v : m.vertices) lo = std::min(lo, v.x), hi = std::max(hi, v.x);
  const double middle = 0.5 * (lo + hi);
  for (Vec3d& v : m.vertices) v.z = 2 * std::fabs(v.x - middle);
  FaceKmeansOptions o;
  o.metric = FaceKmeansOptions::Metric::schlafman;
  o.clusters = 2, o.lambda = 0;
  for (const bool random : {false, true}) {
    o.random_seeds = random, o.seed = 3;
    FaceKmeans c(m, o);
    c.run();
    uint32_t left = FaceKmeans::kNone, right = FaceKmeans::kNone;
    size_t wrong = 0;
    for (uint32_t f = 0; f < m.faces.size(); ++f) {
      uint32_t& side = face_centre(m, f).x < middle ? left : right;
      if (side == FaceKmeans::kNone) side = c.labels()[f];
      wrong += c.labels()[f] != side;
    }
    if (left != right) {  // both seeds may fall on one side
      EXPECT_EQ(wrong, 0u);
    } else {
      EXPECT_TRUE(random);
    }
  }
  // Scaled, it is the same.
  o.lambda = 0.5, o.clusters = 7, o.random_seeds = true;
  FaceKmeans a(m, o);
  FaceMesh large = m;
  for (Vec3d& v : large.vertices) v = v * 1024.0;
  FaceKmeans b(large, o);
  a.run(), b.run();
  EXPECT_EQ(a.labels(), b.labels());
  o.seed = 4;
  FaceKmeans other(m, o);
  other.run();
  EXPECT_NE(a.labels(), other.labels());
  o.lambda = 1.5;
  EXPECT_THROW(FaceKmeans(m, o), Error);
}

TEST(FaceKmeans, RefusesBadInputByName) {
  FaceKmeansOptions o;
  o.clusters = 3;
  EXPECT_THROW(FaceKmeans(FaceMesh(), o), Error);
  FaceMesh m = grid_mesh(2, 2, false);
  m.faces[1][2] = 99;
  EXPECT_THROW(FaceKmeans(m, o), Error);
  m = grid_mesh(2, 2, false);
  m.vertices[0].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(FaceKmeans(m, o), Error);
  o.clusters = 100;
  EXPECT_THROW(FaceKmeans(grid_mesh(2, 2, false), o), Error);
  o.clusters = 2;
  FaceKmeans c(grid_mesh(3, 3, false), o);
  c.run();
  EXPECT_THROW(c.move(std::vector<Vec3d>(3)), Error);
  EXPECT_THROW(c.merge(0, 0), Error);
  EXPECT_THROW(c.split(7), Error);
}

// Perimeters, weights and counts of every node from its faces anew.
void expect_consistent(const FaceClusterTree& t, const DualGraph& g, const std::vector<double>& weights) {
  const auto& nodes = t.nodes();
  std::vector<uint32_t> stack;
  std::vector<uint8_t> seen(weights.size(), 0);
  for (uint32_t x = 0; x < nodes.size(); ++x) {
    std::set<uint32_t> edges;
    double weight = 0;
    uint32_t faces = 0;
    stack.assign(1, x);
    while (!stack.empty()) {
      const uint32_t y = stack.back();
      stack.pop_back();
      if (nodes[y].left != FaceClusterTree::kNone) {
        ASSERT_EQ(nodes[nodes[y].left].parent, y);
        ASSERT_EQ(nodes[nodes[y].right].parent, y);
        stack.push_back(nodes[y].left), stack.push_back(nodes[y].right);
        continue;
      }
      ++faces;
      weight += weights[y];
      if (x == t.root()) seen[y] = 1;
      for (const uint32_t e : g.edges_of(y))
        if (!edges.insert(e).second) edges.erase(e);
    }
    ASSERT_EQ(nodes[x].faces, faces);
    ASSERT_NEAR(nodes[x].weight, weight, 1e-9 * (1 + weight));  // summed in another order
    ASSERT_EQ(nodes[x].perimeter, std::vector<uint32_t>(edges.begin(), edges.end()));
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), static_cast<std::ptrdiff_t>(weights.size()));
}

TEST(FaceClusterTree, PerimetersAndWeightsAreThoseOfTheFaces) {
  const FaceMesh meshes[] = {sphere_mesh(9), torus_mesh(16, 9), grid_mesh(12, 12, false),
                             both(sphere_mesh(5), grid_mesh(4, 4, false), 3), odd_mesh()};
  for (const FaceMesh& m : meshes) {
    Rng rng(4, Stage::test);
    std::vector<double> w(m.faces.size());
    for (double& x : w) x = 0.5 + rng.next_float();
    FaceClusterTree t(m, w);
    const DualGraph g = dual_graph(m);
    expect_consistent(t, g, w);
    EXPECT_EQ(t.nodes().size(), 2 * m.faces.size() - 1);
    for (double& x : w) x *= std::exp2(2 * rng.next_float() - 1);
    t.set_weights(w);
    expect_consistent(t, g, w);
  }
}

TEST(FaceClusterTree, OneWeightMovesItsAncestorsAlone) {
  const FaceMesh m = both(sphere_mesh(12), grid_mesh(8, 8, false), 3);
  const DualGraph g = dual_graph(m);
  Rng rng(6, Stage::test);
  std::vector<double> w(m.faces.size(), 1.0);
  FaceClusterTree t(m, w);
  for (int k = 0; k < 300; ++k) {
    const uint32_t f = rng.next_below(static_cast<uint32_t>(w.size()));
    w[f] = std::exp2(4 * rng.next_float() - 2);
    size_t depth = 0;
    for (uint32_t a = t.nodes()[f].parent; a != FaceClusterTree::kNone; a = t.nodes()[a].parent) ++depth;
    const size_t before = t.perturbations();
    t.set_weight(f, w[f]);
    ASSERT_LE(t.perturbations() - before, 24 * depth);  // max_steps at each ancestor
  }
  expect_consistent(t, g, w);
  EXPECT_LT(t.mean_imbalance(false), 1.0);
  EXPECT_THROW(t.set_weight(static_cast<uint32_t>(w.size()), 1), Error);
  EXPECT_THROW(t.set_weight(0, -1), Error);
}

// Wide filters lose nothing that decides: the tree is the exact one. Narrow ones lose, and still balance.
TEST(FaceClusterTree, WorksOnBloomFilters) {
  const FaceMesh m = torus_mesh(40, 20);
  const FaceClusterTree exact(m, {});
  FaceClusterTreeOptions o;
  o.bloom_bits = 1u << 24, o.bloom_hashes = 1;
  const FaceClusterTree wide(m, {}, o);
  for (int level = 0; level < 8; ++level) ASSERT_EQ(wide.labels_at_level(level), exact.labels_at_level(level));
  o.bloom_bits = 256, o.bloom_hashes = 2;
  FaceClusterTree narrow(m, {}, o);
  EXPECT_NE(narrow.labels_at_level(6), exact.labels_at_level(6));
  EXPECT_LT(narrow.mean_imbalance(false), 1.0);
  for (const auto& node : narrow.nodes()) {
    ASSERT_TRUE(std::is_sorted(node.perimeter.begin(), node.perimeter.end()));
    for (const uint32_t bit : node.perimeter) ASSERT_LT(bit, 256u);
    if (node.left == FaceClusterTree::kNone) continue;  // a parent's bits are the exclusive or of its children's
    std::vector<uint32_t> bits;
    const auto &a = narrow.nodes()[node.left].perimeter, &b = narrow.nodes()[node.right].perimeter;
    std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(bits));
    ASSERT_EQ(node.perimeter, bits);
  }
  const uint32_t sizes[] = {100};
  EXPECT_THROW(narrow.bloom_statistics(256, 1, sizes), Error);
  o.bloom_bits = 7;
  EXPECT_THROW(FaceClusterTree(m, {}, o), Error);
}

TEST(FaceClusterTree, KeepsClustersSimplyConnectedWhereItMay) {
  for (const FaceMesh& m : {sphere_mesh(20), torus_mesh(30, 14), both(sphere_mesh(9), grid_mesh(9, 9, false), 3)}) {
    const FaceClusterTree plain(m, {});
    FaceClusterTreeOptions o;
    o.simply_connected = true;
    FaceClusterTree strict(m, {}, o);
    const auto before = plain.topology(m), after = strict.topology(m);
    EXPECT_LE(after.holed, before.holed);
    EXPECT_LE(after.disconnected, before.disconnected + 1);  // two components
    EXPECT_EQ(after.discs + after.holed + after.disconnected, m.faces.size() - 1);
    EXPECT_LT(after.holed, m.faces.size() / 100);
    // The counts that it keeps are those of the faces.
    size_t discs = 0;
    for (const auto& node : strict.nodes()) discs += node.left != FaceClusterTree::kNone && node.euler == 1;
    EXPECT_GE(discs, after.discs);
    EXPECT_LE(discs, after.discs + after.disconnected);
    strict.set_weights(std::vector<double>(m.faces.size(), 1.0));
    EXPECT_LE(strict.topology(m).holed, after.holed) << "no perturbation makes more";
  }
  FaceClusterTreeOptions o;
  o.simply_connected = true, o.bloom_bits = 256;
  EXPECT_THROW(FaceClusterTree(sphere_mesh(4), {}, o), Error);
}

TEST(FaceClusterTree, StaysBalancedAndNearlyConnected) {
  const FaceMesh m = sphere_mesh(30);
  FaceClusterTree t(m, {});
  EXPECT_LT(t.mean_imbalance(false), 1.0);  // tau
  EXPECT_LT(static_cast<double>(t.disconnected_clusters(dual_graph(m))), 0.02 * static_cast<double>(m.faces.size()));
  // Depth 2 gives four clusters, of weights that differ by the imbalance at most.
  const auto labels = t.labels_at_level(2);
  EXPECT_EQ(*std::max_element(labels.begin(), labels.end()), 3u);
  Rng rng(5, Stage::test);
  std::vector<double> w(m.faces.size());
  for (uint32_t f = 0; f < w.size(); ++f) w[f] = t.nodes()[f].weight * std::exp2(2 * rng.next_float() - 1);
  t.set_weights(w);
  EXPECT_LT(t.mean_imbalance(false), 1.0);
}

TEST(FaceClusterTree, SlackTradesPerimeterForBalance) {
  const FaceMesh m = sphere_mesh(30);
  FaceClusterTreeOptions none;
  none.slack = 0;
  const FaceClusterTree strict(m, {}, none), loose(m, {});
  EXPECT_LT(loose.mean_imbalance(false), strict.mean_imbalance(false));
  // Each exchange may lengthen perimeters by the slack at most; together they lengthen them by less.
  EXPECT_LT(static_cast<double>(loose.perimeter_bytes()), 1.1 * static_cast<double>(strict.perimeter_bytes()));
  const DualGraph g = dual_graph(m);
  EXPECT_LE(loose.disconnected_clusters(g), m.faces.size() / 50);
  none.slack = -1;
  EXPECT_THROW(FaceClusterTree(m, {}, none), Error);
}

TEST(FaceClusterTree, BloomFiltersLoseWhatCollisionsTake) {
  const FaceMesh m = torus_mesh(40, 20);
  const FaceClusterTree t(m, {});
  const uint32_t sizes[] = {1, 100, 800};
  const auto narrow = t.bloom_statistics(256, 1, sizes), wide = t.bloom_statistics(1u << 16, 1, sizes);
  // At the leaves: Eq. 3-5 with e = 3 and m = 256, within the noise of 1600 leaves of three edges.
  const double expected = 1 - 256.0 / 3 * (1 - std::pow(255.0 / 256, 3));
  EXPECT_NEAR(narrow.rows[0].loss, expected, 0.004);
  EXPECT_EQ(narrow.rows[0].edges, 3.0);
  EXPECT_GT(narrow.rows[2].loss, wide.rows[2].loss);
  EXPECT_LT(wide.rows[2].loss, 0.02);
  EXPECT_EQ(wide.bytes, t.nodes().size() * 8192);
  EXPECT_LT(wide.run_length_bytes, wide.bytes / 10);
}

TEST(FaceClusterTree, DegenerateAndBadInput) {
  EXPECT_EQ(FaceClusterTree(FaceMesh(), {}).root(), FaceClusterTree::kNone);
  FaceMesh one = grid_mesh(1, 1, false);
  one.faces.resize(1);
  EXPECT_EQ(FaceClusterTree(one, {}).root(), 0u);
  const FaceMesh m = grid_mesh(3, 3, false);
  EXPECT_THROW(FaceClusterTree(m, std::vector<double>(3, 1.0)), Error);
  EXPECT_THROW(FaceClusterTree(m, std::vector<double>(m.faces.size(), -1.0)), Error);
  const FaceClusterTree flat(m, std::vector<double>(m.faces.size(), 0.0));  // no weight at all
  EXPECT_EQ(flat.mean_imbalance(false), 0.0);
}

// Charts lie in the square and apart, and are their faces' shapes where those lie in a plane.
TEST(TextureAtlas, ChartsAreApartAndTrueToPlaneFaces) {
  FaceMesh m = both(grid_mesh(9, 6, false), sphere_mesh(8), 4);
  FaceKmeansOptions o;
  o.clusters = 12;
  FaceKmeans c(m, o);
  c.run();
  const TextureAtlas atlas = make_texture_atlas(m, c.labels(), 0.01);
  EXPECT_EQ(atlas.charts, c.cluster_count());
  struct Box {
    Point2 lo{2, 2}, hi{-2, -2};
  };
  std::vector<Box> boxes(c.labels().size());
  double covered = 0;
  for (uint32_t f = 0; f < m.faces.size(); ++f) {
    const auto& t = atlas.corners[f];
    for (const Point2& p : t) {
      ASSERT_TRUE(p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1);
      Box& b = boxes[c.labels()[f]];
      b.lo = {std::min(b.lo.x, p.x), std::min(b.lo.y, p.y)}, b.hi = {std::max(b.hi.x, p.x), std::max(b.hi.y, p.y)};
    }
    covered += 0.5 * std::fabs((t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[1].y - t[0].y) * (t[2].x - t[0].x));
    if (f >= 9 * 6 * 2) continue;  // the sheet: a plane
    for (size_t k = 0; k < 3; ++k) {
      const Vec3d edge = m.vertices[m.faces[f][(k + 1) % 3]] - m.vertices[m.faces[f][k]];
      ASSERT_NEAR(std::sqrt(dist2(t[k], t[(k + 1) % 3])), atlas.scale * length(edge), 1e-12);
    }
  }
  EXPECT_NEAR(covered, atlas.used, 1e-9);
  EXPECT_GT(atlas.used, 0.3);
  for (size_t i = 0; i < boxes.size(); ++i)
    for (size_t j = 0; j < i; ++j) {
      if (boxes[i].lo.x > 1 || boxes[j].lo.x > 1) continue;
      const double x = std::max(boxes[i].lo.x - boxes[j].hi.x, boxes[j].lo.x - boxes[i].hi.x),
                   y = std::max(boxes[i].lo.y - boxes[j].hi.y, boxes[j].lo.y - boxes[i].hi.y);
      EXPECT_GT(std::max(x, y), 0.009) << "the gap";
    }
  EXPECT_THROW(make_texture_atlas(m, std::vector<uint32_t>{1}, 0), Error);
  EXPECT_THROW(make_texture_atlas(m, c.labels(), 0.5), Error);
  EXPECT_EQ(make_texture_atlas(FaceMesh(), {}, 0).charts, 0u);
}

TEST(ClusterBoxes, HoldTheirFacesTightly) {
  const FaceMesh m = sphere_mesh(9);
  const FaceClusterTree t(m, {});
  const auto labels = t.labels_at_level(4);
  const auto boxes = cluster_boxes(m, labels);
  ASSERT_EQ(boxes.size(), 16u);
  for (const ClusterBox& b : boxes)
    for (int axis = 0; axis < 3; ++axis) {
      double lo = 1e9, hi = -1e9;
      for (uint32_t f = 0; f < labels.size(); ++f)
        for (const uint32_t v : m.faces[f])
          if (labels[f] == b.label) lo = std::min(lo, m.vertices[v][axis]), hi = std::max(hi, m.vertices[v][axis]);
      EXPECT_EQ(b.lo[axis], lo);
      EXPECT_EQ(b.hi[axis], hi);
    }
}

}  // namespace
}  // namespace lumicut
