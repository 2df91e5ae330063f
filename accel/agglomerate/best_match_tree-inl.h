// Search for the cluster most similar to a given one. [Walter et al. 2008, Fig. 3]
// Departs: an implicit tree of eight children per node stands for the paper's kd-tree. Nodes hold minima of features,
// and the policy's formula on them is the bound; slots are replaced and emptied in place, without pointers or planes.
// Compiled once a target: included again by each pass of foreach_target.h.
#if defined(LUMICUT_ACCEL_AGGLOMERATE_BEST_MATCH_TREE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_BEST_MATCH_TREE_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_BEST_MATCH_TREE_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_BEST_MATCH_TREE_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "accel/agglomerate/clusters-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE::agglomeration {

// Beyond any cost that counts as a match: empty slots cost infinity.
inline constexpr float kWorst = std::numeric_limits<float>::max();

// The most similar cluster: the least cost, among equals the one with the least leaf.
struct Match {
  float cost = kWorst;
  uint32_t least = kNone;  // its least leaf
  uint32_t slot = kNone;
};

// The active clusters, one per slot, below an implicit tree: lane j of block i of level L+1 holds the minimum of each
// feature, and of the least leaves, over block 8i+j of level L. A block of level L spans 8^(L+1) slots.
template <ClusterPolicy Policy>
class BestMatchTree {
 public:
  explicit BestMatchTree(const Clusters<Policy>& clusters)
      : clusters_(clusters), stride_((clusters.feature_count() + 1) * 8) {}

  size_t levels() const { return levels_; }

  void build(const std::vector<uint32_t>& active) {
    size_ = active.size();
    size_t blocks = (size_ + 7) / 8, total = 0, level = 0;
    for (;; blocks = (blocks + 7) / 8, ++level) {
      start_[level] = total;
      count_[level] = blocks;
      total += blocks;
      if (blocks <= 1) break;
    }
    levels_ = level + 1;
    used_ = total * stride_;
    reserve();
    const size_t features = clusters_.feature_count();
    clusters_.for_chunks(count_[0], 512, [&](size_t begin, size_t end) {
      for (size_t b = begin; b < end; ++b) {
        float* block_b = block(0, b);
        for (size_t lane = 0; lane < 8; ++lane) {
          const size_t slot = 8 * b + lane;
          const float* from = slot < size_ ? clusters_.of(active[slot]) : nullptr;
          for (size_t f = 0; f < features; ++f) block_b[8 * f + lane] = from ? from[f] : kInfinity;
          ids(block_b)[lane] = from ? clusters_.least(active[slot]) : kNone;
        }
      }
    });
    for (size_t l = 1; l < levels_; ++l)
      clusters_.for_chunks(count_[l], 512, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b)
          for (size_t lane = 0; lane < 8; ++lane) {
            const bool there = 8 * b + lane < count_[l - 1];
            summarize(there ? block(l - 1, 8 * b + lane) : nullptr, block(l, b), lane);
          }
      });
  }

  void copy(const BestMatchTree& other) {
    size_ = other.size_, levels_ = other.levels_, used_ = other.used_;
    std::copy_n(other.start_, kMaxLevels, start_);
    std::copy_n(other.count_, kMaxLevels, count_);
    reserve();
    clusters_.for_chunks(used_, 1 << 16, [&](size_t begin, size_t end) {
      std::copy(other.data_.data() + begin, other.data_.data() + end, data_.data() + begin);
    });
  }

  // Replaces the cluster in a slot; kNone empties it. Updates levels up to `top`.
  void set(size_t slot, uint32_t cluster, size_t top) {
    float* leaf = block(0, slot / 8);
    const size_t features = clusters_.feature_count();
    for (size_t f = 0; f < features; ++f)
      leaf[8 * f + slot % 8] = cluster == kNone ? kInfinity : clusters_.of(cluster)[f];
    ids(leaf)[slot % 8] = cluster == kNone ? kNone : clusters_.least(cluster);
    size_t at = slot / 8;
    for (size_t l = 1; l <= top; ++l, at /= 8)
      if (!summarize(block(l - 1, at), block(l, at / 8), at % 8)) break;
  }

  // The best match of the cluster in `slot`, or `best` if no other is better. Climbs from the cluster's own block; at
  // each level descends into the siblings whose bound is better. Levels above `top` are searched in `outside`, unless
  // null.
  Match find(uint32_t cluster, size_t slot, Match best, size_t top, const BestMatchTree* outside) const {
    const auto query = clusters_.policy().query(Lanes8(), clusters_.of(cluster));
    visit_leaf(query, slot / 8, 1u << (slot % 8), best);
    climb(query, slot / 8, 1, top, best);
    if (outside != nullptr) outside->climb(query, (slot / 8) >> (3 * top), top + 1, levels_ - 1, best);
    return best;
  }

 private:
  struct Pending {
    float cost;
    uint32_t least, level, block;
  };

  float* block(size_t level, size_t i) { return data_.data() + (start_[level] + i) * stride_; }
  const float* block(size_t level, size_t i) const { return data_.data() + (start_[level] + i) * stride_; }
  uint32_t* ids(float* b) const { return reinterpret_cast<uint32_t*>(b + stride_ - 8); }
  const uint32_t* ids(const float* b) const { return reinterpret_cast<const uint32_t*>(b + stride_ - 8); }

  void reserve() {
    if (used_ <= capacity_) return;
    capacity_ = used_;
    data_ = HugeArray<float>(capacity_);
  }

  // Stores the minima over `child` (null: none) in `lane` of `parent`. True when that changed something.
  bool summarize(const float* child, float* parent, size_t lane) {
    const size_t features = clusters_.feature_count();
    bool changed = false;
    for (size_t f = 0; f < features; ++f) {
      float least = kInfinity;
      if (child != nullptr) {
        const float* c = child + 8 * f;
        least = std::min(std::min(std::min(c[0], c[1]), std::min(c[2], c[3])),
                         std::min(std::min(c[4], c[5]), std::min(c[6], c[7])));
      }
      changed |= parent[8 * f + lane] != least;
      parent[8 * f + lane] = least;
    }
    const uint32_t id = child != nullptr ? *std::min_element(ids(child), ids(child) + 8) : kNone;
    changed |= ids(parent)[lane] != id;
    ids(parent)[lane] = id;
    return changed;
  }

  template <class Query>
  HWY_INLINE void climb(const Query& query, size_t at, size_t from, size_t top, Match& best) const {
    Pending stack[8 * kMaxLevels];
    for (size_t l = from; l <= top; ++l, at /= 8) {
      size_t pending = visit_inner(query, l, at / 8, 1u << (at % 8), best, stack, 0);
      while (pending > 0) {
        const Pending next = stack[--pending];
        if (!(next.cost < best.cost || (next.cost == best.cost && next.least < best.least))) continue;
        if (next.level == 0)
          visit_leaf(query, next.block, 0, best);
        else
          pending = visit_inner(query, next.level, next.block, 0, best, stack, pending);
      }
    }
  }

  // Stores the costs of all lanes. One bit per lane whose cost is not above `best`.
  template <class Query>
  HWY_INLINE uint32_t evaluate(const Query& query, const float* b, float best, float* costs) const {
    const Lanes8 d;
    uint32_t mask = 0;
    for (size_t lane = 0; lane < 8; lane += hn::Lanes(d)) {
      const auto cost = clusters_.policy().cost(d, query, b + lane);
      hn::Store(cost, d, costs + lane);
      uint8_t bits[8] = {};
      hn::StoreMaskBits(d, hn::Le(cost, hn::Set(d, best)), bits);
      mask |= static_cast<uint32_t>(bits[0]) << lane;
    }
    return mask;
  }

  template <class Query>
  HWY_INLINE void visit_leaf(const Query& query, size_t at, uint32_t skip, Match& best) const {
    HWY_ALIGN float costs[8];
    const float* b = block(0, at);
    for (uint32_t mask = evaluate(query, b, best.cost, costs) & ~skip; mask != 0; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      if (costs[lane] < best.cost || (costs[lane] == best.cost && ids(b)[lane] < best.least))
        best = {costs[lane], ids(b)[lane], static_cast<uint32_t>(8 * at) + static_cast<uint32_t>(lane)};
    }
  }

  // Pushes the lanes whose bound is better than `best`; the lowest bound on top.
  template <class Query>
  HWY_INLINE size_t visit_inner(const Query& query, size_t level, size_t at, uint32_t skip, const Match& best,
                                Pending* stack, size_t top) const {
    HWY_ALIGN float costs[8];
    const float* b = block(level, at);
    const size_t bottom = top;
    for (uint32_t mask = evaluate(query, b, best.cost, costs) & ~skip; mask != 0; mask &= mask - 1) {
      const auto lane = static_cast<uint32_t>(__builtin_ctz(mask));
      const uint32_t least = ids(b)[lane];
      if (costs[lane] == best.cost && least >= best.least) continue;
      const Pending p{costs[lane], least, static_cast<uint32_t>(level - 1), static_cast<uint32_t>(8 * at) + lane};
      size_t i = top++;
      for (;
           i > bottom && (stack[i - 1].cost < p.cost || (stack[i - 1].cost == p.cost && stack[i - 1].least < p.least));
           --i)
        stack[i] = stack[i - 1];
      stack[i] = p;
    }
    return top;
  }

  static constexpr size_t kMaxLevels = 12;  // 8^11 slots
  const Clusters<Policy>& clusters_;
  size_t stride_, size_ = 0, levels_ = 0, used_ = 0, capacity_ = 0;
  size_t start_[kMaxLevels] = {}, count_[kMaxLevels] = {};
  HugeArray<float> data_;
};

}  // namespace lumicut::HWY_NAMESPACE::agglomeration
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_BEST_MATCH_TREE_INL_H_
