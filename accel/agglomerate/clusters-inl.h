// The state of an agglomeration: the features of all clusters, and the merges so far.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
#endif

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "accel/agglomerate.h"
#include "accel/agglomerate/policy-inl.h"
#include "core/error.h"
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
    features_ = hwy::AllocateAligned<float>(std::max<size_t>(1, n * feature_count()));
    if (!features_)
      throw Error(ErrorCode::out_of_memory, "agglomerate: no memory for " + std::to_string(n) + " leaves");
    least_.resize(n);
    std::iota(least_.begin(), least_.end(), 0u);
    node_ = least_;
    merges_.reserve(n > 0 ? n - 1 : 0);
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
  float* leaf(size_t i) { return features_.get() + i * feature_count(); }
  const float* of(uint32_t cluster) const { return features_.get() + static_cast<size_t>(cluster) * feature_count(); }
  uint32_t least(uint32_t cluster) const { return least_[cluster]; }
  uint32_t node(uint32_t cluster) const { return node_[cluster]; }
  void set_node(uint32_t cluster, uint32_t id) { node_[cluster] = id; }

  // Cluster `a` becomes the union of `a` and `b`, with that id in the tree. `b` must not be used any more.
  Merge join(uint32_t a, uint32_t b, float cost, uint32_t id) {
    float joint[kMaxFeatures];
    policy_.merge(of(a), of(b), joint);
    std::copy_n(joint, feature_count(), features_.get() + static_cast<size_t>(a) * feature_count());
    const Merge merge{node_[a], node_[b], cost};
    least_[a] = std::min(least_[a], least_[b]);
    node_[a] = id;
    return merge;
  }
  void join(uint32_t a, uint32_t b, float cost) {
    merges_.push_back(join(a, b, cost, static_cast<uint32_t>(n_ + merges_.size())));
  }
  std::vector<Merge>& merges() { return merges_; }

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

  // The merges in canonical order, see Merge.
  std::vector<Merge> canonical() const {
    std::vector<Merge> out(merges_.size());
    if (out.empty()) return out;
    const auto n = static_cast<uint32_t>(n_);
    std::vector<uint32_t> id(merges_.size()), least(merges_.size());
    const auto least_of = [&](uint32_t node) { return node < n ? node : least[node - n]; };
    for (size_t i = 0; i < merges_.size(); ++i)
      least[i] = std::min(least_of(merges_[i].left), least_of(merges_[i].right));
    struct Visit {
      uint32_t merge;
      bool done;
    };
    std::vector<Visit> stack{{static_cast<uint32_t>(merges_.size() - 1), false}};
    uint32_t count = 0;
    while (!stack.empty()) {
      const Visit v = stack.back();
      const Merge& m = merges_[v.merge];
      const bool swap = least_of(m.right) < least_of(m.left);
      const uint32_t left = swap ? m.right : m.left, right = swap ? m.left : m.right;
      if (!v.done) {
        stack.back().done = true;
        if (right >= n) stack.push_back({right - n, false});
        if (left >= n) stack.push_back({left - n, false});
        continue;
      }
      stack.pop_back();
      id[v.merge] = n + count;
      out[count++] = {left < n ? left : id[left - n], right < n ? right : id[right - n], m.cost};
    }
    return out;
  }

 private:
  const Policy& policy_;
  size_t n_;
  bool threads_;
  Progress* progress_;
  hwy::AlignedFreeUniquePtr<float[]> features_;
  std::vector<uint32_t> least_, node_;
  std::vector<Merge> merges_;
};

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_CLUSTERS_INL_H_
