#include "geometry/face_cluster_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <queue>
#include <string>

#include "core/error.h"
#include "core/rng.h"

namespace lumicut {
namespace {

constexpr double kLeastGain = 1e-9;  // so that roundings move nothing for ever

using Edges = std::vector<uint32_t>;

int shared(const Edges& a, const Edges& b) {
  int n = 0;
  auto i = a.begin();
  auto j = b.begin();
  while (i != a.end() && j != b.end()) {
    const uint32_t x = *i, y = *j;
    n += x == y;
    i += x <= y;
    j += y <= x;
  }
  return n;
}

void toggle(Edges& list, uint32_t edge) {
  const auto at = std::lower_bound(list.begin(), list.end(), edge);
  if (at != list.end() && *at == edge)
    list.erase(at);
  else
    list.insert(at, edge);
}

// Whether faces are reached from the first of them over edges. `stamp` holds no `mark` before and after.
bool joined(const DualGraph& graph, const std::vector<uint32_t>& members, uint32_t mark, std::vector<uint32_t>& stamp,
            std::vector<uint32_t>& stack) {
  for (const uint32_t f : members) stamp[f] = mark;
  size_t reached = 1;
  stamp[members[0]] = FaceClusterTree::kNone;
  stack.assign(1, members[0]);
  while (!stack.empty()) {
    const uint32_t f = stack.back();
    stack.pop_back();
    for (const uint32_t g : graph.of(f))
      if (stamp[g] == mark) stamp[g] = FaceClusterTree::kNone, ++reached, stack.push_back(g);
  }
  for (const uint32_t f : members) stamp[f] = FaceClusterTree::kNone;
  return reached == members.size();
}

}  // namespace

double FaceClusterTree::imbalance_of(double a, double b) {
  const double more = std::max(a, b), less = std::min(a, b);
  if (more <= 0) return 0;
  return less > 0 ? std::min(more / less - 1, 1e9) : 1e9;
}

double FaceClusterTree::imbalance(uint32_t n) const {
  const Node& x = nodes_[n];
  return x.left == kNone ? 0 : imbalance_of(nodes_[x.left].weight, nodes_[x.right].weight);
}

void FaceClusterTree::set_children(uint32_t n, uint32_t a, uint32_t b) {
  nodes_[n].left = a, nodes_[n].right = b;
  nodes_[a].parent = nodes_[b].parent = n;
}

void FaceClusterTree::refresh(uint32_t n) {
  Node& x = nodes_[n];
  const Node &a = nodes_[x.left], &b = nodes_[x.right];
  x.weight = a.weight + b.weight;
  x.faces = a.faces + b.faces;
  x.perimeter.clear();
  std::set_symmetric_difference(a.perimeter.begin(), a.perimeter.end(), b.perimeter.begin(), b.perimeter.end(),
                                std::back_inserter(x.perimeter));
  if (options_.simply_connected) x.euler = joint_euler(x.left, x.right, shared(a.perimeter, b.perimeter));
}

// What two clusters have in common lies on both perimeters.
int32_t FaceClusterTree::joint_euler(uint32_t a, uint32_t b, int shared_edges) const {
  const auto vertices = [&](uint32_t n) {
    std::vector<uint32_t> v;
    for (const uint32_t e : nodes_[n].perimeter) v.insert(v.end(), edge_vertices_[e].begin(), edge_vertices_[e].end());
    std::sort(v.begin(), v.end());
    v.erase(std::unique(v.begin(), v.end()), v.end());
    return v;
  };
  return nodes_[a].euler + nodes_[b].euler - (shared(vertices(a), vertices(b)) - shared_edges);
}

struct FaceClusterTree::Choice {
  int kind = -1;  // 0: l and its parent's place, 1: swap
  uint32_t keep = kNone, pair_a = kNone, pair_b = kNone, other_a = kNone, other_b = kNone;
  double gamma = 0, beta = 0;
  double gain = 0;  // imbalance that the nodes whose children change have less in sum
  int spoilt = 0;   // clusters that are no discs, more than before
};

// Fig. 3 after the text of sec. 3.2. Afterwards the children that were newly paired are looked at in turn.
void FaceClusterTree::rebalance(uint32_t n, int& steps) {
  if (nodes_[n].left == kNone || steps <= 0) return;
  const uint32_t l = nodes_[n].left, r = nodes_[n].right;
  const bool l_inner = nodes_[l].left != kNone, r_inner = nodes_[r].left != kNone;
  if (!l_inner && !r_inner) return;
  const auto length = [&](uint32_t x) { return static_cast<double>(nodes_[x].perimeter.size()); };
  const auto gamma = [&](double x, double y) { return x + y + options_.alpha * std::fabs(x - y); };
  const double beta_now = imbalance(n), gamma_now = gamma(length(l), length(r));
  const bool unbalanced = beta_now > options_.tau;
  Choice best;
  const auto is_disc = [&](uint32_t x) { return nodes_[x].euler == 1; };
  const auto consider = [&](const Choice& c) {
    if (c.spoilt > 0) return;
    if (c.spoilt < best.spoilt) {
      best = c;
      return;
    }
    if (best.spoilt < 0 && c.spoilt > best.spoilt) return;
    // Lengths are few and small near the leaves: most choices there tie, and balance decides.
    const bool shorter = c.gamma < gamma_now || (c.gamma == gamma_now && c.gain > kLeastGain);
    if (polishing_) {
      if (c.gain <= kLeastGain || c.gamma > (1 + options_.slack) * gamma_now) return;
      if (best.kind < 0 || c.gain > best.gain) best = c;
      return;
    }
    if (unbalanced ? c.beta >= beta_now : (c.beta >= options_.tau || !shorter)) return;
    if (best.kind < 0 || c.gamma < best.gamma || (c.gamma == best.gamma && c.gain > best.gain)) best = c;
  };
  // Shared edges between grandchildren (a leaf child stands for itself).
  const uint32_t left[2] = {l_inner ? nodes_[l].left : l, l_inner ? nodes_[l].right : kNone};
  const uint32_t right[2] = {r_inner ? nodes_[r].left : r, r_inner ? nodes_[r].right : kNone};
  int s[2][2] = {{0, 0}, {0, 0}};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      if (left[i] != kNone && right[j] != kNone)
        s[i][j] = shared(nodes_[left[i]].perimeter, nodes_[right[j]].perimeter);
  // Rotations: one grandchild joins the other side. In a balanced node only the one whose new pair shares most counts.
  int most = 1;
  if (!unbalanced && !polishing_)
    for (int i = 0; i < 2; ++i)
      most = std::max({most, l_inner ? s[i][0] + s[i][1] : 0, r_inner ? s[0][i] + s[1][i] : 0});
  const auto weight = [&](uint32_t x) { return nodes_[x].weight; };
  const auto rotate = [&](uint32_t keep, uint32_t joins, uint32_t with, int common) {
    if (common < most) return;
    const double pair = length(joins) + length(with) - 2.0 * common;
    const double beta = imbalance_of(weight(keep), weight(joins) + weight(with));
    const double gain =
        beta_now + imbalance_of(weight(keep), weight(joins)) - beta - imbalance_of(weight(joins), weight(with));
    const int spoilt =
        !options_.simply_connected ? 0 : (joint_euler(joins, with, common) != 1) - !is_disc(nodes_[keep].parent);
    consider({0, keep, joins, with, kNone, kNone, gamma(length(keep), pair), beta, gain, spoilt});
  };
  if (l_inner)
    for (int i = 0; i < 2; ++i) rotate(left[1 - i], left[i], r, s[i][0] + s[i][1]);
  if (r_inner)
    for (int j = 0; j < 2; ++j) rotate(right[1 - j], right[j], l, s[0][j] + s[1][j]);
  // Swaps: both new pairs must share as much as the pairs that are, unless it is balance that is wanted.
  if (l_inner && r_inner) {
    const double ab = (length(left[0]) + length(left[1]) - length(l)) / 2,
                 cd = (length(right[0]) + length(right[1]) - length(r)) / 2;
    for (int j = 0; j < 2; ++j) {
      const int x = s[0][j], y = s[1][1 - j];
      if (x == 0 || y == 0 || (!unbalanced && !polishing_ && (x < ab || y < cd))) continue;
      const double beta = imbalance_of(weight(left[0]) + weight(right[j]), weight(left[1]) + weight(right[1 - j]));
      const double gain = beta_now + imbalance(l) + imbalance(r) - beta -
                          imbalance_of(weight(left[0]), weight(right[j])) -
                          imbalance_of(weight(left[1]), weight(right[1 - j]));
      const int spoilt = !options_.simply_connected
                             ? 0
                             : (joint_euler(left[0], right[j], x) != 1) + (joint_euler(left[1], right[1 - j], y) != 1) -
                                   !is_disc(l) - !is_disc(r);
      consider({1, kNone, left[0], right[j], left[1], right[1 - j],
                gamma(length(left[0]) + length(right[j]) - 2.0 * x, length(left[1]) + length(right[1 - j]) - 2.0 * y),
                beta, gain, spoilt});
    }
  }
  if (best.kind < 0) return;
  --steps;
  ++perturbations_;
  if (best.kind == 0) {
    // The inner child that `keep` leaves becomes the new pair.
    const uint32_t freed = nodes_[best.keep].parent;
    set_children(freed, best.pair_a, best.pair_b);
    refresh(freed);
    set_children(n, best.keep, freed);
    rebalance(freed, steps);
  } else {
    set_children(l, best.pair_a, best.pair_b);
    set_children(r, best.other_a, best.other_b);
    refresh(l);
    refresh(r);
    rebalance(l, steps);
    rebalance(r, steps);
  }
}

FaceClusterTree::FaceClusterTree(const FaceMesh& mesh, std::span<const double> weights,
                                 const FaceClusterTreeOptions& options)
    : options_(options) {
  const DualGraph graph = dual_graph(mesh);
  const auto n = static_cast<uint32_t>(mesh.faces.size());
  if (!weights.empty() && weights.size() != n)
    fail_argument("face clusters: " + std::to_string(weights.size()) + " weights for " + std::to_string(n) + " faces");
  if (!(options.alpha >= 0 && options.alpha < 1e6) || !(options.tau > 0) ||
      !(options.slack >= 0 && options.slack < 1e6))
    fail_argument("face clusters: alpha " + std::to_string(options.alpha) + ", tau " + std::to_string(options.tau) +
                  " or slack " + std::to_string(options.slack) + " is out of range");
  if (options.bloom_bits != 0 && (options.bloom_bits < 64 || options.bloom_bits > (1u << 24) ||
                                  options.bloom_hashes < 1 || options.bloom_hashes > 16))
    fail_argument("face clusters: a Bloom filter of " + std::to_string(options.bloom_bits) + " bits and " +
                  std::to_string(options.bloom_hashes) + " hashes");
  if (options.bloom_bits != 0 && options.simply_connected)
    fail_argument("face clusters: simply_connected needs exact perimeters, and bloom_bits is " +
                  std::to_string(options.bloom_bits));
  if (options.simply_connected) edge_vertices_ = graph.edge_vertices;
  nodes_.reserve(2 * static_cast<size_t>(n));
  nodes_.resize(n);
  for (uint32_t f = 0; f < n; ++f) {
    nodes_[f].weight = weights.empty() ? 0.5 * length(face_normal_area(mesh, f)) : weights[f];
    if (!(nodes_[f].weight >= 0 && nodes_[f].weight < 1e300))
      fail_argument("face clusters: weight " + std::to_string(f) + " is " + std::to_string(nodes_[f].weight));
    Edges& perimeter = nodes_[f].perimeter;
    if (options.bloom_bits == 0) {
      perimeter.assign(graph.edges_of(f).begin(), graph.edges_of(f).end());
      continue;
    }
    for (const uint32_t e : graph.edges_of(f))
      for (int k = 0; k < options.bloom_hashes; ++k)
        perimeter.push_back(static_cast<uint32_t>(hash64(e, static_cast<uint64_t>(k)) % options.bloom_bits));
    std::sort(perimeter.begin(), perimeter.end());
    perimeter.erase(std::unique(perimeter.begin(), perimeter.end()), perimeter.end());
  }
  // Breadth first; each face joins the leaf of the face that it was reached from, and its ancestors rebalance.
  std::vector<uint8_t> seen(n, 0);
  std::vector<uint32_t> queue, roots;
  for (uint32_t start = 0; start < n; ++start) {
    if (seen[start]) continue;
    uint32_t top = start;
    seen[start] = 1;
    queue.assign(1, start);
    for (size_t i = 0; i < queue.size(); ++i) {
      const uint32_t from = queue[i];
      for (const uint32_t f : graph.of(from)) {
        if (seen[f]) continue;
        seen[f] = 1;
        queue.push_back(f);
        const auto parent = static_cast<uint32_t>(nodes_.size());
        nodes_.emplace_back();
        const uint32_t above = nodes_[from].parent;
        nodes_[parent].parent = above;
        set_children(parent, from, f);
        refresh(parent);
        if (above == kNone)
          top = parent;
        else
          (nodes_[above].left == from ? nodes_[above].left : nodes_[above].right) = parent;
        for (uint32_t a = above; a != kNone; a = nodes_[a].parent) {
          nodes_[a].weight += nodes_[f].weight;
          ++nodes_[a].faces;
          if (options_.simply_connected)
            nodes_[a].euler = joint_euler(a, f, shared(nodes_[a].perimeter, nodes_[f].perimeter));
          for (const uint32_t e : nodes_[f].perimeter) toggle(nodes_[a].perimeter, e);
        }
        for (uint32_t a = parent; a != kNone; a = nodes_[a].parent) {
          int steps = options_.max_steps;
          rebalance(a, steps);
        }
      }
    }
    roots.push_back(top);
  }
  // Components: the two lightest trees are joined, again and again.
  const auto heavier = [&](uint32_t a, uint32_t b) {
    return nodes_[a].weight != nodes_[b].weight ? nodes_[a].weight > nodes_[b].weight : a > b;
  };
  std::priority_queue<uint32_t, std::vector<uint32_t>, decltype(heavier)> trees(heavier, std::move(roots));
  while (trees.size() > 1) {
    const uint32_t a = trees.top();
    trees.pop();
    const uint32_t b = trees.top();
    trees.pop();
    const auto parent = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    set_children(parent, a, b);
    refresh(parent);
    trees.push(parent);
  }
  if (!trees.empty()) root_ = trees.top();
  settle();
}

// Passes over all nodes, leaves first, until the mean imbalance falls no more; then the same for balance first.
void FaceClusterTree::settle() {
  for (const bool polishing : {false, true}) {
    polishing_ = polishing;
    for (int pass = 0; pass < options_.max_passes; ++pass) {
      const double before = mean_imbalance(false);
      for (const uint32_t x : postorder()) {
        int steps = options_.max_steps;
        rebalance(x, steps);
      }
      if (!(mean_imbalance(false) < 0.99 * before)) break;
    }
  }
  polishing_ = false;
}

std::vector<uint32_t> FaceClusterTree::postorder() const {
  std::vector<uint32_t> order, stack;
  if (root_ != kNone) stack.push_back(root_);
  while (!stack.empty()) {
    const uint32_t n = stack.back();
    stack.pop_back();
    order.push_back(n);
    if (nodes_[n].left != kNone) stack.push_back(nodes_[n].left), stack.push_back(nodes_[n].right);
  }
  std::reverse(order.begin(), order.end());
  return order;
}

void FaceClusterTree::set_weights(std::span<const double> weights) {
  const size_t n = (nodes_.size() + 1) / 2;
  if (weights.size() != n)
    fail_argument("face clusters: " + std::to_string(weights.size()) + " weights for " + std::to_string(n) + " faces");
  for (size_t f = 0; f < n; ++f)
    if (!(weights[f] >= 0 && weights[f] < 1e300))
      fail_argument("face clusters: weight " + std::to_string(f) + " is " + std::to_string(weights[f]));
  for (size_t f = 0; f < n; ++f) nodes_[f].weight = weights[f];
  const auto order = postorder();
  for (const uint32_t x : order)
    if (nodes_[x].left != kNone) nodes_[x].weight = nodes_[nodes_[x].left].weight + nodes_[nodes_[x].right].weight;
  settle();
}

void FaceClusterTree::set_weight(uint32_t face, double weight) {
  const size_t n = (nodes_.size() + 1) / 2;
  if (face >= n) fail_argument("face clusters: no face " + std::to_string(face) + " of " + std::to_string(n));
  if (!(weight >= 0 && weight < 1e300))
    fail_argument("face clusters: weight " + std::to_string(face) + " is " + std::to_string(weight));
  nodes_[face].weight = weight;
  for (uint32_t a = nodes_[face].parent; a != kNone; a = nodes_[a].parent)
    nodes_[a].weight = nodes_[nodes_[a].left].weight + nodes_[nodes_[a].right].weight;
  for (uint32_t a = nodes_[face].parent; a != kNone; a = nodes_[a].parent) {
    int steps = options_.max_steps;
    rebalance(a, steps);
  }
}

FaceClusterTree::Topology FaceClusterTree::topology(const FaceMesh& mesh) const {
  const DualGraph graph = dual_graph(mesh);
  Topology t;
  std::vector<uint32_t> vertex_of(mesh.vertices.size(), kNone), edge_of(graph.edge_vertices.size(), kNone), members,
      stamp(mesh.faces.size(), kNone), stack;
  for (uint32_t x = 0; x < nodes_.size(); ++x) {
    if (nodes_[x].left == kNone) continue;
    members_of(x, members, stack);
    if (!joined(graph, members, x, stamp, stack)) {
      ++t.disconnected;
      continue;
    }
    auto euler = static_cast<int64_t>(members.size());
    for (const uint32_t f : members) {
      for (const uint32_t v : mesh.faces[f])
        if (vertex_of[v] != x) vertex_of[v] = x, ++euler;
      for (const uint32_t e : graph.edges_of(f))
        if (edge_of[e] != x) edge_of[e] = x, --euler;
    }
    ++(euler == 1 ? t.discs : t.holed);
  }
  return t;
}

void FaceClusterTree::members_of(uint32_t n, std::vector<uint32_t>& members, std::vector<uint32_t>& stack) const {
  members.clear();
  stack.assign(1, n);
  while (!stack.empty()) {
    const uint32_t y = stack.back();
    stack.pop_back();
    if (nodes_[y].left == kNone)
      members.push_back(y);
    else
      stack.push_back(nodes_[y].left), stack.push_back(nodes_[y].right);
  }
}

double FaceClusterTree::mean_imbalance(bool with_leaves) const {
  double sum = 0;
  size_t inner = 0;
  for (uint32_t x = 0; x < nodes_.size(); ++x)
    if (nodes_[x].left != kNone) sum += imbalance(x), ++inner;
  const size_t count = with_leaves ? nodes_.size() : inner;
  return count ? sum / static_cast<double>(count) : 0;
}

size_t FaceClusterTree::perimeter_bytes() const {
  size_t edges = 0;
  for (const Node& x : nodes_) edges += x.perimeter.size();
  return edges * sizeof(uint32_t);
}

std::vector<uint32_t> FaceClusterTree::labels_at_level(int level) const {
  std::vector<uint32_t> labels((nodes_.size() + 1) / 2, 0);
  struct Entry {
    uint32_t node;
    int level;
    uint32_t label;
  };
  std::vector<Entry> stack;
  if (root_ != kNone) stack.push_back({root_, 0, kNone});
  uint32_t next = 0;
  while (!stack.empty()) {
    Entry e = stack.back();
    stack.pop_back();
    const Node& x = nodes_[e.node];
    if (e.label == kNone && (e.level == level || x.left == kNone)) e.label = next++;
    if (x.left == kNone)
      labels[e.node] = e.label;
    else
      stack.push_back({x.right, e.level + 1, e.label}), stack.push_back({x.left, e.level + 1, e.label});
  }
  return labels;
}

size_t FaceClusterTree::disconnected_clusters(const DualGraph& graph) const {
  size_t bad = 0;
  std::vector<uint32_t> stamp((nodes_.size() + 1) / 2, kNone), stack, members;
  for (uint32_t x = 0; x < nodes_.size(); ++x) {
    if (nodes_[x].left == kNone) continue;
    members_of(x, members, stack);
    bad += !joined(graph, members, x, stamp, stack);
  }
  return bad;
}

FaceClusterTree::Bloom FaceClusterTree::bloom_statistics(uint32_t bits, int hashes,
                                                         std::span<const uint32_t> sizes) const {
  if (bits < 64 || bits > (1u << 24) || (bits & 63) != 0 || hashes < 1 || hashes > 16)
    fail_argument("face clusters: a Bloom filter of " + std::to_string(bits) + " bits and " + std::to_string(hashes) +
                  " hashes");
  Bloom b;
  for (const uint32_t s : sizes) b.rows.push_back({s});
  if (options_.bloom_bits != 0) fail_state("face clusters: statistics of Bloom filters need exact perimeters");
  const size_t words = bits / 64;
  std::vector<std::vector<uint64_t>> pool;  // vectors of the nodes whose parent is still to come
  for (const uint32_t x : postorder()) {
    const Node& n = nodes_[x];
    if (n.left == kNone) {
      pool.emplace_back(words, 0);
      for (const uint32_t e : n.perimeter)
        for (int k = 0; k < hashes; ++k) {
          const uint64_t h = hash64(e, static_cast<uint64_t>(k)) % bits;
          pool.back()[h / 64] |= uint64_t{1} << (h % 64);
        }
    } else {
      auto& a = pool[pool.size() - 2];
      for (size_t w = 0; w < words; ++w) a[w] ^= pool.back()[w];
      pool.pop_back();
    }
    size_t set = 0, runs = 1;
    uint64_t last = 0;
    for (const uint64_t w : pool.back()) {
      set += static_cast<size_t>(std::popcount(w));
      runs += static_cast<size_t>(std::popcount(w ^ (w << 1 | last)));
      last = w >> 63;
    }
    b.bytes += words * 8;
    b.run_length_bytes += 2 * runs;
    for (auto& row : b.rows)
      if (n.faces >= row.faces / std::sqrt(2.0) && n.faces < row.faces * std::sqrt(2.0) && !n.perimeter.empty()) {
        const auto e = static_cast<double>(n.perimeter.size());
        ++row.nodes;
        row.edges += e;
        row.loss += 1 - static_cast<double>(set) / (hashes * e);
      }
  }
  for (auto& row : b.rows)
    if (row.nodes) row.edges /= static_cast<double>(row.nodes), row.loss /= static_cast<double>(row.nodes);
  return b;
}

}  // namespace lumicut
