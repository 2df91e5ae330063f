// Top-down splitting of clusters of columns: across their principal axis, at the best of 64 places.
#include <numeric>
#include <queue>

#include "clustering/column_clusters.h"
#include "clustering/column_kernels.h"

namespace lumicut {

namespace {

constexpr int kBins = 64;
constexpr int kSteps = 2;  // of power iteration

}  // namespace

uint32_t ColumnClusters::split_place(uint32_t begin, uint32_t end, const Sums& s) {
  const size_t stride = matrix_->stride(), n = end - begin;
  const uint32_t half = begin + static_cast<uint32_t>(n / 2);
  std::vector<double> mean(stride), axis(stride);
  double mean2 = 0;
  for (size_t r = 0; r < stride; ++r) mean[r] = s.sum[r] / s.weight, mean2 += mean[r] * mean[r];

  // Start from the column that lies farthest from the mean, by its weight; then two steps of power iteration.
  project(begin, end, weighted(mean));
  uint32_t far = order_[begin];
  double farthest = -1;
  for (uint32_t i = begin; i < end; ++i) {
    const double w = norms_[order_[i]], d = w * (1 + mean2) - 2.0 * projection_[i];
    if (d > farthest) farthest = d, far = order_[i];
  }
  for (size_t r = 0; r < stride; ++r)
    axis[r] = static_cast<double>(from_bfloat(matrix_->column(far)[r])) * row_weights_[r] / norms_[far] - mean[r];
  const auto normalise = [&] {
    double norm2 = 0;
    for (double v : axis) norm2 += v * v;
    for (double& v : axis) v /= std::sqrt(std::max(norm2, 1e-300));
    return norm2;
  };
  if (!(normalise() > 1e-9)) return half;  // all alike
  const auto offsets = [&] {               // along the axis, from the mean, of the normalised columns
    project(begin, end, weighted(axis));
    const auto center = static_cast<float>(std::inner_product(axis.begin(), axis.end(), mean.begin(), 0.0));
    for (uint32_t i = begin; i < end; ++i) projection_[i] = projection_[i] / norms_[order_[i]] - center;
  };
  const size_t parts = (n + kColumnChunk - 1) / kColumnChunk;
  std::vector<float> partial(parts * stride);
  for (int step = 0; step < kSteps; ++step) {
    offsets();
    std::fill(partial.begin(), partial.end(), 0.0f);
    double total = 0;
    for (uint32_t i = begin; i < end; ++i) total += static_cast<double>(norms_[order_[i]]) * projection_[i];
    column_chunks(n, [&](size_t b, size_t e) {
      accumulate_columns(matrix_->values(), stride, order_.data() + begin + b, e - b, projection_.data() + begin + b,
                         partial.data() + b / kColumnChunk * stride);
    });
    const std::vector<double> last = axis;
    for (size_t r = 0; r < stride; ++r) {
      double sum = 0;
      for (size_t p = 0; p < parts; ++p) sum += partial[p * stride + r];
      axis[r] = (sum * row_weights_[r] - total * mean[r]) / s.weight;
    }
    if (!(normalise() > 1e-14)) {
      axis = last;
      break;
    }
  }
  offsets();

  float lo = projection_[begin], hi = lo;
  for (uint32_t i = begin; i < end; ++i) lo = std::min(lo, projection_[i]), hi = std::max(hi, projection_[i]);
  if (!(hi > lo)) return half;
  struct Bin {
    double w = 0, t = 0, t2 = 0;
  } bins[kBins];
  const float scale = kBins / (hi - lo);
  if (!std::isfinite(scale)) return half;
  const auto bin = [&](float t) { return std::min(kBins - 1, static_cast<int>((t - lo) * scale)); };
  Bin all;
  for (uint32_t i = begin; i < end; ++i) {
    const double w = norms_[order_[i]], t = projection_[i];
    Bin& b = bins[bin(projection_[i])];
    b.w += w, b.t += w * t, b.t2 += w * t * t;
  }
  for (const Bin& b : bins) all.w += b.w, all.t += b.t, all.t2 += b.t2;
  // Σ w_i w_j (t_i − t_j)²/2 of each side: the cost as far as the axis shows it.
  Bin left;
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k + 1 < kBins; ++k) {
    left.w += bins[k].w, left.t += bins[k].t, left.t2 += bins[k].t2;
    const double w = all.w - left.w, t = all.t - left.t, t2 = all.t2 - left.t2;
    const double sides = left.w * left.t2 - left.t * left.t + w * t2 - t * t;
    if (left.w > 0 && w > 0 && sides < least) least = sides, best = k;
  }
  // Partition that keeps the order within both sides.
  scratch_.clear();
  uint32_t kept = begin;
  for (uint32_t i = begin; i < end; ++i) {
    if (bin(projection_[i]) <= best)
      order_[kept++] = order_[i];
    else
      scratch_.push_back(order_[i]);
  }
  std::copy(scratch_.begin(), scratch_.end(), order_.begin() + kept);
  return kept == begin || kept == end ? half : kept;
}

void ColumnClusters::split(size_t count, const Progress& progress) {
  double total = 0;
  for (const Cluster& c : clusters_) total += c.cost;
  const auto cheaper = [&](uint32_t a, uint32_t b) {
    return clusters_[a].cost < clusters_[b].cost || (clusters_[a].cost == clusters_[b].cost && a > b);
  };
  std::priority_queue<uint32_t, std::vector<uint32_t>, decltype(cheaper)> queue(cheaper);
  for (uint32_t c = 0; c < clusters_.size(); ++c) queue.push(c);
  while (clusters_.size() < count && !queue.empty()) {
    const uint32_t index = queue.top();
    queue.pop();
    const Cluster c = clusters_[index];
    if (!(c.cost > 1e-12 * total)) break;
    if (c.end - c.begin < 2) continue;
    progress.check();
    const uint32_t mid = split_place(c.begin, c.end, sums_[index]);
    sums_[index] = sums(c.begin, mid);
    clusters_[index] = {c.begin, mid, sums_[index].weight, cost(sums_[index])};
    append(mid, c.end);
    queue.push(index);
    queue.push(static_cast<uint32_t>(clusters_.size() - 1));
  }
}

}  // namespace lumicut
