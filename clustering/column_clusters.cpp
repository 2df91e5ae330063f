#include "clustering/column_clusters.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/column_clusters.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;

HWY_INLINE V LoadBfloat(D d, const uint16_t* p) {
  const hn::RebindToUnsigned<D> du;
  const hn::Rebind<uint16_t, D> d16;
  return hn::BitCast(d, hn::ShiftLeft<16>(hn::PromoteTo(du, hn::LoadU(d16, p))));
}

HWY_INLINE V DotColumn(D d, const uint16_t* column, const float* HWY_RESTRICT v, size_t stride) {
  V sum = hn::Zero(d);
  for (size_t r = 0; r < stride; r += hn::Lanes(d))
    sum = hn::MulAdd(LoadBfloat(d, column + r), hn::LoadU(d, v + r), sum);
  return sum;
}

// out[i] = Σ_r weights2[r] · column[r]², of columns [0, n).
void Norms2(const uint16_t* values, size_t stride, size_t n, const float* HWY_RESTRICT weights2,
            float* HWY_RESTRICT out) {
  const D d;
  for (size_t i = 0; i < n; ++i) {
    V sum = hn::Zero(d);
    for (size_t r = 0; r < stride; r += hn::Lanes(d)) {
      const V x = LoadBfloat(d, values + i * stride + r);
      sum = hn::MulAdd(hn::Mul(x, x), hn::LoadU(d, weights2 + r), sum);
    }
    out[i] = hn::GetLane(hn::SumOfLanes(d, sum));
  }
}

// out[i] = column(items[i]) · v.
void Project(const uint16_t* values, size_t stride, const uint32_t* HWY_RESTRICT items, size_t n,
             const float* HWY_RESTRICT v, float* HWY_RESTRICT out) {
  const D d;
  for (size_t i = 0; i < n; ++i)
    out[i] = hn::GetLane(hn::SumOfLanes(d, DotColumn(d, values + size_t{items[i]} * stride, v, stride)));
}

// sum += Σ_i factors[i] · column(items[i]).
void Accumulate(const uint16_t* values, size_t stride, const uint32_t* HWY_RESTRICT items, size_t n,
                const float* HWY_RESTRICT factors, float* HWY_RESTRICT sum) {
  const D d;
  for (size_t i = 0; i < n; ++i) {
    const V f = hn::Set(d, factors[i]);
    const uint16_t* column = values + size_t{items[i]} * stride;
    for (size_t r = 0; r < stride; r += hn::Lanes(d))
      hn::StoreU(hn::MulAdd(f, LoadBfloat(d, column + r), hn::LoadU(d, sum + r)), d, sum + r);
  }
}

// Index of the direction with the largest dot product, the first of equals. directions: [count][stride].
uint32_t MostSimilar(const uint16_t* column, size_t stride, const float* HWY_RESTRICT directions, size_t count,
                     float* HWY_RESTRICT scratch) {
  const D d;
  for (size_t r = 0; r < stride; r += hn::Lanes(d)) hn::StoreU(LoadBfloat(d, column + r), d, scratch + r);
  uint32_t best = 0;
  float largest = -1.0f;
  for (size_t c = 0; c < count; c += 4) {  // padded by the caller to a multiple of 4
    V s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
    const float* v = directions + c * stride;
    for (size_t r = 0; r < stride; r += hn::Lanes(d)) {
      const V x = hn::LoadU(d, scratch + r);
      s0 = hn::MulAdd(x, hn::LoadU(d, v + r), s0);
      s1 = hn::MulAdd(x, hn::LoadU(d, v + stride + r), s1);
      s2 = hn::MulAdd(x, hn::LoadU(d, v + 2 * stride + r), s2);
      s3 = hn::MulAdd(x, hn::LoadU(d, v + 3 * stride + r), s3);
    }
    const float dots[4] = {hn::GetLane(hn::SumOfLanes(d, s0)), hn::GetLane(hn::SumOfLanes(d, s1)),
                           hn::GetLane(hn::SumOfLanes(d, s2)), hn::GetLane(hn::SumOfLanes(d, s3))};
    for (uint32_t k = 0; k < 4; ++k)
      if (dots[k] > largest) largest = dots[k], best = static_cast<uint32_t>(c) + k;
  }
  return best;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include <numeric>
#include <queue>

#include "core/parallel.h"
#include "core/rng.h"

namespace lumicut {
HWY_EXPORT(Norms2);
HWY_EXPORT(Project);
HWY_EXPORT(Accumulate);
HWY_EXPORT(MostSimilar);

namespace {

constexpr size_t kChunk = 4096;      // columns of one partial sum: the same whatever the number of threads
constexpr size_t kParallel = 16384;  // from which on chunks are worth spreading over threads
constexpr int kBins = 64;
constexpr int kSteps = 2;  // of power iteration

template <typename Fn>
void chunks(size_t n, Fn&& fn) {
  if (n >= kParallel) {
    parallel_chunks(n, kChunk, fn);
  } else {
    for (size_t begin = 0; begin < n; begin += kChunk) fn(begin, std::min(n, begin + kChunk));
  }
}

}  // namespace

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
  chunks(n, [&](size_t begin, size_t end) {
    HWY_DYNAMIC_DISPATCH(Norms2)
    (matrix_->values() + begin * stride, stride, end - begin, squared.data(), norms_.data() + begin);
    for (size_t i = begin; i < end; ++i) norms_[i] = std::sqrt(norms_[i]);
  });
}

ColumnClusters::Sums ColumnClusters::sums(uint32_t begin, uint32_t end) {
  const size_t stride = matrix_->stride(), n = end - begin, parts = (n + kChunk - 1) / kChunk;
  std::vector<float> partial(parts * stride);
  std::vector<double> weights(parts);
  std::fill(projection_.begin() + begin, projection_.begin() + end, 1.0f);
  chunks(n, [&](size_t b, size_t e) {
    HWY_DYNAMIC_DISPATCH(Accumulate)
    (matrix_->values(), stride, order_.data() + begin + b, e - b, projection_.data() + begin + b,
     partial.data() + b / kChunk * stride);
    for (size_t i = b; i < e; ++i) weights[b / kChunk] += norms_[order_[begin + i]];
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
  chunks(end - begin, [&](size_t b, size_t e) {
    HWY_DYNAMIC_DISPATCH(Project)
    (matrix_->values(), matrix_->stride(), order_.data() + begin + b, e - b, direction.data(),
     projection_.data() + begin + b);
  });
}

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
  const size_t parts = (n + kChunk - 1) / kChunk;
  std::vector<float> partial(parts * stride);
  for (int step = 0; step < kSteps; ++step) {
    offsets();
    std::fill(partial.begin(), partial.end(), 0.0f);
    double total = 0;
    for (uint32_t i = begin; i < end; ++i) total += static_cast<double>(norms_[order_[i]]) * projection_[i];
    chunks(n, [&](size_t b, size_t e) {
      HWY_DYNAMIC_DISPATCH(Accumulate)
      (matrix_->values(), stride, order_.data() + begin + b, e - b, projection_.data() + begin + b,
       partial.data() + b / kChunk * stride);
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
      nearest[i] = HWY_DYNAMIC_DISPATCH(MostSimilar)(matrix_->column(order_[i]), stride, directions.data(), padded,
                                                     column.data());
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
#endif
