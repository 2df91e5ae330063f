// The state of an agglomeration: the features of all clusters, and the merges so far.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "accel/agglomerate.h"
#include "accel/agglomerate/policy-inl.h"
#include "core/error.h"
#include "core/huge_array.h"
#include "core/parallel.h"
#include "core/progress.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

inline constexpr uint32_t kNone = 0xffffffffu;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

inline constexpr const char* kInconsistent =
    "agglomerate: costs are not symmetric, or fall where they must not, so that there is no tree";

// The leaves, the clusters made of them so far, and the merges that made them. A cluster is identified by one of its
// leaves, whose features it replaces; node() gives its id in the tree.
template <ClusterPolicy Policy>
class Clusters {
 public:
  Clusters(const Policy& policy, size_t n, bool threads, Progress* progress)
      : policy_(policy), n_(n), threads_(threads), progress_(progress) {
    features_ = HugeArray<float>(n * feature_count());
    merges_ = HugeArray<Merge>(n > 0 ? n - 1 : 0);
    least_.resize(n);
    std::iota(least_.begin(), least_.end(), 0u);
    node_ = least_;
  }

  size_t leaf_count() const { return n_; }
  const Policy& policy() const { return policy_; }
  size_t feature_count() const {
    if constexpr (Policy::kFeatures > 0) return Policy::kFeatures;
    return policy_.features();
  }
  bool threads() const { return threads_; }
  void check() const {
    if (progress_ != nullptr) progress_->check();
  }

  // What holds by itself where a policy keeps to its requirements, and is tested where that is not sure (kUntrusted).
  void expect([[maybe_unused]] bool holds) const {
    if constexpr (requires { Policy::kUntrusted; })
      if (!holds) fail_argument(kInconsistent);
  }

  // fn(begin, end) over chunks of [0, n); in parallel when threads() is.
  template <class Fn>
  void for_chunks(size_t n, size_t chunk, Fn&& fn) const {
    if (threads_ && n > chunk) {
      parallel_chunks(n, chunk, std::forward<Fn>(fn));
      return;
    }
    if constexpr (requires { policy_.schedule(); }) {  // of benchmarks, which count what could run beside each other
      policy_.schedule().begin_section();
      for (size_t begin = 0; begin < n; begin += chunk) {
        fn(begin, std::min(n, begin + chunk));
        policy_.schedule().end_chunk();
      }
      policy_.schedule().end_section();
      return;
    }
    for (size_t begin = 0; begin < n; begin += chunk) fn(begin, std::min(n, begin + chunk));
  }

  // The features of a cluster, its least leaf, and its id in the tree.
  float* leaf(size_t i) { return features_.data() + i * feature_count(); }
  const float* of(uint32_t cluster) const { return features_.data() + static_cast<size_t>(cluster) * feature_count(); }
  uint32_t least(uint32_t cluster) const { return least_[cluster]; }
  uint32_t node(uint32_t cluster) const { return node_[cluster]; }

  // Cluster `a` becomes the union of `a` and `b`, with that id in the tree. `b` must not be used any more.
  Merge join(uint32_t a, uint32_t b, float cost, uint32_t id) {
    float joint[kMaxFeatures];
    policy_.merge(of(a), of(b), joint);
    std::copy_n(joint, feature_count(), features_.data() + static_cast<size_t>(a) * feature_count());
    const bool in_order = least_[a] < least_[b];
    const Merge merge{node_[in_order ? a : b], node_[in_order ? b : a], cost};
    least_[a] = std::min(least_[a], least_[b]);
    node_[a] = id;
    return merge;
  }
  void join(uint32_t a, uint32_t b, float cost) {
    merges_[merge_count_] = join(a, b, cost, next_id());
    ++merge_count_;
  }
  // `to`: what is in `from` but for kNone, in its order.
  void keep(const std::vector<uint32_t>& from, std::vector<uint32_t>& to) const {
    constexpr size_t kChunk = 1 << 15;
    std::vector<size_t> start(from.size() / kChunk + 2, 0);
    for_chunks(from.size(), kChunk, [&](size_t begin, size_t end) {
      size_t& count = start[begin / kChunk + 1];
      for (size_t i = begin; i < end; ++i) count += from[i] != kNone;
    });
    std::partial_sum(start.begin(), start.end(), start.begin());
    to.resize(start.back());
    for_chunks(from.size(), kChunk, [&](size_t begin, size_t end) {
      size_t at = start[begin / kChunk];
      for (size_t i = begin; i < end; ++i)
        if (from[i] != kNone) to[at++] = from[i];
    });
  }

  size_t merge_count() const { return merge_count_; }
  uint32_t next_id() const { return static_cast<uint32_t>(n_ + merge_count_); }
  // Where merges to come are stored, and how many have been.
  Merge* next_merge() { return merges_.data() + merge_count_; }
  void count_merges(size_t made) { merge_count_ += made; }

  // What a part of the clusters made beside other parts: merges, numbered from `first_id` on, which is not below
  // next_id(); and the clusters they may be of, or kNone.
  struct PartMerges {
    const Merge* merges;
    size_t count;
    uint32_t first_id;
    std::span<const uint32_t> clusters;
  };
  // Appends them without the gaps in their numbers: no part knew how many another makes.
  void append(const std::vector<PartMerges>& parts) {
    const uint32_t from = next_id();
    std::vector<size_t> start(parts.size() + 1, merge_count_);
    for (size_t p = 0; p < parts.size(); ++p) start[p + 1] = start[p] + parts[p].count;
    for_chunks(parts.size(), 1, [&](size_t p, size_t) {
      const PartMerges& part = parts[p];
      const uint32_t shift = part.first_id - static_cast<uint32_t>(n_ + start[p]);
      const auto renumbered = [&](uint32_t node) { return node >= from ? node - shift : node; };
      for (size_t i = 0; i < part.count; ++i) {
        const Merge& m = part.merges[i];
        merges_[start[p] + i] = {renumbered(m.left), renumbered(m.right), m.cost};
      }
      for (const uint32_t cluster : part.clusters)
        if (cluster != kNone) node_[cluster] = renumbered(node_[cluster]);
    });
    merge_count_ = start.back();
  }

  // d(a, b) of one pair.
  float pair_cost(uint32_t a, uint32_t b) const {
    const Lanes8 d;
    HWY_ALIGN float lanes[kMaxFeatures * 8];
    HWY_ALIGN float out[8];
    for (size_t f = 0; f < feature_count(); ++f) std::fill_n(lanes + 8 * f, 8, of(b)[f]);
    const auto query = policy_.query(d, of(a));
    hn::Store(policy_.cost(d, query, lanes), d, out);
    return out[0];
  }

  // The merges in canonical order, see Merge. A subtree's part of the list follows from the sizes of subtrees alone.
  std::vector<Merge> canonical() const {
    const auto n = static_cast<uint32_t>(n_);
    std::vector<Merge> out(merge_count_);
    std::vector<uint32_t> sizes(merge_count_);  // merges in each subtree
    const auto size_of = [&](uint32_t node) { return node < n ? 0u : sizes[node - n]; };
    for (size_t i = 0; i < merge_count_; ++i) sizes[i] = size_of(merges_[i].left) + size_of(merges_[i].right) + 1;

    struct Part {
      uint32_t node, begin;  // of its part of the list
    };
    const auto place = [&](const Part& part, std::vector<Part>& children) {
      const Merge& m = merges_[part.node - n];
      const uint32_t begin_right = part.begin + size_of(m.left), last = begin_right + size_of(m.right);
      out[last] = {m.left < n ? m.left : n + begin_right - 1, m.right < n ? m.right : n + last - 1, m.cost};
      if (m.right >= n) children.push_back({m.right, begin_right});
      if (m.left >= n) children.push_back({m.left, part.begin});
    };
    std::vector<Part> large, small;
    if (merge_count_ > 0) large.push_back({next_id() - 1, 0});
    while (!large.empty()) {
      const Part part = large.back();
      large.pop_back();
      if (size_of(part.node) > kPartMerges)
        place(part, large);
      else
        small.push_back(part);
    }
    for_chunks(small.size(), 4, [&](size_t begin, size_t end) {
      std::vector<Part> parts(small.begin() + static_cast<ptrdiff_t>(begin),
                              small.begin() + static_cast<ptrdiff_t>(end));
      while (!parts.empty()) {
        const Part part = parts.back();
        parts.pop_back();
        place(part, parts);
      }
    });
    return out;
  }

 private:
  static constexpr size_t kPartMerges = 4096;

  const Policy& policy_;
  size_t n_;
  bool threads_;
  Progress* progress_;
  HugeArray<float> features_;
  std::vector<uint32_t> least_, node_;
  HugeArray<Merge> merges_;  // of N - 1
  size_t merge_count_ = 0;
};

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
