// Ball trees: binary trees over balls in any dimension, every node bounded by a ball. [Omohundro 1989]
//
// Departs: bottom-up goes through accel/agglomerate.h (the same greedy pairs as the paper's brute force) on
// single-precision leaves, rounded from the middle of all where they have to be; volumes are compared by radius where one decides alone, and r^d appears in sums only;
// top-down takes an explicit stack, for its depth can be near N; balls of inner nodes are widened by a few roundings,
// so that pruning never loses a leaf.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/progress.h"

namespace lumicut {

enum class BallTreeBuilder {
  kd,  // median of the widest dimension: balanced
  // The split, over all dimensions, of least joint volume: points alone are often split off one by one, so that depth, and
  // with it time, grow faster than their number.
  top_down,
  // On-line, best sibling by branch and bound (not exact for balls: the paper says so), or into the child that expands
  // less. Balls that come in order along a line make a tree as deep as there are balls, in quadratic time.
  insertion,
  cheap_insertion,
  bottom_up  // greedy pairs of least joint ball; dimension at most 16
};

class BallTree {
 public:
  static constexpr uint32_t kNone = 0xffffffffu;

  // Throws invalid_argument on a dimension outside 1 to 1024.
  explicit BallTree(int dimension);
  // `centres`: n rows of `dimension` numbers; `radii`: n numbers, or empty for points. Leaf i is ball i.
  // Throws invalid_argument on sizes that do not fit, values that are not finite or beyond 1e15, radii below 0.
  static BallTree build(std::span<const double> centres, std::span<const double> radii, int dimension,
                        BallTreeBuilder builder, Progress* progress = nullptr);

  // On-line use. Returns the new leaf's id; ids of removed leaves are used again.
  uint32_t insert(std::span<const double> centre, double radius, bool cheap = false);
  // Throws invalid_argument when there is no such leaf.
  void remove(uint32_t leaf);

  size_t size() const { return leaves_; }
  int dimension() const { return dim_; }
  // Sum of radius^d over inner nodes: the paper's measure of a tree (proportional to volume).
  double total_volume() const;
  size_t depth() const;
  // fn(centre, radius, level, leaf) for every ball, from the root's (level 0) down; leaf: kNone for inner ones.
  template <typename Fn>
  void for_each_ball(Fn&& fn) const {
    std::vector<std::pair<uint32_t, size_t>> stack;
    if (root_ != kNone) stack.push_back({root_, 0});
    while (!stack.empty()) {
      const auto [n, level] = stack.back();
      stack.pop_back();
      fn(std::span(centre(n), static_cast<size_t>(dim_)), nodes_[n].radius, level, nodes_[n].leaf);
      if (nodes_[n].leaf == kNone)
        stack.push_back({nodes_[n].left, level + 1}), stack.push_back({nodes_[n].right, level + 1});
    }
  }

  // Leaves, ascending. Balls are closed.
  std::vector<uint32_t> containing(std::span<const double> centre, double radius) const;    // that hold the ball wholly
  std::vector<uint32_t> intersecting(std::span<const double> centre, double radius) const;  // that touch it
  std::vector<uint32_t> contained(std::span<const double> centre, double radius) const;     // wholly inside it
  // The m leaves that are nearest to the point, nearest first, the smaller id on ties: by their centres, by their nearest
  // points (0 inside), or by their furthest.
  enum class Distance { centre, least, greatest };
  std::vector<uint32_t> nearest(std::span<const double> point, size_t m, Distance by = Distance::centre) const;
  // The leaf (other than `except`) whose joint ball with the given one is smallest; kNone when there is none.
  uint32_t best_mate(std::span<const double> centre, double radius, uint32_t except = kNone) const;

  // Every inner ball holds its children, parents and children agree, leaves are all reached. For tests and debugging.
  bool valid() const;

 private:
  struct Node {
    double radius = 0;
    uint32_t left = kNone, right = kNone, parent = kNone;
    uint32_t leaf = kNone;   // leaf id; kNone: inner
    uint32_t least = kNone;  // of the ids of its leaves
  };
  const double* centre(uint32_t node) const { return &centres_[static_cast<size_t>(node) * static_cast<size_t>(dim_)]; }
  double* centre(uint32_t node) { return &centres_[static_cast<size_t>(node) * static_cast<size_t>(dim_)]; }
  double distance(const double* a, const double* b) const;
  double volume(double radius) const;
  double joint_radius(uint32_t node, const double* centre, double radius) const;
  void check(std::span<const double> centre, double radius, const char* what) const;
  // The leaves that takes(distance of centres, radius) takes, in order, below nodes that enters() lets in.
  template <typename Enters, typename Takes>
  std::vector<uint32_t> search(std::span<const double> centre, double radius, Enters enters, Takes takes) const;
  uint32_t new_node();
  uint32_t new_leaf(const double* centre, double radius);
  uint32_t join(uint32_t left, uint32_t right);  // a new inner node
  void fit(uint32_t node);                       // its ball around its children's
  void refit_upwards(uint32_t node);
  uint32_t best_sibling(uint32_t leaf) const;
  uint32_t cheap_sibling(uint32_t leaf) const;
  void attach(uint32_t leaf, uint32_t sibling);
  uint32_t build_kd(std::vector<uint32_t>& nodes, size_t begin, size_t end);
  uint32_t build_top_down(const std::vector<uint32_t>& nodes, Progress* progress);
  uint32_t build_bottom_up(std::span<const double> centres, std::span<const double> radii);

  int dim_;
  uint32_t root_ = kNone;
  size_t leaves_ = 0;
  std::vector<Node> nodes_;
  std::vector<double> centres_;
  std::vector<uint32_t> leaf_node_, free_nodes_, free_leaves_;
};

}  // namespace lumicut
