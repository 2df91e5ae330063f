// Agglomerative clustering, without SIMD types: strategies, results, and the functions for boxes and balls.
// [Walter et al. 2008, Fast Agglomerative Clustering for Rendering] The core for any policy is accel/agglomerate-inl.h;
// lights are clustered by clustering/light_policy.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"

namespace lumicut {

enum class Strategy : uint8_t {
  naive,            // all pairs before each merge, O(N³): the oracle of tests. [Fig. 2]
  heap,             // kd-tree and heap. [Fig. 3]
  locally_ordered,  // nearest-neighbour chain, one thread. [Fig. 4]
  parallel,         // chains in regions of space, on the caller's arena
};

// Two clusters merged into one. Ids below N are leaves, id N+k is the cluster of merge k. Lists of merges are
// canonical: in post-order of the tree, `left` being the child with the smaller least leaf. So equal trees give equal
// lists.
struct Merge {
  uint32_t left = 0, right = 0;
  float cost = 0.0f;  // d(left, right), in units of the policy, which may scale its input
  constexpr bool operator==(const Merge&) const = default;
};

// All strategies build the same tree: among pairs of equal cost the one with the least leaves is merged first, and
// leaves that coincide are merged beforehand into balanced subtrees. N leaves give N-1 merges; 0 and 1 leaf give none.
// N is below 2^31. Throws Error(cancelled).

// d = half the area of the joint box. [sec. 4] Boxes must be finite and not empty, with coordinates below 1e19. Each
// side is extended by 1e-7 of the whole extent, so that boxes without area still cluster by distance.
std::vector<Merge> agglomerate_boxes(std::span<const Aabb> boxes, Strategy strategy, Progress* progress = nullptr);

// d = radius of the smallest ball around both. [Omohundro 1989] `centres`: n rows of `dimension` floats (1 to 16).
// The least radius is also the least volume. Throws Error(invalid_argument) on values that are not finite and on radii
// below 0.
std::vector<Merge> agglomerate_balls(std::span<const float> centres, std::span<const float> radii, int dimension,
                                     Strategy strategy, Progress* progress = nullptr);

// A dissimilarity of the caller's own, on clusters that are vectors of features. Of a joint cluster none may be below
// that of its parts (maxima and sums are not), and cost(a, b) must not fall when a feature of b rises: then it bounds
// itself over many clusters, from the least of their features. Functions are called by several threads at a time with
// Strategy::parallel. What they throw is passed on.
struct Dissimilarity {
  size_t features = 0;         // 1 to 64
  size_t key_features = 0;     // leaves whose first so many are equal are joined beforehand; 0: all
  bool non_decreasing = true;  // cost(a, b) <= cost(a, b ∪ c) [Eq. 1]; if not, naive and heap alone
  // The features of a ∪ b, the same as of b ∪ a.
  std::function<void(const float* a, const float* b, float* joint)> merge;
  // Of a with each of `count` (1 to 8) others, rows of features; cost(a, b) is cost(b, a). Not NaN.
  std::function<void(const float* a, const float* others, size_t count, float* costs)> cost;
  // Up to eight coordinates (the rest is 0) by which clusters are sorted in space, for speed; none: the first features.
  std::function<void(const float* a, float* point)> order;
};

// `leaves`: n rows of features, finite. Throws Error(invalid_argument) on values that are not and on what can be seen of
// a dissimilarity that does not keep to the above: NaN, a joint feature below, costs that are not symmetric.
std::vector<Merge> agglomerate_by(const Dissimilarity& dissimilarity, std::span<const float> leaves, Strategy strategy,
                                  Progress* progress = nullptr);

// "naive", "heap", "local", "parallel"; throws Error on any other name.
Strategy strategy_of(const std::string& name);

}  // namespace lumicut
