// Bottom-up clustering: one core (accel/agglomerate-inl.h), four strategies, one policy per use. [Walter et al. 2008,
// sec. 3] Here: the plain types, and the two policies of this folder. The light policy lies in clustering/light_policy.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/progress.h"

namespace lumicut {

enum class Strategy : uint8_t {
  naive,            // Fig. 2: all pairs, each time. O(N³): the oracle of tests
  heap,             // Fig. 3: best-match tree and a lazy heap
  locally_ordered,  // Fig. 4: nearest-neighbour chain, one thread
  // sec. 3.3's aim by other means: chains at once in regions of space, each of which rests where a best match lies
  // outside; then in new regions over what is left; the last on one thread. On the caller's arena.
  parallel,
};

// Two clusters become one. Ids below N are leaves, id N+k is merge k; children come before their parent.
// Canonical: merges are in post-order of the tree, and `left` holds the smaller least leaf. So equal trees are equal
// lists.
struct Merge {
  uint32_t left = 0, right = 0;
  float cost = 0.0f;  // d(left, right), in the policy's units (see there: a policy may scale its input)
  constexpr bool operator==(const Merge&) const = default;
};

// All strategies build the same tree, ties included: of equally good pairs the one of the least leaves goes first, and
// leaves that coincide are joined beforehand in balanced subtrees. N leaves give N-1 merges; 0 and 1 leaf give none. N
// is below 2^31. Throws Error(cancelled).

// d = area of the joint box. [sec. 4] Boxes are finite and not empty, coordinates below 1e19.
// Each side is taken 1e-7 of the whole longer than it is, so that boxes without an area still cluster by distance.
std::vector<Merge> agglomerate_boxes(std::span<const Aabb> boxes, Strategy strategy, Progress* progress = nullptr);

// d = radius of the smallest ball around both. [Omohundro 1989] `centres`: n rows of `dimension` floats (1 to 16).
// Nesting makes it the volume's order too. Throws Error(invalid_argument) on a value that is not finite or a radius
// below 0.
std::vector<Merge> agglomerate_balls(std::span<const float> centres, std::span<const float> radii, int dimension,
                                     Strategy strategy, Progress* progress = nullptr);

// "naive", "heap", "local", "parallel"; throws Error on any other name.
Strategy strategy_of(const std::string& name);

}  // namespace lumicut
