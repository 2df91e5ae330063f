#include "geometry/ball_query_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "core/error.h"

namespace lumicut {

BallQueryTree::BallQueryTree(std::span<const double> points, int dimension, const Progress* progress)
    : dim_(dimension) {
  if (dimension < 1 || dimension > 1024)
    fail_argument("ball tree: dimension is " + std::to_string(dimension) + ", not 1 to 1024");
  const auto d = static_cast<size_t>(dimension);
  if (points.size() % d != 0 || points.size() / d >= 0x7fffffffu)
    fail_argument("ball tree: " + std::to_string(points.size()) + " coordinates in rows of " + std::to_string(d));
  for (size_t i = 0; i < points.size(); ++i)
    if (!(std::fabs(points[i]) <= 1e18))  // squares stay finite in sums of 1,024
      fail_argument("ball tree: point " + std::to_string(i / d) + " has the coordinate " + std::to_string(points[i]));
  const auto n = static_cast<uint32_t>(points.size() / d);
  ids_.resize(n);
  std::iota(ids_.begin(), ids_.end(), 0u);
  if (n == 0) return;
  build(points, 0, n, progress);
  count_ = n;
  coords_.assign(leaves_.size() * kBucket * d, std::numeric_limits<double>::infinity());  // pads are infinitely far
  std::vector<uint32_t> padded(leaves_.size() * kBucket, 0xffffffffu);
  for (size_t b = 0; b < leaves_.size(); ++b) {
    check_now_and_then(progress, b);
    for (uint32_t i = leaves_[b].first; i < leaves_[b].second; ++i) {
      const size_t slot = i - leaves_[b].first;
      padded[b * kBucket + slot] = ids_[i];
      for (size_t j = 0; j < d; ++j) coords_[(b * d + j) * kBucket + slot] = points[ids_[i] * d + j];
    }
  }
  ids_.swap(padded);
  leaves_.clear();
  leaves_.shrink_to_fit();
}

uint32_t BallQueryTree::build(std::span<const double> points, uint32_t begin, uint32_t end, const Progress* progress) {
  if (end - begin > 4096) check_now_and_then(progress, 0);
  const auto d = static_cast<size_t>(dim_);
  const auto n = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back({0, 0, 0});
  const size_t at = centres_.size();
  centres_.resize(at + d, 0.0);
  std::vector<double> lo(d, std::numeric_limits<double>::infinity()), hi(d, -std::numeric_limits<double>::infinity());
  for (uint32_t i = begin; i < end; ++i) {
    const double* p = &points[ids_[i] * d];
    for (size_t j = 0; j < d; ++j)
      centres_[at + j] += p[j], lo[j] = std::min(lo[j], p[j]), hi[j] = std::max(hi[j], p[j]);
  }
  for (size_t j = 0; j < d; ++j) centres_[at + j] /= static_cast<double>(end - begin);
  for (size_t j = 0; j < d; ++j) boxes_.push_back(lo[j]), boxes_.push_back(hi[j]);
  double most = 0;
  for (uint32_t i = begin; i < end; ++i) {
    const double* p = &points[ids_[i] * d];
    double sum = 0;
    for (size_t j = 0; j < d; ++j) sum += (p[j] - centres_[at + j]) * (p[j] - centres_[at + j]);
    most = std::max(most, sum);
  }
  nodes_[n].radius = std::sqrt(most) * (1 + 1e-14);  // rounding of this sum and of the query's
  if (end - begin <= kBucket) {
    nodes_[n].bucket = static_cast<uint32_t>(leaves_.size());
    leaves_.push_back({begin, end});
    return n;
  }
  size_t widest = 0;
  for (size_t j = 1; j < d; ++j)
    if (hi[j] - lo[j] > hi[widest] - lo[widest]) widest = j;
  // At the middle of the extent, where that is a gap between clusters; else at the median, so that buckets come out
  // full.
  const auto value = [&](uint32_t i) { return points[i * d + widest]; };
  const double middle = 0.5 * (lo[widest] + hi[widest]);
  double below = lo[widest], above = hi[widest];
  uint32_t left = 0;
  for (uint32_t i = begin; i < end; ++i) {
    const double x = value(ids_[i]);
    x < middle ? (++left, below = std::max(below, x)) : above = std::min(above, x);
  }
  const uint32_t count = end - begin, buckets = (count + kBucket - 1) / kBucket;
  uint32_t mid = begin + buckets / 2 * kBucket;
  if (above - below > 0.1 * (hi[widest] - lo[widest]) && std::min(left, count - left) > count / 32) {
    mid = begin + left;
    std::partition(ids_.begin() + begin, ids_.begin() + end, [&](uint32_t i) { return value(i) < middle; });
  } else {
    std::nth_element(ids_.begin() + begin, ids_.begin() + mid, ids_.begin() + end, [&](uint32_t i, uint32_t j) {
      const double x = value(i), y = value(j);
      return x < y || (x == y && i < j);
    });
  }
  build(points, begin, mid, progress);
  const uint32_t right = build(points, mid, end, progress);
  nodes_[n].right = right;
  return n;
}

size_t BallQueryTree::nearest(const double* p, size_t k, uint32_t* index, double* dist2, Scratch& scratch) const {
  return search<true>(p, k, index, dist2, scratch, {0, 0});
}

size_t BallQueryTree::nearest_distances(const double* p, size_t k, double* dist2, Scratch& scratch,
                                        Range without) const {
  return search<false>(p, k, nullptr, dist2, scratch, without);
}

template <bool kTies>
size_t BallQueryTree::search(const double* p, size_t k, uint32_t* index, double* dist2, Scratch& scratch,
                             [[maybe_unused]] Range without) const {
  k = std::min(k, size());
  if (k == 0) return 0;
  const auto d = static_cast<size_t>(dim_);
  size_t count = 0;
  double worst = std::numeric_limits<double>::infinity(), reach = worst;  // the k-th squared distance, and its root
  const auto within = [](double distance, double limit) { return kTies ? distance <= limit : distance < limit; };
  const auto to_centre = [&](uint32_t n) {
    const double* c = &centres_[n * d];
    double sum = 0;
    for (size_t j = 0; j < d; ++j) sum += (p[j] - c[j]) * (p[j] - c[j]);
    return std::sqrt(sum);
  };
  const auto to_box = [&](uint32_t n) {
    const double* b = &boxes_[n * 2 * d];
    double sum = 0;
    for (size_t j = 0; j < d; ++j) {
      const double x = std::max(std::max(b[2 * j] - p[j], p[j] - b[2 * j + 1]), 0.0);
      sum += x * x;
    }
    return std::sqrt(sum) * (1 - 1e-14);
  };
  auto& nodes = scratch.stack_node;
  auto& nears = scratch.stack_near;
  nodes.assign(1, 0u);
  nears.assign(1, 0.0);
  while (!nodes.empty()) {
    uint32_t n = nodes.back();
    const double near = nears.back();
    nodes.pop_back(), nears.pop_back();
    if (!within(near, reach)) continue;
    while (nodes_[n].right != 0) {
      uint32_t a = n + 1, b = nodes_[n].right;
      double da = to_centre(a), db = to_centre(b);
      double na = da - nodes_[a].radius, nb = db - nodes_[b].radius;
      // Where the ball does not rule a child out, its box may.
      if (within(na, reach)) na = std::max(na, to_box(a));
      if (within(nb, reach)) nb = std::max(nb, to_box(b));
      // Inside both balls the nearer centre goes first.
      if (std::max(na, 0.0) > std::max(nb, 0.0) || (na <= 0 && nb <= 0 && da > db)) std::swap(a, b), std::swap(na, nb);
      if (within(nb, reach)) nodes.push_back(b), nears.push_back(nb);
      n = a;
      if (!within(na, reach)) break;
    }
    if (nodes_[n].right != 0) continue;
    double sum[kBucket];
    const double* rows = &coords_[nodes_[n].bucket * d * kBucket];
    for (uint32_t i = 0; i < kBucket; ++i) sum[i] = (rows[i] - p[0]) * (rows[i] - p[0]);
    for (size_t j = 1; j < d; ++j) {
      const double x = p[j];
      const double* row = rows + j * kBucket;
      for (uint32_t i = 0; i < kBucket; ++i) sum[i] += (row[i] - x) * (row[i] - x);
    }
    const uint32_t* ids = &ids_[nodes_[n].bucket * kBucket];
    for (uint32_t i = 0; i < kBucket; ++i) {
      if (!within(sum[i], worst) || ids[i] == 0xffffffffu) continue;
      if constexpr (kTies) {
        if (count == k && sum[i] == worst && ids[i] > index[k - 1]) continue;
      } else if (ids[i] - without.first < without.count) {
        continue;
      }
      // Insertion into the sorted list: k is small.
      size_t at = count < k ? count++ : k - 1;
      for (; at > 0; --at) {
        if constexpr (kTies) {
          if (!(dist2[at - 1] > sum[i] || (dist2[at - 1] == sum[i] && index[at - 1] > ids[i]))) break;
          index[at] = index[at - 1];
        } else if (!(dist2[at - 1] > sum[i])) {
          break;
        }
        dist2[at] = dist2[at - 1];
      }
      dist2[at] = sum[i];
      if constexpr (kTies) index[at] = ids[i];
      if (count == k) worst = dist2[k - 1], reach = std::sqrt(worst);
    }
  }
  return count;
}

}  // namespace lumicut
