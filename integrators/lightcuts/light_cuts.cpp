// Departs from Walter et al.: kCutPoints neighbouring points descend together, so that a bound is a SIMD evaluation and
// the shadow rays to a representative are one bundle. docs/decisions/0002-packet-lightcuts.md
#include "integrators/lightcuts/light_cuts.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "integrators/lightcuts/light_cuts.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clustering/bounds-inl.h"
#include "clustering/kernel_dispatch-inl.h"
#include "clustering/light_kernel-inl.h"
#include "clustering/light_kernel.h"
#include "clustering/sphere_integral-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {

HWY_INLINE V LuminanceOf(D d, V r, V g, V b) {
  return hn::MulAdd(hn::Set(d, 0.0722f), b, hn::MulAdd(hn::Set(d, 0.7152f), g, hn::Mul(hn::Set(d, 0.2126f), r)));
}

HWY_INLINE void Increment(hn::Mask<D> mask, uint32_t* counts) {
  const DU du;
  const auto one = hn::IfThenElseZero(hn::RebindMask(du, mask), hn::Set(du, 1));
  hn::Store(hn::Add(hn::Load(du, counts), one), du, counts);
}

// Unshadowed estimates of the points in `active`, and which of them get any.
struct EstimateKernel {
  template <VplKind kKind, Lobes kLobes>
  static HWY_INLINE uint32_t Run(const Vpl& light, const Rgb& intensity, Falloff falloff, const PointBlock& block,
                                 uint32_t active, float* r, float* g, float* b) {
    const D d;
    uint32_t lit = 0;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      V3 to_light;
      const V3 normal = Load3(d, block.normal, i);
      V geometry;
      V3 f;
      hn::Mask<D> reached;
      if constexpr (kKind == VplKind::sphere) {
        f = SphereRadiance<kLobes, true>(d, light, block, i, Load3(d, block.position, i), normal, to_light);
        geometry = hn::Set(d, 1.0f), reached = MaskOf(d, active, i);
      } else {
        geometry = Geometry<kKind>(d, light, falloff, Load3(d, block.position, i), normal, to_light);
        reached = hn::And(hn::Gt(geometry, hn::Zero(d)), MaskOf(d, active, i));
        f = Reflectance<kLobes>(d, block, i, normal, to_light);
      }
      const V cr = hn::IfThenElseZero(reached, hn::Mul(hn::Mul(f.x, geometry), hn::Set(d, intensity.x)));
      const V cg = hn::IfThenElseZero(reached, hn::Mul(hn::Mul(f.y, geometry), hn::Set(d, intensity.y)));
      const V cb = hn::IfThenElseZero(reached, hn::Mul(hn::Mul(f.z, geometry), hn::Set(d, intensity.z)));
      hn::Store(cr, d, r + i), hn::Store(cg, d, g + i), hn::Store(cb, d, b + i);
      lit |= BitsOf(d, hn::Gt(hn::Add(cr, hn::Add(cg, cb)), hn::Zero(d)), i);
    }
    return lit;
  }
};

HWY_NOINLINE uint32_t EstimateOf(const Vpl& light, const Rgb& intensity, Falloff falloff, const PointBlock& block,
                                 uint32_t active, float* r, float* g, float* b) {
  return RunKernel<EstimateKernel>(light.kind, block.lobes, light, intensity, falloff, block, active, r, g, b);
}

// Traces the shadow rays of a new representative; what is hidden adds nothing.
HWY_INLINE void TraceEstimates(const Accel& accel, const Vpl& light, const Rgb& intensity, Falloff falloff, CutEntry& e,
                               LightCuts& cuts) {
  const D d;
  uint32_t lit[kCutGroups] = {};
  size_t n = 0;
  e.lit = 0;
  for (size_t g = 0; g < kCutGroups; ++g) {
    if (e.active[g] == 0) continue;
    const PointBlock& block = cuts.blocks[g];
    lit[g] =
        EstimateOf(light, intensity, falloff, block, e.active[g], e.estimate[0][g], e.estimate[1][g], e.estimate[2][g]);
    if (lit[g] == 0) continue;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const auto mask = MaskOf(d, lit[g], i);
      // Through a register: compressing into memory is microcode on Zen 4. The arrays have room for a whole vector.
      hn::StoreU(hn::Compress(hn::Load(d, block.position[0] + i), mask), d, cuts.x + n);
      hn::StoreU(hn::Compress(hn::Load(d, block.position[1] + i), mask), d, cuts.y + n);
      hn::StoreU(hn::Compress(hn::Load(d, block.position[2] + i), mask), d, cuts.z + n);
      n += hn::CountTrue(d, mask);
      Increment(mask, cuts.rays[g] + i);
    }
  }
  if (n == 0) return;
  trace_shadows(accel, light, cuts.x, cuts.y, cuts.z, n, cuts.occluded);
  const uint8_t* occluded = cuts.occluded;
  for (size_t g = 0; g < kCutGroups; ++g) {
    if (lit[g] == 0) continue;
    uint32_t visible = lit[g];
    for (uint32_t m = lit[g]; m != 0; m &= m - 1)
      if (*occluded++ != 0) visible &= ~(m & (~m + 1));
    if (visible != 0) e.lit |= 1u << g;
    if (visible == 0 || visible == lit[g]) continue;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const auto mask = MaskOf(d, visible, i);
      for (auto& channel : e.estimate)
        hn::Store(hn::IfThenElseZero(mask, hn::Load(d, channel[g] + i)), d, channel[g] + i);
    }
  }
}

// Notes what the points in `lanes` of a group get by a node of their cuts.
HWY_INLINE void Record(CutRecord& record, const CutEntry& e, size_t group, size_t i, hn::Mask<D> lanes, V luminance) {
  const D d;
  float* to = record.luminance.data() + e.visit * kCutPoints + group * kLanes + i;
  hn::StoreU(hn::IfThenElse(lanes, luminance, hn::LoadU(d, to)), d, to);
}

// Puts a node into the cuts of the points in `active`. `parent`: its parent's entry, or nullptr.
template <bool kRecord>
void AddNode(const LightTree& tree, const Accel& accel, const CutOptions& o, uint32_t node_index,
             const uint16_t* active, const CutEntry* parent, LightCuts& cuts) {
  const D d;
  const V zero = hn::Zero(d), floor = hn::Set(d, std::max(o.floor, 1e-30f));
  const LightNode& node = tree.node(node_index);
  const uint32_t index = cuts.allocate();
  CutEntry& e = cuts.entry(index);
  e.first_child = node.first_child, e.representative = tree.representative(node_index, o.slot);
  e.intensity = node.intensity;
  uint32_t any = 0;
  for (size_t g = 0; g < kCutGroups; ++g) {
    e.active[g] = 0;
    if (active[g] == 0) continue;
    NodeBounds(node, cuts.blocks[g], e.bound[g]);
    uint32_t reached = 0;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const auto asked = MaskOf(d, active[g], i);
      Increment(asked, cuts.bounds[g] + i);
      reached |= BitsOf(d, hn::And(asked, hn::Gt(hn::Load(d, e.bound[g] + i), zero)), i);
    }
    e.active[g] = static_cast<uint16_t>(reached);
    any |= reached;
  }
  if (any == 0) return cuts.release(index);
  if constexpr (kRecord) e.visit = o.record->add(node_index, parent != nullptr ? parent->visit : CutRecord::kNone);

  if (parent != nullptr && parent->representative == e.representative) {
    // The same light at another intensity: its estimates and shadows are known.
    const Rgb& whole = parent->intensity;
    e.lit = 0;
    for (size_t g = 0; g < kCutGroups; ++g)
      if (e.active[g] != 0) e.lit |= parent->lit & 1u << g;
    for (size_t k = 0; k < 3; ++k) {
      const V share = hn::Set(d, whole[static_cast<int>(k)] > 0.0f
                                     ? node.intensity[static_cast<int>(k)] / whole[static_cast<int>(k)]
                                     : 0.0f);
      for (size_t g = 0; g < kCutGroups; ++g)
        for (size_t i = 0; (e.lit >> g & 1) != 0 && i < kLanes; i += hn::Lanes(d))
          hn::Store(
              hn::IfThenElseZero(MaskOf(d, e.active[g], i), hn::Mul(hn::Load(d, parent->estimate[k][g] + i), share)), d,
              e.estimate[k][g] + i);
    }
  } else {
    TraceEstimates(accel, tree.lights()[e.representative], node.intensity, o.falloff, e, cuts);
  }

  V excess = zero;
  const bool leaf = node.leaf();  // exact
  for (size_t g = 0; g < kCutGroups; ++g) {
    if (e.active[g] == 0) continue;
    const bool lit = (e.lit >> g & 1) != 0;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const auto mask = MaskOf(d, e.active[g], i);
      V total = hn::Load(d, cuts.luminance[g] + i);
      Increment(mask, cuts.clusters[g] + i);
      if (lit) {
        const V est[3] = {hn::Load(d, e.estimate[0][g] + i), hn::Load(d, e.estimate[1][g] + i),
                          hn::Load(d, e.estimate[2][g] + i)};
        const V luminance = LuminanceOf(d, est[0], est[1], est[2]);
        total = hn::Add(total, luminance);
        hn::Store(total, d, cuts.luminance[g] + i);
        if constexpr (kRecord)
          if (leaf) Record(*o.record, e, g, i, mask, luminance);
        for (size_t k = 0; leaf && k < 3; ++k)
          hn::Store(hn::Add(hn::Load(d, cuts.radiance[k][g] + i), est[k]), d, cuts.radiance[k][g] + i);
      }
      const V ratio = hn::Div(hn::Load(d, e.bound[g] + i), hn::Max(total, floor));
      excess = hn::Max(excess, hn::IfThenElseZero(mask, ratio));
    }
  }
  if (leaf) return cuts.release(index);
  const float largest = hn::GetLane(hn::MaxOfLanes(d, excess));
  if (largest > o.error) {
    cuts.heap.push_back({largest, index});
    std::push_heap(cuts.heap.begin(), cuts.heap.end());
  } else {
    cuts.resting.push_back(index);
  }
}

// Leaves the cluster in the cuts of the points whose share it is within, and refines it in those of the others.
template <bool kRecord>
HWY_INLINE void Refine(const LightTree& tree, const Accel& accel, const CutOptions& o, uint32_t index,
                       LightCuts& cuts) {
  const D d;
  const DU du;
  const V zero = hn::Zero(d), error = hn::Set(d, o.error), floor = hn::Set(d, o.floor);
  const CutEntry& e = cuts.entry(index);
  const LightNode* children = &tree.node(e.first_child);
  __builtin_prefetch(children), __builtin_prefetch(reinterpret_cast<const char*>(children) + 64);
  __builtin_prefetch(children + 1), __builtin_prefetch(reinterpret_cast<const char*>(children + 1) + 64);
  uint16_t refine[kCutGroups] = {};
  uint32_t any = 0;
  for (size_t g = 0; g < kCutGroups; ++g) {
    if (e.active[g] == 0) continue;
    uint32_t bits = 0;
    for (size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      const V total = hn::Load(d, cuts.luminance[g] + i);
      const auto cut = hn::Load(du, cuts.clusters[g] + i);
      auto wanted = hn::And(MaskOf(d, e.active[g], i),
                            hn::Gt(hn::Load(d, e.bound[g] + i), hn::Mul(error, hn::Max(total, floor))));
      wanted = hn::And(wanted, hn::RebindMask(d, hn::Lt(cut, hn::Set(du, o.max_cut))));
      const auto one = hn::IfThenElseZero(hn::RebindMask(du, wanted), hn::Set(du, 1));
      hn::Store(hn::Sub(cut, one), du, cuts.clusters[g] + i);
      bits |= BitsOf(d, wanted, i);
      if ((e.lit >> g & 1) == 0) continue;
      const V est[3] = {hn::Load(d, e.estimate[0][g] + i), hn::Load(d, e.estimate[1][g] + i),
                        hn::Load(d, e.estimate[2][g] + i)};
      for (size_t k = 0; k < 3; ++k)
        hn::Store(hn::Add(hn::Load(d, cuts.radiance[k][g] + i), hn::IfThenZeroElse(wanted, est[k])), d,
                  cuts.radiance[k][g] + i);
      const V luminance = LuminanceOf(d, est[0], est[1], est[2]);
      if constexpr (kRecord) Record(*o.record, e, g, i, hn::AndNot(wanted, MaskOf(d, e.active[g], i)), luminance);
      const V rest = hn::Max(zero, hn::Sub(total, luminance));
      hn::Store(hn::IfThenElse(wanted, rest, total), d, cuts.luminance[g] + i);
    }
    refine[g] = static_cast<uint16_t>(bits);
    any |= bits;
  }
  if (any != 0) {
    AddNode<kRecord>(tree, accel, o, e.first_child, refine, &e, cuts);
    AddNode<kRecord>(tree, accel, o, e.first_child + 1, refine, &e, cuts);
  }
  cuts.release(index);
}

// Cuts of many clusters outgrow the caches.
HWY_INLINE void Prefetch(const CutEntry& e) {
  __builtin_prefetch(&e);
  for (const auto& group : e.bound) __builtin_prefetch(group);
}

template <bool kRecord>
void GrowCutsOf(const LightTree& tree, const Accel& accel, const CutOptions& o, size_t count, LightCuts& cuts) {
  uint16_t all[kCutGroups];
  for (size_t g = 0; g < kCutGroups; ++g) {
    const size_t in_group = count > g * kLanes ? std::min(kLanes, count - g * kLanes) : 0;
    all[g] = static_cast<uint16_t>((1u << in_group) - 1);
  }
  for (const uint32_t root : tree.roots()) AddNode<kRecord>(tree, accel, o, root, all, nullptr, cuts);
  std::vector<uint32_t>& resting = cuts.resting;
  // Each node of the tree comes here at most twice: from the heap, and from among those that rest.
  uint32_t steps = 0;
  const auto cancelled = [&] { return ++steps % 64 == 0 && o.progress != nullptr && o.progress->cancelled(); };
  for (;;) {
    while (!cuts.heap.empty()) {
      if (cancelled()) return cuts.drop();
      std::pop_heap(cuts.heap.begin(), cuts.heap.end());
      const uint32_t index = cuts.heap.back().entry;
      cuts.heap.pop_back();
      if (!cuts.heap.empty()) Prefetch(cuts.entry(cuts.heap.front().entry));
      Refine<kRecord>(tree, accel, o, index, cuts);
    }
    if (resting.empty()) break;
    if (cancelled()) return cuts.drop();
    // Those that were within the share when they came: radiance may have fallen since.
    const uint32_t index = resting.back();
    resting.pop_back();
    if (!resting.empty()) Prefetch(cuts.entry(resting.back()));
    Refine<kRecord>(tree, accel, o, index, cuts);
  }
}

void GrowCuts(const LightTree& tree, const Accel& accel, const CutOptions& o, size_t count, LightCuts& cuts) {
  o.record != nullptr ? GrowCutsOf<true>(tree, accel, o, count, cuts) : GrowCutsOf<false>(tree, accel, o, count, cuts);
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(GrowCuts);
HWY_EXPORT(EstimateOf);

uint32_t estimate_light(const Vpl& light, const Rgb& intensity, Falloff falloff, const PointBlock& block,
                        uint32_t active, float* r, float* g, float* b) {
  return HWY_DYNAMIC_DISPATCH(EstimateOf)(light, intensity, falloff, block, active, r, g, b);
}

uint32_t CutRecord::add(uint32_t node, uint32_t parent) {
  const auto visit = static_cast<uint32_t>(visits.size());
  visits.push_back({node, parent});
  luminance.resize(visits.size() * kCutPoints, 0.0f);
  if (parent != kNone && visits[parent].children++ == 0) visits[parent].first_child = visit;
  return visit;
}

uint32_t LightCuts::allocate() {
  if (!free_.empty()) {
    const uint32_t i = free_.back();
    free_.pop_back();
    return i;
  }
  if (used_ / kChunk >= chunks_.size()) chunks_.push_back(std::make_unique<CutEntry[]>(kChunk));
  return used_++;
}

void LightCuts::grow(const LightTree& tree, const Accel& accel, const CutOptions& options, const ShadePoints& points,
                     size_t first, size_t count) {
  free_.clear();
  used_ = 0;
  for (size_t g = 0; g * kLanes < count; ++g) blocks[g].load(points, first + g * kLanes);
  const auto clear = [](auto& array) { std::fill_n(&array[0][0], sizeof(array) / sizeof(array[0][0]), 0); };
  for (auto& channel : radiance) clear(channel);
  clear(clusters), clear(rays), clear(bounds), clear(luminance);
  HWY_DYNAMIC_DISPATCH(GrowCuts)(tree, accel, options, count, *this);
}

}  // namespace lumicut
#endif
