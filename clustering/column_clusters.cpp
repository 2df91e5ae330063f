#include "clustering/column_clusters.h"

#include <numeric>

#include "clustering/column_kernels.h"
#include "core/rng.h"

namespace lumicut {

ColumnClusters::ColumnClusters(const LightMatrix& matrix, std::span<const float> row_weights) : matrix_(&matrix) {
  set_weights(row_weights);
  for (uint32_t c = 0; c < matrix.columns(); ++c)
    if (norms_[c] > 0.0f) order_.push_back(c);
  projection_.resize(order_.size());
  if (order_.empty()) return;
  append(0, static_cast<uint32_t>(order_.size()));
}

ColumnClusters::ColumnClusters(const ColumnClusters& start, std::span<const float> row_weights)
    : matrix_(start.matrix_) {
  set_weights(row_weights);
  order_.reserve(start.order_.size());
  projection_.resize(start.order_.size());
  for (const Cluster& c : start.clusters_) {
    const auto begin = static_cast<uint32_t>(order_.size());
    for (uint32_t m : start.members(c))
      if (norms_[m] > 0.0f) order_.push_back(m);
    const auto end = static_cast<uint32_t>(order_.size());
    if (begin != end) append(begin, end);
  }
}

void ColumnClusters::append(uint32_t begin, uint32_t end) {
  sums_.push_back(sums(begin, end));
  clusters_.push_back({begin, end, sums_.back().weight, cost(sums_.back())});
}

void ColumnClusters::set_weights(std::span<const float> row_weights) {
  const size_t stride = matrix_->stride(), n = matrix_->columns();
  row_weights_.assign(stride, 0.0f);
  std::copy(row_weights.begin(), row_weights.end(), row_weights_.begin());
  std::vector<float> squared(stride);
  for (size_t r = 0; r < stride; ++r) squared[r] = row_weights_[r] * row_weights_[r];
  norms_.resize(n);
  column_chunks(n, [&](size_t begin, size_t end) {
    column_norms2(matrix_->values() + begin * stride, stride, end - begin, squared.data(), norms_.data() + begin);
    for (size_t i = begin; i < end; ++i) norms_[i] = std::sqrt(norms_[i]);
  });
}

ColumnClusters::Sums ColumnClusters::sums(uint32_t begin, uint32_t end) {
  const size_t stride = matrix_->stride(), n = end - begin, parts = (n + kColumnChunk - 1) / kColumnChunk;
  std::vector<float> partial(parts * stride);
  std::vector<double> weights(parts);
  std::fill(projection_.begin() + begin, projection_.begin() + end, 1.0f);
  column_chunks(n, [&](size_t b, size_t e) {
    accumulate_columns(matrix_->values(), stride, order_.data() + begin + b, e - b, projection_.data() + begin + b,
                       partial.data() + b / kColumnChunk * stride);
    for (size_t i = b; i < e; ++i) weights[b / kColumnChunk] += norms_[order_[begin + i]];
  });
  Sums s;
  s.sum.assign(stride, 0.0);
  for (size_t p = 0; p < parts; ++p) {
    s.weight += weights[p];
    for (size_t r = 0; r < stride; ++r) s.sum[r] += static_cast<double>(partial[p * stride + r]) * row_weights_[r];
  }
  return s;
}

double ColumnClusters::cost(const Sums& s) const {
  double norm2 = 0;
  for (double v : s.sum) norm2 += v * v;
  return std::max(0.0, s.weight * s.weight - norm2);
}

std::vector<float> ColumnClusters::weighted(const std::vector<double>& direction) const {
  std::vector<float> v(direction.size());
  for (size_t r = 0; r < v.size(); ++r) v[r] = static_cast<float>(direction[r] * row_weights_[r]);
  return v;
}

void ColumnClusters::project(uint32_t begin, uint32_t end, const std::vector<float>& direction) {
  column_chunks(end - begin, [&](size_t b, size_t e) {
    project_columns(matrix_->values(), matrix_->stride(), order_.data() + begin + b, e - b, direction.data(),
                    projection_.data() + begin + b);
  });
}

void ColumnClusters::sample(size_t count, uint64_t seed, const Progress& progress) {
  if (clusters_.size() != 1 || count < 2) return;
  const uint32_t n = clusters_[0].end;
  const size_t stride = matrix_->stride();
  const Sums s = sums_[0];
  // A column's share in the cost: Σ_j ‖ρi‖‖ρj‖ − ρi·ρj = ‖ρi‖W − ρi·S.
  project(0, n, weighted(s.sum));
  std::vector<double> upto(n);
  double total = 0;
  for (uint32_t i = 0; i < n; ++i) {
    total += std::max(0.0, norms_[order_[i]] * s.weight - projection_[i]);
    upto[i] = total;
  }
  if (!(total > 0)) return;
  std::vector<uint32_t> centers;
  for (size_t k = 0; k < count; ++k) {  // one from each of `count` equal parts of the cost
    Rng rng(seed, Stage::representative, k, 0x5a3b1e);
    const double at = (static_cast<double>(k) + rng.next_float()) / static_cast<double>(count) * total;
    const auto i = std::min<size_t>(n - 1, std::upper_bound(upto.begin(), upto.end(), at) - upto.begin());
    if (centers.empty() || centers.back() != order_[i]) centers.push_back(order_[i]);
  }
  const size_t padded = (centers.size() + 3) / 4 * 4;
  // Directions with the row weights applied twice: once for the direction's own, once for the column's.
  std::vector<float> directions(padded * stride);
  for (size_t k = 0; k < padded; ++k) {
    const uint32_t c = centers[std::min(k, centers.size() - 1)];
    for (size_t r = 0; r < stride; ++r)
      directions[k * stride + r] = from_bfloat(matrix_->column(c)[r]) * row_weights_[r] * row_weights_[r] / norms_[c];
  }
  std::vector<uint32_t> nearest(n);
  parallel_chunks(n, 256, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    std::vector<float> column(stride);
    for (size_t i = begin; i < end; ++i)
      nearest[i] = most_similar_direction(matrix_->column(order_[i]), stride, directions.data(), padded, column.data());
  });
  progress.check();
  std::vector<uint32_t> starts(padded + 1);
  for (uint32_t k : nearest) ++starts[k + 1];
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  std::vector<uint32_t> sorted(n), next(starts.begin(), starts.end() - 1);
  for (uint32_t i = 0; i < n; ++i) sorted[next[nearest[i]]++] = order_[i];
  order_ = std::move(sorted);
  clusters_.clear(), sums_.clear();
  for (size_t k = 0; k < padded; ++k)
    if (starts[k] != starts[k + 1]) append(starts[k], starts[k + 1]);
}

std::vector<float> race_times(size_t lights, uint64_t seed, uint32_t slot, const Progress* progress) {
  std::vector<float> times(lights);
  for (size_t l = 0; l < lights; ++l) {
    check_now_and_then(progress, l);
    times[l] = -std::log(1.0f - Rng(seed, Stage::representative, l, slot).next_float());
  }
  return times;
}

ColumnRepresentative representative(const ColumnClusters& clusters, const ColumnClusters::Cluster& cluster,
                                    const std::vector<Vpl>& lights, std::span<const float> times) {
  ColumnRepresentative best{};
  float soonest = std::numeric_limits<float>::infinity();
  Vec3d sum{};
  for (uint32_t m : clusters.members(cluster)) {
    const float w = clusters.norm(m), time = times[m] / w;
    if (time < soonest) soonest = time, best.column = m;
    const Rgb& i = lights[m].intensity;
    const double share = w / luminance(i);
    sum += Vec3d{i.x * share, i.y * share, i.z * share};
  }
  const double own = clusters.norm(best.column) / luminance(lights[best.column].intensity);
  best.intensity = {static_cast<float>(sum.x / own), static_cast<float>(sum.y / own), static_cast<float>(sum.z / own)};
  return best;
}

}  // namespace lumicut
