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
      : policy_(policy), n_(n), next_(static_cast<uint32_t>(n)), threads_(threads), progress_(progress) {
    features_ = hwy::AllocateAligned<float>(std::max<size_t>(1, (2 * n) * k()));
    if (!features_)
      throw Error(ErrorCode::out_of_memory, "agglomerate: no memory for " + std::to_string(n) + " leaves");
    least_.resize(2 * n);
    std::iota(least_.begin(), least_.begin() + static_cast<ptrdiff_t>(n), 0u);
    merges_.resize(n > 0 ? n - 1 : 0);
  }

  float* leaf(size_t i) { return features_.get() + i * k(); }

  std::vector<Merge> run(Strategy strategy) {
    check();
    std::vector<uint32_t> active = join_coincident();
    if constexpr (!Policy::kNonDecreasing)
      if (strategy == Strategy::locally_ordered || strategy == Strategy::parallel)
        throw Error(
            ErrorCode::invalid_argument,
            "agglomerate: locally ordered strategies need a dissimilarity that never falls as clusters grow (Eq. 1)");
    if (active.size() > 1) {
      if (strategy == Strategy::naive) naive(std::move(active));
      if (strategy == Strategy::heap) heap(std::move(active));
      if (strategy == Strategy::locally_ordered) chain(std::move(active));
      if (strategy == Strategy::parallel) rounds(std::move(active));
    }
    return canonical();
  }

 private:
  size_t k() const {
    if constexpr (Policy::kFeatures > 0) return Policy::kFeatures;
    return policy_.features();
  }
  const float* of(uint32_t cluster) const { return features_.get() + static_cast<size_t>(cluster) * k(); }
  void check() const {
    if (progress_ != nullptr) progress_->check();
  }
  template <class Fn>
  void for_chunks(size_t n, size_t chunk, Fn&& fn) const {
    if (threads_ && n > chunk) {
      parallel_chunks(n, chunk, std::forward<Fn>(fn));
      return;
    }
    for (size_t begin = 0; begin < n; begin += chunk) fn(begin, std::min(n, begin + chunk));
  }

  // Writes cluster `c`, the union of `a` and `b`.
  void join(uint32_t a, uint32_t b, uint32_t c, float cost) {
    policy_.merge(of(a), of(b), features_.get() + static_cast<size_t>(c) * k());
    least_[c] = std::min(least_[a], least_[b]);
    merges_[c - n_] = {a, b, cost};
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

  // Joins leaves with equal keys in balanced subtrees; what is left to cluster, in order of least leaf.
  std::vector<uint32_t> join_coincident() {
    const size_t key = policy_.key_features();
    size_t buckets = 16;
    while (buckets < 2 * n_) buckets *= 2;
    std::vector<uint32_t> table(buckets, kNone), next(n_, kNone), last(n_, kNone);
    std::vector<uint32_t> active;
    active.reserve(n_);
    for (uint32_t i = 0; i < n_; ++i) {
      if ((i & 0xffff) == 0) check();
      uint64_t hash = 0;
      for (size_t f = 0; f < key; ++f) {
        const float value = of(i)[f] + 0.0f;  // -0 becomes 0
        uint32_t bits;
        std::memcpy(&bits, &value, sizeof(bits));
        hash = (hash ^ bits) * 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 32;
      }
      for (size_t at = hash & (buckets - 1);; at = (at + 1) & (buckets - 1)) {
        const uint32_t first = table[at];
        if (first == kNone) {
          table[at] = i, last[i] = i;
          active.push_back(i);
          break;
        }
        if (std::equal(of(i), of(i) + key, of(first))) {
          next[last[first]] = i, last[first] = i;
          break;
        }
      }
    }
    std::vector<uint32_t> group;
    for (uint32_t& cluster : active) {
      if (next[cluster] == kNone) continue;
      group.clear();
      for (uint32_t i = cluster; i != kNone; i = next[i]) group.push_back(i);
      while (group.size() > 1) {  // pair by pair, so that the depth is log2 of their number
        size_t out = 0;
        for (size_t i = 0; i < group.size(); i += 2) {
          if (i + 1 == group.size()) {
            group[out++] = group[i];
            continue;
          }
          if ((next_ & 0xfff) == 0) check();
          join(group[i], group[i + 1], next_, pair_cost(group[i], group[i + 1]));
          group[out++] = next_++;
        }
        group.resize(out);
      }
      cluster = group[0];
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
  // one a lane, by the least of each feature and the least of their least leaves. [Stands for the paper's kd-tree, Fig.
  // 3; slots are replaced and emptied in place]
  class BestMatchTree {
   public:
    BestMatchTree(const Core& core) : core_(core), stride_((core.k() + 1) * 8) {}

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
      if (total * stride_ > capacity_) {
        capacity_ = total * stride_;
        data_ = hwy::AllocateAligned<float>(capacity_);
        if (!data_) throw Error(ErrorCode::out_of_memory, "agglomerate: no memory for the search tree");
      }
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

    // Puts a cluster in the slot, or nothing (kNone).
    void set(size_t slot, uint32_t cluster) {
      float* leaf = block(0, slot / 8);
      const size_t features = core_.k();
      for (size_t f = 0; f < features; ++f)
        leaf[8 * f + slot % 8] = cluster == kNone ? kInfinity : core_.of(cluster)[f];
      ids(leaf)[slot % 8] = cluster == kNone ? kNone : core_.least_[cluster];
      size_t at = slot / 8;
      for (size_t l = 1; l < levels_; ++l, at /= 8)
        if (!summarize(block(l - 1, at), block(l, at / 8), at % 8)) break;
    }

    // The best match of the cluster in `slot`, where it is better than `best`; else `best` as it is.
    // Starts at the cluster's own leaf and climbs; at each level looks down into the siblings that may hold a better
    // one.
    Match find(uint32_t cluster, size_t slot, Match best) const {
      const Lanes8 d;
      const auto query = core_.policy_.query(d, core_.of(cluster));
      Pending stack[8 * kMaxLevels];
      visit_leaf(query, slot / 8, 1u << (slot % 8), best);
      size_t at = slot / 8;
      for (size_t l = 1; l < levels_; ++l, at /= 8) {
        size_t top = visit_inner(query, l, at / 8, 1u << (at % 8), best, stack, 0);
        while (top > 0) {
          const Pending& next = stack[--top];
          if (!(next.cost < best.cost || (next.cost == best.cost && next.least < best.least))) continue;
          if (next.level == 0)
            visit_leaf(query, next.block, 0, best);
          else
            top = visit_inner(query, next.level, next.block, 0, best, stack, top);
        }
      }
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
    size_t stride_, size_ = 0, levels_ = 0, capacity_ = 0;
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
      join(active[left], active[right], next_, best);
      active[left] = next_++;
      active.erase(active.begin() + static_cast<ptrdiff_t>(right));
    }
  }

  // Fig. 3. Pairs whose first cluster is gone are dropped, pairs whose second is gone are sought anew.
  void heap(std::vector<uint32_t> active) {
    struct Pair {
      float cost;
      uint32_t lo, hi;  // least leaves
      uint32_t owner, other;
      bool operator<(const Pair& o) const {  // of std::priority_queue: the least on top
        return cost != o.cost ? cost > o.cost : (lo != o.lo ? lo > o.lo : hi > o.hi);
      }
    };
    BestMatchTree tree(*this);
    std::vector<uint32_t> slot_of(2 * n_, kNone), in_slot;
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
      const Match match = tree.find(cluster, slot_of[cluster], {});
      const uint32_t other = in_slot[match.slot];
      const auto [lo, hi] = std::minmax({least_[cluster], least_[other]});
      queue.push({match.cost, lo, hi, cluster, other});
    };
    for (size_t i = 0; i < active.size(); ++i) {
      if ((i & 0xfff) == 0) check();
      push(active[i]);
    }
    while (alive > 1) {
      const Pair pair = queue.top();
      queue.pop();
      if (slot_of[pair.owner] == kNone) continue;
      if (slot_of[pair.other] == kNone) {
        push(pair.owner);
        continue;
      }
      if ((next_ & 0xfff) == 0) check();
      const uint32_t slot_a = slot_of[pair.owner], slot_b = slot_of[pair.other], c = next_++;
      join(pair.owner, pair.other, c, pair.cost);
      slot_of[pair.owner] = slot_of[pair.other] = kNone;
      in_slot[slot_a] = c, in_slot[slot_b] = kNone;
      slot_of[c] = slot_a;
      tree.set(slot_b, kNone);
      tree.set(slot_a, c);
      if (--alive <= next_rebuild && alive > 64) {
        active.clear();
        for (const uint32_t cluster : in_slot)
          if (cluster != kNone) active.push_back(cluster);
        rebuild();
        next_rebuild = alive / 2;
      }
      if (alive > 1) push(c);
    }
  }

  // Fig. 4, with the chain kept as a stack: what lies below the top stays a chain of best matches when the top merges.
  void chain(std::vector<uint32_t> active) {
    BestMatchTree tree(*this);
    std::vector<uint32_t> slot_of(2 * n_, kNone), in_slot;
    struct Link {
      uint32_t cluster;
      Match match;  // the link before: a better match must beat it
    };
    std::vector<Link> links;
    size_t alive = active.size(), next_rebuild = 0, scan = 0;
    const auto rebuild = [&] {
      sort_in_space(active);
      tree.build(active);
      in_slot = active;
      for (size_t i = 0; i < active.size(); ++i) slot_of[active[i]] = static_cast<uint32_t>(i);
      for (size_t i = 1; i < links.size(); ++i) links[i].match.slot = slot_of[links[i - 1].cluster];
      next_rebuild = alive > 64 ? alive / 2 : 0;
      scan = 0;
    };
    rebuild();
    while (alive > 1) {
      if (alive <= next_rebuild) {
        active.clear();
        for (const uint32_t cluster : in_slot)
          if (cluster != kNone) active.push_back(cluster);
        rebuild();
      }
      if (links.empty()) {
        while (in_slot[scan] == kNone) ++scan;
        links.push_back({in_slot[scan], {}});
      }
      const Link top = links.back();
      const Match match = tree.find(top.cluster, slot_of[top.cluster], top.match);
      if (match.slot != top.match.slot) {
        links.push_back({in_slot[match.slot], {match.cost, least_[top.cluster], slot_of[top.cluster]}});
        continue;
      }
      if ((next_ & 0xfff) == 0) check();
      const uint32_t other = links[links.size() - 2].cluster, c = next_++;
      const uint32_t slot_a = slot_of[top.cluster], slot_b = slot_of[other];
      links.resize(links.size() - 2);
      join(top.cluster, other, c, match.cost);
      in_slot[slot_b] = c, in_slot[slot_a] = kNone;
      slot_of[c] = slot_b;
      tree.set(slot_a, kNone);
      tree.set(slot_b, c);
      scan = std::min<size_t>(scan, slot_b);
      --alive;
    }
  }

  // In each round every cluster knows its best match, and all pairs that agree merge at once: by Eq. 1 greed would
  // merge them too, sooner or later. What is computed depends on nothing but the clusters: the same tree on any number
  // of threads.
  void rounds(std::vector<uint32_t> active) {
    constexpr size_t kChunk = 256;
    BestMatchTree tree(*this);
    sort_in_space(active);
    size_t sorted = active.size();
    std::vector<Match> match(active.size()), new_match;  // slot kNone: to be sought, and `cost`, `least` bound it
    std::vector<uint32_t> new_active, new_slot, first_new, first_out;
    while (active.size() > 1) {
      check();
      const size_t m = active.size();
      tree.build(active);
      for_chunks(m, kChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
          if (match[i].least == kNone || match[i].slot == kNone) match[i] = tree.find(active[i], i, {});
      });
      // Where each chunk's clusters and merges will be written.
      const size_t chunks = (m + kChunk - 1) / kChunk;
      const auto is_first = [&](size_t i) { return match[i].slot > i && match[match[i].slot].slot == i; };
      const auto is_second = [&](size_t i) { return match[i].slot < i && match[match[i].slot].slot == i; };
      first_new.assign(chunks + 1, 0);
      first_out.assign(chunks + 1, 0);
      for_chunks(m, kChunk, [&](size_t begin, size_t end) {
        uint32_t merged = 0, kept = 0;
        for (size_t i = begin; i < end; ++i) merged += is_first(i), kept += !is_second(i);
        first_new[begin / kChunk + 1] = merged, first_out[begin / kChunk + 1] = kept;
      });
      for (size_t c = 0; c < chunks; ++c) first_new[c + 1] += first_new[c], first_out[c + 1] += first_out[c];
      const uint32_t merged = first_new[chunks];
      // Long chains of ever better matches merge one pair a round: those are work for the serial chain.
      if (m <= 64 || merged < m / 64) {
        chain(std::move(active));
        return;
      }
      new_active.resize(first_out[chunks]);
      new_slot.resize(m);
      for_chunks(m, kChunk, [&](size_t begin, size_t end) {
        uint32_t c = next_ + first_new[begin / kChunk], out = first_out[begin / kChunk];
        for (size_t i = begin; i < end; ++i) {
          if (is_second(i)) continue;
          new_slot[i] = out;
          if (is_first(i)) {
            join(active[i], active[match[i].slot], c, match[i].cost);
            new_active[out] = c++;
          } else {
            new_active[out] = active[i];
          }
          ++out;
        }
      });
      next_ += merged;
      new_match.assign(new_active.size(), {});
      for_chunks(m, kChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
          if (is_second(i) || is_first(i)) continue;
          const size_t j = match[i].slot;
          const bool gone = is_first(j) || is_second(j);
          if (!gone) new_match[new_slot[i]] = {match[i].cost, match[i].least, new_slot[j]};
        }
      });
      active.swap(new_active);
      match.swap(new_match);
      if (active.size() <= sorted / 2) {
        resort(active, match);
        sorted = active.size();
      }
    }
  }

  // Puts the clusters in order anew, their matches with them.
  void resort(std::vector<uint32_t>& active, std::vector<Match>& match) {
    std::vector<uint32_t> before = active, slot_of_cluster(next_, kNone);
    std::vector<Match> moved(match.size());
    sort_in_space(active);
    for (uint32_t i = 0; i < active.size(); ++i) slot_of_cluster[active[i]] = i;
    for (size_t i = 0; i < before.size(); ++i) {
      Match m = match[i];
      if (m.slot != kNone) m.slot = slot_of_cluster[before[m.slot]];
      moved[slot_of_cluster[before[i]]] = m;
    }
    match.swap(moved);
  }

  // Post-order from the root, the child with the smaller least leaf first.
  std::vector<Merge> canonical() const {
    std::vector<Merge> out(merges_.size());
    if (out.empty()) return out;
    std::vector<uint32_t> id(merges_.size());
    struct Visit {
      uint32_t merge;
      bool done;
    };
    std::vector<Visit> stack{{next_ - 1 - static_cast<uint32_t>(n_), false}};
    uint32_t count = 0;
    const auto n = static_cast<uint32_t>(n_);
    while (!stack.empty()) {
      const Visit v = stack.back();
      const Merge& m = merges_[v.merge];
      const bool swap = least_[m.right] < least_[m.left];
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

  static constexpr size_t kMaxFeatures = 64;
  const Policy& policy_;
  size_t n_;
  uint32_t next_;
  bool threads_;
  Progress* progress_;
  hwy::AlignedFreeUniquePtr<float[]> features_;
  std::vector<uint32_t> least_;
  std::vector<Merge> merges_;
};

}  // namespace agglomeration
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#endif  // LUMICUT_ACCEL_AGGLOMERATE_INL_H_
