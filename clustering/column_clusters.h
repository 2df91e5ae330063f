// Clusters of the columns of a light matrix: lights that light the rows alike, up to a factor.
// [Hašan et al. 2007, sec. 5; Ou and Pellacini 2011, sec. 4.2]
//
// The cost of a cluster is Σ‖ρi‖‖ρj‖ − ρi·ρj over its pairs: the expected squared error of standing for it by one
// column drawn with probability ‖ρi‖/W and scaled by W/‖ρi‖. With W = Σ‖ρi‖ and S = Σρi it is W² − ‖S‖², so that splits
// are costed in time linear in the columns. Departs: a cluster is split across the principal axis of its normalised
// columns rather than a random line, at the best of 64 places.
#pragma once

#include <span>
#include <vector>

#include "clustering/light_matrix.h"
#include "core/progress.h"

namespace lumicut {

class ColumnClusters {
 public:
  struct Cluster {
    uint32_t begin, end;  // of members()
    double weight;        // W
    double cost;          // W² − ‖S‖²
  };

  // One cluster of all columns that are not zero. The matrix outlives this. `row_weights`: factors of the rows, one for
  // each of the matrix's rows, not below 0.
  ColumnClusters(const LightMatrix& matrix, std::span<const float> row_weights);
  // The clusters of `start` under other row weights.
  ColumnClusters(const ColumnClusters& start, std::span<const float> row_weights);

  // Replaces the one cluster by up to `count`: each column goes to the most similar of as many columns drawn by their
  // share in the cost. [Hašan et al. 2007, sec. 5.2, "clustering by sampling"] Throws Error(cancelled).
  void sample(size_t count, uint64_t seed, const Progress& progress);
  // Splits the costliest cluster until there are `count`, or all cost nothing. [sec. 5.2, "top-down splitting"]
  // Throws Error(cancelled).
  void split(size_t count, const Progress& progress);

  std::span<const Cluster> clusters() const { return clusters_; }
  std::span<const uint32_t> members(const Cluster& c) const { return {order_.data() + c.begin, c.end - c.begin}; }
  // ‖ρ‖ of a column, under the row weights.
  float norm(uint32_t column) const { return norms_[column]; }

 private:
  struct Sums {
    double weight = 0;
    std::vector<double> sum;  // S, row weights applied
  };
  void set_weights(std::span<const float> row_weights);
  Sums sums(uint32_t begin, uint32_t end);
  double cost(const Sums& s) const;
  void project(uint32_t begin, uint32_t end, const std::vector<float>& direction);
  std::vector<float> weighted(const std::vector<double>& direction) const;
  void append(uint32_t begin, uint32_t end);
  // Reorders the columns of a cluster, two or more, into two parts, and returns where the second begins.
  uint32_t split_place(uint32_t begin, uint32_t end, const Sums& s);

  const LightMatrix* matrix_;
  std::vector<float> row_weights_;  // stride() long
  std::vector<float> norms_;        // of all columns
  std::vector<uint32_t> order_;     // columns that are not zero, cluster by cluster, ascending in each
  std::vector<Cluster> clusters_;
  std::vector<Sums> sums_;         // of the clusters
  std::vector<float> projection_;  // scratch, as long as order_
  std::vector<uint32_t> scratch_;
};

// A light that stands for a cluster.
struct ColumnRepresentative {
  uint32_t column;
  Rgb intensity;  // in place of the light's own
};

// Exponential variables of rate 1, one a light, that belong to (seed, slot, light).
std::vector<float> race_times(size_t lights, uint64_t seed, uint32_t slot, const Progress* progress = nullptr);

// Draws a column with probability ‖ρ‖/W: the least of times/‖ρ‖. Clusters that share most of their lights mostly draw
// the same one, so that neighbouring slices agree. The colour is that of the cluster's sum, the strength W/‖ρ‖.
ColumnRepresentative representative(const ColumnClusters& clusters, const ColumnClusters::Cluster& cluster,
                                    const std::vector<Vpl>& lights, std::span<const float> times);

}  // namespace lumicut
