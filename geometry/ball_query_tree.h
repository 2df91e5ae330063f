// Nearest neighbours among points that do not change: a ball tree of buckets, split in gaps and at medians.
//
// Not from the paper: bucket leaves of sixteen, coordinate by coordinate, so that a leaf is a few vector operations.
// Each node keeps the ball around the mean of its points.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/progress.h"

namespace lumicut {

class BallQueryTree {
 public:
  // `points`: n rows of `dimension` numbers. Throws invalid_argument as BallTree::build does, and cancelled.
  BallQueryTree(std::span<const double> points, int dimension, const Progress* progress = nullptr);

  size_t size() const { return count_; }
  // Reusable memory of one thread's queries.
  struct Scratch {
    std::vector<double> stack_near;
    std::vector<uint32_t> stack_node;
  };
  // The k nearest points to `point` (`dimension` numbers), nearest first, the smaller index on ties: their indices and
  // squared distances. Returns how many, the lesser of k and size().
  size_t nearest(const double* point, size_t k, uint32_t* index, double* dist2, Scratch& scratch) const;
  // A range of indices.
  struct Range {
    uint32_t first, count;
  };
  // Their squared distances alone: quick even where all points are at one place. Those of `without` are left out, so that
  // there may be fewer than k.
  size_t nearest_distances(const double* point, size_t k, double* dist2, Scratch& scratch,
                           Range without = {0, 0}) const;

 private:
  // kTies: among points at one distance the smaller index wins.
  template <bool kTies>
  size_t search(const double* point, size_t k, uint32_t* index, double* dist2, Scratch& scratch, Range without) const;
  static constexpr uint32_t kBucket = 16;
  struct Node {
    double radius;
    uint32_t right;   // 0: leaf; the left child is the next node
    uint32_t bucket;  // of a leaf
  };
  uint32_t build(std::span<const double> points, uint32_t begin, uint32_t end, const Progress* progress);

  int dim_;
  size_t count_ = 0;
  std::vector<std::pair<uint32_t, uint32_t>> leaves_;  // while building: ranges of ids_
  std::vector<Node> nodes_;
  std::vector<double> centres_;  // by node
  std::vector<double> boxes_;    // by node: lo and hi of each coordinate
  std::vector<double> coords_;   // by bucket: dimension rows of sixteen
  std::vector<uint32_t> ids_;    // by bucket
};

}  // namespace lumicut
