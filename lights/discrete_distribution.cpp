#include "lights/discrete_distribution.h"

#include <algorithm>

namespace lumicut {

DiscreteDistribution::DiscreteDistribution(const std::vector<double>& weights) {
  cdf_.resize(weights.size() + 1, 0.0);
  for (size_t i = 0; i < weights.size(); ++i) cdf_[i + 1] = cdf_[i] + std::max(0.0, weights[i]);
  total_ = cdf_.back();
}

size_t DiscreteDistribution::sample(double u) const {
  double rest;
  return sample(u, 0, size(), rest);
}

size_t DiscreteDistribution::sample(double u, size_t first, size_t last, double& rest) const {
  // First entry whose cumulative sum passes u·sum: entries of weight 0 are never first.
  const double at = cdf_[first] + u * (cdf_[last] - cdf_[first]);
  const auto begin = cdf_.begin() + static_cast<std::ptrdiff_t>(first) + 1;
  const auto it = std::upper_bound(begin, cdf_.begin() + static_cast<std::ptrdiff_t>(last) + 1, at);
  size_t i = std::min<size_t>(static_cast<size_t>(it - cdf_.begin()) - 1, last - 1);
  while (i > first && cdf_[i + 1] == cdf_[i]) --i;  // rounded up to the sum
  rest = std::clamp((at - cdf_[i]) / (cdf_[i + 1] - cdf_[i]), 0.0, 1.0);
  return i;
}

}  // namespace lumicut
