// The core of bottom-up clustering, for policies over vectors of floats. [Walter et al. 2008, sec. 3]
//
// A cluster is a vector of features, and features are chosen so that
//   - those of A∪B are never below those of A or of B (merge: per feature the greater one, or the sum), and
//   - d(A, B) never falls when a feature of B rises.
// A box is (-lo, hi), a set of lights adds its intensity, a ball is (centre, -centre, radius). Two things follow:
//   - Eq. 1, d(A, B) <= d(A∪C, B), holds, also in floating point, where each operation rounds monotonically;
//   - the least of each feature over many clusters, put in place of B, gives a lower bound of d over them all.
// So one formula of the policy, eight lanes wide, is both the exact dissimilarity and the bound, and the kd-tree of the
// paper becomes an implicit tree of eight children a node: no pointers, no planes (BestMatchTree).
//
// Departs from the paper: ties are broken by the least leaf of each cluster. With a total order of pairs that Eq. 1
// respects, no chain can cycle, and every strategy builds the same tree. Leaves that coincide are joined in balanced
// subtrees first: by greed alone a million of them would make a tree a million deep.
//
// A policy has:
//   static constexpr bool kNonDecreasing;      // Eq. 1 holds; the locally-ordered strategies refuse a policy without
//   it static constexpr int kFeatures;            // 0: known at run time, by features() static constexpr int
//   kOrderDims;           // of the points by which leaves are put in order size_t features() const; size_t
//   key_features() const;               // leaves are coincident when this many leading features are equal void
//   merge(const float* a, const float* b, float* out) const; void order_point(const float* a, float* point) const;
//   Query<D> query(D d, const float* a) const; // whatever of A the formula needs
//   Vec<D> cost(D d, const Query<D>& a, const float* b) const;  // lane i: d(A, features b[8·k + i])
// Multiplications and additions are not fused, so that all instruction sets build the same tree.

#if defined(LUMICUT_ACCEL_AGGLOMERATE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#undef LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#else
#define LUMICUT_ACCEL_AGGLOMERATE_INL_H_
#endif

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <queue>
#include <vector>

#include "accel/agglomerate.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/rng.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut {
namespace HWY_NAMESPACE {
namespace agglomeration {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes8 = hn::CappedTag<float, 8>;

inline constexpr uint32_t kNone = 0xffffffffu;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Beyond any cost that counts as a match: empty slots cost infinity.
inline constexpr float kWorst = std::numeric_limits<float>::max();

// A match and how good it is; better is less.
struct Match {
  float cost = kWorst;
  uint32_t least = kNone;  // least leaf of the match
  uint32_t slot = kNone;
};

template <class Policy>
class Core {
 public:
  Core(const Policy& policy, size_t n, bool threads, Progress* progress)
      : policy_(policy), n_(n), threads_(threads), progress_(progress) {
    features_ = hwy::AllocateAligned<float>(std::max<size_t>(1, n * k()));
    if (!features_)
      throw Error(ErrorCode::out_of_memory, "agglomerate: no memory for " + std::to_string(n) + " leaves");
    least_.resize(n);
    std::iota(least_.begin(), least_.end(), 0u);
    node_ = least_;
    merges_.reserve(n > 0 ? n - 1 : 0);
  }

  float* leaf(size_t i) { return features_.get() + i * k(); }

  // fn(begin, end), in parallel where the strategy is.
  template <class Fn>
  void for_chunks(size_t n, size_t chunk, Fn&& fn) const {
    if (threads_ && n > chunk) {
      parallel_chunks(n, chunk, std::forward<Fn>(fn));
      return;
    }
    for (size_t begin = 0; begin < n; begin += chunk) fn(begin, std::min(n, begin + chunk));
  }

  std::vector<Merge> run(Strategy strategy) {
    check();
    if constexpr (!Policy::kNonDecreasing)
      if (strategy == Strategy::locally_ordered || strategy == Strategy::parallel)
        fail_argument(
            "agglomerate: locally ordered strategies need a dissimilarity that never falls as clusters grow (Eq. 1)");
    std::vector<uint32_t> active = join_coincident();
    if (active.size() > 1) {
      if (strategy == Strategy::naive) naive(active);
      if (strategy == Strategy::heap) heap(active);
      if (strategy == Strategy::locally_ordered) chain(active);
      if (strategy == Strategy::parallel) regions(active);
    }
    return canonical();
  }

 private:
  static constexpr size_t kMaxFeatures = 64;

  size_t k() const {
    if constexpr (Policy::kFeatures > 0) return Policy::kFeatures;
    return policy_.features();
  }
  // A cluster is known by the leaf whose place in memory it took over; node_ has its id in the tree.
  const float* of(uint32_t cluster) const { return features_.get() + static_cast<size_t>(cluster) * k(); }
  void check() const {
    if (progress_ != nullptr) progress_->check();
  }
  // Cluster `a` becomes the union of `a` and `b`, with that id in the tree; `b` is no more.
  Merge join(uint32_t a, uint32_t b, float cost, uint32_t id) {
    float joint[kMaxFeatures];
    policy_.merge(of(a), of(b), joint);
    std::copy_n(joint, k(), features_.get() + static_cast<size_t>(a) * k());
    const Merge merge{node_[a], node_[b], cost};
    least_[a] = std::min(least_[a], least_[b]);
    node_[a] = id;
    return merge;
  }
  void join(uint32_t a, uint32_t b, float cost) {
    merges_.push_back(join(a, b, cost, static_cast<uint32_t>(n_ + merges_.size())));
  }

  // d(a, b) of one pair.
  float pair_cost(uint32_t a, uint32_t b) const {
    const Lanes8 d;
    HWY_ALIGN float lanes[kMaxFeatures * 8];
    HWY_ALIGN float out[8];
    for (size_t f = 0; f < k(); ++f) std::fill_n(lanes + 8 * f, 8, of(b)[f]);
    const auto query = policy_.query(d, of(a));
    hn::Store(policy_.cost(d, query, lanes), d, out);
    return out[0];
  }

  // For each leaf the least one with the same key. Leaves are dealt out by hash, so that each share has a table that
  // fits a cache.
  std::vector<uint32_t> first_equal() const {
    const size_t key = policy_.key_features(), shares = n_ / 4096 + 1;
    std::vector<uint32_t> hashes(n_), first(n_), dealt(n_), start(shares + 1, 0);
    for_chunks(n_, 4096, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float* f = features_.get() + i * k();
        uint64_t hash = 0;
        for (size_t j = 0; j < key; ++j) {
          const float value = f[j] + 0.0f;  // -0 becomes 0
          uint32_t bits;
          std::memcpy(&bits, &value, sizeof(bits));
          hash = (hash ^ bits) * 0x9e3779b97f4a7c15ull;
          hash ^= hash >> 32;
        }
        hashes[i] = static_cast<uint32_t>(hash);
      }
    });
    const auto share_of = [&](size_t i) { return static_cast<size_t>((uint64_t{hashes[i]} * shares) >> 32); };
    for (size_t i = 0; i < n_; ++i) ++start[share_of(i) + 1];
    for (size_t s = 0; s < shares; ++s) start[s + 1] += start[s];
    std::vector<uint32_t> fill(start.begin(), start.end() - 1);
    for (size_t i = 0; i < n_; ++i) dealt[fill[share_of(i)]++] = static_cast<uint32_t>(i);
    for_chunks(shares, 1, [&](size_t share, size_t) {
      check();
      const size_t count = start[share + 1] - start[share];
      size_t buckets = 16;
      while (buckets < 2 * count) buckets *= 2;
      std::vector<uint32_t> table(buckets, kNone);
      for (size_t d = start[share]; d < start[share + 1]; ++d) {
        const uint32_t i = dealt[d];
        for (size_t at = (hashes[i] * 0x9e3779b1u) & (buckets - 1);; at = (at + 1) & (buckets - 1)) {
          if (table[at] == kNone) table[at] = i;
          const uint32_t other = table[at];
          if (other == i || (hashes[other] == hashes[i] && std::equal(of(i), of(i) + key, of(other)))) {
            first[i] = other;
            break;
          }
        }
      }
    });
    return first;
  }

  // Joins leaves with equal keys in balanced subtrees; what is left to cluster, in order of least leaf.
  std::vector<uint32_t> join_coincident() {
    const std::vector<uint32_t> first = first_equal();
    std::vector<uint32_t> next(n_, kNone), last(first);
    std::vector<uint32_t> active;
    active.reserve(n_);
    for (uint32_t i = 0; i < n_; ++i) {
      if (first[i] == i) {
        active.push_back(i);
      } else {
        next[last[first[i]]] = i;
        last[first[i]] = i;
      }
    }
    std::vector<uint32_t> group;
    for (const uint32_t cluster : active) {
      if (next[cluster] == kNone) continue;
      group.clear();
      for (uint32_t i = cluster; i != kNone; i = next[i]) group.push_back(i);
      while (group.size() > 1) {  // pair by pair, so that the depth is log2 of their number
        size_t out = 0;
        for (size_t i = 0; i < group.size(); i += 2) {
          if ((merges_.size() & 0xfff) == 0) check();
          if (i + 1 < group.size()) join(group[i], group[i + 1], pair_cost(group[i], group[i + 1]));
          group[out++] = group[i];
        }
        group.resize(out);
      }
    }
    return active;
  }

  // Puts clusters in an order in which runs of 8, 64, 512... lie close together: splits at medians, at multiples of
  // `unit`.
  struct Item {
    float point[Policy::kOrderDims];
    uint32_t cluster;
  };
  void split(Item* items, size_t n, size_t unit) const {
    while (n > 8) {
      while (unit >= n) unit /= 8;
      if (unit < 8) unit = 8;
      const size_t middle = (n + unit - 1) / unit / 2 * unit;
      float lo[Policy::kOrderDims], hi[Policy::kOrderDims];
      for (int a = 0; a < Policy::kOrderDims; ++a) lo[a] = kInfinity, hi[a] = -kInfinity;
      for (size_t i = 0; i < n; ++i)
        for (int a = 0; a < Policy::kOrderDims; ++a) {
          lo[a] = std::min(lo[a], items[i].point[a]);
          hi[a] = std::max(hi[a], items[i].point[a]);
        }
      int axis = 0;
      for (int a = 1; a < Policy::kOrderDims; ++a)
        if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
      std::nth_element(items, items + middle, items + n, [axis](const Item& a, const Item& b) {
        return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.cluster < b.cluster;
      });
      if (n > 0x4000) check();
      if (threads_ && n > 0x2000) {
        tbb::parallel_invoke([&] { split(items, middle, unit); }, [&] { split(items + middle, n - middle, unit); });
        return;
      }
      split(items, middle, unit);
      items += middle, n -= middle;
    }
  }
  void sort_in_space(std::vector<uint32_t>& active) const {
    std::vector<Item> items(active.size());
    for_chunks(active.size(), 4096, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        policy_.order_point(of(active[i]), items[i].point);
        items[i].cluster = active[i];
      }
    });
    size_t unit = 8;
    while (unit * 8 < items.size()) unit *= 8;
    split(items.data(), items.size(), unit);
    for (size_t i = 0; i < active.size(); ++i) active[i] = items[i].cluster;
  }

  // The active clusters, one a slot, under an implicit tree: block i of level L+1 sums up blocks 8i to 8i+7 of level L,
  // one a lane, by the least of each feature and the least of their least leaves. A block of level L spans 8^(L+1)
  // slots. [Stands for the paper's kd-tree, Fig. 3; slots are replaced and emptied in place]
  class BestMatchTree {
   public:
    explicit BestMatchTree(const Core& core) : core_(core), stride_((core.k() + 1) * 8) {}

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
      const size_t features = core_.k();
      core_.for_chunks(count_[0], 512, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
          float* block_b = block(0, b);
          for (size_t lane = 0; lane < 8; ++lane) {
            const size_t slot = 8 * b + lane;
            const float* from = slot < size_ ? core_.of(active[slot]) : nullptr;
            for (size_t f = 0; f < features; ++f) block_b[8 * f + lane] = from ? from[f] : kInfinity;
            ids(block_b)[lane] = from ? core_.least_[active[slot]] : kNone;
          }
        }
      });
      for (size_t l = 1; l < levels_; ++l)
        core_.for_chunks(count_[l], 512, [&](size_t begin, size_t end) {
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
      core_.for_chunks(used_, 1 << 16, [&](size_t begin, size_t end) {
        std::copy(other.data_.get() + begin, other.data_.get() + end, data_.get() + begin);
      });
    }

    // Puts a cluster in the slot, or nothing (kNone). Levels above `top` are left as they are.
    void set(size_t slot, uint32_t cluster, size_t top) {
      float* leaf = block(0, slot / 8);
      const size_t features = core_.k();
      for (size_t f = 0; f < features; ++f)
        leaf[8 * f + slot % 8] = cluster == kNone ? kInfinity : core_.of(cluster)[f];
      ids(leaf)[slot % 8] = cluster == kNone ? kNone : core_.least_[cluster];
      size_t at = slot / 8;
      for (size_t l = 1; l <= top; ++l, at /= 8)
        if (!summarize(block(l - 1, at), block(l, at / 8), at % 8)) break;
    }

    // The best match of the cluster in `slot`, where it is better than `best`; else `best` as it is.
    // Starts at the cluster's own leaf and climbs; at each level looks down into the siblings that may hold a better
    // one. Up to level `top` in this tree, further up in `outside`.
    Match find(uint32_t cluster, size_t slot, Match best, size_t top, const BestMatchTree* outside) const {
      const auto query = core_.policy_.query(Lanes8(), core_.of(cluster));
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

    float* block(size_t level, size_t i) { return data_.get() + (start_[level] + i) * stride_; }
    const float* block(size_t level, size_t i) const { return data_.get() + (start_[level] + i) * stride_; }
    uint32_t* ids(float* b) const { return reinterpret_cast<uint32_t*>(b + stride_ - 8); }
    const uint32_t* ids(const float* b) const { return reinterpret_cast<const uint32_t*>(b + stride_ - 8); }

    void reserve() {
      if (used_ <= capacity_) return;
      capacity_ = used_;
      data_ = hwy::AllocateAligned<float>(capacity_);
      if (!data_) throw Error(ErrorCode::out_of_memory, "agglomerate: no memory for the search tree");
    }

    // Sums `child` up in `lane` of `parent`. True when that changed anything.
    bool summarize(const float* child, float* parent, size_t lane) {
      const size_t features = core_.k();
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

    // Costs of all lanes, and the lanes that are as good as `best` or better.
    template <class Query>
    HWY_INLINE uint32_t evaluate(const Query& query, const float* b, float best, float* costs) const {
      const Lanes8 d;
      uint32_t mask = 0;
      for (size_t lane = 0; lane < 8; lane += hn::Lanes(d)) {
        const auto cost = core_.policy_.cost(d, query, b + lane);
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

    // Pushes the lanes that may hold a better match, the best on top.
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
        for (; i > bottom &&
               (stack[i - 1].cost < p.cost || (stack[i - 1].cost == p.cost && stack[i - 1].least < p.least));
             --i)
          stack[i] = stack[i - 1];
        stack[i] = p;
      }
      return top;
    }

    static constexpr size_t kMaxLevels = 12;  // 8^11 slots
    const Core& core_;
    size_t stride_, size_ = 0, levels_ = 0, used_ = 0, capacity_ = 0;
    size_t start_[kMaxLevels] = {}, count_[kMaxLevels] = {};
    hwy::AlignedFreeUniquePtr<float[]> data_;
  };

  // Fig. 2.
  void naive(std::vector<uint32_t> active) {
    while (active.size() > 1) {
      check();
      float best = kInfinity;
      uint32_t best_lo = kNone, best_hi = kNone;
      size_t left = 0, right = 1;
      for (size_t i = 0; i < active.size(); ++i)
        for (size_t j = i + 1; j < active.size(); ++j) {
          const float cost = pair_cost(active[i], active[j]);
          const auto [lo, hi] = std::minmax({least_[active[i]], least_[active[j]]});
          if (cost < best || (cost == best && (lo < best_lo || (lo == best_lo && hi < best_hi))))
            best = cost, best_lo = lo, best_hi = hi, left = i, right = j;
        }
      join(active[left], active[right], best);
      active.erase(active.begin() + static_cast<ptrdiff_t>(right));
    }
  }

  // Fig. 3. Pairs whose first cluster is gone are dropped, pairs whose second is gone are sought anew.
  void heap(std::vector<uint32_t> active) {
    struct Pair {
      float cost;
      uint32_t lo, hi;  // least leaves
      uint32_t owner, other, owner_node, other_node;
      bool operator<(const Pair& o) const {  // of std::priority_queue: the least on top
        return cost != o.cost ? cost > o.cost : (lo != o.lo ? lo > o.lo : hi > o.hi);
      }
    };
    BestMatchTree tree(*this);
    std::vector<uint32_t> slot_of(n_, kNone), in_slot;
    const auto rebuild = [&] {
      sort_in_space(active);
      tree.build(active);
      in_slot = active;
      for (size_t i = 0; i < active.size(); ++i) slot_of[active[i]] = static_cast<uint32_t>(i);
    };
    rebuild();
    size_t alive = active.size(), next_rebuild = alive / 2;
    std::priority_queue<Pair> queue;
    const auto push = [&](uint32_t cluster) {
      const Match match = tree.find(cluster, slot_of[cluster], {}, tree.levels() - 1, nullptr);
      const uint32_t other = in_slot[match.slot];
      const auto [lo, hi] = std::minmax({least_[cluster], least_[other]});
      queue.push({match.cost, lo, hi, cluster, other, node_[cluster], node_[other]});
    };
    for (size_t i = 0; i < active.size(); ++i) {
      if ((i & 0xfff) == 0) check();
      push(active[i]);
    }
    while (alive > 1) {
      const Pair pair = queue.top();
      queue.pop();
      if (slot_of[pair.owner] == kNone || node_[pair.owner] != pair.owner_node) continue;
      if (slot_of[pair.other] == kNone || node_[pair.other] != pair.other_node) {
        push(pair.owner);
        continue;
      }
      if ((merges_.size() & 0xfff) == 0) check();
      join(pair.owner, pair.other, pair.cost);
      const uint32_t slot = slot_of[pair.other];
      slot_of[pair.other] = kNone, in_slot[slot] = kNone;
      tree.set(slot, kNone, tree.levels() - 1);
      tree.set(slot_of[pair.owner], pair.owner, tree.levels() - 1);
      if (--alive <= next_rebuild && alive > 64) {
        active.clear();
        for (const uint32_t cluster : in_slot)
          if (cluster != kNone) active.push_back(cluster);
        rebuild();
        next_rebuild = alive / 2;
      }
      if (alive > 1) push(pair.owner);
    }
  }

  // Fig. 4 over the slots [begin, end), which the block of level `top` over them spans, with the chain kept as a stack:
  // what lies below the top stays a chain of best matches when the top merges. Stops when `stop_at` clusters are left.
  // Where a cluster's best match lies outside (in `outside`, a copy of the tree from before), the chain ends there and
  // its clusters rest: clusters outside only grow, so by Eq. 1 whatever merges inside is right whatever happens
  // outside.
  void chain_within(BestMatchTree& tree, const BestMatchTree* outside, size_t top, size_t begin, size_t end,
                    size_t stop_at, uint32_t first_id, std::vector<uint32_t>& in_slot, std::vector<Merge>& merges) {
    struct Link {
      uint32_t slot;
      Match match;  // the link before: what a better match must beat
    };
    std::vector<Link> links;
    std::vector<uint8_t> resting(outside != nullptr ? end - begin : 0, 0);
    const auto rests = [&](size_t slot) { return outside != nullptr && resting[slot - begin] != 0; };
    size_t alive = end - begin, scan = begin;
    while (alive > stop_at) {
      if (links.empty()) {
        while (scan < end && (in_slot[scan] == kNone || rests(scan))) ++scan;
        if (scan == end) return;
        links.push_back({static_cast<uint32_t>(scan), {}});
      }
      const Link last = links.back();
      const uint32_t cluster = in_slot[last.slot];
      const Match match = tree.find(cluster, last.slot, last.match, top, outside);
      if (match.slot != last.match.slot) {
        if (match.slot < begin || match.slot >= end || rests(match.slot)) {
          for (const Link& link : links) resting[link.slot - begin] = 1;
          links.clear();
          continue;
        }
        links.push_back({match.slot, {match.cost, least_[cluster], last.slot}});
        continue;
      }
      if (match.slot == kNone) return;  // alone
      if ((merges.size() & 0x3ff) == 0) check();
      const uint32_t into = match.slot;
      links.resize(links.size() - 2);
      merges.push_back(join(in_slot[into], cluster, match.cost, first_id + static_cast<uint32_t>(merges.size())));
      in_slot[last.slot] = kNone;
      tree.set(last.slot, kNone, top);
      tree.set(into, in_slot[into], top);
      scan = std::min<size_t>(scan, into);
      --alive;
    }
  }

  static void keep_alive(const std::vector<uint32_t>& in_slot, std::vector<uint32_t>& active) {
    active.clear();
    for (const uint32_t cluster : in_slot)
      if (cluster != kNone) active.push_back(cluster);
  }

  // Fig. 4. The tree is built anew whenever half of the clusters are gone.
  void chain(std::vector<uint32_t> active) {
    BestMatchTree tree(*this);
    std::vector<uint32_t> in_slot;
    while (active.size() > 1) {
      sort_in_space(active);
      tree.build(active);
      in_slot = active;
      const size_t stop_at = active.size() > 64 ? active.size() / 2 : 1;
      chain_within(tree, nullptr, tree.levels() - 1, 0, active.size(), stop_at, static_cast<uint32_t>(n_), in_slot,
                   merges_);
      keep_alive(in_slot, active);
    }
  }

  // Chains run at once in regions: subtrees of the search tree, whose size depends on the number of clusters alone.
  // When all have come to rest, what is left is put in new regions. So the tree is the same on any number of threads.
  void regions(std::vector<uint32_t> active) {
    BestMatchTree tree(*this), before(*this);
    std::vector<uint32_t> in_slot;
    std::vector<std::vector<Merge>> merges;
    for (;;) {
      const size_t m = active.size(), top = m > (1u << 21) ? 4 : (m > (1u << 16) ? 3 : 2),
                   span = size_t{1} << (3 * (top + 1));
      if (m < 4 * span) return chain(std::move(active));
      sort_in_space(active);
      tree.build(active);
      before.copy(tree);
      in_slot = active;
      const size_t count = (m + span - 1) / span;
      const auto first_id = static_cast<uint32_t>(n_ + merges_.size());
      merges.assign(count, {});
      for_chunks(count, 1, [&](size_t region, size_t) {
        const size_t begin = region * span, end = std::min(m, begin + span);
        chain_within(tree, &before, top, begin, end, 1, first_id + static_cast<uint32_t>(begin), in_slot,
                     merges[region]);
      });
      // Ids were given with gaps, since no region knows how many merges another has.
      for (size_t region = 0; region < count; ++region) {
        const auto gapped = first_id + static_cast<uint32_t>(region * span),
                   shift = gapped - static_cast<uint32_t>(n_ + merges_.size());
        for (Merge merge : merges[region]) {
          if (merge.left >= first_id) merge.left -= shift;
          if (merge.right >= first_id) merge.right -= shift;
          merges_.push_back(merge);
        }
        for (size_t slot = region * span; slot < std::min(m, (region + 1) * span); ++slot)
          if (in_slot[slot] != kNone && node_[in_slot[slot]] >= first_id) node_[in_slot[slot]] -= shift;
      }
      keep_alive(in_slot, active);
      // Where regions hardly merge, one chain over all is as good.
      if (active.size() > m - m / 8) return chain(std::move(active));
    }
  }

  // Post-order from the root, the child with the smaller least leaf first.
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

  const Policy& policy_;
  size_t n_;
  bool threads_;
  Progress* progress_;
  hwy::AlignedFreeUniquePtr<float[]> features_;
  std::vector<uint32_t> least_, node_;
  std::vector<Merge> merges_;
};

}  // namespace agglomeration
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_INL_H_
