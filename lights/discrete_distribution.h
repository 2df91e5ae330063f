// Indices drawn by weight.
#pragma once

#include <cstddef>
#include <vector>

namespace lumicut {

// Discrete distribution by inverted cumulative sums. pmf(i) is what sample() draws with.
class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  explicit DiscreteDistribution(const std::vector<double>& weights);
  bool empty() const { return !(total_ > 0.0); }
  double total() const { return total_; }
  size_t size() const { return cdf_.empty() ? 0 : cdf_.size() - 1; }
  // u in [0,1). Never an index of weight 0.
  size_t sample(double u) const;
  // The same among entries [first, last) alone, whose sum must be above 0; `rest`: where u fell within the entry.
  size_t sample(double u, size_t first, size_t last, double& rest) const;
  double sum(size_t first, size_t last) const { return cdf_[last] - cdf_[first]; }
  size_t bytes() const { return cdf_.capacity() * sizeof(double); }
  double pmf(size_t i) const { return (cdf_[i + 1] - cdf_[i]) / total_; }

 private:
  std::vector<double> cdf_;
  double total_ = 0.0;
};

}  // namespace lumicut
