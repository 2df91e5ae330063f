#include "geometry/balltree.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <string>

#include "accel/agglomerate.h"
#include "core/error.h"

namespace lumicut {

BallTree::BallTree(int dimension) : dim_(dimension) {
  if (dimension < 1 || dimension > 1024)
    fail_argument("ball tree: dimension is " + std::to_string(dimension) + ", not 1 to 1024");
}

double BallTree::distance(const double* a, const double* b) const {
  double sum = 0;
  for (int j = 0; j < dim_; ++j) sum += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(sum);
}

double BallTree::volume(double radius) const {
  double v = 1, base = radius;
  for (int e = dim_; e > 0; e >>= 1, base *= base)
    if (e & 1) v *= base;
  return v;
}

double BallTree::joint_radius(uint32_t node, const double* c, double radius) const {
  const double d = distance(centre(node), c), r = nodes_[node].radius;
  if (d + radius <= r) return r;
  if (d + r <= radius) return radius;
  return 0.5 * (d + r + radius);
}

void BallTree::check(std::span<const double> c, double radius, const char* what) const {
  if (c.size() != static_cast<size_t>(dim_))
    fail_argument(std::string("ball tree: ") + what + " has " + std::to_string(c.size()) + " coordinates, not " +
                  std::to_string(dim_));
  for (const double x : c)
    if (!(std::fabs(x) <= 1e15))
      fail_argument(std::string("ball tree: ") + what + " has the coordinate " + std::to_string(x));
  if (!(radius >= 0 && radius <= 1e15))
    fail_argument(std::string("ball tree: ") + what + " has the radius " + std::to_string(radius));
}

uint32_t BallTree::new_node() {
  if (!free_nodes_.empty()) {
    const uint32_t n = free_nodes_.back();
    free_nodes_.pop_back();
    nodes_[n] = Node();
    return n;
  }
  nodes_.emplace_back();
  centres_.resize(centres_.size() + static_cast<size_t>(dim_));
  return static_cast<uint32_t>(nodes_.size() - 1);
}

uint32_t BallTree::new_leaf(const double* c, double radius) {
  const uint32_t n = new_node();
  std::copy(c, c + dim_, centre(n));
  nodes_[n].radius = radius;
  uint32_t id = static_cast<uint32_t>(leaf_node_.size());
  if (free_leaves_.empty()) {
    leaf_node_.push_back(n);
  } else {
    id = free_leaves_.back();
    free_leaves_.pop_back();
    leaf_node_[id] = n;
  }
  nodes_[n].leaf = nodes_[n].least = id;
  ++leaves_;
  return n;
}

void BallTree::fit(uint32_t n) {
  const uint32_t a = nodes_[n].left, b = nodes_[n].right;
  nodes_[n].least = std::min(nodes_[a].least, nodes_[b].least);
  const double ra = nodes_[a].radius, rb = nodes_[b].radius;
  const double *ca = centre(a), *cb = centre(b);
  double* c = centre(n);
  const double d = distance(ca, cb);
  if (d + rb <= ra) {
    std::copy(ca, ca + dim_, c);
    nodes_[n].radius = ra;
    return;
  }
  if (d + ra <= rb) {
    std::copy(cb, cb + dim_, c);
    nodes_[n].radius = rb;
    return;
  }
  const double r = 0.5 * (d + ra + rb), t = (r - ra) / d;
  double size = r;
  for (int j = 0; j < dim_; ++j) {
    c[j] = ca[j] + (cb[j] - ca[j]) * t;
    size = std::max(size, std::fabs(c[j]));
  }
  // The centre and both distances to it round; so does the distance that a query computes.
  nodes_[n].radius = r + 1e-15 * std::sqrt(static_cast<double>(dim_)) * 4 * size;
}

uint32_t BallTree::join(uint32_t left, uint32_t right) {
  const uint32_t n = new_node();
  nodes_[n].left = left;
  nodes_[n].right = right;
  nodes_[left].parent = nodes_[right].parent = n;
  fit(n);
  return n;
}

void BallTree::refit_upwards(uint32_t n) {
  for (; n != kNone; n = nodes_[n].parent) fit(n);
}

BallTree BallTree::build(std::span<const double> centres, std::span<const double> radii, int dimension,
                         BallTreeBuilder builder, Progress* progress) {
  BallTree t(dimension);
  const auto d = static_cast<size_t>(dimension);
  const size_t n = centres.size() / d;
  if (n * d != centres.size() || n >= kNone / 2)
    fail_argument("ball tree: " + std::to_string(centres.size()) + " coordinates in rows of " + std::to_string(d));
  if (!radii.empty() && radii.size() != n)
    fail_argument("ball tree: " + std::to_string(radii.size()) + " radii for " + std::to_string(n) + " centres");
  for (size_t i = 0; i < n; ++i)
    t.check(centres.subspan(i * d, d), radii.empty() ? 0.0 : radii[i], ("ball " + std::to_string(i)).c_str());
  if (n == 0) return t;
  t.nodes_.reserve(2 * n);
  t.centres_.reserve(2 * n * d);
  if (progress != nullptr) progress->begin("ball tree", n);
  std::vector<uint32_t> nodes(n);
  const bool online = builder == BallTreeBuilder::insertion || builder == BallTreeBuilder::cheap_insertion;
  for (size_t i = 0; i < n; ++i) {
    nodes[i] = t.new_leaf(&centres[i * d], radii.empty() ? 0.0 : radii[i]);
    if (online)
      t.attach(nodes[i], t.root_ == kNone                        ? kNone
                         : builder == BallTreeBuilder::insertion ? t.best_sibling(nodes[i])
                                                                 : t.cheap_sibling(nodes[i]));
    if (online && progress != nullptr) progress->advance(1), progress->check();
  }
  if (builder == BallTreeBuilder::kd) t.root_ = t.build_kd(nodes, 0, n);
  if (builder == BallTreeBuilder::top_down) t.root_ = t.build_top_down(nodes, progress);
  if (builder == BallTreeBuilder::bottom_up) t.root_ = t.build_bottom_up(centres, radii);
  return t;
}

uint32_t BallTree::build_kd(std::vector<uint32_t>& nodes, size_t begin, size_t end) {
  if (end - begin == 1) return nodes[begin];
  int widest = 0;
  double most = -1;
  for (int j = 0; j < dim_; ++j) {
    double lo = centre(nodes[begin])[j], hi = lo;
    for (size_t i = begin; i < end; ++i) lo = std::min(lo, centre(nodes[i])[j]), hi = std::max(hi, centre(nodes[i])[j]);
    if (hi - lo > most) most = hi - lo, widest = j;
  }
  const size_t mid = begin + (end - begin + 1) / 2;
  const auto at = [&](size_t i) { return nodes.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(mid), at(end), [&](uint32_t a, uint32_t b) {
    const double x = centre(a)[widest], y = centre(b)[widest];
    return x < y || (x == y && a < b);
  });
  const uint32_t left = build_kd(nodes, begin, mid), right = build_kd(nodes, mid, end);
  return join(left, right);
}

uint32_t BallTree::build_top_down(const std::vector<uint32_t>& all, Progress* progress) {
  // Splits first, with placeholders; then inner balls from the bottom up.
  struct Range {
    size_t begin, end, by;  // in order of that dimension; dim_: as they came
    uint32_t parent;
    bool is_left;
  };
  const auto dimensions = static_cast<size_t>(dim_);
  std::vector<Range> stack{{0, all.size(), dimensions, kNone, false}};
  // Sorted once by each dimension, then parted in order; the last order is that in which they came.
  const auto at = [](std::vector<uint32_t>& of, size_t i) { return of.begin() + static_cast<std::ptrdiff_t>(i); };
  const auto sort = [&](std::vector<uint32_t>& of, size_t begin, size_t end, size_t j) {
    std::sort(at(of, begin), at(of, end), [&](uint32_t a, uint32_t b) {
      const double x = centre(a)[j], y = centre(b)[j];
      return x < y || (x == y && a < b);
    });
  };
  std::vector<std::vector<uint32_t>> order(dimensions + 1, all);
  for (size_t j = 0; j < dimensions; ++j) sort(order[j], 0, all.size(), j);
  std::vector<uint32_t> created, rest;
  std::vector<uint8_t> left_of(nodes_.size(), 0);
  std::vector<double> cost(all.size()), c(dimensions);
  uint32_t root = kNone;
  while (!stack.empty()) {
    const Range r = stack.back();
    stack.pop_back();
    uint32_t n;
    if (r.end - r.begin == 1) {
      n = order[r.by][r.begin];
      if (progress != nullptr) progress->advance(1), progress->check();
    } else {
      // A ball that grows over the range, from either end. [fill_in_cst]
      double radius = 0, scale = 0;
      const auto grow = [&](uint32_t leaf) {
        const double* q = centre(leaf);
        const double d = distance(c.data(), q), s = nodes_[leaf].radius;
        if (d + s <= radius) return;
        if (d + radius <= s) {
          std::copy(q, q + dim_, c.begin());
          radius = s;
          return;
        }
        const double next = 0.5 * (d + radius + s), t = (next - radius) / d;
        for (int j = 0; j < dim_; ++j) c[static_cast<size_t>(j)] += (q[j] - c[static_cast<size_t>(j)]) * t;
        radius = next;
      };
      const auto start = [&](uint32_t leaf) {
        std::copy(centre(leaf), centre(leaf) + dim_, c.begin());
        radius = nodes_[leaf].radius;
      };
      start(order[r.by][r.begin]);
      for (size_t i = r.begin; i < r.end; ++i) grow(order[r.by][i]);
      scale = radius > 0 ? 1 / radius : 0;  // costs relative to the whole range: r^d would underflow
      double best = std::numeric_limits<double>::infinity();
      size_t split = r.begin + 1, by = 0;
      for (size_t j = 0; j < dimensions; ++j) {
        const std::vector<uint32_t>& nodes = order[j];
        start(nodes[r.begin]);
        for (size_t i = r.begin; i + 1 < r.end; ++i) grow(nodes[i]), cost[i] = volume(radius * scale);
        start(nodes[r.end - 1]);
        bool better = false;
        // Of equal costs the evenest split: balls that are all alike make no chain.
        const auto uneven = [&](size_t i) { return std::max(i - r.begin, r.end - i); };
        for (size_t i = r.end - 1; i > r.begin; --i) {
          grow(nodes[i]);
          const double sum = cost[i - 1] + volume(radius * scale);
          if (sum < best || (better && sum == best && uneven(i) < uneven(split))) best = sum, split = i, better = true;
        }
        if (better) by = j;
      }
      for (size_t i = r.begin; i < r.end; ++i) left_of[order[by][i]] = i < split;
      for (size_t j = 0; j < dimensions; ++j) {
        if (j == by) continue;
        rest.clear();
        auto to = at(order[j], r.begin);
        for (size_t i = r.begin; i < r.end; ++i)
          if (const uint32_t leaf = order[j][i]; left_of[leaf] != 0)
            *to++ = leaf;
          else
            rest.push_back(leaf);
        std::copy(rest.begin(), rest.end(), to);
      }
      n = new_node();
      created.push_back(n);
      stack.push_back({r.begin, split, by, n, true});
      stack.push_back({split, r.end, by, n, false});
    }
    nodes_[n].parent = r.parent;
    if (r.parent == kNone)
      root = n;
    else
      (r.is_left ? nodes_[r.parent].left : nodes_[r.parent].right) = n;
  }
  for (size_t i = created.size(); i-- > 0;) fit(created[i]);
  return root;
}

uint32_t BallTree::build_bottom_up(std::span<const double> centres, std::span<const double> radii) {
  // Numbers that are single-precision ones stay. Of others it is places in the middle of all that are rounded, so that
  // what is far from the origin is as exact as what is near it.
  std::vector<double> middle(static_cast<size_t>(dim_), 0.0);
  const auto rounds = [](double x) { return static_cast<double>(static_cast<float>(x)) != x; };
  if (std::any_of(centres.begin(), centres.end(), rounds))
    for (size_t j = 0; j < middle.size(); ++j) {
      double lo = centres[j], hi = lo;
      for (size_t i = j; i < centres.size(); i += middle.size())
        lo = std::min(lo, centres[i]), hi = std::max(hi, centres[i]);
      middle[j] = lo + 0.5 * (hi - lo);
    }
  std::vector<float> c(centres.size()), r(leaves_, 0.0f);
  for (size_t i = 0; i < c.size(); ++i) c[i] = static_cast<float>(centres[i] - middle[i % middle.size()]);
  for (size_t i = 0; i < radii.size(); ++i) r[i] = static_cast<float>(radii[i]);
  const auto merges = agglomerate_balls(c, r, dim_, Strategy::parallel);
  std::vector<uint32_t> node_of(leaf_node_);
  for (const Merge& m : merges) node_of.push_back(join(node_of[m.left], node_of[m.right]));
  return node_of.back();
}

// The sibling that adds least volume: its joint ball with the leaf, and what its ancestors expand by. [best_sib]
uint32_t BallTree::best_sibling(uint32_t leaf) const {
  const double* c = centre(leaf);
  const double radius = nodes_[leaf].radius;
  struct Fringe {
    double expansion, joint;
    uint32_t node;
  };
  const auto later = [](const Fringe& a, const Fringe& b) {
    return a.expansion != b.expansion ? a.expansion > b.expansion : a.node > b.node;
  };
  std::priority_queue<Fringe, std::vector<Fringe>, decltype(later)> fringe(later);
  uint32_t best = root_;
  double cost = volume(joint_radius(root_, c, radius));
  const double least = volume(radius);  // of any joint ball
  if (nodes_[root_].leaf == kNone) fringe.push({0, cost, root_});
  while (!fringe.empty()) {
    const Fringe f = fringe.top();
    fringe.pop();
    if (f.expansion + least >= cost) break;
    const double expansion = f.expansion + f.joint - volume(nodes_[f.node].radius);
    for (const uint32_t child : {nodes_[f.node].left, nodes_[f.node].right}) {
      const double joint = volume(joint_radius(child, c, radius));
      if (joint + expansion < cost) cost = joint + expansion, best = child;
      if (nodes_[child].leaf == kNone && expansion + least < cost) fringe.push({expansion, joint, child});
    }
  }
  return best;
}

uint32_t BallTree::cheap_sibling(uint32_t leaf) const {
  const double* c = centre(leaf);
  const double radius = nodes_[leaf].radius;
  uint32_t best = root_;
  double joint = volume(joint_radius(root_, c, radius)), cost = joint, expansion = 0;
  for (uint32_t n = root_; nodes_[n].leaf == kNone;) {
    expansion += joint - volume(nodes_[n].radius);
    if (expansion >= cost) break;
    const uint32_t l = nodes_[n].left, r = nodes_[n].right;
    const double jl = volume(joint_radius(l, c, radius)), jr = volume(joint_radius(r, c, radius));
    if (expansion + jl <= cost) best = l, cost = expansion + jl;
    if (expansion + jr <= cost) best = r, cost = expansion + jr;
    const bool left = jl - volume(nodes_[l].radius) <= jr - volume(nodes_[r].radius);
    joint = left ? jl : jr;
    n = left ? l : r;
  }
  return best;
}

// Makes `leaf` the sibling of a node, under a new parent. [ins_at_node]
void BallTree::attach(uint32_t leaf, uint32_t sibling) {
  if (sibling == kNone) {
    root_ = leaf;
    return;
  }
  const uint32_t above = nodes_[sibling].parent;
  const uint32_t parent = join(sibling, leaf);
  nodes_[parent].parent = above;
  if (above == kNone)
    root_ = parent;
  else
    (nodes_[above].left == sibling ? nodes_[above].left : nodes_[above].right) = parent;
  refit_upwards(above);
}

uint32_t BallTree::insert(std::span<const double> c, double radius, bool cheap) {
  check(c, radius, "the new ball");
  const uint32_t leaf = new_leaf(c.data(), radius);
  attach(leaf, root_ == kNone ? kNone : cheap ? cheap_sibling(leaf) : best_sibling(leaf));
  return nodes_[leaf].leaf;
}

void BallTree::remove(uint32_t id) {
  if (id >= leaf_node_.size() || leaf_node_[id] == kNone)
    fail_argument("ball tree: no leaf " + std::to_string(id) + " to remove");
  const uint32_t leaf = leaf_node_[id], parent = nodes_[leaf].parent;
  leaf_node_[id] = kNone;
  free_leaves_.push_back(id);
  free_nodes_.push_back(leaf);
  --leaves_;
  if (parent == kNone) {
    root_ = kNone;
    return;
  }
  const uint32_t sibling = nodes_[parent].left == leaf ? nodes_[parent].right : nodes_[parent].left;
  const uint32_t above = nodes_[parent].parent;
  free_nodes_.push_back(parent);
  nodes_[sibling].parent = above;
  if (above == kNone)
    root_ = sibling;
  else
    (nodes_[above].left == parent ? nodes_[above].left : nodes_[above].right) = sibling;
  refit_upwards(above);
}

double BallTree::total_volume() const {
  double sum = 0;
  for_each_ball([&](auto, double radius, size_t, uint32_t leaf) {
    if (leaf == kNone) sum += volume(radius);
  });
  return sum;
}

size_t BallTree::depth() const {
  size_t deepest = 0;
  for_each_ball([&](auto, double, size_t level, uint32_t) { deepest = std::max(deepest, level + 1); });
  return deepest;
}

template <typename Enters, typename Takes>
std::vector<uint32_t> BallTree::search(std::span<const double> c, double radius, Enters enters, Takes takes) const {
  check(c, radius, "the query");
  std::vector<uint32_t> found, stack;
  if (root_ != kNone) stack.push_back(root_);
  while (!stack.empty()) {
    const uint32_t i = stack.back();
    const Node& n = nodes_[i];
    stack.pop_back();
    const double d = distance(centre(i), c.data());
    if (n.leaf != kNone) {
      if (takes(d, n.radius)) found.push_back(n.leaf);
    } else if (enters(d, n.radius)) {
      stack.push_back(n.left), stack.push_back(n.right);
    }
  }
  if (found.size() > leaf_node_.size() / 16) {  // many: marked in place of sorted
    std::vector<uint8_t> marked(leaf_node_.size(), 0);
    for (const uint32_t id : found) marked[id] = 1;
    found.clear();
    for (uint32_t id = 0; id < marked.size(); ++id)
      if (marked[id] != 0) found.push_back(id);
    return found;
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<uint32_t> BallTree::containing(std::span<const double> c, double radius) const {
  const auto contains = [radius](double d, double r) { return d + radius <= r; };
  return search(c, radius, contains, contains);
}

std::vector<uint32_t> BallTree::intersecting(std::span<const double> c, double radius) const {
  const auto meets = [radius](double d, double r) { return d <= radius + r; };
  return search(c, radius, meets, meets);
}

std::vector<uint32_t> BallTree::contained(std::span<const double> c, double radius) const {
  return search(
      c, radius, [radius](double d, double r) { return d <= radius + r; },
      [radius](double d, double r) { return d + r <= radius; });
}

std::vector<uint32_t> BallTree::nearest(std::span<const double> p, size_t m, Distance by) const {
  check(p, 0, "the query");
  std::vector<std::pair<double, uint32_t>> heap;  // the m best so far, worst on top
  struct Entry {
    double near;
    uint32_t node;
  };
  std::vector<Entry> stack;
  const auto near = [&](uint32_t n) { return distance(centre(n), p.data()) - nodes_[n].radius; };
  // No leaf below is better than that: where many are equally near, ids decide.
  const auto least_key = [&](const Entry& e) { return std::pair(e.near, nodes_[e.node].least); };
  if (root_ != kNone && m > 0) stack.push_back({near(root_), root_});
  while (!stack.empty()) {
    const Entry e = stack.back();
    stack.pop_back();
    const Node& n = nodes_[e.node];
    if (n.leaf != kNone) {
      const double d = distance(centre(e.node), p.data());
      const std::pair<double, uint32_t> candidate{by == Distance::centre  ? d
                                                  : by == Distance::least ? std::max(0.0, d - n.radius)
                                                                          : d + n.radius,
                                                  n.leaf};
      if (heap.size() == m && !(candidate < heap.front())) continue;
      heap.push_back(candidate);
      std::push_heap(heap.begin(), heap.end());
      if (heap.size() > m) std::pop_heap(heap.begin(), heap.end()), heap.pop_back();
      continue;
    }
    if (heap.size() == m && least_key(e) > heap.front()) continue;
    Entry a{near(n.left), n.left}, b{near(n.right), n.right};
    if (least_key(a) < least_key(b)) std::swap(a, b);
    stack.push_back(a);
    stack.push_back(b);  // the nearer one first
  }
  std::sort_heap(heap.begin(), heap.end());
  std::vector<uint32_t> ids;
  for (const auto& h : heap) ids.push_back(h.second);
  return ids;
}

uint32_t BallTree::best_mate(std::span<const double> c, double radius, uint32_t except) const {
  check(c, radius, "the query");
  // No leaf in a node gives a smaller joint ball than the node's point nearest to the query would.
  const auto bound = [&](uint32_t n) {
    const double near = std::max(0.0, distance(centre(n), c.data()) - nodes_[n].radius);
    return std::pair(std::max(radius, 0.5 * (near + radius)), nodes_[n].least);
  };
  std::pair<double, uint32_t> best{std::numeric_limits<double>::infinity(), kNone};
  std::vector<uint32_t> stack;
  if (root_ != kNone) stack.push_back(root_);
  while (!stack.empty()) {
    const uint32_t i = stack.back();
    const Node& n = nodes_[i];
    stack.pop_back();
    if (n.leaf != kNone) {
      if (n.leaf != except) best = std::min(best, {joint_radius(i, c.data(), radius), n.leaf});
      continue;
    }
    if (bound(i) > best) continue;
    const bool left_last = bound(n.left) <= bound(n.right);
    stack.push_back(left_last ? n.right : n.left);
    stack.push_back(left_last ? n.left : n.right);
  }
  return best.second;
}

bool BallTree::valid() const {
  size_t seen = 0;
  std::vector<uint32_t> stack;
  if (root_ != kNone) stack.push_back(root_);
  if (root_ != kNone && nodes_[root_].parent != kNone) return false;
  while (!stack.empty()) {
    const uint32_t i = stack.back();
    const Node& n = nodes_[i];
    stack.pop_back();
    if (n.leaf != kNone) {
      if (leaf_node_[n.leaf] != i) return false;
      ++seen;
      continue;
    }
    for (const uint32_t child : {n.left, n.right}) {
      if (nodes_[child].parent != i) return false;
      if (distance(centre(i), centre(child)) + nodes_[child].radius > n.radius * (1 + 1e-15)) return false;
      stack.push_back(child);
    }
  }
  return seen == leaves_;
}

}  // namespace lumicut
